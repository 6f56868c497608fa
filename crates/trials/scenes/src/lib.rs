//! What several suites share: the built-in case, synthetic heads, conditions that break methods,
//! claims of papers, Python packages of others.
//!
//! # When not to use it
//! In an app or a simulator: nothing there may depend on this crate.

pub mod case;
pub mod claims;
pub mod conditions;
pub mod population;
pub mod python;
