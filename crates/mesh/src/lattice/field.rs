//! The signed distance of a mask, smoothed: where the lattice finds inside, outside and the surface between.
//!
//! # Theory
//! The exact distance to the mask's surface ([`DistanceField`]); a Gaussian of width σ then takes out what a lattice of spacing a ≫ σ could only alias.
//! On a sheared grid the zero set stays right, the slope does not, and only the zero set matters here.
//!
//! # Practice
//! Only the box of the largest 6-connected part, padded, is kept: what touches the grid's border is closed there. 4 bytes a voxel.

use super::blur::blur;
use crate::MeshError;
use glam::{DAffine3, DVec3};
use trepan_volume::{DistanceField, VoxelVolume, largest_component};

/// A smooth function of world space: about millimetres to the surface, negative inside.
pub(super) struct Field {
    dims: [usize; 3],
    values: Vec<f32>,
    voxel_from_world: DAffine3,
    /// World box of the mask's voxels.
    pub(super) min: DVec3,
    pub(super) max: DVec3,
    /// Volume of the mask, mm³.
    pub(super) mask_mm3: f64,
}

impl Field {
    /// The field of the largest part of a mask. `smoothing_mm` gets σ from the volume of that part, mm³.
    pub(super) fn of_mask(mask: &VoxelVolume<u8>, smoothing_mm: impl FnOnce(f64) -> f64) -> Result<Self, MeshError> {
        check_volume(mask)?;
        let part = largest_component(mask);
        let (low, high) = voxel_box(&part).ok_or(MeshError::EmptyMask)?;
        let mask_mm3 = part.data.iter().filter(|v| **v != 0).count() as f64 * mask.voxel_mm3();
        let sigma = (smoothing_mm(mask_mm3) / mask.spacing_mm()).to_array();
        let pad = sigma.map(|s| 2 + (3.0 * s).ceil() as usize);
        let padded = padded(&part, low, high, pad);
        let mut values = DistanceField::of_mask(&padded).values().data.clone();
        blur(&mut values, padded.dims, sigma);
        let (min, max) = world_box(mask, low, high);
        let voxel_from_world = padded.world_from_voxel.inverse();
        Ok(Self { dims: padded.dims, values, voxel_from_world, min, max, mask_mm3 })
    }

    /// Trilinear; constant beyond the border.
    pub(super) fn sample(&self, world: DVec3) -> f64 {
        let last = DVec3::from_array(self.dims.map(|n| (n - 1) as f64));
        let at = self.voxel_from_world.transform_point3(world).clamp(DVec3::ZERO, last);
        let cell = at.floor().min(last - 1.0);
        let t = at - cell;
        let [nx, ny, _] = self.dims;
        let base = cell.x as usize + nx * (cell.y as usize + ny * cell.z as usize);
        let along_x = |at: usize| {
            let (a, b) = (f64::from(self.values[at]), f64::from(self.values[at + 1]));
            a + (b - a) * t.x
        };
        let along_y = |at: usize| {
            let (a, b) = (along_x(at), along_x(at + nx));
            a + (b - a) * t.y
        };
        let (a, b) = (along_y(base), along_y(base + nx * ny));
        a + (b - a) * t.z
    }
}

fn check_volume(mask: &VoxelVolume<u8>) -> Result<(), MeshError> {
    let wanted = mask.dims.iter().try_fold(1usize, |n, &d| n.checked_mul(d));
    if wanted != Some(mask.data.len()) {
        let got = format!("{:?} with {} samples", mask.dims, mask.data.len());
        return Err(MeshError::Mask { field: "dims", got, wanted: "as many samples as the product of the dimensions" });
    }
    let determinant = mask.world_from_voxel.matrix3.determinant();
    if !mask.world_from_voxel.is_finite() || !determinant.is_finite() || determinant.abs() < 1e-12 {
        let got = format!("{:?}", mask.world_from_voxel);
        return Err(MeshError::Mask { field: "world_from_voxel", got, wanted: "finite and invertible" });
    }
    Ok(())
}

/// Lowest and highest voxel that is not 0.
fn voxel_box(mask: &VoxelVolume<u8>) -> Option<([usize; 3], [usize; 3])> {
    let [nx, ny, _] = mask.dims;
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for (at, _) in mask.data.iter().enumerate().filter(|(_, v)| **v != 0) {
        let voxel = [at % nx, at / nx % ny, at / (nx * ny)];
        for d in 0..3 {
            (low[d], high[d]) = (low[d].min(voxel[d]), high[d].max(voxel[d]));
        }
    }
    (low[0] <= high[0]).then_some((low, high))
}

/// The box of a mask and `pad` empty voxels around.
fn padded(mask: &VoxelVolume<u8>, low: [usize; 3], high: [usize; 3], pad: [usize; 3]) -> VoxelVolume<u8> {
    let size: [usize; 3] = std::array::from_fn(|d| high[d] - low[d] + 1);
    let dims = std::array::from_fn(|d| size[d] + 2 * pad[d]);
    let shift = DVec3::from_array(std::array::from_fn(|d| low[d] as f64 - pad[d] as f64));
    let mut box_of_part = VoxelVolume::filled(dims, mask.world_from_voxel * DAffine3::from_translation(shift), 0);
    for k in 0..size[2] {
        for j in 0..size[1] {
            let from = mask.index([low[0], low[1] + j, low[2] + k]);
            let to = box_of_part.index([pad[0], pad[1] + j, pad[2] + k]);
            box_of_part.data[to..to + size[0]].copy_from_slice(&mask.data[from..from + size[0]]);
        }
    }
    box_of_part
}

/// World box of the corners of a box of voxels.
fn world_box(mask: &VoxelVolume<u8>, low: [usize; 3], high: [usize; 3]) -> (DVec3, DVec3) {
    let corner = |n: usize| {
        let end = |d: usize| if n >> d & 1 == 0 { low[d] as f64 - 0.5 } else { high[d] as f64 + 0.5 };
        mask.world_from_voxel.transform_point3(DVec3::new(end(0), end(1), end(2)))
    };
    (0..8).map(corner).fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)))
}
