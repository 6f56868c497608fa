//! The brain in a T1 MRI, by threshold, morphology and the largest piece; inside the skull where a CT is given.

use crate::component::Components;
use crate::{
    DistanceField, Grid, Interpolation, OverlapError, VoxelVolume, bone_isovalue, largest_component, overlap, resample,
};

/// How the brain is found.
#[derive(Clone, Debug, PartialEq)]
pub struct BrainConfig {
    /// Bone threshold in the CT, HU; `None` guesses it from the histogram.
    pub isovalue: Option<i16>,
    /// Edge of the voxels that the search runs on, mm: smaller is slower and follows the surface closer.
    pub work_mm: f32,
    /// Radius of the ball that must fit into brain, mm: parts that hang on something thinner are cut off.
    pub opening_mm: f32,
    /// Radius of the ball that closes gaps, mm: sulci narrower than twice this are filled.
    pub closing_mm: f32,
    /// Least volume that passes for an adult brain, ml.
    pub least_ml: f64,
    /// Greatest volume that passes for an adult brain, ml.
    pub greatest_ml: f64,
}

impl Default for BrainConfig {
    fn default() -> Self {
        Self { isovalue: None, work_mm: 1.5, opening_mm: 3.0, closing_mm: 4.0, least_ml: 900.0, greatest_ml: 1900.0 }
    }
}

/// Why there is no brain mask.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MaskError {
    /// Nothing was found.
    #[error("no brain was found: {0}; is this a T1 MRI of a head? Give a label volume instead")]
    Empty(&'static str),
    /// An implausible volume.
    #[error(
        "the brain mask holds {found_ml:.0} ml, an adult brain {least_ml:.0} to {greatest_ml:.0} ml; give a label volume instead"
    )]
    Volume {
        /// Volume of the mask, ml.
        found_ml: f64,
        /// Least that passes, ml.
        least_ml: f64,
        /// Most that passes, ml.
        greatest_ml: f64,
    },
    /// Several pieces.
    #[error("the brain mask is in {pieces} pieces, the second of {second_ml:.1} ml; keep the largest one")]
    Pieces {
        /// How many.
        pieces: usize,
        /// Volume of the second largest, ml.
        second_ml: f64,
    },
    /// Voxels without a number.
    #[error("{count} voxels of the MRI hold no number (NaN or infinite); write them as 0 or give another file")]
    NotANumber {
        /// How many.
        count: usize,
    },
    /// CT and MRI lie apart.
    #[error(transparent)]
    Apart(#[from] OverlapError),
}

/// Finds the brain in a T1 MRI: 1 in the brain, 0 elsewhere, on the MRI's grid. `skull` is a CT in HU on any grid.
pub fn brain_mask(
    mri: &VoxelVolume<f32>,
    skull: Option<&VoxelVolume<i16>>,
    config: &BrainConfig,
) -> Result<VoxelVolume<u8>, MaskError> {
    let count = mri.data.iter().filter(|v| !v.is_finite()).count();
    if count > 0 {
        return Err(MaskError::NotANumber { count });
    }
    let grid = Grid::isotropic_over(mri, config.work_mm);
    let coarse = resample(mri, &grid, Interpolation::Trilinear, 0.0);
    let candidate = match skull {
        Some(ct) => {
            overlap(ct, mri)?;
            inside_skull(ct, &grid, config)?
        }
        None => VoxelVolume::filled(grid.dims, grid.world_from_voxel, 1u8),
    };
    let tissue = VoxelVolume { data: coarse.data.iter().zip(&candidate.data).map(|(_, &c)| c).collect(), ..candidate };
    let opened = opened(&tissue, config.opening_mm);
    let mask = resample(&opened, &Grid::of(mri), Interpolation::Nearest, 0);
    check_brain_mask(&mask, config)?;
    Ok(mask)
}

fn inside_skull(ct: &VoxelVolume<i16>, grid: &Grid, config: &BrainConfig) -> Result<VoxelVolume<u8>, MaskError> {
    let isovalue = config.isovalue.unwrap_or_else(|| bone_isovalue(ct));
    let hu = resample(ct, grid, Interpolation::Trilinear, crate::AIR_HU);
    Ok(largest_component(&hu.map(|v| u8::from(v < isovalue && v > -200))))
}

fn opened(mask: &VoxelVolume<u8>, radius_mm: f32) -> VoxelVolume<u8> {
    let field = DistanceField::of_mask(mask);
    let core = largest_component(&field.values().map(|d| u8::from(d < -radius_mm)));
    let field = DistanceField::of_mask(&core);
    field.values().map(|d| u8::from(d < radius_mm))
}

/// Checks a brain mask: not empty, one piece, an adult's volume.
pub fn check_brain_mask(mask: &VoxelVolume<u8>, config: &BrainConfig) -> Result<(), MaskError> {
    let pieces = Components::of(mask.dims, |at| mask.data[at] != 0);
    let Some(largest) = pieces.largest() else { return Err(MaskError::Empty("the mask is empty")) };
    let ml = |voxels: usize| voxels as f64 * mask.voxel_mm3() * 1e-3;
    let found_ml = ml(pieces.size(largest));
    if !(config.least_ml..=config.greatest_ml).contains(&found_ml) {
        return Err(MaskError::Volume { found_ml, least_ml: config.least_ml, greatest_ml: config.greatest_ml });
    }
    Ok(())
}
