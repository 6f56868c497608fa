//! How a number that was measured in many scenes follows a few features of the scene.
//!
//! # Theory
//! ```text
//! ln y = w₀ + w₁ f₁ + w₂ f₂ + w₃ f₃ + r        fᵢ logarithms of lengths: a product of powers
//! ```
//! The weights are those of least squares, drawn a little towards 0 (ridge), so that features that
//! never varied stay out. What is left, r, is kept as two numbers: its root mean square, and the
//! bound under which it stays in [`COVERED`] of the scenes.
//!
//! # When not to use it
//! Far outside the features of the scenes that it was fitted to: a power law bends somewhere.

/// Features of a scene.
pub const FEATURES: usize = 3;
/// Root mean squares of r that a careful bound is wide.
const WIDE: f64 = 2.5;
/// Weight of the ridge, in scenes.
const RIDGE: f64 = 0.3;

/// A product of powers with its spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLaw {
    /// w₀ to w₃.
    pub weights: [f64; FEATURES + 1],
    /// Root mean square of r.
    pub spread: f64,
    /// What r stays under in nearly all scenes.
    pub bound: f64,
}

impl PowerLaw {
    /// Always this.
    pub fn constant(value: f64) -> Self {
        Self { weights: [value.ln(), 0.0, 0.0, 0.0], spread: 0.0, bound: 0.0 }
    }

    /// The expected value.
    pub fn expected(&self, features: &[f64; FEATURES]) -> f64 {
        (self.weights[0] + self.weights[1..].iter().zip(features).map(|(w, f)| w * f).sum::<f64>()).exp()
    }

    /// What the value stays under in nearly all scenes.
    pub fn at_most(&self, features: &[f64; FEATURES]) -> f64 {
        self.expected(features) * self.bound.exp()
    }

    /// The law of measured values, each with its features, and the bound that covers a share of
    /// them; `None` without any, or where one is not above 0 and finite.
    pub fn fit(measured: &[([f64; FEATURES], f64)], covered: f64) -> Option<Self> {
        let sound = |(f, y): &([f64; FEATURES], f64)| *y > 0.0 && y.is_finite() && f.iter().all(|f| f.is_finite());
        if measured.is_empty() || !measured.iter().all(sound) {
            return None;
        }
        let count = measured.len() as f64;
        let middle: [f64; FEATURES] = std::array::from_fn(|k| measured.iter().map(|(f, _)| f[k]).sum::<f64>() / count);
        let level = measured.iter().map(|(_, y)| y.ln()).sum::<f64>() / count;
        let slopes = slopes(measured, &middle, level);
        let offset = level - slopes.iter().zip(&middle).map(|(w, m)| w * m).sum::<f64>();
        let mut law = Self { weights: [offset, slopes[0], slopes[1], slopes[2]], spread: 0.0, bound: 0.0 };
        let mut left: Vec<f64> = measured.iter().map(|(f, y)| (y / law.expected(f)).ln()).collect();
        left.sort_by(f64::total_cmp);
        law.spread = (left.iter().map(|r| r * r).sum::<f64>() / count).sqrt();
        law.bound = left[((covered * count).ceil() as usize).clamp(1, left.len()) - 1].max(0.0);
        Some(law)
    }

    /// With a bound of 2.5 root mean squares, where care costs little: unlike the worst scenes of a
    /// few it puts choices in the order of their errors.
    pub fn careful(self) -> Self {
        Self { bound: WIDE * self.spread, ..self }
    }
}

/// Slopes of least squares with a ridge, by Gauss's elimination; the matrix is positive definite.
fn slopes(measured: &[([f64; FEATURES], f64)], middle: &[f64; FEATURES], level: f64) -> [f64; FEATURES] {
    let mut rows = [[0.0; FEATURES + 1]; FEATURES];
    for (f, y) in measured {
        for i in 0..FEATURES {
            (0..FEATURES).for_each(|j| rows[i][j] += (f[i] - middle[i]) * (f[j] - middle[j]));
            rows[i][FEATURES] += (f[i] - middle[i]) * (y.ln() - level);
        }
    }
    (0..FEATURES).for_each(|i| rows[i][i] += RIDGE);
    for i in 0..FEATURES {
        for k in i + 1..FEATURES {
            let share = rows[k][i] / rows[i][i];
            (i..=FEATURES).for_each(|j| rows[k][j] -= share * rows[i][j]);
        }
    }
    let mut slopes = [0.0; FEATURES];
    for i in (0..FEATURES).rev() {
        let known: f64 = (i + 1..FEATURES).map(|j| rows[i][j] * slopes[j]).sum();
        slopes[i] = (rows[i][FEATURES] - known) / rows[i][i];
    }
    slopes
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
    fn what_has_no_logarithm_has_no_law() {
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
