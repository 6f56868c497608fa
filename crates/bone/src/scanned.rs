//! Keeps the densities as they were scanned: a brick is copied before its first change.
//!
//! # Practice
//! The pool has room for all bricks; its pages are taken from the system when they are first
//! written, so that memory grows with what a lifted flap changes, 1 kB a brick. What tools cut is a
//! field of its own and changes nothing here.

use crate::BoneVolume;
use crate::cut::within;
use crate::stroke::BRICK_VOXELS;
use bytemuck::allocation::zeroed_slice_box;
use glam::IVec3;
use std::sync::atomic::{AtomicI16, AtomicU32, Ordering};
use trepan_volume::{AIR_HU, VoxelVolume};

/// Copies of the bricks that have changed.
#[derive(Debug)]
pub(crate) struct Scanned {
    /// For each brick its place in the pool and 1, or 0 while it is unchanged.
    table: Box<[AtomicU32]>,
    used: AtomicU32,
    values: Box<[AtomicI16]>,
}

impl Scanned {
    /// Nothing has changed in this many bricks.
    pub fn new(bricks: usize) -> Self {
        let values = zeroed_slice_box(bricks * BRICK_VOXELS);
        Self { table: zeroed_slice_box(bricks), used: AtomicU32::new(0), values }
    }

    /// Copies a brick's densities, voxel by voxel, unless it was copied before.
    #[inline]
    pub fn keep(&self, brick: usize, density: impl Fn(usize) -> i16) {
        if self.table[brick].load(Ordering::Relaxed) == 0 {
            let place = self.used.fetch_add(1, Ordering::Relaxed);
            let copy = &self.values[place as usize * BRICK_VOXELS..][..BRICK_VOXELS];
            copy.iter().enumerate().for_each(|(n, value)| value.store(density(n), Ordering::Relaxed));
            self.table[brick].store(place + 1, Ordering::Release);
        }
    }

    /// Density of the `n`th voxel of a brick, if the brick has changed.
    fn of(&self, brick: usize, n: usize) -> Option<i16> {
        let place = self.table[brick].load(Ordering::Acquire).checked_sub(1)?;
        Some(self.values[place as usize * BRICK_VOXELS + n].load(Ordering::Relaxed))
    }
}

impl BoneVolume {
    /// Density of a voxel as it was scanned, HU, whatever was changed or cut since; air outside.
    pub fn scanned(&self, voxel: IVec3) -> i16 {
        // Read before the table: whoever sees a change sees the copy that was made before it.
        let now = self.index(voxel).map(|at| self.hu[at].load(Ordering::Acquire));
        let kept = |now| self.scanned.of(self.brick_of(voxel), within(voxel)).unwrap_or(now);
        now.map_or(AIR_HU, kept)
    }

    /// All densities as they were scanned, HU.
    pub fn scanned_volume(&self) -> VoxelVolume<i16> {
        let mut volume = VoxelVolume::isotropic(self.dims, self.origin, self.spacing_mm, AIR_HU);
        self.voxels().zip(&mut volume.data).for_each(|(voxel, hu)| *hu = self.scanned(voxel));
        volume
    }

    /// Voxels that were bone when they were scanned, in their order, each with its index.
    pub fn scanned_bone(&self) -> impl Iterator<Item = (usize, IVec3)> {
        let is_bone = |at: &(usize, IVec3)| {
            self.solid[self.brick_of(at.1)].load(Ordering::Relaxed) && self.scanned(at.1) >= self.isovalue
        };
        self.voxels().enumerate().filter(is_bone)
    }

    /// Gives the densities as they were scanned back, in the same memory.
    pub fn into_scanned(self) -> VoxelVolume<i16> {
        let (dims, origin, spacing_mm) = (self.dims, self.origin, self.spacing_mm);
        if self.scanned.used.load(Ordering::Relaxed) > 0 {
            return self.scanned_volume();
        }
        let data = self.hu.into_iter().map(AtomicI16::into_inner).collect();
        VoxelVolume { dims, data, ..VoxelVolume::isotropic([0; 3], origin, spacing_mm, AIR_HU) }
    }

    fn voxels(&self) -> impl Iterator<Item = IVec3> + use<> {
        let [nx, ny, nz] = self.dims.map(|n| n as i32);
        (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| IVec3::new(x, y, z))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    #[test]
    fn what_was_scanned_outlasts_changes_cuts_and_undoing() {
        let mut ct = VoxelVolume::isotropic([19, 17, 11], Vec3::new(3.0, -2.0, 1.0), 0.5, 900i16);
        ct.data.iter_mut().enumerate().for_each(|(at, hu)| *hu += (at % 37) as i16);
        let bone = BoneVolume::new(&ct, 400).unwrap();
        bone.begin_stroke();
        for n in 0..200 {
            bone.set_hu(IVec3::new(n % 19, n % 17, n % 11), if n % 3 == 0 { 700 } else { AIR_HU });
        }
        bone.cut_writer().set(IVec3::splat(5), crate::CUT_SURFACE);
        assert!(bone.snapshot() != ct && bone.scanned_volume() == ct);
        assert_eq!(bone.scanned_bone().count(), ct.data.len());
        bone.undo_stroke();
        bone.set_hu(IVec3::ZERO, 1);
        assert_eq!((bone.scanned(IVec3::ZERO), bone.scanned(IVec3::NEG_X)), (ct.data[0], AIR_HU));
        assert_eq!(bone.into_scanned(), ct);
        assert_eq!(BoneVolume::new(&ct, 400).unwrap().into_scanned(), ct);
    }
}
