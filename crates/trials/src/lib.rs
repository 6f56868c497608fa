//! How right is each method, and what does it cost: scenes with known truth, rows, gates, charts.
//!
//! # Theory
//! Methods never grade themselves. A suite puts every method of a family into the same scenes,
//! measures error against a closed form or an f64 oracle and cost in the same run, and charts one
//! against the other. A method that another beats in both is not worth its code.
//!
//! # Practice
//! `cargo xtask validate [SUITE[/PART]] [--quick] [--shard I/N] [--out DIR]`. A suite is a list of
//! parts that stand alone: a run that is stopped goes on where it was, and `cargo xtask merge` puts
//! shards together. It gives `SUITE.json` and a section of `index.html`; a broken promise makes the
//! command fail. Times are medians and quantiles of many calls; compare them only within one run,
//! or by `cargo xtask compare`, which knows how far two runs are apart.
//!
//! # When not to use it
//! In an app or a simulator: nothing there may depend on it.

pub mod borders;
pub mod compare;
mod conditions;
pub mod families;
pub mod front;
pub mod page;
pub mod part;
pub mod picture;
pub mod plot;
pub mod population;
mod python;
pub mod report;
pub mod store;
pub mod suite;
pub mod suites;
pub mod timer;
