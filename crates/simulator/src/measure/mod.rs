//! Measures what a plan needs: the speed of this machine, and the error of each choice in this
//! case.

pub mod bone;
mod case_errors;
mod machine;
pub mod picture;
pub mod tissue;

pub use case_errors::{CaseErrors, Sight};
pub use machine::{Wanted, machine};

/// Quantile `share` (0 to 1) of values in any order; NaN without values.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
}
