//! Runs a simulation session from its flags to its files, with its pictures, start page and command
//! line.
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
mod desk;
mod device_limits;
mod error;
mod hand;
mod inspect;
mod models;
mod operation;
mod options;
mod recordings;
#[cfg(test)]
mod replay_tests;
mod session;
mod session_setup;
mod sessions;
mod setting_paths;
mod settings;
mod show;
mod ticks;

pub use command::command;
pub use error::SessionError;
pub use options::Options;
pub use session::Session;
pub use trepan_patient::{Inputs, TissueSource};
pub use trepan_report::summary::Summary;
pub use trepan_runtime::Stages;
pub use trepan_stages::Program;

/// The examples of the README compile.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
