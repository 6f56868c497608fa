//! What a session leaves: summary, scores, report page, drilled skull, markups; lessons and marks.
//!
//! # Theory
//! Results are told with the [band](uncertainty) that the spread of the physical
//! [constants] leaves them. The drilled skull is in the scanner's voxels ([`drilled`]).
//!
//! # Practice
//! [`output::write`] writes the files of a session, each whole or not at all;
//! [`debrief::Debrief`] sets it against its lesson and against earlier sessions.
//!
//! # When not to use it
//! To read a recording's ticks: use `trepan-link`.

pub mod chart;
pub mod constants;
pub mod csv;
pub mod debrief;
pub mod device_test;
pub mod drilled;
mod error;
pub mod film;
pub mod kept;
pub mod models;
pub mod output;
pub mod page;
pub mod printable;
pub mod regions;
pub mod slicer;
pub mod summary;
pub mod tool_use;
pub mod training;
pub mod uncertainty;
pub mod whole;

pub use error::ReportError;

/// The examples of the README compile.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
