//! Runs a simulation session from its flags to its files: threads, clocks, phases, warnings,
//! scores, recording.
//!
//! # Theory
//! Three loops run in parallel and exchange their newest values without waiting: the haptic tick at
//! 1 kHz or more, the collision step and the solver step. A fourth thread renders. The body of each
//! loop is a stage without a clock:
//!
//! | stage | reads | returns |
//! |---|---|---|
//! | [`HapticStage::tick`] | device, newest patch | wrench, tool, record |
//! | [`CollisionStage::step`] | newest tool, newest node positions | patch, contacts, record |
//! | [`SolverStage::step`] | newest contact | moved nodes, record |
//!
//! `run/threads.rs` runs the stages live; `run/lockstep.rs` replays them from a recording, bit for
//! bit.
//!
//! # Practice
//! [`Session::open`] reports every user error before anything is written; [`Session::run`] runs the
//! session and writes its files.
//!
//! # When not to use it
//! To use a single method in your own program: use the method's crate.

mod batch;
mod case;
mod command;
mod compare;
mod device_test;
mod error;
mod hand;
pub mod measure;
mod models;
mod operation;
mod options;
mod printable;
mod program;
mod recipe;
mod recordings;
mod report;
mod run;
mod session;
mod session_setup;
mod show;
mod stages;
mod tissue_class;

pub use case::cache::Cache;
pub use case::choice::{Built, build_case};
pub use case::import::open as open_case;
pub use case::opening::Opening;
pub use case::plan::Plan;
pub use case::scene::{RestBrain, Scene};
pub use case::{Brain, Case, Inputs};
pub use command::command;
pub use error::SessionError;
pub use models::{BoneSummary, Facts, ModelSummary, Models, PictureSummary, TissueSummary};
pub use operation::Operation;
pub use options::{Options, Patient, Tolerances};
pub use program::{Phase, Program, called};
pub use recipe::Recipe;
pub use report::plan_comparison::PlanComparison;
pub use report::regions::{Region, regions};
pub use report::summary::Summary;
pub use run::clock::{Clock, Schedule};
pub use run::stop::Stop;
pub use run::{Cells, Outcome, RenderInputs, Replayed, SolverOutcome, Stages, Ticks, Times, Tissue, View};
pub use session::{Ended, Session};
pub use stages::alarms::Limits;
pub use stages::collision_step::{CollisionStage, SoftFrame};
pub use stages::haptic_config::HapticConfig;
pub use stages::haptic_tick::{FRESH_MS, GONE_MS, HapticStage, Tick, TickInput, ToolSample};
pub use stages::notice::{Hindrance, Notice, Warning, Watch, What};
pub use stages::score::ScoreKeeper;
pub use stages::second_hand::{SecondHand, SecondOutcome, SecondView};
pub use stages::settling::Settling;
pub use stages::skull_wall::SkullWall;
pub use stages::solver_step::{EACH, REST_MOTION_MM, SolverFaults, SolverStage};
pub use tissue_class::{TissueClass, TissueSource};
