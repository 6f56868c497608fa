//! Synthetic head with its ground truth.

use super::base::BaseHead;
use super::lesion::Tumour;
use super::recipe::HeadRecipe;
use super::scan::{Patient, ct_grid, mri_grid};
use super::warp::Warp;
use trepan_volume::VoxelVolume;

/// Head made from a real one, with its ground truth.
pub struct Head {
    /// CT image, HU.
    pub ct: VoxelVolume<i16>,
    /// T1-weighted MRI image, in the CT's space.
    pub mri: VoxelVolume<f32>,
    /// True brain mask on the MRI's grid, 0 or 1.
    pub brain: VoxelVolume<u8>,
    /// True FreeSurfer labels on the MRI's grid; 0 outside the brain.
    pub labels: VoxelVolume<u16>,
    /// Tumour mask on the MRI's grid, 0 or 1, if there is a tumour.
    pub tumour: Option<VoxelVolume<u8>>,
    /// Recipe of the head.
    pub recipe: HeadRecipe,
    /// Share of the recipe's displacements that was kept to prevent folding, 0 to 1.
    pub share: f64,
}

impl Head {
    /// Makes a head; the same recipe and base give identical bits.
    pub fn make(recipe: &HeadRecipe, base: &BaseHead) -> Self {
        let warp = Warp::new(recipe, base);
        let tumour = recipe.tumour.map(|tumour| Tumour::placed(&tumour, recipe.seed, &warp, base));
        let patient = Patient { recipe, base, warp: &warp, tumour };
        let of_mri = mri_grid(recipe, &warp, base);
        let brain = patient.brain(&of_mri);
        Self {
            ct: patient.ct(&ct_grid(recipe, &warp, base)),
            mri: patient.mri(&of_mri),
            labels: patient.labels(&brain),
            tumour: patient.tumour_labels(&brain),
            brain,
            recipe: recipe.clone(),
            share: warp.share,
        }
    }
}
