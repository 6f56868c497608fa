//! The simulators: threads, clocks, phases, warnings, scores, and a session from its flags to its files.
//!
//! # Theory
//! Three loops turn side by side and exchange newest values without waiting: the haptic tick at 1 kHz or more, the
//! collision step, the solver step; a fourth thread draws. Each loop's body is a stage without a clock:
//!
//! | stage | reads | gives |
//! |---|---|---|
//! | [`HapticStage::tick`] | device, newest patch | wrench, tool, record |
//! | [`CollisionStage::step`] | newest tool, newest brain | patch, contact, record |
//! | [`SolverStage::step`] | newest contact | moved brain, record |
//!
//! [`threads`] runs the stages live; [`lockstep`] runs them again from a recording, bit for bit.
//!
//! # Practice
//! [`Session::open`] finds everything that a user can get wrong before anything is written; [`Session::run`] runs and writes.
//!
//! # When not to use it
//! To use one method in a program of your own: take its crate.

mod ahead;
mod cache;
mod case_folder;
mod chart;
mod clock;
mod collision_step;
mod command;
mod driver;
mod error;
mod haptic_tick;
mod import;
mod journal;
pub mod lockstep;
mod measure;
mod notice;
mod options;
mod output;
mod picture;
mod program;
mod report;
mod run;
mod scene;
mod score;
mod session;
mod site;
mod solver_step;
mod stop;
mod summary;
pub mod threads;
mod window;

pub use cache::Cache;
pub use clock::{Clock, Schedule};
pub use collision_step::{CollisionStage, SoftFrame};
pub use command::command;
pub use error::SessionError;
pub use haptic_tick::{FRESH_MS, GONE_MS, HapticConfig, HapticStage, Tick, TickInput, ToolSample};
pub use import::{Brain, Case, Inputs, Recipe, open as open_case};
pub use notice::{Notice, Warning, Watch, What};
pub use options::{Options, Patient};
pub use program::{Phase, Program};
pub use run::{Cells, Eyes, Outcome, Replayed, SolverOutcome, Stages, Ticks, Times, Tissue, View};
pub use scene::{RestBrain, Scene};
pub use score::ScoreKeeper;
pub use session::{Ended, Session, build_case};
pub use solver_step::{EACH, SolverStage};
pub use stop::Stop;
pub use summary::Summary;
