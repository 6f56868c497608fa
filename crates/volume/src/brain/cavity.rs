//! Segments the inside of the skull in a CT.
//!
//! # Theory
//! The skull has holes, up to the 3 cm of the foramen magnum, so that a flood fill bounded by bone
//! leaks. Instead, with d the distance to bone, the space around it is divided at its necks by a
//! watershed of -d (Vincent and Soille 1991) from two markers:
//!
//! ```text
//! inside   the largest piece with d > 12 mm that sees bone in at least 4 of the 6 grid directions
//! outside  voxels that see bone in at most 2 of them: air, face, neck
//! ```
//!
//! Finally, parts connected to the cavity by less than a ball of 11 mm (the spinal canal, the optic
//! canals) are cut off.
//!
//! # Sources
//! L. Vincent, P. Soille, "Watersheds in digital spaces", IEEE PAMI 13, 1991.

use super::flood::{INSIDE, OUTSIDE, UNKNOWN, flood};
use super::morphology::{core, within};
use crate::component::Components;
use crate::{AIR_HU, DistanceField, Grid, Interpolation, VoxelVolume, resample};

/// Distance to bone that marks the inside, mm.
const DEEP_MM: f32 = 12.0;

/// Radius of the ball that must fit into the cavity, mm: wider than the spinal canal.
const BALL_MM: f32 = 11.0;

/// Larger distances are clamped to this in the flood, mm.
const DEEPEST_MM: f32 = 64.0;

/// The space inside the skull on a RAS grid of cubes; `None` if nothing is enclosed.
pub(super) fn cavity(ct: &VoxelVolume<i16>, isovalue: i16, grid: &Grid) -> Option<VoxelVolume<u8>> {
    let hu = resample(ct, grid, Interpolation::Trilinear, AIR_HU);
    let bone = hu.map(|v| u8::from(v >= isovalue));
    let to_bone = DistanceField::of_mask(&bone);
    let depth = to_bone.values();
    let walls = walls(&bone);
    let deep = Components::of(bone.dims, |at| depth.data[at] > DEEP_MM && walls[at] >= 4);
    let inside = deep.largest()?;
    let mut labels = vec![UNKNOWN; bone.data.len()];
    deep.each_run(inside, |run| labels[run].fill(INSIDE));
    for (at, label) in labels.iter_mut().enumerate() {
        if *label == UNKNOWN && walls[at] <= 2 {
            *label = OUTSIDE;
        }
    }
    flood(bone.dims, &depth.data, DEEPEST_MM, &mut labels);
    let air = i16::midpoint(AIR_HU, 0);
    let held = |at: usize| labels[at] == INSIDE && depth.data[at] > 0.0 && hu.data[at] > air;
    let space = VoxelVolume {
        data: (0..labels.len()).map(|at| u8::from(held(at))).collect(),
        ..VoxelVolume::filled([0; 3], grid.world_from_voxel, 0)
    };
    let space = VoxelVolume { dims: grid.dims, ..space };
    let core = core(&space, BALL_MM)?;
    Some(within(&core, BALL_MM + 4.0, |at| space.data[at] != 0))
}

/// Number of the 6 grid directions in which each voxel sees bone.
fn walls(bone: &VoxelVolume<u8>) -> Vec<u8> {
    let [nx, ny, nz] = bone.dims;
    let mut seen = vec![0; bone.data.len()];
    let mut sweep = |start: usize, step: usize, length: usize| {
        for backwards in [false, true] {
            let mut hit = 0;
            for n in 0..length {
                let at = start + step * if backwards { length - 1 - n } else { n };
                hit |= bone.data[at];
                seen[at] += hit;
            }
        }
    };
    (0..ny * nz).for_each(|row| sweep(row * nx, 1, nx));
    (0..nx * nz).for_each(|c| sweep(c / nx * nx * ny + c % nx, nx, ny));
    (0..nx * ny).for_each(|c| sweep(c, nx * ny, nz));
    seen
}
