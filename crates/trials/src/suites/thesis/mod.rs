//! Every numbered figure and table of the thesis's chapters 3 to 6, beside what this project
//! measures.
//!
//! # Practice
//! Parts make comparisons (printed, the thesis's method here, ours), lines over frames, pictures,
//! and pointers to the item in the sources that does what a box of a flow chart says. The judgement
//! makes the table from them and counts: a figure or table has a counterpart only if the run made a
//! finite value, a line, a picture, or found the item in the sources. Scenes, paths and models are
//! those of the suites `rigid`, `deformable` and `voxel-size`; rules of the verdicts are in
//! [`comparison`].
//!
//! # Sources
//! The thesis, chapters 3 to 6, its errata put right. Bunny, cow and armadillo are not to be had
//! without a folder of models (`TREPAN_DATA`): the built-in brain stands in.

mod comparison;
mod deformable;
mod grid;
mod items;
mod judgement;
mod pointers;
mod prototypes;
mod rigid;

pub use judgement::judge;

use super::{Part, Scope};

/// Lists the parts, in the order of the thesis.
pub fn parts(scope: Scope) -> Vec<Part> {
    let mut parts = rigid::parts();
    parts.extend(deformable::parts());
    parts.extend(grid::parts(scope));
    parts.extend(prototypes::parts());
    parts.extend(pointers::parts());
    parts
}
