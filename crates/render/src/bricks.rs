//! Where bone may be: the padded grid, its bricks, and how far a ray may leap.
//!
//! # Theory
//! The grid is padded by one voxel of air, so that bone at the border has a surface too. Cell (i, j, k) lies between the centres of padded voxels
//! (i, j, k) and (i+1, j+1, k+1). A brick is 4³ cells. Where no corner of a brick's cells reaches the isovalue, no ray can
//! enter bone. Free bricks hold the distance to the nearest other one in bricks, the largest of the three axes counting (Cohen and Sheffer 1994).
//!
//! # Practice
//! One byte a brick. Drilling only makes bricks free; a brick that gets bone back (an undo) makes the distances anew, which costs about 1 ms.

use glam::{IVec3, Vec3};
use trepan_geometry::Aabb;
use trepan_volume::{AIR_HU, BRICK, BoneVolume};

/// Edge of a brick of cells; `BRICK` in `bricks.wgsl`. Divides the bone's own brick.
pub(crate) const LEAP: usize = 4;

/// Edge of a block whose share of bone is kept for ambient light, in voxels.
pub(crate) const BLOCK: usize = 4;

/// The padded grid of a bone volume.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    /// Padded voxels along x, y, z.
    pub dims: [usize; 3],
    /// World centre of the padded voxel (0, 0, 0), mm.
    pub origin: Vec3,
    /// Edge of a voxel, mm.
    pub spacing_mm: f32,
    /// Bone is at or over this, HU.
    pub isovalue: i16,
}

/// How far a ray may leap from each brick.
#[derive(Clone, Debug)]
pub(crate) struct Leaps {
    /// Bricks of cells along x, y, z.
    pub bricks: [usize; 3],
    /// 0 where bone may be, else the distance to the nearest such brick, at most 255.
    pub free: Vec<u8>,
}

impl Grid {
    /// The grid of a bone; without any, eight voxels of air.
    pub fn of(bone: Option<&BoneVolume>) -> Self {
        let Some(bone) = bone else {
            return Self { dims: [2; 3], origin: Vec3::ZERO, spacing_mm: 1.0, isovalue: i16::MAX };
        };
        Self {
            dims: bone.dims().map(|n| n + 2),
            origin: bone.centre_of(IVec3::NEG_ONE),
            spacing_mm: bone.spacing_mm(),
            isovalue: bone.isovalue(),
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

    /// World box that a change of a brick of voxels may change the surface in, mm.
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

    /// Shares of bone of all blocks, x fastest.
    pub fn shares(&self, bone: Option<&BoneVolume>) -> Vec<u8> {
        let [bx, by, bz] = self.blocks();
        let Some(bone) = bone else { return vec![0; bx * by * bz] };
        (0..bx * by * bz).map(|at| self.share(bone, [at % bx, at / bx % by, at / (bx * by)])).collect()
    }

    /// Share of bone in a block, 0 to 255.
    pub fn share(&self, bone: &BoneVolume, block: [usize; 3]) -> u8 {
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

/// All places from `low` to `high`, both taken, that lie inside `dims`.
fn boxed(low: [usize; 3], high: [usize; 3], dims: [usize; 3]) -> Vec<[usize; 3]> {
    let high = [0, 1, 2].map(|a| high[a].min(dims[a] - 1));
    let rows = (low[2]..=high[2]).flat_map(|z| (low[1]..=high[1]).map(move |y| (y, z)));
    rows.flat_map(|(y, z)| (low[0]..=high[0]).map(move |x| [x, y, z])).collect()
}

impl Leaps {
    pub fn of(bone: Option<&BoneVolume>, grid: &Grid) -> Self {
        let bricks = grid.dims.map(|n| (n - 1).div_ceil(LEAP));
        let mut leaps = Self { bricks, free: vec![255; bricks.iter().product()] };
        let Some(bone) = bone else { return leaps };
        for at in 0..leaps.free.len() {
            if may_hold_bone(bone, leaps.place(at)) {
                leaps.free[at] = 0;
            }
        }
        leaps.spread();
        leaps
    }

    fn place(&self, at: usize) -> [usize; 3] {
        [at % self.bricks[0], at / self.bricks[0] % self.bricks[1], at / (self.bricks[0] * self.bricks[1])]
    }

    /// Position of a brick in `free`.
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.bricks[0] * (y + self.bricks[1] * z)
    }

    /// Looks again at the bricks of cells that touch a brick of voxels. Returns them, and whether the distances had to be made anew.
    pub fn follow(&mut self, bone: &BoneVolume, brick: [usize; 3]) -> (Vec<[usize; 3]>, bool) {
        let low = brick.map(|b| b * (BRICK / LEAP));
        let cells = boxed(low, low.map(|v| v + BRICK / LEAP), self.bricks);
        let mut anew = false;
        cells.iter().for_each(|&c| anew |= self.refresh(bone, c));
        (cells, anew)
    }

    /// Looks at a brick of cells again. Whether the distances had to be made anew (else only this brick's entry may differ).
    fn refresh(&mut self, bone: &BoneVolume, brick: [usize; 3]) -> bool {
        let at = self.index(brick);
        let held = self.free[at] == 0;
        let holds = may_hold_bone(bone, brick);
        if held && !holds {
            self.free[at] = 1;
        } else if holds && !held {
            self.free.iter_mut().filter(|f| **f != 0).for_each(|f| *f = 255);
            self.free[at] = 0;
            self.spread();
            return true;
        }
        false
    }

    /// Chessboard distances by one sweep up and one down; exact for this measure (Rosenfeld and Pfaltz 1968).
    fn spread(&mut self) {
        let count = self.free.len();
        for at in 0..count {
            self.relax(at, -1);
        }
        for at in (0..count).rev() {
            self.relax(at, 1);
        }
    }

    /// Takes what the half of the neighbours before (`side` -1) or after (1) a brick allow.
    fn relax(&mut self, at: usize, side: i64) {
        let here = self.place(at).map(|v| v as i64);
        let mut best = self.free[at];
        for n in 0..13 {
            // The 13 offsets that come before the middle of a 3³ box, or their mirror images.
            let offset = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1].map(|o: i64| -side * o);
            let there = [0, 1, 2].map(|a| here[a] + offset[a]);
            if (0..3).all(|a| there[a] >= 0 && there[a] < self.bricks[a] as i64) {
                best = best.min(self.free[self.index(there.map(|v| v as usize))].saturating_add(1));
            }
        }
        self.free[at] = best;
    }
}

/// Whether a corner of the cells of a brick reaches the isovalue.
fn may_hold_bone(bone: &BoneVolume, brick: [usize; 3]) -> bool {
    corners(brick.map(|b| b * LEAP), LEAP + 1).any(|padded| bone.is_bone(padded - 1))
}

/// Densities of the padded box of `size` voxels from `first`, x fastest, by the given conversion.
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
            values.extend((0..size[0] as i32).map(|i| convert(bone.hu(IVec3::new(x + i, y + j, z + k)))));
        }
    }
    debug_assert_eq!(AIR_HU, bone.hu(IVec3::NEG_ONE));
    values
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

    fn check(bone: &BoneVolume, leaps: &Leaps, exact: bool) {
        let held: Vec<[usize; 3]> =
            (0..leaps.free.len()).map(|at| leaps.place(at)).filter(|&b| may_hold_bone(bone, b)).collect();
        for at in 0..leaps.free.len() {
            let here = leaps.place(at);
            let far = |b: &[usize; 3]| (0..3).map(|a| b[a].abs_diff(here[a])).max().unwrap();
            let nearest = held.iter().map(far).min().unwrap_or(255);
            let given = usize::from(leaps.free[at]);
            assert!(
                given == nearest || (!exact && given < nearest && (given > 0) == (nearest > 0)),
                "{here:?}: {given} for {nearest}"
            );
        }
    }

    #[test]
    fn leaps_are_the_distance_to_the_nearest_bone_and_stay_safe_while_it_changes() {
        let bone = bone_at([70, 40, 50], &[[3, 3, 2], [60, 20, 46]]);
        let grid = Grid::of(Some(&bone));
        let mut leaps = Leaps::of(Some(&bone), &grid);
        check(&bone, &leaps, true);
        bone.set_hu(IVec3::new(60, 20, 46), AIR_HU);
        assert!(!leaps.follow(&bone, [7, 2, 5]).1);
        check(&bone, &leaps, false);
        bone.set_hu(IVec3::new(40, 30, 20), 700);
        assert!(leaps.follow(&bone, [5, 3, 2]).1);
        check(&bone, &leaps, true);
    }

    #[test]
    fn a_corner_shared_by_eight_bricks_marks_them_all() {
        let bone = bone_at([20, 20, 20], &[[7, 7, 7]]);
        let leaps = Leaps::of(Some(&bone), &Grid::of(Some(&bone)));
        assert_eq!(leaps.bricks, [6, 6, 6]);
        assert_eq!(leaps.free.iter().filter(|&&f| f == 0).count(), 8);
        assert_eq!(Grid::of(Some(&bone)).share(&bone, [2, 2, 2]), 255 / 64);
    }
}
