//! Empty-space skipping: the padded grid, its bricks, and the free distance from each brick.
//!
//! # Theory
//! The grid is padded by one voxel of air, so that bone at the border has a closed surface. Cell
//! (i, j, k) lies between the centres of padded voxels (i, j, k) and (i+1, j+1, k+1). A brick is 4³
//! cells. Where no corner of a brick's cells reaches the isovalue, or all was cut, no ray can enter
//! bone. Free
//! bricks store, for each octant of directions, the chessboard distance in bricks to the nearest
//! non-free brick in that octant (Cohen and Sheffer 1994), so that bricks behind a ray do not limit
//! it. In other bricks each cell has an occupancy bit.
//!
//! # Practice
//! 17 bytes a brick of 64 cells. Drilling only frees bricks; when bricks regain bone (an undo) the
//! distances are recomputed, at about 0.1 µs a brick.

use crate::drilled::{Drilled, LEAP};
use glam::{IVec3, Vec3};
use rayon::prelude::*;
use trepan_bone::{BRICK, BoneVolume};
use trepan_geometry::Aabb;
use trepan_volume::AIR_HU;

/// Distance stored for a ray that hits nothing.
pub(crate) const NOTHING: f32 = 1e30;

/// Edge of a block whose bone fraction is stored for ambient light, in voxels.
pub(crate) const BLOCK: usize = 4;

/// A numerical parameter: largest distance between points of the smoothed CT, mm; at least a voxel.
const SMOOTH_STEP_MM: f32 = 1.0;

/// The padded grid of a bone volume.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    /// Padded voxels along x, y, z.
    pub dims: [usize; 3],
    /// World centre of the padded voxel (0, 0, 0), mm.
    pub origin: Vec3,
    /// Edge of a voxel, mm.
    pub spacing_mm: f32,
    /// Isovalue of bone, HU.
    pub isovalue: i16,
    /// Steps of the cut's lattice along a voxel's edge.
    pub steps: usize,
    /// Voxels from one point of the smoothed CT's lattice to the next.
    pub smooth_step: usize,
}

/// Free distances from each brick.
#[derive(Clone, Debug)]
pub(crate) struct SkipDistances {
    /// Bricks of cells along x, y, z.
    pub bricks: [usize; 3],
    /// Free distance per octant, at most 255; 0 where bone may be.
    /// Bit n of the octant is set where the ray ascends along axis n.
    pub octants: Vec<[u8; 8]>,
    /// Occupancy bits of the cells with a corner in bone, x fastest.
    pub cells: Vec<u64>,
    /// What was cut in each brick.
    pub drilled: Drilled,
    stale: bool,
}

/// What a change of bone did to bricks of cells.
#[derive(Clone, Debug, Default)]
pub(crate) struct Touched {
    /// Bricks that became free of bone.
    pub freed: Vec<[usize; 3]>,
    /// Bricks whose cut was copied, with their places.
    pub drilled: Vec<(usize, usize)>,
}

impl Grid {
    /// The grid of a bone volume; without bone, eight voxels of air.
    pub fn of(bone: Option<&BoneVolume>) -> Self {
        let Some(bone) = bone else {
            return Self {
                dims: [2; 3],
                origin: Vec3::ZERO,
                spacing_mm: 1.0,
                isovalue: i16::MAX,
                steps: 1,
                smooth_step: 1,
            };
        };
        Self {
            dims: bone.dims().map(|n| n + 2),
            origin: bone.centre_of(IVec3::NEG_ONE),
            spacing_mm: bone.spacing_mm(),
            isovalue: bone.isovalue(),
            steps: 2 * bone.cut_nodes() as usize,
            smooth_step: ((SMOOTH_STEP_MM / bone.spacing_mm() + 1e-3) as usize).max(1),
        }
    }

    /// Blocks of voxels along x, y, z.
    pub fn blocks(&self) -> [usize; 3] {
        self.dims.map(|n| n.div_ceil(BLOCK))
    }

    /// First padded voxel and size of a brick of the bone's own voxels.
    pub fn voxels_of(&self, brick: [usize; 3]) -> ([usize; 3], [usize; 3]) {
        let first = brick.map(|b| b * BRICK + 1);
        (first, [0, 1, 2].map(|a| BRICK.min(self.dims[a] - 1 - first[a])))
    }

    /// World box in which a change of a brick of voxels may change the surface, mm.
    pub fn box_of(&self, brick: [usize; 3]) -> Aabb {
        let (first, size) = self.voxels_of(brick);
        let corner = |voxel: [usize; 3]| self.origin + self.spacing_mm * Vec3::from(voxel.map(|v| v as f32));
        Aabb { min: corner(first.map(|v| v - 1)), max: corner([0, 1, 2].map(|a| first[a] + size[a])) }
    }

    /// The blocks that share voxels with a brick of voxels.
    pub fn blocks_of(&self, brick: [usize; 3]) -> Vec<[usize; 3]> {
        let (first, size) = self.voxels_of(brick);
        let low = first.map(|v| v / BLOCK);
        let high = [0, 1, 2].map(|a| (first[a] + size[a] - 1) / BLOCK);
        boxed(low, high, self.blocks())
    }

    /// Bone fractions of all blocks, x fastest.
    pub fn shares(&self, bone: Option<&BoneVolume>) -> Vec<u8> {
        let [bx, by, bz] = self.blocks();
        let Some(bone) = bone else { return vec![0; bx * by * bz] };
        let place = |at: usize| [at % bx, at / bx % by, at / (bx * by)];
        (0..bx * by * bz).into_par_iter().map(|at| self.share(bone, place(at))).collect()
    }

    /// Bone fraction of a block, 0 to 255.
    pub fn share(&self, bone: &BoneVolume, block: [usize; 3]) -> u8 {
        let low = IVec3::from(block.map(|b| (b * BLOCK) as i32)) - 1;
        if !bone.may_hold_bone(low, low + (BLOCK as i32 - 1)) {
            return 0;
        }
        let count = corners(block.map(|b| b * BLOCK), BLOCK).filter(|&v| bone.is_bone(v - 1)).count();
        (count * 255 / BLOCK.pow(3)) as u8
    }
}

/// Coordinates of the `edge`³ box that starts at `first`, x fastest.
pub(crate) fn corners(first: [usize; 3], edge: usize) -> impl Iterator<Item = IVec3> {
    let [x, y, z] = first.map(|v| v as i32);
    let edge = edge as i32;
    (0..edge).flat_map(move |k| (0..edge).flat_map(move |j| (0..edge).map(move |i| IVec3::new(x + i, y + j, z + k))))
}

/// All indices from `low` to `high`, inclusive, that lie inside `dims`.
fn boxed(low: [usize; 3], high: [usize; 3], dims: [usize; 3]) -> Vec<[usize; 3]> {
    let high = [0, 1, 2].map(|a| high[a].min(dims[a] - 1));
    let rows = (low[2]..=high[2]).flat_map(|z| (low[1]..=high[1]).map(move |y| (y, z)));
    rows.flat_map(|(y, z)| (low[0]..=high[0]).map(move |x| [x, y, z])).collect()
}

impl SkipDistances {
    pub fn of(bone: Option<&BoneVolume>, grid: &Grid) -> Self {
        let bricks = grid.dims.map(|n| (n - 1).div_ceil(LEAP));
        let count = bricks.iter().product();
        let (octants, drilled) = (vec![[u8::MAX; 8]; count], Drilled::new(grid.steps, count));
        let mut leaps = Self { bricks, octants, cells: vec![0; count], drilled, stale: bone.is_some() };
        if let Some(bone) = bone {
            for at in 0..count {
                leaps.drilled.follow(bone, at, leaps.place(at));
            }
            leaps.cells = (0..count).into_par_iter().map(|at| leaps.promising(bone, at)).collect();
        }
        leaps.settle();
        leaps
    }

    fn place(&self, at: usize) -> [usize; 3] {
        [at % self.bricks[0], at / self.bricks[0] % self.bricks[1], at / (self.bricks[0] * self.bricks[1])]
    }

    /// Index of a brick in the lists.
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.bricks[0] * (y + self.bricks[1] * z)
    }

    /// Distance to the nearest brick that may hold bone, in any direction; 0 where bone may be.
    pub fn free(&self, at: usize) -> u8 {
        self.octants[at].into_iter().fold(u8::MAX, u8::min)
    }

    /// Updates the bricks of cells near bricks of voxels. Call [`settle`](Self::settle) before
    /// casting rays.
    pub fn follow(&mut self, bone: &BoneVolume, bricks: &[[usize; 3]]) -> Touched {
        let near = |brick: &[usize; 3]| {
            let low = brick.map(|b| b * (BRICK / LEAP));
            // The cut is a spline, which reaches two nodes beyond the brick.
            boxed(low.map(|v| v.saturating_sub(1)), low.map(|v| v + BRICK / LEAP), self.bricks)
        };
        let mut near: Vec<usize> = bricks.iter().flat_map(near).map(|brick| self.index(brick)).collect();
        near.sort_unstable();
        near.dedup();
        let mut touched = Touched::default();
        for at in near {
            touched.drilled.extend(self.drilled.follow(bone, at, self.place(at)).map(|place| (at, place)));
            let held = self.cells[at] != 0;
            self.cells[at] = self.promising(bone, at);
            match (held, self.cells[at] != 0) {
                (true, false) => {
                    self.octants[at] = [1; 8];
                    touched.freed.push(self.place(at));
                }
                (false, true) => self.stale = true,
                _ => (),
            }
        }
        touched
    }

    /// Occupancy bits of the cells of a brick with a corner at the isovalue and a part that was not
    /// cut, x fastest.
    fn promising(&self, bone: &BoneVolume, at: usize) -> u64 {
        const EDGE: usize = LEAP + 1;
        let low = IVec3::from(self.place(at).map(|b| (b * LEAP) as i32)) - 1;
        if !bone.may_hold_bone(low, low + LEAP as i32) {
            return 0;
        }
        let mut corner = [false; EDGE * EDGE * EDGE];
        for (is_bone, padded) in corner.iter_mut().zip(corners(self.place(at).map(|b| b * LEAP), EDGE)) {
            *is_bone = bone.ct(padded - 1) >= bone.isovalue();
        }
        if !corner.contains(&true) {
            return 0;
        }
        let near = [0, 1, EDGE, EDGE + 1].map(|at| [at, at + EDGE * EDGE]);
        let depths = self.drilled.brick(at);
        let holds = |cell: usize| {
            let local = [cell % LEAP, cell / LEAP % LEAP, cell / (LEAP * LEAP)];
            let first = local[0] + EDGE * (local[1] + EDGE * local[2]);
            near.as_flattened().iter().any(|at| corner[first + at])
                && depths.is_none_or(|depths| self.drilled.is_left(depths, IVec3::from(local.map(|n| n as i32))))
        };
        (0..LEAP.pow(3)).fold(0, |bits, cell| bits | u64::from(holds(cell)) << cell)
    }

    /// Recomputes the distances if free bricks regained bone; returns whether they did.
    pub fn settle(&mut self) -> bool {
        if std::mem::take(&mut self.stale) {
            (0..8).for_each(|octant| self.spread(octant));
            return true;
        }
        false
    }

    /// Distances of an octant, from its far corner back: one more than the minimum of the seven
    /// neighbours in that octant. Exact for the chessboard distance.
    fn spread(&mut self, octant: usize) {
        let [nx, ny, nz] = self.bricks;
        let strides = [1, nx, nx * ny];
        let up = [0, 1, 2].map(|axis| octant >> axis & 1 == 1);
        let place = |axis: usize, n: usize| if up[axis] { self.bricks[axis] - 1 - n } else { n };
        for n in 0..nx * ny * nz {
            let steps = [n % nx, n / nx % ny, n / (nx * ny)];
            let at = (0..3).map(|axis| place(axis, steps[axis]) * strides[axis]).sum::<usize>();
            let mut least = u8::MAX;
            for way in 1..8 {
                if (0..3).all(|axis| way >> axis & 1 == 0 || steps[axis] > 0) {
                    let moved = (0..3).filter(|axis| way >> axis & 1 == 1);
                    let there =
                        moved.fold(at, |to, axis| if up[axis] { to + strides[axis] } else { to - strides[axis] });
                    least = least.min(self.octants[there][octant]);
                }
            }
            self.octants[at][octant] = if self.cells[at] != 0 { 0 } else { least.saturating_add(1) };
        }
    }
}

/// Converts the CT's densities of the padded box of `size` voxels from `first`, x fastest.
pub(crate) fn densities<T>(
    bone: Option<&BoneVolume>,
    first: [usize; 3],
    size: [usize; 3],
    convert: impl Fn(i16) -> T,
) -> Vec<T> {
    let Some(bone) = bone else { return (0..size.iter().product()).map(|_| convert(AIR_HU)).collect() };
    let [x, y, z] = first.map(|v| v as i32 - 1);
    let mut values = Vec::with_capacity(size.iter().product());
    for k in 0..size[2] as i32 {
        for j in 0..size[1] as i32 {
            values.extend((0..size[0] as i32).map(|i| convert(bone.ct(IVec3::new(x + i, y + j, z + k)))));
        }
    }
    debug_assert_eq!(AIR_HU, bone.ct(IVec3::NEG_ONE));
    values
}

/// Result of updating the bone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Followed {
    pub bricks: u32,
    pub left: u32,
    /// Box in which bone changed, world mm.
    pub changed: Aabb,
}

impl Default for Followed {
    fn default() -> Self {
        Self { bricks: 0, left: 0, changed: Aabb::EMPTY }
    }
}

impl Followed {
    pub fn of(grid: &Grid, bricks: &[[usize; 3]], left: usize) -> Self {
        let grow = |all: Aabb, &brick: &[usize; 3]| {
            let changed = grid.box_of(brick);
            all.grown(changed.min).grown(changed.max)
        };
        Self { bricks: bricks.len() as u32, left: left as u32, changed: bricks.iter().fold(Aabb::EMPTY, grow) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_volume::VoxelVolume;

    fn bone_at(dims: [usize; 3], voxels: &[[usize; 3]]) -> BoneVolume {
        let mut volume = VoxelVolume::isotropic(dims, Vec3::ZERO, 1.0, AIR_HU);
        for &v in voxels {
            let at = volume.index(v);
            volume.data[at] = 1000;
        }
        BoneVolume::new(&volume, 400).unwrap()
    }

    fn check(bone: &BoneVolume, leaps: &SkipDistances, exact: bool) {
        let count = leaps.cells.len();
        let holds = |b: [usize; 3]| corners(b.map(|v| v * LEAP), LEAP + 1).any(|padded| bone.is_bone(padded - 1));
        let held: Vec<[usize; 3]> = (0..count).map(|at| leaps.place(at)).filter(|&b| holds(b)).collect();
        for (at, octant) in (0..count).flat_map(|at| (0..8).map(move |octant| (at, octant))) {
            let here = leaps.place(at);
            let ahead =
                |b: &&[usize; 3]| (0..3).all(|a| if octant >> a & 1 == 1 { b[a] >= here[a] } else { b[a] <= here[a] });
            let far = |b: &[usize; 3]| (0..3).map(|a| b[a].abs_diff(here[a])).max().unwrap();
            let nearest = held.iter().filter(ahead).map(far).min().unwrap_or(255);
            let given = usize::from(leaps.octants[at][octant]);
            assert!(
                given == nearest || (!exact && given < nearest && (given > 0) == (nearest > 0)),
                "{here:?}: {given} for {nearest}"
            );
            assert_eq!(leaps.cells[at] != 0, holds(here));
        }
    }

    #[test]
    fn a_cell_has_its_bit_where_one_of_its_corners_is_bone() {
        let bone = bone_at([20, 20, 20], &[[7, 7, 7], [10, 9, 8]]);
        let leaps = SkipDistances::of(Some(&bone), &Grid::of(Some(&bone)));
        for brick in [[1, 1, 1], [2, 2, 2], [2, 2, 1], [0, 4, 4]] {
            for cell in 0..64 {
                let low = [cell % 4, cell / 4 % 4, cell / 16];
                let first = [0, 1, 2].map(|a| 4 * brick[a] + low[a]);
                let holds = corners(first, 2).any(|padded| bone.is_bone(padded - 1));
                assert_eq!(leaps.cells[leaps.index(brick)] >> cell & 1 == 1, holds, "{brick:?} {cell}");
            }
        }
    }

    #[test]
    fn free_distances_reach_the_nearest_bone_and_stay_valid_while_it_changes() {
        let bone = bone_at([70, 40, 50], &[[3, 3, 2], [60, 20, 46]]);
        let grid = Grid::of(Some(&bone));
        let mut leaps = SkipDistances::of(Some(&bone), &grid);
        check(&bone, &leaps, true);
        bone.set_hu(IVec3::new(60, 20, 46), AIR_HU);
        leaps.follow(&bone, &[[7, 2, 5]]);
        assert!(!leaps.settle());
        check(&bone, &leaps, false);
        bone.set_hu(IVec3::new(40, 30, 20), 700);
        leaps.follow(&bone, &[[5, 3, 2]]);
        assert!(leaps.settle());
        check(&bone, &leaps, true);
    }

    #[test]
    fn a_corner_shared_by_eight_bricks_marks_them_all() {
        let bone = bone_at([20, 20, 20], &[[7, 7, 7]]);
        let leaps = SkipDistances::of(Some(&bone), &Grid::of(Some(&bone)));
        assert_eq!(leaps.bricks, [6, 6, 6]);
        assert_eq!((0..216).filter(|&at| leaps.free(at) == 0).count(), 8);
        assert_eq!(Grid::of(Some(&bone)).share(&bone, [2, 2, 2]), 255 / 64);
    }
}
