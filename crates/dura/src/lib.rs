//! The dura mater as a sheet over an opening: it bears a tool, is incised, and is held back.
//!
//! # Theory
//! A thin sheet that bears tension and wrinkles instead of being compressed (`membrane`), brought
//! to rest by dynamic relaxation (`dura`), cut along its edges (`sheet`) after a blade (`blade`).
//! Its shape at rest is the taut one over the brain below (`over`). Closed, it is in equilibrium
//! with the pressure of the fluid below, which goes once an incision lets the fluid out.
//!
//! # Practice
//! ```text
//! over ─→ pin (what bone holds) ─→ step (tool, blade) … ─→ hold_back (sutures) ─→ step …
//! ```
//! Nothing is allocated after [`Dura::over`]; the same calls give the same bytes. While nothing
//! touches it the sheet sleeps. Stiffness and strength are those of a meta-analysis; thickness and
//! the forces of blade and sutures are assumed (`fixtures/measurements/dura.csv`).
//!
//! # When not to use it
//! For a sheet that meets itself or bone; for the force that it puts on the brain.

mod blade;
mod dura;
mod membrane;
mod over;
mod sheet;
mod touch_force;

pub use dura::{Account, Dura, Tip};

#[doc = include_str!("../README.md")]
#[cfg(doctest)]
struct ReadmeExample;
