//! The cost function of a cell size and its minimum (thesis, 5.3, with r_t = t_p / t_v and without
//! the ceiling).
//!
//! # Theory
//! With q = (1 − p_nc) r_t and c = 3√3 / (2 A_t), setting dz/dδ = 0 and dividing by (s/δ + 2)²/δ² >
//! 0 gives
//!
//! ```text
//! 4 q c δ³ − s q c δ² − 3 s p_nc = 0
//! ```
//!
//! Its coefficients change sign once, so that it has one positive root; z decreases before it and
//! increases after it. The root is computed with Cardano's formula in its stable hyperbolic form
//! and refined by Newton's method; [`CostModel::minimised`] finds the same minimum without the
//! derivative.
//!
//! # When not to use it
//! To predict a time: only the location of the minimum is meaningful. The area of facets represents
//! the number of particles; where particles are not the mesh's nodes (a tool's pointshell), use
//! counts ([`crate::counts`]).

use crate::Measures;
use crate::error::{VoxelSizeError, checked, positive};

/// The two constants of the cost function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostModel {
    /// Fraction of tetrahedra without collision, 0 to 1 (1 excluded). Higher values favour larger
    /// cells. Thesis: 0.98 to 0.99.
    pub p_nc: f64,
    /// Cost of testing one particle in visits of one cell, t_p / t_v. Higher values favour smaller
    /// cells. Thesis: about 5; measure it.
    pub r_t: f64,
}

impl Default for CostModel {
    /// The thesis's numbers.
    fn default() -> Self {
        Self { p_nc: 0.99, r_t: 5.0 }
    }
}

impl CostModel {
    /// z(δ), in cell visits per tetrahedron.
    pub fn cost(&self, measures: &Measures, delta_mm: f64) -> f64 {
        self.with_cells(measures, delta_mm, (measures.longest_edge_mm / delta_mm + 2.0).powi(3))
    }

    /// z(δ) with whole cells, as Eq 5.4 is printed: correct as a count, but discontinuous, so do
    /// not minimise it.
    pub fn cost_in_whole_cells(&self, measures: &Measures, delta_mm: f64) -> f64 {
        self.with_cells(measures, delta_mm, (measures.longest_edge_mm / delta_mm + 2.0).ceil().powi(3))
    }

    fn with_cells(&self, measures: &Measures, delta_mm: f64, cells: f64) -> f64 {
        cells * (self.p_nc + self.q() * particle_density(measures) * delta_mm * delta_mm)
    }

    fn q(&self) -> f64 {
        (1.0 - self.p_nc) * self.r_t
    }

    /// The cheapest cell edge, mm: the positive root of the cubic, in closed form.
    pub fn analytic(&self, measures: &Measures) -> Result<f64, VoxelSizeError> {
        let (s, k) = self.cubic(measures)?;
        Ok(s * root(k))
    }

    /// The cheapest cell edge, mm, by golden-section search on the logarithm of δ.
    pub fn minimised(&self, measures: &Measures) -> Result<f64, VoxelSizeError> {
        let (s, k) = self.cubic(measures)?;
        // The root of x³ − x²/4 = k lies between 1/4 and 1/4 + ∛k.
        let (low, high) = ((0.2 * s).ln(), (s * (0.3 + k.cbrt())).ln());
        Ok(golden_section(|log| self.cost(measures, log.exp()), low, high, 80).exp())
    }

    /// s and k of the cubic, which is x³ − x²/4 − k = 0 in x = δ / s.
    fn cubic(&self, measures: &Measures) -> Result<(f64, f64), VoxelSizeError> {
        self.check()?;
        let s = measures.checked()?.longest_edge_mm;
        Ok((s, 3.0 * self.p_nc / (4.0 * self.q() * particle_density(measures) * s * s)))
    }

    /// Checks that the parameters are in range.
    pub fn check(&self) -> Result<(), VoxelSizeError> {
        checked("p_nc", self.p_nc, (0.0..1.0).contains(&self.p_nc), "at least 0 and less than 1")?;
        positive("r_t", self.r_t).map(|_| ())
    }
}

/// c: a cell of edge δ contains c δ² particles.
fn particle_density(measures: &Measures) -> f64 {
    3.0 * 3f64.sqrt() / (2.0 * measures.facet_mm2)
}

/// The positive root of x³ − x²/4 = k, k ≥ 0. With x = y + 1/12 it is y³ − y/48 − (k + 1/864) = 0.
fn root(k: f64) -> f64 {
    let half = 0.5 * (k + 1.0 / 864.0);
    let third: f64 = 1.0 / 144.0;
    // One real root: y = 2 √(p/3) cosh(acosh(q/2 / √(p/3)³) / 3), p = 1/48.
    let cosh = (half / third.powf(1.5)).max(1.0);
    let y = 2.0 * third.sqrt() * (cosh.acosh() / 3.0).cosh();
    let mut x = y + 1.0 / 12.0;
    for _ in 0..3 {
        x -= (x * x * (x - 0.25) - k) / (x * (3.0 * x - 0.5));
    }
    x
}

/// The minimum of a unimodal function.
pub(crate) fn golden_section(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64, steps: usize) -> f64 {
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_a, mut at_b) = (f(a), f(b));
    for _ in 0..steps {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - golden * (high - low);
            at_a = f(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + golden * (high - low);
            at_b = f(b);
        }
    }
    0.5 * (low + high)
}

/// The error of Eq 5.9: distance of a size from the best one, relative to the good zone on its
/// side.
/// It is 0 at the best size and 1 at the zone's limit.
///
/// All four values in the same unit (the thesis: cells per axis).
pub fn zone_error(value: f64, low: f64, best: f64, high: f64) -> f64 {
    let side = if value < best { best - low } else { high - best };
    (best - value).abs() / side
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn measures(s: f64, facet_mm2: f64) -> Measures {
        Measures { elements: 1, longest_edge_mm: s, mean_edge_mm: 0.9 * s, facet_mm2 }
    }

    proptest! {
        #[test]
        fn the_root_solves_the_cubic_and_is_the_minimum(s in 0.01f64..100.0, thin in 0.01f64..1.0, p_nc in 0.0f64..0.9999, r_t in 0.1f64..100.0) {
            let model = CostModel { p_nc, r_t };
            let measures = measures(s, thin * 0.433 * s * s);
            let d = model.analytic(&measures).unwrap();
            let qc = model.q() * particle_density(&measures);
            let terms = [4.0 * qc * d.powi(3), -s * qc * d * d, -3.0 * s * p_nc];
            let largest = terms.iter().fold(0.0f64, |a, t| a.max(t.abs()));
            prop_assert!(terms.iter().sum::<f64>().abs() < 1e-12 * largest);
            prop_assert!((model.minimised(&measures).unwrap() / d - 1.0).abs() < 1e-5);
            for off in [0.5, 0.9, 1.1, 2.0] {
                prop_assert!(model.cost(&measures, off * d) > model.cost(&measures, d));
            }
            prop_assert!(model.cost_in_whole_cells(&measures, d) >= model.cost(&measures, d));
        }

        #[test]
        fn sizes_scale_with_the_mesh(scale in 0.01f64..100.0) {
            let model = CostModel::default();
            let one = model.analytic(&measures(1.0, 0.4)).unwrap();
            let scaled = model.analytic(&measures(scale, 0.4 * scale * scale)).unwrap();
            prop_assert!((scaled / (scale * one) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn without_idle_tetrahedra_the_root_is_a_quarter_of_the_edge() {
        let d = CostModel { p_nc: 0.0, r_t: 5.0 }.analytic(&measures(8.0, 20.0)).unwrap();
        assert!((d - 2.0).abs() < 1e-12);
    }

    #[test]
    fn bad_numbers_are_named() {
        let good = measures(1.0, 0.4);
        let field = |result: Result<f64, VoxelSizeError>| match result {
            Err(VoxelSizeError::Field { field, .. }) => field,
            other => panic!("{other:?}"),
        };
        assert_eq!(field(CostModel { p_nc: 1.0, r_t: 5.0 }.analytic(&good)), "p_nc");
        assert_eq!(field(CostModel { p_nc: f64::NAN, r_t: 5.0 }.analytic(&good)), "p_nc");
        assert_eq!(field(CostModel { p_nc: 0.9, r_t: 0.0 }.minimised(&good)), "r_t");
        assert_eq!(field(CostModel::default().analytic(&measures(f64::NAN, 0.4))), "longest_edge_mm");
        assert_eq!(field(CostModel::default().minimised(&measures(1.0, 0.0))), "facet_mm2");
    }

    #[test]
    fn the_thesis_s_errors_come_out_of_its_sizes() {
        // Tables 5.2 and 5.3: low, best, high, analytic, traditional, and the two errors.
        let rows = [
            [20.0, 28.33, 39.0, 28.73, 41.90, 0.038, 1.272],
            [22.0, 28.16, 38.0, 30.94, 45.16, 0.283, 1.727],
            [16.0, 34.04, 54.0, 32.49, 47.40, 0.086, 0.669],
            [8.0, 26.63, 47.0, 34.48, 50.29, 0.385, 1.162],
            [20.0, 37.87, 57.0, 35.65, 51.90, 0.124, 0.734],
        ];
        for [low, best, high, analytic, traditional, error_analytic, error_traditional] in rows {
            assert!((zone_error(analytic, low, best, high) - error_analytic).abs() < 1.5e-3);
            assert!((zone_error(traditional, low, best, high) - error_traditional).abs() < 1.5e-3);
        }
    }
}
