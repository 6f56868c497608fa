//! The bone around the tool, copied close together: densities of voxels, or what is kept on the
//! finer nodes of the cut.
//!
//! # Theory
//! A ball touches some thousands of voxels of the millions. They are kept in a cube whose edge is a
//! power of two and which wraps around: voxel (i, j, k) lies at (i mod n, j mod n, k mod n). When
//! the tool moves on by a voxel only the layer that comes in is read.
//!
//! ```text
//! │c d a b│  →  │c d e b│     window b..e after a..d: e took a's place
//! ```
//!
//! # Practice
//! A look costs about a nanosecond, with no test for borders. The window is a copy: what its owner
//! changes it is told ([`Window::eight_mut`]), what others change it finds by the versions of the
//! bricks that it meets ([`Window::renew`]), a nanosecond each.

use crate::eight::Vec3x8;
use crate::rows::each;
use glam::IVec3;
use trepan_bone::{BRICK, BetweenScratch, BoneVolume, CUT_STEPS, CUT_SURFACE};
use wide::{f32x8, i16x8, i32x8};

/// Largest edge, log2: 128 voxels, 4 MB.
const MAX_BITS: u32 = 7;
/// Bricks along an edge for which versions are kept: more than the largest window meets; a power of
/// two.
const BRICKS: i32 = 32;

/// What a window shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WindowContent {
    /// The CT's density at the nodes of the cut, HU.
    Density,
    /// The cut at its nodes.
    Cut,
}

pub(crate) struct Window {
    shown: WindowContent,
    cells: Vec<i16>,
    /// One box as it is read.
    read: Vec<i16>,
    scratch: BetweenScratch,
    /// Cells along the edge of a brick of voxels.
    brick: i32,
    bits: u32,
    /// Lowest voxel held.
    low: IVec3,
    filled: bool,
    /// Versions of the bricks that it meets; brick (i, j, k) lies at each index mod [`BRICKS`].
    seen: Vec<u32>,
    /// The same for bricks of nodes, of the cut.
    seen_parts: Vec<u32>,
    /// The value from which a cell is bone; with the cut, from which it is not.
    border: i16,
}

impl Window {
    pub fn new(shown: WindowContent) -> Self {
        let (cells, seen) = (vec![0; 1 << (3 * MAX_BITS)], vec![0; BRICKS.pow(3) as usize]);
        let seen_parts = if shown == WindowContent::Cut { seen.clone() } else { Vec::new() };
        let read = Vec::with_capacity(1 << (3 * MAX_BITS));
        let scratch = BetweenScratch::new(if shown == WindowContent::Density { 1 << MAX_BITS } else { 0 });
        let (brick, low) = (BRICK as i32, IVec3::ZERO);
        Self { shown, cells, read, scratch, brick, bits: 0, low, filled: false, seen, seen_parts, border: CUT_SURFACE }
    }

    /// Everything is to be read anew.
    pub fn forget(&mut self) {
        self.filled = false;
    }

    /// Makes the cut end bone so many nodes behind its surface.
    pub fn clear(&mut self, nodes: f32) {
        self.border = CUT_SURFACE - (nodes * CUT_STEPS).round() as i16;
    }

    /// Makes the window hold all voxels within `half` of `centre`. Returns the voxels read, or
    /// `None` when that is more than it can hold.
    pub fn cover(&mut self, bone: &BoneVolume, centre: IVec3, half: i32) -> Option<u32> {
        let bits = ((2 * half + 2).max(8) as u32).next_power_of_two().trailing_zeros();
        if bits > MAX_BITS {
            return None;
        }
        let edge = 1 << bits;
        // The least shift that holds the box: the layers left behind are read again only when the
        // tool comes back.
        let mut low = self.low.clamp(centre + half + 1 - edge, centre - half);
        let far = (low - self.low).abs().max_element() >= edge;
        self.brick = BRICK as i32 * bone.cut_nodes();
        if self.shown == WindowContent::Density && self.border != bone.isovalue() {
            (self.filled, self.border) = (false, bone.isovalue());
        }
        if !self.filled || bits != self.bits || far {
            low = centre - edge / 2;
            (self.bits, self.low, self.filled) = (bits, low, true);
            self.read(bone, low, low + edge);
            self.bricks(|window, brick| window.see(bone, brick));
            return Some((edge * edge * edge) as u32);
        }
        let mut read = 0;
        for axis in 0..3 {
            let (was, is) = (self.low[axis], low[axis]);
            self.low[axis] = is;
            let (mut from, mut to) = (self.low, self.low + edge);
            if is > was {
                from[axis] = was + edge;
            } else {
                to[axis] = was;
            }
            if is != was {
                self.read(bone, from, to);
                read += (is - was).abs() * edge * edge;
            }
        }
        if read > 0 {
            self.bricks(|window, brick| window.see(bone, brick));
        }
        Some(read as u32)
    }

    /// Reads the bricks anew that others have changed. Returns whether there were any.
    pub fn renew(&mut self, bone: &BoneVolume) -> bool {
        let mut changed = false;
        let (low, high) = (self.low, self.low + (1 << self.bits));
        self.bricks(|window, brick| {
            let version = window.version(bone, brick);
            if std::mem::replace(&mut window.seen[place(brick)], version) == version {
                return;
            }
            changed = true;
            if window.shown == WindowContent::Density {
                // Densities change beyond the brick, by less than a voxel.
                let (from, more) = (brick * window.brick, bone.cut_nodes());
                return window.read(bone, (from - more).max(low), (from + window.brick + more).min(high));
            }
            let (edge, [first, end]) = (BRICK as i32, window.parts(bone, brick));
            each(first, end, |part| {
                let version = bone.cut_part_version(part);
                if std::mem::replace(&mut window.seen_parts[place(part)], version) != version {
                    window.read(bone, (edge * part).max(low), (edge * (part + 1)).min(high));
                }
            });
        });
        changed
    }

    /// Calls `visit` with each brick that the window meets.
    fn bricks(&mut self, mut visit: impl FnMut(&mut Self, IVec3)) {
        if !self.filled {
            return;
        }
        let of = |cell: IVec3| cell.div_euclid(IVec3::splat(self.brick));
        let (first, last) = (of(self.low), of(self.low + (1 << self.bits) - 1));
        each(first, last + 1, |brick| visit(self, brick));
    }

    fn version(&self, bone: &BoneVolume, brick: IVec3) -> u32 {
        if self.shown == WindowContent::Cut { bone.cut_version(brick) } else { bone.ct_version(brick) }
    }

    fn see(&mut self, bone: &BoneVolume, brick: IVec3) {
        self.seen[place(brick)] = self.version(bone, brick);
        if self.shown == WindowContent::Cut {
            let [first, end] = self.parts(bone, brick);
            each(first, end, |part| self.seen_parts[place(part)] = bone.cut_part_version(part));
        }
    }

    /// The first brick of nodes of a brick of voxels that the window meets, and the end of them.
    fn parts(&self, bone: &BoneVolume, brick: IVec3) -> [IVec3; 2] {
        let of = |cell: IVec3| cell.div_euclid(IVec3::splat(BRICK as i32));
        let (first, last) = (of(self.low), of(self.low + (1 << self.bits) - 1));
        [first.max(brick * bone.cut_nodes()), (last + 1).min((brick + 1) * bone.cut_nodes())]
    }

    fn read(&mut self, bone: &BoneVolume, from: IVec3, to: IVec3) {
        let size = to - from;
        if size.cmple(IVec3::ZERO).any() {
            return;
        }
        self.read.resize(size.element_product() as usize, 0);
        if self.shown == WindowContent::Cut {
            bone.read_cut(from, size, &mut self.read);
        } else {
            bone.read_between(from, size, &mut self.scratch, &mut self.read);
        }
        let mut rest = &self.read[..];
        let (mask, cells) = ((1 << self.bits) - 1, &mut self.cells);
        for k in from.z..to.z {
            for j in from.y..to.y {
                let (row, next) = rest.split_at(size.x as usize);
                let start = ((j & mask) << self.bits | (k & mask) << (2 * self.bits)) as usize;
                row.iter().enumerate().for_each(|(i, value)| {
                    cells[start + ((from.x + i as i32) & mask) as usize] = *value;
                });
                rest = next;
            }
        }
    }

    /// How far a cell is over the border of bone, HU; 1000 a node for the cut.
    #[inline]
    pub fn over(&self, cell: IVec3) -> f32 {
        self.scaled(self.cells[self.index(cell)])
    }

    #[inline]
    fn scaled(&self, value: i16) -> f32 {
        match self.shown {
            WindowContent::Cut => f32::from(self.border - value) * (1000.0 / CUT_STEPS),
            WindowContent::Density => f32::from(value) - f32::from(self.border),
        }
    }

    fn index(&self, voxel: IVec3) -> usize {
        let mask = (1 << self.bits) - 1;
        let v = voxel & IVec3::splat(mask);
        (v.x | v.y << self.bits | v.z << (2 * self.bits)) as usize
    }

    /// The 27 cells around and at `cell`, x fastest.
    #[inline]
    pub fn block(&self, cell: IVec3) -> [i16; 27] {
        let mask = (1 << self.bits) - 1;
        let of = |at: i32, axis: u32| [-1, 0, 1].map(|n| (((at + n) & mask) << (axis * self.bits)) as usize);
        let ([x, y, z], cells) = ([of(cell.x, 0), of(cell.y, 1), of(cell.z, 2)], &self.cells[..1 << (3 * self.bits)]);
        core::array::from_fn(|n| cells[x[n % 3] | y[n / 3 % 3] | z[n / 9]])
    }

    /// How far eight values of cells are over the border of bone: as [`over`](Self::over).
    #[inline]
    pub fn scaled_eight(&self, values: &[i16; 8]) -> f32x8 {
        match self.shown {
            WindowContent::Cut => (f32::from(self.border) - wide(values)) * (1000.0 / CUT_STEPS),
            WindowContent::Density => wide(values) - f32::from(self.border),
        }
    }

    /// A cell within the window; outside it, some other cell.
    #[inline]
    pub fn at(&self, cell: IVec3) -> i16 {
        self.cells[self.index(cell)]
    }

    /// The value from which a cell is bone; with the cut, from which it is not.
    pub fn border(&self) -> i16 {
        self.border
    }

    /// How the values rise a cell at the eight cells along x from `cell`, which is at a multiple of
    /// eight.
    pub fn rise(&self, cell: IVec3) -> Vec3x8 {
        let of = |step: IVec3| wide(self.eight(cell + step));
        let [a, b, c, d, e, f, g, h] = *self.eight(cell);
        let (before, after) = (self.at(cell - IVec3::X), self.at(cell + 8 * IVec3::X));
        let x = wide(&[b, c, d, e, f, g, h, after]) - wide(&[before, a, b, c, d, e, f, g]);
        let (y, z) = (of(IVec3::Y) - of(IVec3::NEG_Y), of(IVec3::Z) - of(IVec3::NEG_Z));
        Vec3x8 { x, y, z } * f32x8::splat(0.5)
    }

    /// How far the eight cells along x from `cell`, which is at a multiple of eight, are over the
    /// border of bone, HU.
    #[inline]
    pub fn overs(&self, cell: IVec3) -> f32x8 {
        wide(self.eight(cell)) - f32::from(self.border)
    }

    fn index_of_eight(&self, cell: IVec3) -> usize {
        debug_assert_eq!(cell.x % 8, 0);
        self.index(cell) & !7
    }

    /// The eight cells along x from `cell`, which is at a multiple of eight.
    #[inline]
    pub fn eight(&self, cell: IVec3) -> &[i16; 8] {
        let at = self.index_of_eight(cell);
        self.cells[at..].first_chunk().expect("the edge is a multiple of eight")
    }

    /// Whether the eight cells from `cell` on are all within the window.
    #[inline]
    pub fn holds_eight(&self, cell: IVec3) -> bool {
        (0..=(1 << self.bits) - 8).contains(&(cell.x - self.low.x))
    }

    /// The eight cells from `cell` on, for their owner to change as it cuts.
    #[inline]
    pub fn eight_mut(&mut self, cell: IVec3) -> &mut [i16; 8] {
        let at = self.index_of_eight(cell);
        self.cells[at..].first_chunk_mut().expect("the edge is a multiple of eight")
    }

    /// Takes note that what it shows of the bricks that it meets is how they are now.
    pub fn see_all(&mut self, bone: &BoneVolume) {
        self.bricks(|window, brick| window.see(bone, brick));
    }

    /// One bit for each of `count` cells along x from `start` that `holds`, at most 128.
    #[inline]
    pub fn bits(&self, start: IVec3, count: i32, holds: impl Fn(i16x8) -> i16x8) -> u128 {
        let before = start.x & 7;
        let first = start - before * IVec3::X;
        let mut bits = 0u128;
        for done in (0..before + count).step_by(8) {
            let eight = u128::from(holds(i16x8::new(*self.eight(first + done * IVec3::X))).to_bitmask() & 0xFF);
            bits |= if done == 0 { eight >> before } else { eight << (done - before) };
        }
        bits & !0 >> (128 - count.clamp(1, 128))
    }
}

/// Eight values as floats.
#[inline]
pub fn wide(values: &[i16; 8]) -> f32x8 {
    f32x8::from_i32x8(i32x8::from_i16x8(i16x8::new(*values)))
}

/// Index of a brick among the versions.
fn place(brick: IVec3) -> usize {
    let b = brick & (BRICKS - 1);
    (b.x + BRICKS * (b.y + BRICKS * b.z)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use trepan_geometry::Vec3;
    use trepan_volume::VoxelVolume;

    proptest! {
        #[test]
        fn the_window_shows_the_volume_wherever_it_goes(path in prop::collection::vec((-3i32..12, -3i32..12, -3i32..12, 1i32..6), 1..20)) {
            let mut ct = VoxelVolume::isotropic([9, 10, 11], Vec3::ZERO, 0.3, 0i16);
            ct.data.iter_mut().enumerate().for_each(|(i, v)| *v = i as i16);
            let bone = BoneVolume::new(&ct, 400).unwrap();
            let mut window = Window::new(WindowContent::Density);
            for (x, y, z, half) in path {
                let centre = IVec3::new(x, y, z);
                prop_assert!(window.cover(&bone, centre, half).is_some());
                let others = centre + IVec3::new(half, -half, 0);
                bone.set_hu(others, 1000 + half as i16);
                let within = others.cmpge(IVec3::ZERO).all() && others.cmplt(IVec3::new(9, 10, 11)).all();
                prop_assert_eq!(window.renew(&bone), within);
                prop_assert!(!window.renew(&bone));
                for at in 0..(2 * half + 1).pow(3) {
                    let n = 2 * half + 1;
                    let voxel = centre - half + IVec3::new(at % n, at / n % n, at / n / n);
                    prop_assert_eq!(window.at(voxel), bone.ct(voxel));
                }
            }
        }
    }

    #[test]
    fn what_others_cut_is_read_wherever_the_window_goes() {
        // Two nodes a voxel: a brick of voxels holds eight of nodes.
        let ct = VoxelVolume::isotropic([24; 3], Vec3::ZERO, 1.0, 900i16);
        let bone = BoneVolume::new(&ct, 400).unwrap();
        let mut window = Window::new(WindowContent::Cut);
        for n in 0..60 {
            let centre = IVec3::new(n % 40, 20 + n % 7, (3 * n) % 40);
            window.cover(&bone, centre, 8).unwrap();
            let others = centre + IVec3::new(n % 9 - 4, 5 - n % 11, n % 5);
            bone.cut_writer().set(others, CUT_SURFACE + n as i16);
            assert!(window.renew(&bone) && !window.renew(&bone), "{n}");
            each(centre - 8, centre + 9, |node| assert_eq!(window.at(node), bone.cut_at(node), "{n} {node}"));
        }
    }

    #[test]
    fn more_than_it_can_hold_is_refused() {
        let bone = BoneVolume::new(&VoxelVolume::isotropic([2, 2, 2], Vec3::ZERO, 0.3, 900i16), 400).unwrap();
        assert_eq!(Window::new(WindowContent::Density).cover(&bone, IVec3::ZERO, 64), None);
    }
}
