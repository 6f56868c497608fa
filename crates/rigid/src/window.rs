//! The densities around the tool, copied close together.
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
//! changes it is told ([`Window::set`]), what others change it finds by the versions of the bricks
//! that it meets ([`Window::renew`]), a nanosecond each.

use crate::rows::each;
use glam::IVec3;
use trepan_volume::{BRICK, BoneVolume};

/// Largest edge, log2: 128 voxels, 4 MB.
const MAX_BITS: u32 = 7;
/// Bricks along an edge for which versions are kept: more than the largest window meets; a power of
/// two.
const BRICKS: i32 = 32;

pub(crate) struct Window {
    cells: Vec<i16>,
    bits: u32,
    /// Lowest voxel held.
    low: IVec3,
    filled: bool,
    /// Versions of the bricks that it meets; brick (i, j, k) lies at each index mod [`BRICKS`].
    seen: Vec<u32>,
    /// Density from which a voxel is bone, HU.
    pub isovalue: i16,
}

impl Window {
    pub fn new() -> Self {
        let (cells, seen) = (vec![0; 1 << (3 * MAX_BITS)], vec![0; BRICKS.pow(3) as usize]);
        Self { cells, bits: 0, low: IVec3::ZERO, filled: false, seen, isovalue: 0 }
    }

    /// Everything is to be read anew.
    pub fn forget(&mut self) {
        self.filled = false;
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
        if !self.filled || bits != self.bits || far || self.isovalue != bone.isovalue() {
            low = centre - edge / 2;
            (self.bits, self.low, self.filled, self.isovalue) = (bits, low, true, bone.isovalue());
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
            if window.seen[place(brick)] != bone.version(brick) {
                window.see(bone, brick);
                let from = brick * BRICK as i32;
                window.read(bone, from.max(low), (from + BRICK as i32).min(high));
                changed = true;
            }
        });
        changed
    }

    /// Calls `visit` with each brick that the window meets.
    fn bricks(&mut self, mut visit: impl FnMut(&mut Self, IVec3)) {
        if !self.filled {
            return;
        }
        let of = |voxel: IVec3| voxel.div_euclid(IVec3::splat(BRICK as i32));
        let (first, last) = (of(self.low), of(self.low + (1 << self.bits) - 1));
        each(first, last + 1, |brick| visit(self, brick));
    }

    fn see(&mut self, bone: &BoneVolume, brick: IVec3) {
        self.seen[place(brick)] = bone.version(brick);
    }

    fn read(&mut self, bone: &BoneVolume, from: IVec3, to: IVec3) {
        each(from, to, |voxel| {
            let at = self.index(voxel);
            self.cells[at] = bone.hu(voxel);
        });
    }

    fn index(&self, voxel: IVec3) -> usize {
        let mask = (1 << self.bits) - 1;
        let v = voxel & IVec3::splat(mask);
        (v.x | v.y << self.bits | v.z << (2 * self.bits)) as usize
    }

    /// Density of a voxel within the window, HU; outside it, of some other voxel.
    pub fn hu(&self, voxel: IVec3) -> i16 {
        self.cells[self.index(voxel)]
    }

    /// The row of voxels along x through `voxel`, for looks at many of them.
    #[inline]
    pub fn row(&self, voxel: IVec3) -> Row<'_> {
        let mask = (1usize << self.bits) - 1;
        let start = self.index(voxel.with_x(0));
        Row { cells: &self.cells[start..=start + mask], mask }
    }

    /// Takes note of the density that its owner has just given to a voxel.
    pub fn set(&mut self, bone: &BoneVolume, voxel: IVec3) {
        let inside = voxel.cmpge(self.low).all() && voxel.cmplt(self.low + (1 << self.bits)).all();
        if self.filled && inside {
            let at = self.index(voxel);
            self.cells[at] = bone.hu(voxel);
            self.see(bone, voxel.div_euclid(IVec3::splat(BRICK as i32)));
        }
    }
}

/// Index of a brick among the versions.
fn place(brick: IVec3) -> usize {
    let b = brick & (BRICKS - 1);
    (b.x + BRICKS * (b.y + BRICKS * b.z)) as usize
}

/// One row of the window.
pub(crate) struct Row<'a> {
    cells: &'a [i16],
    mask: usize,
}

impl Row<'_> {
    /// Density of the voxel at `x`, HU.
    pub fn hu(&self, x: i32) -> i16 {
        self.cells[x as usize & self.mask]
    }
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
            let mut ct = VoxelVolume::isotropic([9, 10, 11], Vec3::ZERO, 1.0, 0i16);
            ct.data.iter_mut().enumerate().for_each(|(i, v)| *v = i as i16);
            let bone = BoneVolume::new(&ct, 400).unwrap();
            let mut window = Window::new();
            for (x, y, z, half) in path {
                let centre = IVec3::new(x, y, z);
                prop_assert!(window.cover(&bone, centre, half).is_some());
                bone.set_hu(centre, 7);
                window.set(&bone, centre);
                let others = centre + IVec3::new(half, -half, 0);
                bone.set_hu(others, 1000 + half as i16);
                let within = others.cmpge(IVec3::ZERO).all() && others.cmplt(IVec3::new(9, 10, 11)).all();
                prop_assert_eq!(window.renew(&bone), within);
                prop_assert!(!window.renew(&bone));
                for at in 0..(2 * half + 1).pow(3) {
                    let n = 2 * half + 1;
                    let voxel = centre - half + IVec3::new(at % n, at / n % n, at / n / n);
                    prop_assert_eq!(window.hu(voxel), bone.hu(voxel));
                }
            }
        }
    }

    #[test]
    fn more_than_it_can_hold_is_refused() {
        let bone = BoneVolume::new(&VoxelVolume::isotropic([2, 2, 2], Vec3::ZERO, 1.0, 900i16), 400).unwrap();
        assert_eq!(Window::new().cover(&bone, IVec3::ZERO, 64), None);
    }
}
