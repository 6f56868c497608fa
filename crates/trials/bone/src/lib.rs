//! Suites for bone: contact and drilling, force models, devices in hands, cell sizes, constants.
//!
//! # Practice
//! A module is a suite: `parts` makes its rows, `judge` reads them. `trepan-trials` lists them all.
//!
//! # When not to use it
//! In an app or a simulator: nothing there may depend on this crate.

pub mod force;
pub mod haptics;
pub mod rigid;
pub mod sensitivity;
pub mod voxel_size;
