//! The cortex as the MRI shows it, with its sulci: what is seen of a brain.
//!
//! # Theory
//! Tetrahedra of some millimetres fill the brain with its sulci closed: so does the mask. Within
//! it the cortex is where a T1 MRI falls below the middle between grey matter and CSF. A value in
//! mm, over zero inside, is the lesser of two: the signal over that level, by its slope across the
//! cortex's border, and the distance into the mask. It is smoothed over a voxel.
//!
//! # Practice
//! On the MRI's voxels, 0.7 s for the built-in head (`validate render/cortex`). Parts without a way
//! to the outside, as ventricles, are left out. An MRI in which the mask holds little over that
//! level, as a T2, gives the mask alone.
//!
//! # When not to use it
//! To compute with: sheets may touch. For that there are tetrahedra.

use rayon::prelude::*;
use trepan_geometry::Vec3;
use trepan_mesh::{TriMesh, surface_nets};
use trepan_volume::{DistanceField, VoxelVolume, grey_level};

/// A numerical parameter: share of the mask that must be tissue.
const TISSUE_SHARE: f32 = 0.6;
/// Width over which the signal rises from CSF to grey matter, mm, numerical: a voxel or two.
const RISE_MM: f32 = 2.0;
/// Cosine of the angle between normals up to which vertices are merged, numerical: 30 degrees.
const FLAT: f32 = 0.866;
/// Values beyond this are cut off, mm, numerical.
const REACH_MM: f32 = 1.5;

/// A surface to be seen, and how deep in a sulcus each of its vertices lies.
#[derive(Clone, Debug, Default)]
pub struct Cortex {
    /// Triangles, world mm, counterclockwise from outside.
    pub surface: TriMesh,
    /// Depth of each vertex below the brain with its sulci closed, mm.
    pub depth_mm: Vec<f32>,
}

impl Cortex {
    /// The cortex in an MRI, within a mask on its grid, whose distance field is given.
    pub fn of(mri: &VoxelVolume<f32>, mask: &VoxelVolume<u8>, field: &DistanceField) -> Self {
        let surface = surface_nets(&into_tissue(mri, mask, field), 0.0).largest_part();
        let surface = surface.clustered(2.0 * mri.spacing_mm().max_element() as f32, FLAT);
        let depth = |place: &Vec3| (-field.sample(*place)).max(0.0);
        let depth_mm = surface.positions.iter().map(depth).collect();
        Self { surface, depth_mm }
    }
}

/// How far each voxel is in tissue, mm.
fn into_tissue(mri: &VoxelVolume<f32>, mask: &VoxelVolume<u8>, field: &DistanceField) -> VoxelVolume<f32> {
    let to_mask = field.values();
    let level = grey_level(mri, mask).filter(|level| {
        let inside = || mri.data.iter().zip(&mask.data).filter(|(_, mask)| **mask != 0);
        let tissue = inside().filter(|(value, _)| *value >= level).count();
        tissue as f32 > TISSUE_SHARE * inside().count() as f32
    });
    // Signal of grey matter over that of CSF is some 0.62 of the level's.
    let of_signal = level.map(|level| move |value: f32| (value / level - 1.0) * RISE_MM);
    let value = |(value, mm): (&f32, &f32)| {
        let of_signal = of_signal.map_or(f32::INFINITY, |of| of(*value));
        of_signal.min(-mm).clamp(-REACH_MM, REACH_MM)
    };
    let data: Vec<f32> = mri.data.iter().zip(&to_mask.data).map(value).collect();
    VoxelVolume { dims: mri.dims, data: smoothed(data, mri.dims), world_from_voxel: mri.world_from_voxel }
}

/// Each value and its neighbours along each axis in turn, 1:2:1. Banks of a sulcus that are a voxel
/// apart else meet in a saw of single voxels.
fn smoothed(mut values: Vec<f32>, dims: [usize; 3]) -> Vec<f32> {
    let steps = [1, dims[0], dims[0] * dims[1]];
    for step in steps {
        let of = |at: usize| values.get(at).copied().unwrap_or(-REACH_MM);
        let mean = |at: usize| 0.25 * (of(at.wrapping_sub(step)) + of(at + step)) + 0.5 * of(at);
        values = (0..values.len()).into_par_iter().map(mean).collect();
    }
    values
}
