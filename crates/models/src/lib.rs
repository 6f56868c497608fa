//! Models of a session: what they are made of, what they cost here, and how they err in a case.
//!
//! # Theory
//! A model is made of [ingredients](Ingredients): element, law, relaxation, friction. Its
//! [errors](measure::CaseErrors) are measured in the patient's case before the case is built, its
//! costs on [this machine](measure::machine); `trepan-budget` chooses by both.
//!
//! # Practice
//! A key of `--set` is a row of one table, [`KEYS`](ingredients::KEYS). [`solver::build`] makes the
//! tissue's solver, on processor or graphics card.
//!
//! # When not to use it
//! To step one solver: use `trepan-tled`. To choose by stored laws only: use `trepan-budget`.

mod error;
pub mod ingredients;
pub mod measure;
pub mod methods;
pub mod perfusion;
pub mod solver;

pub use error::ModelError;
pub use ingredients::{Effect, Element, Ingredients, Law, Relaxation, SolverDevice, Support};
pub use ingredients::{Variant, of_quality, realistic, variants};

/// The examples of the README compile.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
