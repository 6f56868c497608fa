//! Erosion, dilation, opening and closing by balls of any radius, from distance fields.
//!
//! # Theory
//! With D the signed distance to a mask (negative inside), the erosion by a ball of radius r is
//! `D < -r` and the dilation `D < r` (Serra 1982), both exact for any r and at the cost of one
//! distance transform. It is computed in a box around the mask; nothing outside of it can be set.

use super::{extent, part_of};
use crate::component::Components;
use crate::{DistanceField, Grid, VoxelVolume, largest_component};

/// More than what a distance is rounded by, mm.
pub(super) const SPARE_MM: f32 = 0.1;

fn eroded(mask: &VoxelVolume<u8>, radius_mm: f32) -> VoxelVolume<u8> {
    DistanceField::of_mask_within(mask, radius_mm + SPARE_MM).values().map(|d| u8::from(d < -radius_mm))
}

fn dilated(mask: &VoxelVolume<u8>, radius_mm: f32) -> VoxelVolume<u8> {
    DistanceField::of_mask_within(mask, radius_mm + SPARE_MM).values().map(|d| u8::from(d < radius_mm))
}

/// The largest piece after erosion; `None` if nothing is left.
pub(super) fn core(mask: &VoxelVolume<u8>, radius_mm: f32) -> Option<VoxelVolume<u8>> {
    let core = in_box(mask, 0.0, |mask| largest_component(&eroded(mask, radius_mm)));
    core.data.contains(&1).then_some(core)
}

/// The voxels within `radius_mm` of a mask that are `allowed`.
pub(super) fn within(mask: &VoxelVolume<u8>, radius_mm: f32, allowed: impl Fn(usize) -> bool) -> VoxelVolume<u8> {
    let mut near = in_box(mask, radius_mm, |mask| dilated(mask, radius_mm));
    near.data.iter_mut().enumerate().for_each(|(at, near)| *near &= u8::from(*near != 0 && allowed(at)));
    near
}

/// Closes gaps narrower than twice the radius, and holes.
pub(super) fn closed(mask: &VoxelVolume<u8>, radius_mm: f32) -> VoxelVolume<u8> {
    in_box(mask, radius_mm, |mask| filled(&eroded(&dilated(mask, radius_mm), radius_mm)))
}

/// Voxels between what an operation sets and the border of its box, which has no surface.
const FRAME: usize = 3;

/// Applies an operation in a box around a mask, wider by a margin, within its grid.
fn in_box(
    mask: &VoxelVolume<u8>,
    margin_mm: f32,
    operation: impl Fn(&VoxelVolume<u8>) -> VoxelVolume<u8>,
) -> VoxelVolume<u8> {
    let Some([low, high]) = extent(mask) else { return operation(mask) };
    let margin = mask.spacing_mm().to_array().map(|mm| (f64::from(margin_mm) / mm).ceil() as usize + FRAME);
    let low = [0, 1, 2].map(|a| low[a].saturating_sub(margin[a]));
    let high = [0, 1, 2].map(|a| (high[a] + margin[a]).min(mask.dims[a] - 1));
    let grid = part_of(&Grid::of(mask), [low, high]);
    let rows = || (low[2]..=high[2]).flat_map(|k| (low[1]..=high[1]).map(move |j| mask.index([low[0], j, k])));
    let mut data = Vec::with_capacity(grid.voxels());
    rows().for_each(|at| data.extend_from_slice(&mask.data[at..at + grid.dims[0]]));
    let done = operation(&VoxelVolume { dims: grid.dims, data, world_from_voxel: grid.world_from_voxel });
    let mut out = VoxelVolume::filled(mask.dims, mask.world_from_voxel, 0);
    for (at, row) in rows().zip(done.data.chunks_exact(grid.dims[0])) {
        out.data[at..at + row.len()].copy_from_slice(row);
    }
    out
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
