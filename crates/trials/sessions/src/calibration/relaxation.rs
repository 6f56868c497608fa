//! Shares of a Prony series fitted to the stress at held strain.
//!
//! # Theory
//! `g(t) = 1 - Σ g_i (1 - e^(-t/τ_i))` with times that are not fitted: the solid's, from tests in
//! shear, where no fluid flows; and two for pore fluid, tens of seconds and minutes.

use super::least_squares::{Minimum, Parameter, minimise};
use trepan_measurements::brain_relaxation;

/// Time constants, s: solid, pore fluid, and what is slower.
pub const TIMES_S: [f64; 3] =
    [brain_relaxation::CORTEX_TIME.value, brain_relaxation::FLUID_TIME.value, brain_relaxation::SLOW_TIME.value];

/// Names of the shares in the table of fits.
pub const NAMES: [&str; 3] = ["relaxation-solid-share", "relaxation-fluid-share", "relaxation-slow-share"];

/// What is left of the stress after a time, s.
pub fn left(shares: &[f64], seconds: f64) -> f64 {
    1.0 - shares.iter().zip(TIMES_S).map(|(share, time)| share * (1.0 - (-seconds / time).exp())).sum::<f64>()
}

/// Fits the shares.
pub fn fit() -> Minimum {
    let parameter = Parameter { start: 0.2, limits: [0.0, 1.0] };
    let later = brain_relaxation::CURVE.iter().filter(|row| row.at > 0.0);
    minimise(&[parameter; 3], |p| later.clone().map(|row| left(p, row.at) - row.value).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_follows_the_curve_within_a_hundredth() {
        let found = fit();
        let worst = brain_relaxation::CURVE.iter().map(|row| (left(&found.at, row.at) - row.value).abs());
        assert!(worst.fold(0.0, f64::max) < 0.01 && found.at.iter().sum::<f64>() < 0.9, "{found:?}");
    }
}
