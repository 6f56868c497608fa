//! The models of a session as `summary.json` and the report tell them.

use serde::Serialize;
use trepan_models::Ingredients;

/// The models in `summary.json`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ModelSummary {
    /// Source of the choice: a quality, or `replay`.
    pub quality: &'static str,
    /// Bone.
    pub bone: BoneSummary,
    /// Tissue.
    pub tissue: TissueSummary,
    /// Picture.
    pub picture: PictureSummary,
    /// What bone and tissue are made of, by the keys of `--set`.
    pub ingredients: Ingredients,
    /// CPU load that the plan expects, cores; `null` without a plan.
    pub planned_cores: Option<f64>,
}

/// Model and haptic method of bone.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BoneSummary {
    /// Name of the method.
    pub method: &'static str,
    /// Edge of a voxel, mm.
    pub spacing_mm: f64,
    /// Points on the burr; 0 for the method's default.
    pub points: usize,
    /// Reason for the choice.
    pub why: String,
}

/// Mesh and solver of tissue.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TissueSummary {
    /// Name of the solver.
    pub solver: &'static str,
    /// Requested number of tetrahedra.
    pub tets: usize,
    /// Halvings of the edge length around the opening.
    pub halvings: u32,
    /// Reason for the choice.
    pub why: String,
}

/// Rendering of pictures.
#[derive(Clone, Debug, Default, Serialize)]
pub struct PictureSummary {
    /// Whether rays are skipped where bone is smooth.
    pub sparse: bool,
    /// Resolution along an edge, as a share of the full picture's.
    pub detail: f64,
    /// Reason for the choice.
    pub why: String,
}
