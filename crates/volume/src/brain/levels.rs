//! Grey-value range of brain in a T1 MRI.
//!
//! # Theory
//! Deep in the head there is white matter, grey matter and little CSF. With m the median and w the
//! 90th percentile of the signal there, brain is from 0.62 m (halfway between CSF and grey matter)
//! to 1.3 w (under fat and contrast agent). The head is everything over half of Otsu's threshold
//! (1979), closed and filled.

use super::morphology::{SPARE_MM, closed, filled};
use crate::{DistanceField, VoxelVolume, largest_component};

/// Depth under the skin from which there is only brain and CSF, mm.
const CORE_MM: f32 = 35.0;

/// Depth inside a mask of brain or of the skull's inside from which there is brain, mm.
const DEEP_MM: f32 = 10.0;

/// Grey-value range of brain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Levels {
    pub least: f32,
    pub greatest: f32,
}

impl Levels {
    /// Computes it from the voxels for which `deep` holds; `None` if they are too few or uniform.
    pub fn of(mri: &VoxelVolume<f32>, deep: impl Fn(usize) -> bool) -> Option<Self> {
        let mut values: Vec<f32> = (0..mri.data.len()).filter(|&at| deep(at)).map(|at| mri.data[at]).collect();
        values.sort_unstable_by(f32::total_cmp);
        let floor = 0.1 * *values.get(values.len() * 99 / 100)?;
        let signal = &values[values.partition_point(|&v| v <= floor)..];
        if signal.len() < 1000 {
            return None;
        }
        let at = |share: f64| signal[(share * (signal.len() - 1) as f64) as usize];
        Some(Self { least: 0.62 * at(0.5), greatest: 1.3 * at(0.9) })
    }

    /// Computes it from the voxels over 10 mm inside a mask on the MRI's grid.
    pub fn within(mri: &VoxelVolume<f32>, mask: &VoxelVolume<u8>) -> Option<Self> {
        let to_wall = DistanceField::of_mask_within(mask, DEEP_MM + SPARE_MM);
        Self::of(mri, |at| to_wall.values().data[at] < -DEEP_MM)
    }

    pub fn hold(self, value: f32) -> bool {
        (self.least..=self.greatest).contains(&value)
    }
}

/// Signal halfway between CSF and grey matter in a T1 MRI, by what lies deep in the brain.
///
/// The mask of the brain is on its grid. `None` if too little lies deep or all is one value.
pub fn grey_level(mri: &VoxelVolume<f32>, mask: &VoxelVolume<u8>) -> Option<f32> {
    Levels::within(mri, mask).map(|levels| levels.least)
}

/// Depth of each voxel under the skin, mm, exact up to the core; negative outside the head.
pub(super) fn depth_in_head(mri: &VoxelVolume<f32>) -> VoxelVolume<f32> {
    let mut values: Vec<f32> = mri.data.iter().copied().filter(|&v| v > 0.0).collect();
    values.sort_unstable_by(f32::total_cmp);
    let level = 0.5 * otsu(&values);
    let head = filled(&closed(&largest_component(&mri.map(|v| u8::from(v > level))), 6.0));
    DistanceField::of_mask_within(&head, CORE_MM + SPARE_MM).values().map(|d| -d)
}

/// Whether a depth belongs to the middle of the head.
pub(super) fn is_core(depth_mm: f32) -> bool {
    depth_mm > CORE_MM
}

/// Otsu's threshold of sorted values, on 512 bins.
fn otsu(sorted: &[f32]) -> f32 {
    let (Some(&low), Some(&high)) = (sorted.first(), sorted.last()) else { return 0.0 };
    let total: f64 = sorted.iter().map(|&v| f64::from(v)).sum();
    let (mut below, mut sum, mut best) = (0, 0.0, (0.0, low));
    for bin in 1..512 {
        let edge = low + (high - low) * bin as f32 / 512.0;
        let until = sorted.partition_point(|&v| v <= edge);
        sum += sorted[below..until].iter().map(|&v| f64::from(v)).sum::<f64>();
        below = until;
        let above = sorted.len() - below;
        if below > 0 && above > 0 {
            let apart = sum / below as f64 - (total - sum) / above as f64;
            let between = below as f64 * above as f64 * apart * apart;
            if between > best.0 {
                best = (between, edge);
            }
        }
    }
    best.1
}
