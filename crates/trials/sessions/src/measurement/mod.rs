//! Published measurements beside what this project computes, and whether it lies inside.
//!
//! # Practice
//! Parts make a `Comparison` for each published value and lines of curves
//! over data; the judgement makes the table "Against measurement". Values are rows of
//! `trepan-measurements`, by their names.

mod brain;
mod comparison;
mod drilling;
mod judgement;
mod living;
mod phantoms;
mod shift;

pub use judgement::judge;

use trepan_evidence::part::{Part, Scope};

/// Lists the parts.
pub fn parts(scope: Scope) -> Vec<Part> {
    [brain::parts, living::parts, drilling::parts, shift::parts, phantoms::parts]
        .into_iter()
        .flat_map(|parts| parts(scope))
        .collect()
}
