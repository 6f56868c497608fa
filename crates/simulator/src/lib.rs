//! Runs a simulation session from its flags to its files: threads, clocks, phases, warnings,
//! scores, recording.
//!
//! # Theory
//! Three loops run in parallel and exchange their newest values without waiting: the haptic tick at
//! 1 kHz or more, the collision step and the solver step. A fourth thread renders. The body of each
//! loop is a stage without a clock, in `trepan-stages`.
//!
//! `run/threads.rs` runs the stages live; `run/lockstep` replays them from a recording, bit for
//! bit.
//!
//! # Practice
//! [`Session::open`] reports every user error before anything is written; [`Session::run`] runs the
//! session and writes its files.
//!
//! # When not to use it
//! To use a single method in your own program: use the method's crate.

mod batch;
mod choice;
mod command;
mod compare;
mod config;
mod constants;
mod desk;
mod device_limits;
mod device_test;
mod error;
mod hand;
mod inspect;
mod models;
mod operation;
mod options;
mod printable;
mod recordings;
mod report;
mod run;
mod session;
mod session_setup;
mod settings;
mod show;
mod training;
mod uncertainty;
mod whole;

pub use command::command;
pub use error::SessionError;
pub use options::Options;
pub use report::summary::Summary;
pub use run::Stages;
pub use session::Session;
pub use trepan_patient::{Inputs, TissueSource};
pub use trepan_stages::Program;
