//! The solvers beside Total Lagrangian Explicit Dynamics (`trepan-tled`), and the static oracle.

pub mod corotational;
pub mod linear;
pub mod mass_spring;
mod nodes;
mod parts;
pub mod reference;
pub mod xpbd;
