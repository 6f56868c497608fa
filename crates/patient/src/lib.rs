//! A patient's CT and MRI as a case to operate on: skull, brain mesh, planned opening, anchors.
//!
//! # Theory
//! [`Import::begin`](import::Import::begin) reads the images and knows their properties;
//! [`build`](import::Import::build) makes the case in voxels and tetrahedra that may be chosen in
//! between. [`Scene::new`](scene::Scene::new) prepares a case for contact, drilling and
//! deformation. All coordinates are patient RAS+ mm.
//!
//! # Practice
//! Images that contradict each other, or are no head, are refused with the remedy; what looks odd
//! but can be worked with is a remark. Cases are [cached](cache::Cache) by the content of their
//! files, and no name of a patient is kept.
//!
//! # When not to use it
//! To read one image: use `trepan-volume`. To mesh one mask: use `trepan-mesh`.

mod anatomy;
pub mod anchors;
pub mod cache;
pub mod cortex;
mod error;
pub mod fineness;
mod fit;
pub mod folder;
pub mod identity;
pub mod import;
pub mod mixture;
pub mod opening;
pub mod plan;
mod plan_comparison;
pub mod preview;
pub mod progress;
mod recipe;
pub mod remark;
pub mod scene;
mod space;
pub mod stages;
pub mod tissue_class;

pub use anatomy::scanned;
pub use cache::Cache;
pub use cortex::Cortex;
pub use error::PatientError;
pub use fineness::Fineness;
pub use import::open as open_case;
pub use mixture::body_of;
pub use plan::Plan;
pub use plan_comparison::PlanComparison;
pub use recipe::Recipe;
pub use scene::{RestBrain, Scene};
pub use tissue_class::{TissueClass, TissueSource};

use mixture::Shares;
use opening::Opening;
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
    /// A made tumour, if any.
    pub tumour: Option<MadeTumour>,
}

/// A ball of brain that is made a tumour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MadeTumour {
    /// Its centre, RAS mm; `None` for below the opening, where it comes to the surface.
    pub centre: Option<[f32; 3]>,
    /// Its radius, mm.
    pub radius_mm: f32,
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

impl Case {
    /// Properties that the choice of models depends on.
    pub fn facts(&self) -> import::Facts {
        import::Facts {
            ct_voxel_mm: self.skull.as_ref().map(|skull| skull.spacing_mm().element_sum() / 3.0),
            brain_mm3: self.brain.as_ref().map(|brain| import::volume_mm3(&brain.classes)),
        }
    }
}

/// The brain of a case.
#[derive(Clone, Debug)]
pub struct Brain {
    /// Codes of [`TissueClass`] on cubic voxels around the brain; 0 outside.
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

/// The examples of the README compile.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
