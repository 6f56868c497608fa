//! The smoothed distance to the boundary of one label, as a function of world position.
//!
//! # Theory
//! The exact distance to the label's surface ([`DistanceField`]), positive inside; a Gaussian of
//! width σ then removes detail that a lattice of spacing a ≫ σ would alias, and the steps of the
//! voxels, which no scanned surface has: σ is at least 0.75 voxels. On a sheared grid the zero set
//! remains correct, the gradient does not; only the zero set is used here.
//!
//! # Practice
//! Only the padded box of the label is stored: labels at the grid's border are closed there. 4
//! bytes a voxel.

use super::blur::blur;
use glam::{DAffine3, DVec3};
use trepan_volume::{DistanceField, VoxelVolume};

/// Least width of the Gaussian, voxels.
const STEPS: f64 = 0.75;

/// The box of a label in its volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Block {
    /// First voxel and last.
    pub(super) low: [usize; 3],
    pub(super) high: [usize; 3],
    /// Number of voxels with the label.
    pub(super) voxels: usize,
}

impl Block {
    /// The blocks of all labels but 0, ascending by label.
    pub(super) fn of_each(labels: &VoxelVolume<u16>) -> Vec<(u16, Self)> {
        let mut blocks = vec![None::<Self>; usize::from(u16::MAX) + 1];
        let [nx, ny, _] = labels.dims;
        for (at, &label) in labels.data.iter().enumerate().filter(|(_, label)| **label != 0) {
            let voxel = [at % nx, at / nx % ny, at / (nx * ny)];
            let this = Self { low: voxel, high: voxel, voxels: 1 };
            let block = &mut blocks[usize::from(label)];
            *block = Some(block.map_or(this, |block| block.with(&this)));
        }
        blocks.iter().enumerate().filter_map(|(label, block)| Some((label as u16, (*block)?))).collect()
    }

    /// The union of two blocks.
    pub(super) fn with(&self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|d| self.low[d].min(other.low[d])),
            high: std::array::from_fn(|d| self.high[d].max(other.high[d])),
            voxels: self.voxels + other.voxels,
        }
    }

    /// World box of the corners of its voxels.
    pub(super) fn world_box(&self, labels: &VoxelVolume<u16>) -> [DVec3; 2] {
        let corner = |n: usize| {
            let end = |d: usize| if n >> d & 1 == 0 { self.low[d] as f64 - 0.5 } else { self.high[d] as f64 + 0.5 };
            labels.world_from_voxel.transform_point3(DVec3::new(end(0), end(1), end(2)))
        };
        let all = (0..8).map(corner);
        all.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[a, b], p| [a.min(p), b.max(p)])
    }
}

/// Approximate distance to a boundary, mm, positive inside.
#[derive(Clone)]
pub(super) struct Field {
    dims: [usize; 3],
    spacing_mm: DVec3,
    values: Vec<f32>,
    voxel_from_world: DAffine3,
}

impl Field {
    /// The distance to the boundary of the labels selected by `inside`, with a margin for smoothing
    /// up to `most_mm`.
    pub(super) fn of(labels: &VoxelVolume<u16>, block: &Block, most_mm: f64, inside: impl Fn(u16) -> bool) -> Self {
        let spacing_mm = labels.spacing_mm();
        let pad = (most_mm / spacing_mm).to_array().map(|sigma| 2 + (3.0 * sigma.max(STEPS)).ceil() as usize);
        let mask = padded(labels, block, pad, inside);
        let mut values = DistanceField::of_mask(&mask).into_values().data;
        values.iter_mut().for_each(|d| *d = -*d);
        Self { dims: mask.dims, spacing_mm, values, voxel_from_world: mask.world_from_voxel.inverse() }
    }

    /// Smooths with a Gaussian of `sigma_mm`, at least of [`STEPS`].
    pub(super) fn smooth(&mut self, sigma_mm: f64) {
        blur(&mut self.values, self.dims, (sigma_mm / self.spacing_mm).max(DVec3::splat(STEPS)).to_array());
    }

    /// Whether the padded box contains a point.
    pub(super) fn contains(&self, world: DVec3) -> bool {
        let at = self.voxel_from_world.transform_point3(world);
        let last = DVec3::from_array(self.dims.map(|n| (n - 1) as f64));
        at.cmpge(DVec3::ZERO).all() && at.cmple(last).all()
    }

    /// Samples trilinearly; constant beyond the border.
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

/// The mask of a block with `pad` empty voxels around it.
fn padded(labels: &VoxelVolume<u16>, block: &Block, pad: [usize; 3], inside: impl Fn(u16) -> bool) -> VoxelVolume<u8> {
    let size: [usize; 3] = std::array::from_fn(|d| block.high[d] - block.low[d] + 1);
    let dims = std::array::from_fn(|d| size[d] + 2 * pad[d]);
    let shift = DVec3::from_array(std::array::from_fn(|d| block.low[d] as f64 - pad[d] as f64));
    let mut mask = VoxelVolume::filled(dims, labels.world_from_voxel * DAffine3::from_translation(shift), 0);
    for k in 0..size[2] {
        for j in 0..size[1] {
            let from = labels.index([block.low[0], block.low[1] + j, block.low[2] + k]);
            let to = mask.index([pad[0], pad[1] + j, pad[2] + k]);
            let row = labels.data[from..from + size[0]].iter().map(|&label| u8::from(inside(label)));
            mask.data[to..to + size[0]].iter_mut().zip(row).for_each(|(voxel, value)| *voxel = value);
        }
    }
    mask
}
