//! Validation suites: accuracy and cost of every method in scenes with ground truth, with gates and
//! charts.
//!
//! # Theory
//! Accuracy is never computed by the method under test. A suite puts every method of a family into
//! the same scenes, measures error against a closed form or an f64 oracle and cost in the same run,
//! and charts one against the other. A method that another beats in both is not worth keeping.
//!
//! # Practice
//! The suites stand in three crates beside this one, by what they measure: bone, tissue, sessions.
//! Here are their list, the failures of every method and the thesis's figures.
//!
//! `cargo xtask validate [SUITE[/PART]] [--quick] [--shard I/N] [--out DIR]`. A suite is a list of
//! independent parts: a stopped run resumes, and `cargo xtask merge` combines shards. The output is
//! `SUITE.json` and a section of `index.html`; the command fails if an acceptance limit is broken.
//! Times are medians and quantiles of many calls. Compare them only within one run, or with
//! `cargo xtask compare`, which estimates the noise between two runs.
//!
//! # When not to use it
//! In an app or a simulator: nothing there may depend on this crate.

pub mod suites;
