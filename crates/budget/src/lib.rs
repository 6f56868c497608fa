//! Picks method, voxel size, mesh size, solver and picture quality for a
//! scene's tolerance and a machine's time.
//!
//! # Theory
//! Chooses the cheapest model that meets the tolerance. The cost and error of each choice were
//! measured in many scenes and stored as power laws in a few scene features ([`Rows`],
//! [`PowerLaw`]); a machine scales the costs ([`Machine`]), a scene the errors ([`Scene`]). Of the
//! choices that run in time with headroom, the cheapest whose error bound is within the tolerance
//! is taken. If there is none, the most accurate one that runs is taken, and the plan reports it.
//!
//! # Practice
//! Runs once at start, in microseconds. Nothing is measured here: the machine's numbers are passed
//! in, so that equal numbers give equal plans. Costs are in cores (CPU seconds per second), so that
//! they add up.
//!
//! ```
//! use trepan_budget::{Machine, Scene, plan};
//!
//! let machine = Machine { threads: 8, ..Machine::default() };
//! let plan = plan(&machine, &Scene::default())?;
//! assert!(plan.in_time() && plan.cores() < 8.0);
//! println!("{plan}");
//! # Ok::<(), trepan_budget::PlanError>(())
//! ```
//!
//! # When not to use it
//! For a scene outside the range of the measured rows: another tissue geometry, tools thinner than
//! a voxel.

mod choice;
mod display;
mod machine;
mod plan;
mod power_law;
mod rows;
mod scene;
mod setup;
mod step;

pub use choice::{Choice, Neighbour};
pub use machine::{Machine, PlanError};
pub use plan::{
    Plan, bone_cores, bone_error_n, dt_ms, holds_walls, picture_cores, plan, plan_with, tissue_cores, tissue_over,
};
pub use power_law::{FEATURES, PowerLaw};
pub use rows::{Kind, Row, Rows, TissueForce, read, write};
pub use scene::Scene;
pub use setup::{Bone, Picture, Quality, Setup, Tissue};
pub use step::{edge_mm, stable_dt_ms};

#[doc = include_str!("../README.md")]
#[cfg(doctest)]
struct ReadmeExample;
