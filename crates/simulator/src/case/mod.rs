//! From a patient's files to the operating table.

pub(crate) mod anatomy;
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
pub(crate) mod tissue;

use crate::case::opening::Opening;
use crate::case::tissue::TissueSource;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use trepan_mesh::TetMesh;
use trepan_volume::VoxelVolume;

/// The files of a case.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inputs {
    /// A name that may be shown; `None` for a user's own files.
    pub name: Option<&'static str>,
    /// CT, where there is one.
    pub ct: Option<PathBuf>,
    /// MRI, where there is one.
    pub mri: Option<PathBuf>,
    /// Labels, where there are some: what is not 0 is brain.
    pub labels: Option<PathBuf>,
    /// What in the brain is of another kind.
    pub tissues: Vec<TissueSource>,
}

/// The numbers that a case depends on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recipe {
    /// Edge of a skull voxel, mm.
    pub spacing_mm: f32,
    /// Tetrahedra of the brain.
    pub tets: usize,
    /// How often their edges are halved around the opening.
    #[serde(default)]
    pub halvings: u32,
    /// Threshold of bone, HU; `None` for the histogram's.
    pub isovalue_hu: Option<i16>,
    /// Which series of the CT's folder, as [`trepan_volume::dicom::series`] lists them; `None` for
    /// the largest.
    pub ct_series: Option<usize>,
    /// Which series of the MRI's folder.
    pub mri_series: Option<usize>,
    /// Whether the MRI, and labels with it, are moved to where they fit the CT.
    pub register: bool,
    /// A point outside the skull over the place to open, RAS mm; `None` for one that is found.
    pub opening: Option<[f32; 3]>,
}

/// What a session needs of the patient.
#[derive(Clone, Debug, Default)]
pub struct Case {
    /// A name without a patient in it.
    pub name: String,
    /// Hash of inputs and recipe, hexadecimal.
    pub hash: String,
    /// Hash of each of the patient's images, by `ct` and `mri`; empty in folders of older versions.
    pub images: BTreeMap<String, String>,
    /// The numbers that it was made by; `None` only for a case that was put together by hand.
    pub recipe: Option<Recipe>,
    /// Skull densities in HU on a grid of cubes, largest piece only; `None` without a CT.
    pub skull: Option<VoxelVolume<i16>>,
    /// Threshold of bone, HU.
    pub isovalue_hu: i16,
    /// The brain; `None` without an MRI.
    pub brain: Option<Brain>,
    /// Where the skull is to be opened; `None` without one.
    pub opening: Option<Opening>,
    /// How CT and MRI fit, as a PNG file's bytes; `None` without both.
    pub fit_png: Option<Vec<u8>>,
    /// Remarks of the import.
    pub notes: Vec<String>,
    /// Whether it came from the cache.
    pub cached: bool,
}

/// The brain of a case.
#[derive(Clone, Debug)]
pub struct Brain {
    /// 0 outside, a [`TissueClass`](tissue::TissueClass)'s code inside, on a grid of cubes around
    /// the brain.
    pub classes: VoxelVolume<u8>,
    /// The MRI on the same grid.
    pub mri: VoxelVolume<f32>,
    /// Tetrahedra.
    pub mesh: TetMesh,
    /// Class code of each tetrahedron.
    pub class_of_tet: Vec<u8>,
}
