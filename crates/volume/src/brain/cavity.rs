//! The inside of the skull in a CT.
//!
//! # Theory
//! The skull has holes, up to the 3 cm of the foramen magnum, so no flood stops at bone alone. Instead, with d the distance to
//! bone, the space around it is divided at its necks by a watershed of -d (Vincent and Soille 1991) from two markers:
//!
//! ```text
//! inside   the largest piece with d > 12 mm that sees bone in at least 4 of the 6 grid directions
//! outside  what sees bone in at most 2 of them: air, face, neck
//! ```
//!
//! What hangs on the cavity by less than a ball of 11 mm (the spinal canal, the optic canals) is cut off in the end.
//!
//! # Sources
//! L. Vincent, P. Soille, "Watersheds in digital spaces", IEEE PAMI 13, 1991.

use super::morphology::{core, within};
use crate::component::Components;
use crate::{AIR_HU, DistanceField, Grid, Interpolation, VoxelVolume, resample};

/// Depth that a ball must have to mark the inside, mm.
const DEEP_MM: f32 = 12.0;

/// Ball that must fit into the cavity, mm: wider than the spinal canal.
const BALL_MM: f32 = 11.0;

/// Levels of the flood per millimetre.
const LEVELS_PER_MM: f32 = 4.0;

/// Levels of the flood: distances over 64 mm count as 64.
const LEVELS: usize = 256;

/// The space inside the skull on a RAS grid of cubes; `None` where nothing is enclosed.
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
    flood(bone.dims, &depth.data, &mut labels);
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

const UNKNOWN: u8 = 0;
const INSIDE: u8 = 1;
const OUTSIDE: u8 = 2;

/// In how many of the 6 grid directions each voxel sees bone.
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

/// Spreads the labels into what is unknown, deepest places first.
fn flood([nx, ny, nz]: [usize; 3], depth: &[f32], labels: &mut [u8]) {
    let level_of = |at: usize| ((depth[at] * LEVELS_PER_MM) as usize).min(LEVELS - 1);
    let mut levels: Vec<Vec<usize>> = vec![Vec::new(); LEVELS];
    let neighbours = |at: usize| {
        let (i, j, k) = (at % nx, at / nx % ny, at / (nx * ny));
        let sides = [
            (i > 0, at.wrapping_sub(1)),
            (i + 1 < nx, at + 1),
            (j > 0, at.wrapping_sub(nx)),
            (j + 1 < ny, at + nx),
            (k > 0, at.wrapping_sub(nx * ny)),
            (k + 1 < nz, at + nx * ny),
        ];
        sides.into_iter().filter(|s| s.0).map(|s| s.1)
    };
    for at in 0..labels.len() {
        if labels[at] != UNKNOWN && depth[at] > 0.0 && neighbours(at).any(|n| labels[n] == UNKNOWN) {
            levels[level_of(at)].push(at);
        }
    }
    for level in (0..LEVELS).rev() {
        while let Some(at) = levels[level].pop() {
            for n in neighbours(at) {
                if labels[n] == UNKNOWN && depth[n] > 0.0 {
                    labels[n] = labels[at];
                    levels[level_of(n).min(level)].push(n);
                }
            }
        }
    }
}
