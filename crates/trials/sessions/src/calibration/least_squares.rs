//! Nonlinear least squares within limits, with standard errors.
//!
//! # Theory
//! Levenberg-Marquardt: `(JᵀJ + λ diag JᵀJ) δ = -Jᵀr`, every step cut to the limits. The errors are
//! the roots of the diagonal of `s² (JᵀJ)⁻¹`, `s² = r·r/(n - p)`: how well the curves fix the
//! parameters, not how specimens differ.
//!
//! # Sources
//! Marquardt, J. Soc. Ind. Appl. Math. 11 (1963).

use nalgebra::{DMatrix, DVector};

/// Steps at most, and gain in the sum of squares below which a search ends.
const MOST_STEPS: usize = 400;
const LEAST_GAIN: f64 = 1e-12;

/// A parameter: where the search starts, and its limits.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Where the search starts.
    pub start: f64,
    /// Lowest and highest value.
    pub limits: [f64; 2],
}

/// The minimum of a sum of squares.
#[derive(Clone, Debug, PartialEq)]
pub struct Minimum {
    /// The parameters.
    pub at: Vec<f64>,
    /// Standard error of each; NaN where the data do not fix it.
    pub errors: Vec<f64>,
}

/// Finds the parameters with the least sum of squares of the residuals.
pub fn minimise(parameters: &[Parameter], residuals: impl Fn(&[f64]) -> Vec<f64>) -> Minimum {
    let of = |at: &DVector<f64>| DVector::from_vec(residuals(at.as_slice()));
    let mut at = DVector::from_iterator(parameters.len(), parameters.iter().map(|p| p.start));
    let (mut left, mut damping) = (of(&at), 1e-3);
    for _ in 0..MOST_STEPS {
        let slopes = jacobian(&at, &left, parameters, &of);
        let (normal, down) = (slopes.transpose() * &slopes, slopes.transpose() * &left);
        let mut gained = None;
        while gained.is_none() && damping < 1e12 {
            let damped = &normal + DMatrix::from_diagonal(&(normal.diagonal() * damping).add_scalar(1e-14));
            let step = damped.cholesky().map_or_else(|| DVector::zeros(at.len()), |found| found.solve(&down));
            let next = limited(&(&at - step), parameters);
            let there = of(&next);
            let gain = left.norm_squared() - there.norm_squared();
            if gain > 0.0 {
                (at, left, gained) = (next, there, Some(gain));
                damping *= 0.3;
            } else {
                damping *= 4.0;
            }
        }
        if gained.is_none_or(|gain| gain < LEAST_GAIN * left.norm_squared()) {
            break;
        }
    }
    let slopes = jacobian(&at, &left, parameters, &of);
    let variance = left.norm_squared() / left.len().saturating_sub(at.len()).max(1) as f64;
    let inverse = (slopes.transpose() * &slopes).try_inverse();
    let error = |i: usize| inverse.as_ref().map_or(f64::NAN, |inverse| (variance * inverse[(i, i)]).sqrt());
    Minimum { errors: (0..at.len()).map(error).collect(), at: at.as_slice().to_vec() }
}

fn limited(at: &DVector<f64>, parameters: &[Parameter]) -> DVector<f64> {
    let cut = |(value, p): (&f64, &Parameter)| value.clamp(p.limits[0], p.limits[1]);
    DVector::from_iterator(at.len(), at.iter().zip(parameters).map(cut))
}

/// Slopes of the residuals, by differences that stay within the limits.
fn jacobian(
    at: &DVector<f64>,
    left: &DVector<f64>,
    parameters: &[Parameter],
    of: &impl Fn(&DVector<f64>) -> DVector<f64>,
) -> DMatrix<f64> {
    let column = |i: usize| {
        let size = 1e-6 * at[i].abs().max(1e-3);
        let step = if at[i] + size > parameters[i].limits[1] { -size } else { size };
        let mut there = at.clone();
        there[i] += step;
        (of(&there) - left) / step
    };
    DMatrix::from_columns(&(0..at.len()).map(column).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decay_is_found_and_its_errors_are_those_of_linear_theory() {
        let data: Vec<[f64; 2]> = (0..20).map(|i| f64::from(i) * 0.2).map(|t| [t, 3.0 * (-0.7 * t).exp()]).collect();
        let noise = |i: usize| if i.is_multiple_of(2) { 1e-3 } else { -1e-3 };
        let left = |p: &[f64]| {
            let of = |(i, [t, y]): (usize, &[f64; 2])| p[0] * (-p[1] * t).exp() - y - noise(i);
            data.iter().enumerate().map(of).collect()
        };
        let parameter = |start| Parameter { start, limits: [0.0, 10.0] };
        let found = minimise(&[parameter(1.0), parameter(2.0)], left);
        assert!((found.at[0] - 3.0).abs() < 2e-3 && (found.at[1] - 0.7).abs() < 1e-3, "{found:?}");
        assert!(found.errors.iter().all(|e| (1e-4..2e-3).contains(e)), "{found:?}");
    }

    #[test]
    fn a_minimum_outside_the_limits_is_taken_at_the_limit() {
        let found = minimise(&[Parameter { start: 1.5, limits: [1.0, 2.0] }], |p| vec![p[0] - 5.0, p[0] - 5.0]);
        assert_eq!(found.at, [2.0]);
    }
}
