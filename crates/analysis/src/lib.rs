//! Analysis of recorded sessions: Parquet tables, SQL over them, and studies with their statistics.
//!
//! # Practice
//! [`export`] writes the recordings of a folder as Parquet tables, a partition for each session.
//! [`query`] runs SQL over them on DataFusion. [`study`] plans a study from a protocol, checks its
//! runs and computes its results, with the methods of [`statistics`].
//!
//! # When not to use it
//! A session's own page and scores are in `trepan-report`; arrays of one recording in Python are
//! in the package `trepan`.

pub mod export;
mod facts;
pub mod files;
pub mod query;
pub mod statistics;
pub mod study;
pub mod tables;
