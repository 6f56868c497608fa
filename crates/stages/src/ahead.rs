//! Remaining bone ahead of the burr, for the warning before the inner table is broken through.
//!
//! # Theory
//! A ray starts at the foremost point of the ball along a direction (the tool's axis, or the
//! direction of pressing). The density is trilinear between voxel centres. The remaining bone is
//! the length up to the last crossing of the isovalue within the reach.
//!
//! # Practice
//! Steps of a quarter voxel with the crossing interpolated: within 0.1 voxel on flat bone. At
//! voxels of 1/3 mm a millimetre takes 12 samples of 8 loads: under 1 us for the 2 mm of the
//! warnings.
//!
//! # When not to use it
//! Along the axis alone, for a burr that cuts with its side: that bone is not the bone being cut.

use glam::IVec3;
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;

/// Returns the remaining bone along `direction` (unit) from `front`, mm, at most `reach_mm`.
pub fn bone_ahead_mm(bone: &BoneVolume, front: Vec3, direction: Vec3, reach_mm: f32) -> f32 {
    let step = 0.25 * bone.spacing_mm();
    let over = |mm: f32| density(bone, front + mm * direction) - f32::from(bone.isovalue());
    let (mut left, mut last) = (0.0, over(0.0));
    let steps = (reach_mm / step).ceil().clamp(0.0, 512.0) as usize;
    for i in 1..=steps {
        let (from, to) = ((i - 1) as f32 * step, i as f32 * step);
        let now = over(to);
        if now >= 0.0 {
            left = to;
        } else if last >= 0.0 {
            left = from + step * last / (last - now);
        }
        last = now;
    }
    left.min(reach_mm)
}

/// Returns the trilinear density, HU.
pub fn density(bone: &BoneVolume, point: Vec3) -> f32 {
    let grid = bone.grid_of(point);
    let low = grid.floor();
    let t = grid - low;
    let voxel = low.as_ivec3();
    let at = |i, j, k| f32::from(bone.hu(voxel + IVec3::new(i, j, k)));
    let along_x = |j, k| at(0, j, k) + t.x * (at(1, j, k) - at(0, j, k));
    let along_y = |k| along_x(0, k) + t.y * (along_x(1, k) - along_x(0, k));
    along_y(0) + t.z * (along_y(1) - along_y(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_volume::VoxelVolume;

    /// Makes bone from x = -3 to 3 mm, blurred over one voxel.
    fn slab() -> BoneVolume {
        let mut ct = VoxelVolume::isotropic([24, 8, 8], Vec3::new(-6.0, -2.0, -2.0), 0.5, 0i16);
        for at in 0..ct.data.len() {
            let x = -6.0 + 0.5 * (at % 24) as f32;
            ct.data[at] = (400.0 + 2000.0 * (3.0 - x.abs())).clamp(-600.0, 1400.0) as i16;
        }
        BoneVolume::new(&ct, 400).expect("there is bone")
    }

    #[test]
    fn remaining_bone_of_a_slab_is_measured_to_less_than_a_voxel() {
        let bone = slab();
        for depth in [0.1f32, 0.77, 1.5, 3.33, 5.0, 5.9] {
            let left = bone_ahead_mm(&bone, Vec3::X * (3.0 - depth), Vec3::NEG_X, 10.0);
            assert!((left - (6.0 - depth)).abs() < 0.05, "{left} at depth {depth}");
        }
        assert_eq!(bone_ahead_mm(&bone, Vec3::X * 3.0, Vec3::NEG_X, 2.0), 2.0);
        assert_eq!(bone_ahead_mm(&bone, Vec3::X * 4.0, Vec3::X, 2.0), 0.0);
        assert_eq!(bone_ahead_mm(&bone, Vec3::NAN, Vec3::X, 2.0), 0.0);
    }
}
