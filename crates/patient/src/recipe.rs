//! Parameters of a case: voxel size, mesh, isovalue, series, opening.

use serde::{Deserialize, Serialize};

/// Parameters of a case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Recipe {
    /// Edge of a skull voxel, mm.
    pub spacing_mm: f32,
    /// Tetrahedra of the brain.
    pub tets: usize,
    /// Halvings of the edge length around the opening.
    #[serde(default)]
    pub halvings: u32,
    /// Threshold of bone, HU; `None` for the histogram's.
    pub isovalue_hu: Option<i16>,
    /// Which series of the CT's folder, as [`trepan_volume::dicom::series`] lists them; `None` for
    /// the largest.
    pub ct_series: Option<usize>,
    /// Which series of the MRI's folder.
    pub mri_series: Option<usize>,
    /// Whether the MRI, and the labels with it, are registered to the CT.
    pub register: bool,
    /// Point outside the skull over the place to open, RAS mm; `None` for an automatic choice.
    pub opening: Option<[f32; 3]>,
}
