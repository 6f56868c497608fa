//! Total Lagrangian Explicit Dynamics (TLED): large deformations of soft tissue in real time.
//!
//! # Theory
//! ```text
//! M ü + α M u̇ + f_int(u) = f_ext            F = I + Σ u_a ⊗ ∇N_a,   f_int,a = V P(F) ∇N_a
//! v⁺ = ((1 - α dt/2) v + dt M⁻¹ (f_ext - f_int)) / (1 + α dt/2)          u⁺ = u + dt v⁺
//! ```
//! Everything refers to the rest state, so shape-function gradients are computed once (Miller,
//! Joldes, Lance and Wittek 2007). A step is four passes: element forces, contact, node update,
//! bookkeeping; no system of equations is solved.
//!
//! # Practice
//! A step is stable up to [`stable_dt_ms`](trepan_soft::SoftSolver::stable_dt_ms). A longer one is
//! cut into substeps, and so is one over the stable step of the elements as deformed now, which
//! [`next_dt_ms`](trepan_soft::SoftSolver::next_dt_ms) tells. Elements
//! are stored in blocks of sixteen, one lane each. Their forces are stored and gathered per node in
//! a fixed order, so the same input gives the same bytes on every machine and with every kernel. A
//! step neither allocates nor panics. With several threads it takes locks that nobody else holds,
//! and waits for the parts that its own threads have begun.
//!
//! ```
//! use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
//! use trepan_tled::{Config, Tled};
//!
//! let mesh = boxes::split_box([3, 3, 3], trepan_geometry::Vec3::splat(30.0));
//! let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
//! let mut tled = Tled::new(&Body::uniform(mesh, fixed, Material::BRAIN), &Config::default())?;
//! let gravity = trepan_geometry::Vec3::new(0.0, 0.0, -9.81e-3);
//! let dt = tled.stable_dt_ms();
//! let report = tled.step(&Loads { gravity, ..Loads::default() }, dt);
//! assert_eq!((report.inverted, report.substeps), (0, 1));
//! # Ok::<(), trepan_soft::BodyError>(())
//! ```
//!
//! # When not to use it
//! For nearly incompressible tissue (ν over about 0.47) without [`Config::averaged_pressure`]:
//! plain 4-node tetrahedra lock. For slow processes (minutes): the speed of sound limits the step,
//! so use a static solver.

mod averaging;
mod base;
mod block;
mod bound;
pub mod choice;
mod config;
mod damping;
mod dynamic_scaling;
mod element;
mod elements;
mod field;
mod fill;
mod force_slots;
#[cfg(feature = "gpu")]
pub mod gpu;
mod law;
mod node_groups;
mod nodes;
mod part;
mod principal;
mod relaxation;
mod scaling;
mod settle;
mod sheet;
mod stiffness;
mod symmetric;
mod team;
mod tled;

pub use config::{Config, Damping};
pub use fill::{FULL, RAMP_STEPS};
pub use relaxation::{PRONY_TERMS, Relaxation};
pub use settle::{Settled, Settling};
pub use tled::{Pass, Tled};
pub use trepan_soft::simd::Kernel;
