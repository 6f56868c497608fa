//! Population of synthetic heads with ground truth, varied in size, shape, bone, scan and
//! pathology.
//!
//! # Theory
//! A head is a real head sampled through a map. A point of the new head is mapped to the base by
//!
//! ```text
//! base = local(q + spline(q)),   q = A⁻¹ · point
//! ```
//!
//! A is affine (size, shear, rotation, translation), the spline cubic with control points 30 mm
//! apart, and `local` moves along the gradients of three distance fields: away from the cavity
//! (thickness of the vault), into the brain (atrophy), around the ventricles. CT, MRI and masks go
//! through one map, so that the ground truth remains exact. The scan is simulated afterwards:
//! voxels, gantry tilt, noise, metal, bias field.
//!
//! # Practice
//! [`base_heads`] reads the real heads, [`HeadRecipe::of_run`] draws recipes, [`Head::make`] makes
//! a head: the same recipe gives identical bits for any number of threads.
//!
//! # When not to use it
//! For anatomy that no map of a healthy head yields: fractures, missing bone, infants.

mod base;
mod files;
mod head;
mod lesion;
mod local;
mod metal;
mod recipe;
mod scan;
mod spline;
#[cfg(test)]
mod tests;
mod warp;

pub use base::{BaseHead, base_heads};
pub use files::Files;
pub use head::Head;
pub use recipe::{HeadRecipe, Spacing, TumourRecipe};
