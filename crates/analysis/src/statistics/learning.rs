//! Power law of practice: value = floor + gain × attempt^-rate.
//!
//! # Theory
//! For a given rate the law is linear in floor and gain, so the least squares are a search over the
//! rate alone (variable projection, Golub and Pereyra 1973).
//!
//! # Sources
//! Newell and Rosenbloom 1981, Mechanisms of skill acquisition and the law of practice.

use super::mean;
use serde::Serialize;

/// A fitted law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PowerLaw {
    /// Value after endless practice, in the unit of the values.
    pub floor: f64,
    /// What practice changes, from the first attempt on; negative for a value that grows.
    pub gain: f64,
    /// Exponent: how fast it changes.
    pub rate: f64,
    /// Share of the variance that the law explains.
    pub r_squared: f64,
}

impl PowerLaw {
    /// Value at an attempt, from 1.
    pub fn at(&self, attempt: f64) -> f64 {
        self.floor + self.gain * attempt.powf(-self.rate)
    }
}

/// Rates that are tried; numerical, the ends are no learning and all of it in one attempt.
const RATES: [f64; 2] = [0.02, 4.0];
/// Rates on the first, coarse pass; numerical.
const STEPS: usize = 60;

/// Fits the law to points of attempt, from 1, and value. `None` with fewer than four attempts, or
/// where no value differs.
pub fn fit_power_law(points: &[(f64, f64)]) -> Option<PowerLaw> {
    let mut attempts: Vec<f64> = points.iter().map(|(attempt, _)| *attempt).collect();
    attempts.sort_by(f64::total_cmp);
    attempts.dedup();
    let values: Vec<f64> = points.iter().map(|(_, value)| *value).collect();
    let middle = mean(&values);
    let total: f64 = values.iter().map(|value| (value - middle).powi(2)).sum();
    if attempts.len() < 4 || total.is_nan() || total <= 0.0 {
        return None;
    }
    let spacing = (RATES[1] / RATES[0]).powf(1.0 / STEPS as f64);
    let coarse = (0..=STEPS).map(|step| RATES[0] * spacing.powi(step as i32));
    let best = coarse.min_by(|a, b| solve(points, *a).1.total_cmp(&solve(points, *b).1))?;
    let (mut low, mut high) = ((best / spacing).max(RATES[0]), (best * spacing).min(RATES[1]));
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    while high - low > 1e-6 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if solve(points, a).1 < solve(points, b).1 { high = b } else { low = a }
    }
    let rate = 0.5 * (low + high);
    let ([floor, gain], left) = solve(points, rate);
    Some(PowerLaw { floor, gain, rate, r_squared: 1.0 - left / total })
}

/// Floor, gain and remaining squares at a rate.
fn solve(points: &[(f64, f64)], rate: f64) -> ([f64; 2], f64) {
    let x: Vec<f64> = points.iter().map(|(attempt, _)| attempt.powf(-rate)).collect();
    let (x_mean, y_mean) = (mean(&x), points.iter().map(|(_, y)| y).sum::<f64>() / points.len() as f64);
    let xy: f64 = x.iter().zip(points).map(|(x, (_, y))| (x - x_mean) * (y - y_mean)).sum();
    let gain = xy / x.iter().map(|x| (x - x_mean).powi(2)).sum::<f64>();
    let floor = y_mean - gain * x_mean;
    (([floor, gain]), x.iter().zip(points).map(|(x, (_, y))| (y - floor - gain * x).powi(2)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_is_found_again() {
        for (floor, gain, rate) in [(2.0, 8.0, 0.4), (50.0, -30.0, 1.3), (0.0, 1.0, 0.2)] {
            let law = PowerLaw { floor, gain, rate, r_squared: 1.0 };
            let points: Vec<_> = (1..=12).map(|n| (f64::from(n), law.at(f64::from(n)))).collect();
            let found = fit_power_law(&points).unwrap();
            assert!((found.rate - rate).abs() < 1e-4 && (found.floor - floor).abs() < 1e-2, "{found:?} for {law:?}");
            assert!(found.r_squared > 0.999_999);
        }
        assert_eq!(fit_power_law(&[(1.0, 2.0), (2.0, 1.0), (3.0, 0.5)]), None);
        assert_eq!(fit_power_law(&[(1.0, 2.0), (2.0, 2.0), (3.0, 2.0), (4.0, 2.0)]), None);
    }
}
