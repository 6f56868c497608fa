//! One head with its truth.

use super::base::BaseHead;
use super::lesion::Tumour;
use super::recipe::HeadRecipe;
use super::scan::{Patient, ct_grid, mri_grid};
use super::warp::Warp;
use trepan_volume::VoxelVolume;

/// A head made from a real one, with what is known of it.
pub struct Head {
    /// CT, HU.
    pub ct: VoxelVolume<i16>,
    /// T1-weighted MRI, in the CT's space.
    pub mri: VoxelVolume<f32>,
    /// The true brain on the MRI's grid, 0 or 1.
    pub brain: VoxelVolume<u8>,
    /// The tumour on the MRI's grid, 0 or 1, if there is one.
    pub tumour: Option<VoxelVolume<u8>>,
    /// What it was made by.
    pub recipe: HeadRecipe,
    /// Share of the recipe's displacements that was kept so that the map folds nowhere, 0 to 1.
    pub share: f64,
}

impl Head {
    /// Makes a head; the same recipe and base give the same bits.
    pub fn make(recipe: &HeadRecipe, base: &BaseHead) -> Self {
        let warp = Warp::new(recipe, base);
        let tumour = recipe.tumour.map(|tumour| Tumour::placed(&tumour, recipe.seed, &warp, base));
        let patient = Patient { recipe, base, warp: &warp, tumour };
        let of_mri = mri_grid(recipe, &warp, base);
        let brain = patient.brain(&of_mri);
        Self {
            ct: patient.ct(&ct_grid(recipe, &warp, base)),
            mri: patient.mri(&of_mri),
            tumour: patient.tumour_labels(&brain),
            brain,
            recipe: recipe.clone(),
            share: warp.share,
        }
    }
}
