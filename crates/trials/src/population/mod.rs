//! A population of heads: real heads made different in size, shape, bone, scan and illness, with
//! the truth kept.
//!
//! # Theory
//! A head is a real one looked up through a map. A point of the new head goes back to the base by
//!
//! ```text
//! base = local(q + spline(q)),   q = A⁻¹ · point
//! ```
//!
//! A is affine (size, shear, turn, shift), the spline cubic with control points 30 mm apart, and
//! `local` moves along the gradients of three distance fields: away from the cavity (thickness of
//! the vault), into the brain (atrophy), around the ventricles. CT, MRI and masks go through one
//! map, so that the truth stays true. The scan comes after it: voxels, gantry tilt, noise, metal,
//! bias field.
//!
//! # Practice
//! [`base_heads`] reads the real heads, [`HeadRecipe::of_run`] draws recipes, [`Head::make`] makes
//! a head: the same recipe gives the same bits for any number of threads.
//!
//! # When not to use it
//! For anatomy that a map of a healthy head cannot give: fractures, missing bone, infants.

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
