//! What tools have cut from the bone: a signed distance in bricks of fine nodes, kept only near
//! cuts.
//!
//! # Theory
//! The burr is a ball, and what it cuts is a union of balls. Beside the unchanged CT a second field
//! holds how deep a place lies in that union, in nodes:
//! ```text
//! d(x) = max over balls (r - |x - c|)         bone: CT(x) ≥ isovalue and d(x) < 0
//! ```
//! So the cut surface is exact to a small part of a node's distance, whatever the voxels and
//! whatever the density of the bone, and the density that was cut is still known.
//!
//! # Practice
//! Nodes lie on the voxels' grid, a whole number a voxel, so that every voxel's centre is a node.
//! A node is an `i16`, [`CUT_STEPS`] a node's distance; 0 is further than 4 nodes from any cut, so
//! that memory which was never written says that nothing was cut. Bricks of 8³ nodes come from a
//! pool that covers all bone; its pages are taken from the system when they are first written.
//! 1 kB a brick, 4 bytes of table a brick of the whole grid. A read costs two loads.
//!
//! # When not to use it
//! For bone that is taken away whole, as a lifted flap: change the CT.

use crate::BoneVolume;
use crate::stroke::BRICK;
use bytemuck::allocation::zeroed_slice_box;
use glam::IVec3;
use std::sync::atomic::{AtomicI16, AtomicU32, Ordering};
use trepan_geometry::Vec3;

/// Steps of a node for each node of distance.
pub const CUT_STEPS: f32 = 4096.0;
/// A node's value at the surface of the cut; more lies in it.
pub const CUT_SURFACE: i16 = 4 * CUT_STEPS as i16;
/// Longest distance between nodes, mm, unless voxels are finer.
const NODE_MM: f32 = 0.5;
/// Nodes in a brick.
const BRICK_NODES: usize = BRICK * BRICK * BRICK;
/// Most bricks: 64 MB. At a third of a millimetre they hold 1,240 cm³ of bone.
const MOST_BRICKS: usize = 1 << 16;
/// A numerical parameter: steepness with which a cut lowers the densities of voxels, HU a voxel.
const RAMP_HU: f32 = 1000.0;

/// The cut beside a volume.
#[derive(Debug)]
pub(crate) struct CutField {
    /// Nodes along a voxel's edge.
    pub nodes: i32,
    /// Bricks along each axis, one beyond the grid on either side among them. At the end of a CT
    /// the surface of a cut needs nodes beyond it.
    bricks: IVec3,
    /// For each brick its place in the pool and 1, or 0.
    table: Box<[AtomicU32]>,
    /// The brick of each used place.
    owners: Box<[AtomicU32]>,
    used: AtomicU32,
    values: Box<[AtomicI16]>,
    /// How often the brick at each place was changed.
    versions: Box<[AtomicU32]>,
}

impl CutField {
    /// Nothing is cut of a grid whose bricks of voxels hold bone in `solid` of them.
    pub fn new(dims: [usize; 3], spacing_mm: f32, solid: usize) -> Self {
        let nodes = (spacing_mm / NODE_MM - 1e-3).ceil().clamp(1.0, 64.0) as i32;
        let bricks = IVec3::from(dims.map(|n| (n * nodes as usize).div_ceil(BRICK) as i32)) + 2;
        let all = bricks.to_array().map(|n| n as usize).iter().product::<usize>();
        // A cut reaches into the bricks beside the bone.
        let pool = (solid * (nodes as usize).pow(3)).saturating_mul(4).min(all).min(MOST_BRICKS);
        Self {
            nodes,
            bricks,
            table: zeroed_slice_box(all),
            owners: zeroed_slice_box(pool),
            used: AtomicU32::new(0),
            values: zeroed_slice_box(pool * BRICK_NODES),
            versions: zeroed_slice_box(pool),
        }
    }

    /// Most bricks that it can hold.
    pub fn pool(&self) -> usize {
        self.owners.len()
    }

    fn index(&self, brick: IVec3) -> Option<usize> {
        let brick = brick + 1;
        let inside = brick.cmpge(IVec3::ZERO).all() && brick.cmplt(self.bricks).all();
        inside.then(|| (brick.x + self.bricks.x * (brick.y + self.bricks.y * brick.z)) as usize)
    }

    /// The place of a brick in the pool, if something near it was cut.
    #[inline]
    fn find(&self, brick: IVec3) -> Option<usize> {
        let place = self.table[self.index(brick)?].load(Ordering::Acquire) as usize;
        place.checked_sub(1)
    }

    /// The same, taking a place for a brick that has none; `None` beyond all bricks and where
    /// the pool is used up.
    fn find_or_take(&self, brick: IVec3) -> Option<usize> {
        let index = self.index(brick)?;
        if let Some(place) = (self.table[index].load(Ordering::Acquire) as usize).checked_sub(1) {
            return Some(place);
        }
        let place = self.used.load(Ordering::Relaxed) as usize;
        self.owners.get(place)?.store(index as u32, Ordering::Relaxed);
        self.used.store(place as u32 + 1, Ordering::Relaxed);
        // The values of a new place are zeros, which readers may see from now on.
        self.table[index].store(place as u32 + 1, Ordering::Release);
        Some(place)
    }

    /// The nodes of the brick at a place in the pool.
    pub fn values(&self, place: usize) -> &[AtomicI16] {
        &self.values[place * BRICK_NODES..][..BRICK_NODES]
    }

    /// The lowest node of the brick at a place in the pool.
    pub fn low_of(&self, place: usize) -> IVec3 {
        let [bx, by, _] = self.bricks.to_array();
        let at = self.owners[place].load(Ordering::Relaxed) as i32;
        BRICK as i32 * (IVec3::new(at % bx, at / bx % by, at / (bx * by)) - 1)
    }

    #[inline]
    pub fn at(&self, node: IVec3) -> i16 {
        if self.used.load(Ordering::Relaxed) == 0 {
            return 0;
        }
        let Some(place) = self.find(node >> BRICK.trailing_zeros()) else { return 0 };
        self.values[place * BRICK_NODES + within(node)].load(Ordering::Relaxed)
    }
}

/// Index of a node in its brick.
#[inline]
pub(crate) fn within(node: IVec3) -> usize {
    let v = node & (BRICK as i32 - 1);
    v.x as usize + BRICK * (v.y as usize + BRICK * v.z as usize)
}

/// How deep a node's value lies in the cut, nodes; at least -4.
#[inline]
pub fn cut_depth(value: i16) -> f32 {
    f32::from(value - CUT_SURFACE) / CUT_STEPS
}

impl BoneVolume {
    /// Nodes of the cut along a voxel's edge.
    #[inline]
    pub fn cut_nodes(&self) -> i32 {
        self.cut.nodes
    }

    /// Distance between the nodes of the cut, mm.
    pub fn node_mm(&self) -> f32 {
        self.spacing_mm / self.cut.nodes as f32
    }

    /// Coordinates of a world point in nodes of the cut; nodes are at whole numbers.
    #[inline]
    pub fn node_at(&self, point: Vec3) -> Vec3 {
        self.cut.nodes as f32 * self.grid_of(point)
    }

    /// Value of the cut at a node, which is at voxel `node / cut_nodes()`; see
    /// [`cut_depth`]. 0 far from all cuts.
    #[inline]
    pub fn cut_at(&self, node: IVec3) -> i16 {
        self.cut.at(node)
    }

    /// The density that a voxel of `hu` shows when the cut at its centre is `value`. It is under a
    /// ramp through the isovalue at the surface of the cut, 1000 HU a voxel.
    #[inline]
    pub(crate) fn ramped(&self, hu: i16, value: i16) -> i16 {
        if value == 0 {
            return hu;
        }
        let under = (RAMP_HU / self.cut.nodes as f32 * cut_depth(value)).round() as i32;
        let most = i32::from(self.isovalue) - if value >= CUT_SURFACE { under.max(1) } else { under };
        hu.min(most.clamp(trepan_volume::AIR_HU.into(), i16::MAX.into()) as i16)
    }

    /// How often a brick of nodes was changed; it lies in the brick of voxels at its place over
    /// [`cut_nodes`](Self::cut_nodes), whose [`cut_version`](Self::cut_version) changes after it.
    #[inline]
    pub fn cut_part_version(&self, brick: IVec3) -> u32 {
        self.cut.find(brick).map_or(0, |place| self.cut.versions[place].load(Ordering::Acquire))
    }

    /// Whether anything was cut within 4 nodes of the box of nodes from `low` to `high`, inclusive.
    /// It may say so of boxes up to a brick away from the cut.
    pub fn is_cut_near(&self, low: IVec3, high: IVec3) -> bool {
        if self.cut.used.load(Ordering::Relaxed) == 0 {
            return false;
        }
        let (first, last) = (low >> BRICK.trailing_zeros(), high >> BRICK.trailing_zeros());
        let (first, last) = (first.max(IVec3::NEG_ONE), last.min(self.cut.bricks - 2));
        let mut all = (first.z..=last.z).flat_map(|k| (first.y..=last.y).map(move |j| (j, k)));
        all.any(|(j, k)| (first.x..=last.x).any(|i| self.cut.find(IVec3::new(i, j, k)).is_some()))
    }

    /// Copies the values of the cut in a box of nodes, x fastest.
    pub fn read_cut(&self, low: IVec3, size: IVec3, out: &mut [i16]) {
        let [nx, ny, nz] = size.to_array();
        for (row, out) in out[..(nx * ny * nz) as usize].chunks_exact_mut(nx.max(1) as usize).enumerate() {
            let start = low + IVec3::new(0, row as i32 % ny, row as i32 / ny);
            let mut done = 0;
            while done < nx {
                let node = start + IVec3::new(done, 0, 0);
                let count = (BRICK as i32 - (node.x & (BRICK as i32 - 1))).min(nx - done);
                let part = &mut out[done as usize..(done + count) as usize];
                match self.cut.find(node >> BRICK.trailing_zeros()) {
                    Some(place) => {
                        let from = &self.cut.values[place * BRICK_NODES + within(node)..][..count as usize];
                        part.iter_mut().zip(from).for_each(|(to, from)| *to = from.load(Ordering::Relaxed));
                    }
                    None => part.fill(0),
                }
                done += count;
            }
        }
    }

    /// Starts a change of the cut. For the writer only.
    pub fn cut_writer(&self) -> CutWriter<'_> {
        CutWriter { bone: self, brick: IVec3::MIN, place: None }
    }

    /// The brick of voxels in which a node lies, or the nearest one.
    pub(crate) fn brick_of_node(&self, node: IVec3) -> usize {
        self.brick_of((node / self.cut.nodes).clamp(IVec3::ZERO, self.last()))
    }
}

/// Changes the cut; readers notice after each brick, and at the latest when it is
/// dropped.
pub struct CutWriter<'a> {
    bone: &'a BoneVolume,
    brick: IVec3,
    place: Option<usize>,
}

impl CutWriter<'_> {
    /// Sets the value of a node. Returns false beyond the grid and the brick next to it, and where
    /// no memory is left: then nothing changes.
    #[inline]
    pub fn set(&mut self, node: IVec3, value: i16) -> bool {
        let lane = node.x & 7;
        self.set_eight(node - lane * IVec3::X, [value; 8], 1 << lane)
    }

    /// Sets those of the eight nodes along x from `node` on that have a bit in `which`: fast where
    /// it has all eight. The first is at a multiple of eight. Returns false beyond the grid and
    /// the brick next to it, and where no memory is left: then nothing changes.
    #[inline]
    pub fn set_eight(&mut self, node: IVec3, values: [i16; 8], which: u32) -> bool {
        debug_assert_eq!(node.x % 8, 0);
        let brick = node >> BRICK.trailing_zeros();
        if brick != self.brick {
            self.look_at(brick);
        }
        let Some(place) = self.place else { return false };
        let cells = &self.bone.cut.values[place * BRICK_NODES + within(node)..][..8];
        let all = which == 0xFF;
        for (lane, (cell, value)) in cells.iter().zip(values).enumerate() {
            if all || which >> lane & 1 == 1 {
                cell.store(value, Ordering::Relaxed);
            }
        }
        true
    }

    fn look_at(&mut self, brick: IVec3) {
        self.publish();
        let bone = self.bone;
        (self.brick, self.place) = (brick, bone.cut.find_or_take(brick));
        if let Some(place) = self.place {
            let stored = bone.versions.len() + place;
            if bone.strokes.is_first(stored) {
                let values = bone.cut.values(place);
                bone.strokes.keep(stored, |n| values[n].load(Ordering::Relaxed));
            }
        }
    }

    fn publish(&mut self) {
        if self.place.is_some() {
            self.bone.note_cut(self.brick);
        }
    }
}

impl Drop for CutWriter<'_> {
    fn drop(&mut self) {
        self.publish();
    }
}

impl BoneVolume {
    /// Tells readers that a brick of nodes has changed.
    pub(crate) fn note_cut(&self, brick: IVec3) {
        let add =
            |version: &AtomicU32| version.store(version.load(Ordering::Relaxed).wrapping_add(1), Ordering::Release);
        self.cut.find(brick).into_iter().for_each(|place| add(&self.cut.versions[place]));
        let low = BRICK as i32 * brick;
        // A brick of nodes lies within one brick of voxels, since its edge divides theirs.
        add(&self.cut_versions[self.brick_of_node(low)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Undone;
    use trepan_volume::{AIR_HU, VoxelVolume};

    const MIDDLE: Vec3 = Vec3::splat(7.3);

    /// Bone of 1 mm voxels, two nodes each.
    fn block() -> BoneVolume {
        BoneVolume::new(&VoxelVolume::isotropic([16; 3], Vec3::ZERO, 1.0, 1200i16), 400).unwrap()
    }

    fn nodes() -> impl Iterator<Item = IVec3> {
        (0..32i32.pow(3)).map(|at| IVec3::new(at % 32, at / 32 % 32, at / 1024))
    }

    fn depth(node: IVec3, radius: f32) -> f32 {
        radius - (0.5 * node.as_vec3()).distance(MIDDLE)
    }

    /// Cuts a ball.
    fn cut(bone: &BoneVolume, radius: f32) {
        let mut writer = bone.cut_writer();
        for node in nodes() {
            let depth = (2.0 * depth(node, radius)).clamp(-3.0, 3.0);
            let value = CUT_SURFACE + (depth * CUT_STEPS).round() as i16;
            if depth > -3.0 && value > bone.cut_at(node) {
                assert!(writer.set(node, value), "{node}");
            }
        }
    }

    #[test]
    fn a_cut_is_read_node_by_node_row_by_row_and_as_densities() {
        let bone = block();
        assert_eq!((bone.cut_nodes(), bone.node_mm(), bone.cut_at(IVec3::splat(9))), (2, 0.5, 0));
        assert!(!bone.is_cut_near(IVec3::ZERO, IVec3::splat(31)));
        cut(&bone, 3.0);
        assert!(bone.is_cut_near(IVec3::splat(9), IVec3::splat(9)));
        let (low, size) = (IVec3::new(-3, 5, 11), IVec3::new(29, 13, 9));
        let mut out = vec![7; size.element_product() as usize];
        bone.read_cut(low, size, &mut out);
        for (at, value) in out.iter().enumerate() {
            let at = at as i32;
            let node = low + IVec3::new(at % size.x, at / size.x % size.y, at / (size.x * size.y));
            assert_eq!(*value, bone.cut_at(node), "{node}");
        }
        for node in nodes().filter(|node| depth(*node, 3.0).abs() < 1.4) {
            let found = 0.5 * cut_depth(bone.cut_at(node));
            assert!((found - depth(node, 3.0)).abs() < 1e-3, "{node}: {found}");
        }
        for voxel in nodes().filter(|node| node.max_element() < 16) {
            let (deep, hu) = (depth(2 * voxel, 3.0), bone.hu(voxel));
            assert_eq!((hu < 400, bone.ct(voxel)), (deep >= 0.0, 1200), "{voxel}");
            let ramp = (400.0 - 1000.0 * deep.clamp(-1.5, 1.5)).clamp(f32::from(AIR_HU), 1200.0);
            assert!((f32::from(hu) - ramp).abs() < 3.0 || deep > 1.4, "{voxel}: {hu} {ramp}");
        }
        let snapshot = bone.snapshot();
        assert!(
            nodes()
                .filter(|n| n.max_element() < 16)
                .all(|v| snapshot.get(v.to_array().map(|i| i as usize)) == Some(bone.hu(v)))
        );
        let mut writer = bone.cut_writer();
        assert!(!writer.set(IVec3::splat(-9), CUT_SURFACE) && !writer.set(IVec3::new(40, 0, 0), CUT_SURFACE));
        assert!(writer.set(IVec3::splat(-1), CUT_SURFACE) && bone.cut_at(IVec3::splat(-1)) == CUT_SURFACE);
    }

    #[test]
    fn readers_notice_a_cut_and_a_stroke_is_undone_to_the_last_node() {
        let bone = block();
        cut(&bone, 2.0);
        let all = |bone: &BoneVolume| nodes().map(|node| bone.cut_at(node)).collect::<Vec<_>>();
        let (before, mut seen) = (all(&bone), bone.seen());
        bone.begin_stroke();
        cut(&bone, 4.0);
        bone.set_hu(IVec3::splat(1), AIR_HU);
        bone.end_stroke();
        let mut changed = 0;
        bone.changed(&mut seen, 99, |_| changed += 1);
        assert!(changed == 8 && all(&bone) != before, "{changed} bricks");
        // What the stroke took would come back there, and only there.
        let back = |place: Vec3| {
            (0..bone.stroke_bricks()).any(|n| {
                bone.brings_back(n, |middle, half| middle.distance(place) < half, |p| p.distance(place) < 0.45)
            })
        };
        let [taken, before_it, beyond, alone] = [3.0, 0.0, 5.0, -6.3].map(|off| back(MIDDLE + off * Vec3::X));
        assert!(taken && !before_it && !beyond && !alone, "{taken} {before_it} {beyond} {alone}");
        assert!(matches!(bone.undo_stroke(), Undone::Bricks(_)));
        assert!(all(&bone) == before && bone.ct(IVec3::splat(1)) == 1200);
    }
}
