//! What a plan is made from and no table can say: how fast this machine is, and how far each choice
//! is off in this very case.

pub mod bone;
mod case_errors;
mod machine;
pub mod picture;
pub mod tissue;

pub use case_errors::{CaseErrors, Sight};
pub use machine::{Wanted, machine};

/// A quantile of values in any order, 0 to 1; NaN without any.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
}
