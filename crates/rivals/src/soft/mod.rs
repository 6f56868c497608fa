//! Solvers of soft tissue beside Total Lagrangian Explicit Dynamics (`trepan-tled`).

use trepan_soft::{Method, reference};

pub mod corotational;
pub mod linear;
pub mod mass_spring;
mod nodes;
mod parts;
pub mod xpbd;

/// Every solver but `trepan-tled`'s, in the order of charts; the static oracle is the last.
pub const METHODS: [Method; 5] = [
    Method::of(&linear::METHOD),
    Method::of(&mass_spring::METHOD),
    Method::of(&corotational::METHOD),
    Method::of(&xpbd::METHOD),
    Method::of(&reference::METHOD),
];
