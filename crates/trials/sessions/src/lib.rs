//! Suites for whole sessions: the operation, its ingredients, plans, populations of heads, and
//! published measurements of people.
//!
//! # Practice
//! A module is a suite: `parts` makes its rows, `judge` reads them. `trepan-trials` lists them all.
//!
//! # When not to use it
//! In an app or a simulator: nothing there may depend on this crate.

pub mod ablation;
pub mod budget;
pub mod calibration;
pub mod measurement;
pub mod operation;
pub mod population;
pub mod scripted;
pub mod simulators;
