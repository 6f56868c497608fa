//! Suites for images, meshes, contact with tissue, its solvers and pictures, on processor and card.
//!
//! # Practice
//! A module is a suite: `parts` makes its rows, `judge` reads them. `trepan-trials` lists them all.
//!
//! # When not to use it
//! In an app or a simulator: nothing there may depend on this crate.

pub mod card;
pub mod deformable;
pub mod mesh;
pub mod render;
pub mod rivals;
pub mod tled;
pub mod volume;
