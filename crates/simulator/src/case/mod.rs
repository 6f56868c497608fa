//! Builds and opens cases from a patient's files.

pub(crate) mod anatomy;
pub(crate) mod anchors;
pub(crate) mod cache;
pub(crate) mod choice;
mod fit;
pub(crate) mod folder;
pub(crate) mod identity;
pub(crate) mod import;
pub(crate) mod opening;
pub(crate) mod plan;
pub(crate) mod scene;
mod space;
mod stages;

use crate::case::opening::Opening;
use crate::mixture::Shares;
use crate::recipe::Recipe;
use crate::tissue_class::TissueSource;
use std::collections::BTreeMap;
use std::path::PathBuf;
use trepan_mesh::TetMesh;
use trepan_volume::VoxelVolume;

/// Input files of a case.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inputs {
    /// A name that may be shown; `None` for a user's own files.
    pub name: Option<&'static str>,
    /// CT, if any.
    pub ct: Option<PathBuf>,
    /// MRI, if any.
    pub mri: Option<PathBuf>,
    /// Label volume of the brain, if any: all nonzero voxels.
    pub labels: Option<PathBuf>,
    /// Label volumes of tissue classes inside the brain.
    pub tissues: Vec<TissueSource>,
}

/// Patient data of a session.
#[derive(Clone, Debug, Default)]
pub struct Case {
    /// Name, which does not contain a patient's.
    pub name: String,
    /// Hash of inputs and recipe, hexadecimal.
    pub hash: String,
    /// Hash of each of the patient's images, by `ct` and `mri`; empty in folders of older versions.
    pub images: BTreeMap<String, String>,
    /// Parameters that it was built with; `None` only for a case assembled in code.
    pub recipe: Option<Recipe>,
    /// Skull densities in HU on cubic voxels, largest piece only; `None` without a CT.
    pub skull: Option<VoxelVolume<i16>>,
    /// Threshold of bone, HU.
    pub isovalue_hu: i16,
    /// The brain; `None` without an MRI.
    pub brain: Option<Brain>,
    /// Planned opening of the skull; `None` without one.
    pub opening: Option<Opening>,
    /// Overlay of CT and MRI, as the bytes of a PNG file; `None` unless both are given.
    pub fit_png: Option<Vec<u8>>,
    /// Remarks of the import.
    pub notes: Vec<String>,
}

/// The brain of a case.
#[derive(Clone, Debug)]
pub struct Brain {
    /// Codes of [`TissueClass`](crate::TissueClass) on cubic voxels around the brain; 0 outside.
    pub classes: VoxelVolume<u8>,
    /// The MRI on the same grid.
    pub mri: VoxelVolume<f32>,
    /// Tetrahedra.
    pub mesh: TetMesh,
    /// Class code of each tetrahedron, or a larger code for a mixture.
    pub class_of_tet: Vec<u8>,
    /// Shares of the classes in each mixture.
    pub mixtures: Vec<Shares>,
}
