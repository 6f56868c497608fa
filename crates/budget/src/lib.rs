//! Picks voxel size, point shell, mesh size and solver step for a scene's tolerance and a machine's time.
//!
//! # Theory
//! The cheapest model that meets the tolerance, no more. What each choice costs and how far it is off was measured once and stored ([`Rows`]);
//! a machine scales the costs ([`Machine`]), a scene scales the errors ([`Scene`]). Among the rows that run in time with headroom the
//! cheapest one within the tolerance is taken; if none is, the most accurate one that runs, and the plan says so.
//!
//! # Practice
//! Runs once at start, microseconds. Nothing here measures: the machine's numbers are passed in, so a plan is the same for the same numbers.
//!
//! ```
//! use trepan_budget::{Machine, Scene, plan};
//!
//! let laptop = Machine { ns_per_tet_step: 20.0, us_per_rigid_tick: 30.0, threads: 4 };
//! let plan = plan(&laptop, &Scene::default())?;
//! assert!(plan.mesh.in_time && plan.rigid.in_time);
//! println!("{plan}");
//! # Ok::<(), trepan_budget::PlanError>(())
//! ```
//!
//! # When not to use it
//! For a scene outside what the rows were measured on: another tissue geometry, tools thinner than a voxel.

mod machine;
mod plan;
mod rows;
mod step;

pub use machine::{Machine, PlanError, Scene};
pub use plan::{Choice, Plan, plan, plan_with};
pub use rows::{MeshRow, RigidRow, Rows};
pub use step::{edge_mm, stable_dt_ms};

#[doc = include_str!("../README.md")]
#[cfg(doctest)]
struct ReadmeExample;
