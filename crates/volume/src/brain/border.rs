//! Finds the border of a brain: the darkest layer around its tissue.
//!
//! # Theory
//! Between brain and scalp a T1 MRI has a dark layer of CSF, dura and the skull's inner table. A
//! watershed of the smoothed grey values, brightest first, starts from the tissue on one side and
//! from the known outside on the other; the two meet in this layer, as in the skull stripping of
//! Hahn and Peitgen (2000). The known outside is farther than a reach from the tissue, brighter
//! than brain, just under the skin, or outside a CT's skull.
//!
//! # Sources
//! H. K. Hahn, H.-O. Peitgen, "The skull stripping problem in MRI solved by a single 3D watershed
//! transform", MICCAI 2000.

use super::flood::{INSIDE, OUTSIDE, UNKNOWN, flood};
use crate::VoxelVolume;

/// Distance to the tissue within which bright voxels may be its vessels, mm.
const BRIGHT_MM: f32 = 2.0;
/// The smallest grey value, as a fraction of the brightest brain, since a flood stops at 0.
const DARKEST: f32 = 1e-3;

/// Extends the tissue up to the darkest layer around it. `distance` is that to the tissue, mm,
/// negative inside.
pub(super) fn grown(
    mri: &VoxelVolume<f32>,
    distance: &[f32],
    greatest: f32,
    reach_mm: f32,
    outside: impl Fn(usize) -> bool,
) -> VoxelVolume<u8> {
    let bright = |at: usize| mri.data[at] > greatest && distance[at] > BRIGHT_MM;
    let label = |at: usize| match distance[at] {
        d if d < 0.0 => INSIDE,
        d if d > reach_mm || bright(at) || outside(at) => OUTSIDE,
        _ => UNKNOWN,
    };
    let mut labels: Vec<u8> = (0..mri.data.len()).map(label).collect();
    let values: Vec<f32> = smoothed(mri).into_iter().map(|v| v.max(DARKEST * greatest)).collect();
    flood(mri.dims, &values, greatest, &mut labels);
    let data = labels.into_iter().map(|label| u8::from(label == INSIDE)).collect();
    VoxelVolume { dims: mri.dims, data, world_from_voxel: mri.world_from_voxel }
}

/// Grey values smoothed by 1, 2, 1 along each axis, so that noise does not lead the flood.
fn smoothed(mri: &VoxelVolume<f32>) -> Vec<f32> {
    let [nx, ny, _] = mri.dims;
    let mut values = mri.data.clone();
    for (step, count) in [(1, mri.dims[0]), (nx, mri.dims[1]), (nx * ny, mri.dims[2])] {
        let of = |at: usize| {
            let n = at / step % count;
            let before = if n > 0 { values[at - step] } else { values[at] };
            let after = if n + 1 < count { values[at + step] } else { values[at] };
            0.25 * (before + 2.0 * values[at] + after)
        };
        values = (0..values.len()).map(of).collect();
    }
    values
}
