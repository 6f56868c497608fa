//! Erosion, dilation, opening and closing by balls of any radius, from distance fields.
//!
//! # Theory
//! With D the signed distance to a mask (negative inside), the erosion by a ball of radius r is
//! `D < -r` and the dilation `D < r` (Serra 1982), both exact for any r and at the cost of one
//! distance transform.

use crate::component::Components;
use crate::{DistanceField, VoxelVolume, largest_component};

/// The largest piece after erosion; `None` if nothing is left.
pub(super) fn core(mask: &VoxelVolume<u8>, radius_mm: f32) -> Option<VoxelVolume<u8>> {
    let eroded = DistanceField::of_mask(mask).values().map(|d| u8::from(d < -radius_mm));
    let core = largest_component(&eroded);
    core.data.contains(&1).then_some(core)
}

/// The voxels within `radius_mm` of a mask that are `allowed`.
pub(super) fn within(mask: &VoxelVolume<u8>, radius_mm: f32, allowed: impl Fn(usize) -> bool) -> VoxelVolume<u8> {
    let field = DistanceField::of_mask(mask);
    let data = field.values().data.iter().enumerate().map(|(at, &d)| u8::from(d < radius_mm && allowed(at))).collect();
    VoxelVolume { dims: mask.dims, data, world_from_voxel: mask.world_from_voxel }
}

/// Closes gaps narrower than twice the radius, and holes.
pub(super) fn closed(mask: &VoxelVolume<u8>, radius_mm: f32) -> VoxelVolume<u8> {
    let wide = DistanceField::of_mask(mask).values().map(|d| u8::from(d < radius_mm));
    filled(&DistanceField::of_mask(&wide).values().map(|d| u8::from(d < -radius_mm)))
}

/// Fills enclosed holes: everything but the largest piece of the background.
pub(super) fn filled(mask: &VoxelVolume<u8>) -> VoxelVolume<u8> {
    let gaps = Components::of(mask.dims, |at| mask.data[at] == 0);
    let mut out = VoxelVolume::filled(mask.dims, mask.world_from_voxel, 1);
    if let Some(outside) = gaps.largest() {
        gaps.each_run(outside, |run| out.data[run].fill(0));
    }
    out
}
