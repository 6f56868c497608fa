//! A power law for a quantity measured in many scenes, as a function of a few scene features.
//!
//! # Theory
//! ```text
//! ln y = w₀ + w₁ f₁ + w₂ f₂ + w₃ f₃ + r        fᵢ logarithms of lengths: a product of powers
//! ```
//! The weights are fitted by ridge-regularised least squares, so that features that never varied
//! get no weight. The residual r is stored as two numbers: its root mean square, and the bound that
//! holds in [`COVERED`] of the scenes.
//!
//! # When not to use it
//! Far outside the features of the fitted scenes: a power law does not extrapolate far.

use nalgebra::{Matrix3, Vector3};

/// Number of features of a scene.
pub const FEATURES: usize = 3;
/// Features of a scene, or a slope for each.
type Features = Vector3<f64>;
/// Width of a conservative bound, in root mean squares of r.
const WIDE: f64 = 2.5;
/// Weight of the ridge term, in scenes.
const RIDGE: f64 = 0.3;

/// A product of powers with the spread of its residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLaw {
    /// w₀ to w₃.
    pub weights: [f64; FEATURES + 1],
    /// Root mean square of r.
    pub spread: f64,
    /// Bound of r in nearly all scenes.
    pub bound: f64,
}

impl PowerLaw {
    /// A constant, without spread.
    pub fn constant(value: f64) -> Self {
        Self { weights: [value.ln(), 0.0, 0.0, 0.0], spread: 0.0, bound: 0.0 }
    }

    /// The law with these slopes through a value that was measured at some features.
    #[must_use]
    pub fn through(&self, at: &[f64; FEATURES], value: f64) -> Self {
        let [w0, slopes @ ..] = self.weights;
        let w0 = w0 + (value / self.expected(at)).ln();
        Self { weights: [w0, slopes[0], slopes[1], slopes[2]], spread: 0.0, bound: 0.0 }
    }

    /// The expected value.
    pub fn expected(&self, features: &[f64; FEATURES]) -> f64 {
        (self.weights[0] + self.weights[1..].iter().zip(features).map(|(w, f)| w * f).sum::<f64>()).exp()
    }

    /// Upper bound of the value in nearly all scenes.
    pub fn at_most(&self, features: &[f64; FEATURES]) -> f64 {
        self.expected(features) * self.bound.exp()
    }

    /// Fits the law to measured values with their features; the bound covers the share `covered`.
    /// `None` without values, or if one is not finite and above 0.
    pub fn fit(measured: &[([f64; FEATURES], f64)], covered: f64) -> Option<Self> {
        let sound = |(f, y): &([f64; FEATURES], f64)| *y > 0.0 && y.is_finite() && f.iter().all(|f| f.is_finite());
        if measured.is_empty() || !measured.iter().all(sound) {
            return None;
        }
        let count = measured.len() as f64;
        let middle = measured.iter().map(|(f, _)| Features::from(*f)).sum::<Features>() / count;
        let level = measured.iter().map(|(_, y)| y.ln()).sum::<f64>() / count;
        let slopes = slopes(measured, &middle, level)?;
        let offset = level - slopes.dot(&middle);
        let mut law = Self { weights: [offset, slopes[0], slopes[1], slopes[2]], spread: 0.0, bound: 0.0 };
        let mut left: Vec<f64> = measured.iter().map(|(f, y)| (y / law.expected(f)).ln()).collect();
        left.sort_by(f64::total_cmp);
        law.spread = (left.iter().map(|r| r * r).sum::<f64>() / count).sqrt();
        law.bound = left[((covered * count).ceil() as usize).clamp(1, left.len()) - 1].max(0.0);
        Some(law)
    }

    /// Replaces the bound by 2.5 root mean squares, where a conservative bound is cheap. Unlike the
    /// worst of a few scenes it preserves the order of the choices' errors.
    pub fn careful(self) -> Self {
        Self { bound: WIDE * self.spread, ..self }
    }
}

/// Slopes of ridge-regularised least squares; the matrix is positive definite.
fn slopes(measured: &[([f64; FEATURES], f64)], middle: &Features, level: f64) -> Option<Features> {
    let (mut squares, mut moments) = (Matrix3::from_diagonal_element(RIDGE), Features::zeros());
    for (f, y) in measured {
        let off = Features::from(*f) - middle;
        squares += off * off.transpose();
        moments += off * (y.ln() - level);
    }
    Some(squares.cholesky()?.solve(&moments))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn grid(y: impl Fn([f64; 3]) -> f64) -> Vec<([f64; 3], f64)> {
        let at = |n: usize| [(n % 5) as f64 - 2.0, (n / 5 % 4) as f64 * 0.7, (n / 20) as f64 * 0.5 - 1.0];
        (0..100).map(at).map(|f| (f, y(f))).collect()
    }

    #[test]
    fn a_product_of_powers_is_found_again() {
        let measured = grid(|[a, b, c]| (0.3 + 1.5 * a - 0.5 * b + 0.25 * c).exp());
        let law = PowerLaw::fit(&measured, 0.98).unwrap();
        for (found, true_one) in law.weights.iter().zip([0.3, 1.5, -0.5, 0.25]) {
            assert!((found - true_one).abs() < 0.01, "{law:?}");
        }
        assert!(law.spread < 0.01 && law.bound < 0.02);
    }

    #[test]
    fn a_feature_that_never_varied_has_no_weight() {
        let law = PowerLaw::fit(&[([1.0, 2.0, 3.0], 0.5), ([1.0, 2.0, 3.0], 0.7)], 0.98).unwrap();
        assert_eq!(law.weights[1..], [0.0; 3]);
        assert!((law.expected(&[1.0, 2.0, 3.0]) - 0.35f64.sqrt()).abs() < 1e-12);
        assert!((law.at_most(&[1.0, 2.0, 3.0]) - 0.7).abs() < 1e-12);
    }

    #[test]
    fn values_without_a_logarithm_have_no_power_law() {
        assert_eq!(PowerLaw::fit(&[], 0.98), None);
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(PowerLaw::fit(&[([0.0; 3], 1.0), ([0.0; 3], bad)], 0.98), None);
        }
        assert_eq!(PowerLaw::constant(0.0).at_most(&[1.0; 3]), 0.0);
    }

    proptest! {
        #[test]
        fn the_bound_covers_its_share(noise in prop::collection::vec(-1.0f64..1.0, 100)) {
            let measured: Vec<_> = grid(|[a, _, c]| (a - 0.5 * c).exp()).into_iter().zip(&noise).map(|((f, y), n)| (f, y * n.exp())).collect();
            let law = PowerLaw::fit(&measured, 0.98).unwrap();
            let over = measured.iter().filter(|(f, y)| *y > law.at_most(f) * (1.0 + 1e-9)).count();
            prop_assert!(over <= 2, "{over} of 100 over the bound");
        }
    }
}
