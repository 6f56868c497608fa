//! Every material's energy, stress and tangent in f64: what the fast solvers are checked against
//! and what the reference solves.
//!
//! # Theory
//! ```text
//! neo-Hookean             W = μ/2 (J^(-2/3) I₁ - 3) + κ U(J)
//! St. Venant-Kirchhoff    W = λ/2 (tr E)² + μ E:E                           E = (FᵀF - I)/2
//! Mooney-Rivlin           W = c₁₀ (J^(-2/3) I₁ - 3) + c₀₁ (J^(-4/3) I₂ - 3) + κ U(J)
//! Ogden                   W = Σ_p 2 μ_p/α_p² (Σ_i (J^(-1/3) λ_i)^α_p - 3) + κ U(J)
//! stiffening              see `stiffening.rs`
//! ```
//! λ_i² are the eigenvalues of FᵀF, U is `(J-1)²/2` with a wall below 0.3 (see `energy.rs`). Powers
//! of J continue linearly below 0.3 ([`crate::FADE_BELOW`]), principal stretches stop at 0.1, so
//! that every energy is finite for every F.

use crate::energy::{NeoHookean, VolumeWall, cofactor, cofactor_change, dot, power, squared, volumetric};
use crate::stiffening::Stiffening;
use glam::{DMat3, DVec3};
use nalgebra::Matrix3;

/// Principal stretches below this are taken for it.
pub const LEAST_STRETCH: f64 = 0.1;

/// A hyperelastic law with its constants, MPa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Compressible neo-Hookean.
    NeoHookean(NeoHookean),
    /// Linear in Green's strain.
    StVenantKirchhoff {
        /// First Lamé constant λ.
        lambda: f64,
        /// Shear modulus μ.
        mu: f64,
    },
    /// Both isochoric invariants.
    MooneyRivlin {
        /// Constant of the first invariant.
        c10: f64,
        /// Constant of the second invariant.
        c01: f64,
        /// Bulk modulus κ.
        kappa: f64,
    },
    /// Powers of the principal stretches, two terms.
    Ogden {
        /// μ_p; their sum is the shear modulus at small strain.
        mu: [f64; 2],
        /// α_p.
        alpha: [f64; 2],
        /// Bulk modulus κ.
        kappa: f64,
    },
    /// Stiffening with strain, more in compression.
    Stiffening(Stiffening),
}

impl Law {
    /// Energy per rest volume, N mm/mm³.
    pub fn energy(&self, f: DMat3) -> f64 {
        let j = f.determinant();
        match *self {
            Self::NeoHookean(law) => law.energy(f),
            Self::Stiffening(law) => law.energy(f),
            Self::StVenantKirchhoff { lambda, mu } => {
                let e = green(f);
                0.5 * lambda * trace(e).powi(2) + mu * squared(e)
            }
            Self::MooneyRivlin { c10, c01, kappa } => {
                let first = c10 * (power(j, -2.0 / 3.0)[0] * squared(f) - 3.0);
                let second = c01 * (power(j, -4.0 / 3.0)[0] * squared(cofactor(f)) - 3.0);
                first + second + kappa * volumetric(j, VolumeWall::USUAL)[0]
            }
            Self::Ogden { mu, alpha, kappa } => {
                let (squares, _) = eigen(f.transpose() * f);
                let term = |p: usize| {
                    let sum: f64 = squares.to_array().iter().map(|s| stretch_power(*s, alpha[p]).0).sum();
                    2.0 * mu[p] / (alpha[p] * alpha[p]) * (power(j, -alpha[p] / 3.0)[0] * sum - 3.0)
                };
                (0..2).filter(|&p| mu[p] != 0.0).map(term).sum::<f64>() + kappa * volumetric(j, VolumeWall::USUAL)[0]
            }
        }
    }

    /// First Piola-Kirchhoff stress P, MPa.
    pub fn stress(&self, f: DMat3) -> DMat3 {
        let (j, c) = (f.determinant(), cofactor(f));
        match *self {
            Self::NeoHookean(law) => law.stress(f),
            Self::Stiffening(law) => law.stress(f),
            Self::StVenantKirchhoff { lambda, mu } => {
                let e = green(f);
                f * (DMat3::from_diagonal(DVec3::splat(lambda * trace(e))) + e * (2.0 * mu))
            }
            Self::MooneyRivlin { c10, c01, kappa } => {
                let [g, dg, _] = power(j, -2.0 / 3.0);
                let [h, dh, _] = power(j, -4.0 / 3.0);
                let along_c =
                    c10 * dg * squared(f) + c01 * dh * squared(c) + kappa * volumetric(j, VolumeWall::USUAL)[1];
                f * (2.0 * c10 * g) + second_invariant_slope(f) * (c01 * h) + c * along_c
            }
            Self::Ogden { mu, alpha, kappa } => {
                ogden_stress(f, mu, alpha) + c * (kappa * volumetric(j, VolumeWall::USUAL)[1])
            }
        }
    }

    /// The change of the stress, `∂P/∂F : dF`, for a change `df`, MPa.
    pub fn stress_change(&self, f: DMat3, df: DMat3) -> DMat3 {
        match *self {
            Self::NeoHookean(law) => law.stress_change(f, df),
            Self::Stiffening(law) => law.stress_change(f, df),
            Self::StVenantKirchhoff { lambda, mu } => {
                let (e, de) = (green(f), symmetric(f.transpose() * df));
                let second = |e: DMat3| DMat3::from_diagonal(DVec3::splat(lambda * trace(e))) + e * (2.0 * mu);
                df * second(e) + f * second(de)
            }
            Self::MooneyRivlin { .. } => self.mooney_rivlin_change(f, df),
            Self::Ogden { .. } => {
                let h = 1e-5;
                (self.stress(f + df * h) - self.stress(f - df * h)) * (0.5 / h)
            }
        }
    }

    /// Shear and bulk modulus at small strain, MPa.
    pub fn moduli(&self) -> (f64, f64) {
        match *self {
            Self::NeoHookean(NeoHookean { mu, kappa }) => (mu, kappa),
            Self::StVenantKirchhoff { lambda, mu } => (mu, lambda + mu * 2.0 / 3.0),
            Self::MooneyRivlin { c10, c01, kappa } => (2.0 * (c10 + c01), kappa),
            Self::Ogden { mu, kappa, .. } => (mu[0] + mu[1], kappa),
            Self::Stiffening(law) => (law.mu, law.kappa),
        }
    }

    /// The same law with another bulk modulus at small strain, MPa.
    pub fn with_bulk(self, bulk_mpa: f64) -> Self {
        match self {
            Self::NeoHookean(law) => Self::NeoHookean(NeoHookean { kappa: bulk_mpa, ..law }),
            Self::StVenantKirchhoff { mu, .. } => Self::StVenantKirchhoff { lambda: bulk_mpa - mu * 2.0 / 3.0, mu },
            Self::MooneyRivlin { c10, c01, .. } => Self::MooneyRivlin { c10, c01, kappa: bulk_mpa },
            Self::Ogden { mu, alpha, .. } => Self::Ogden { mu, alpha, kappa: bulk_mpa },
            Self::Stiffening(law) => Self::Stiffening(Stiffening { kappa: bulk_mpa, ..law }),
        }
    }

    /// Whether an incompressible specimen gets stiffer against more pull, `dT/dλ > 0` for stretches
    /// 0.5 to 2, uniaxial and equibiaxial.
    pub fn is_stable(&self) -> bool {
        let pulls = |along: fn(f64) -> DVec3| {
            let work = |stretch: f64| self.energy(DMat3::from_diagonal(along(stretch)));
            (0..=60).all(|i| {
                let (stretch, h) = (0.5 + 0.025 * f64::from(i), 1e-3);
                work(stretch + h) - 2.0 * work(stretch) + work(stretch - h) > 0.0
            })
        };
        pulls(|s| DVec3::new(s, s.powf(-0.5), s.powf(-0.5))) && pulls(|s| DVec3::new(s, s, s.powi(-2)))
    }

    fn mooney_rivlin_change(&self, f: DMat3, df: DMat3) -> DMat3 {
        let Self::MooneyRivlin { c10, c01, kappa } = *self else { return DMat3::ZERO };
        let (j, c, dc) = (f.determinant(), cofactor(f), cofactor_change(f, df));
        let ([g, dg, ddg], [h, dh, ddh]) = (power(j, -2.0 / 3.0), power(j, -4.0 / 3.0));
        let (i1, i2, dj) = (squared(f), squared(c), dot(c, df));
        let (di1, di2) = (2.0 * dot(f, df), 2.0 * dot(c, dc));
        let along_c = c10 * dg * i1 + c01 * dh * i2 + kappa * volumetric(j, VolumeWall::USUAL)[1];
        let change = c10 * (ddg * dj * i1 + dg * di1)
            + c01 * (ddh * dj * i2 + dh * di2)
            + kappa * volumetric(j, VolumeWall::USUAL)[2] * dj;
        let (slope, dslope) = (second_invariant_slope(f), second_invariant_slope_change(f, df));
        df * (2.0 * c10 * g)
            + f * (2.0 * c10 * dg * dj)
            + dslope * (c01 * h)
            + slope * (c01 * dh * dj)
            + c * change
            + dc * along_c
    }
}

/// `∂I₂/∂F = 2 (I₁ F - F FᵀF)`.
fn second_invariant_slope(f: DMat3) -> DMat3 {
    (f * squared(f) - f * (f.transpose() * f)) * 2.0
}

fn second_invariant_slope_change(f: DMat3, df: DMat3) -> DMat3 {
    let (c, dc) = (f.transpose() * f, df.transpose() * f + f.transpose() * df);
    (df * squared(f) + f * (2.0 * dot(f, df)) - df * c - f * dc) * 2.0
}

fn ogden_stress(f: DMat3, mu: [f64; 2], alpha: [f64; 2]) -> DMat3 {
    let (squares, axes) = eigen(f.transpose() * f);
    let (j, c) = (f.determinant(), cofactor(f));
    let (mut second, mut along_c) = (DVec3::ZERO, 0.0);
    for p in (0..2).filter(|&p| mu[p] != 0.0) {
        let [g, dg, _] = power(j, -alpha[p] / 3.0);
        let scale = 2.0 * mu[p] / (alpha[p] * alpha[p]);
        let powers = squares.to_array().map(|s| stretch_power(s, alpha[p]));
        second += DVec3::from_array(powers.map(|(_, slope)| 2.0 * scale * g * slope));
        along_c += scale * dg * powers.iter().map(|(value, _)| value).sum::<f64>();
    }
    f * (axes * DMat3::from_diagonal(second) * axes.transpose()) + c * along_c
}

/// `λ^α` as a function of λ², and its slope over λ²; constant below the least stretch.
fn stretch_power(square: f64, alpha: f64) -> (f64, f64) {
    let at = square.max(LEAST_STRETCH * LEAST_STRETCH);
    let value = at.powf(0.5 * alpha);
    let slope = 0.5 * alpha * value / at;
    if square < at { (value + slope * (square - at), slope) } else { (value, slope) }
}

fn green(f: DMat3) -> DMat3 {
    (f.transpose() * f - DMat3::IDENTITY) * 0.5
}

fn symmetric(a: DMat3) -> DMat3 {
    (a + a.transpose()) * 0.5
}

fn trace(a: DMat3) -> f64 {
    a.x_axis.x + a.y_axis.y + a.z_axis.z
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix.
fn eigen(a: DMat3) -> (DVec3, DMat3) {
    let found = Matrix3::from_column_slice(&a.to_cols_array()).symmetric_eigen();
    (DVec3::from_slice(found.eigenvalues.as_slice()), DMat3::from_cols_slice(found.eigenvectors.as_slice()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn laws() -> [Law; 5] {
        [
            Law::NeoHookean(NeoHookean { mu: 0.7, kappa: 3.0 }),
            Law::StVenantKirchhoff { lambda: 2.0, mu: 0.7 },
            Law::MooneyRivlin { c10: 0.2, c01: 0.15, kappa: 3.0 },
            Law::Ogden { mu: [0.5, 0.2], alpha: [-4.7, 2.0], kappa: 3.0 },
            Law::Stiffening(Stiffening { mu: 0.7, share: 0.4, bound: 0.02, kappa: 3.0 }),
        ]
    }

    proptest! {
        #[test]
        fn stress_is_the_slope_of_the_energy_and_the_tangent_that_of_the_stress(
            entries in proptest::array::uniform9(-0.4f64..0.4), change in proptest::array::uniform9(-1.0f64..1.0), scale in 0.3f64..1.5,
        ) {
            let f = (DMat3::IDENTITY + DMat3::from_cols_array(&entries)) * scale;
            let df = DMat3::from_cols_array(&change);
            let least = eigen(f.transpose() * f).0.min_element();
            prop_assume!([crate::FADE_BELOW, VolumeWall::STIFFENING.below, 0.0].iter().all(|at| (f.determinant() - at).abs() > 1e-3) && (least.abs().sqrt() - LEAST_STRETCH).abs() > 1e-3);
            for law in laws() {
                let h = 1e-6;
                let slope = (law.energy(f + df * h) - law.energy(f - df * h)) / (2.0 * h);
                let stress = law.stress(f);
                prop_assert!((slope - dot(stress, df)).abs() < 1e-5 * (1.0 + squared(stress).sqrt()), "{law:?}");
                let turn = (law.stress(f + df * h) - law.stress(f - df * h)) * (0.5 / h);
                let error = squared(turn - law.stress_change(f, df)).sqrt();
                prop_assert!(error < 1e-4 * (1.0 + squared(turn).sqrt()), "{law:?} {error}");
            }
        }

        #[test]
        fn eigenvectors_diagonalise(x in proptest::array::uniform6(-3.0f64..3.0)) {
            let a = DMat3::from_cols(DVec3::new(x[0], x[1], x[2]), DVec3::new(x[1], x[3], x[4]), DVec3::new(x[2], x[4], x[5]));
            let (values, axes) = eigen(a);
            prop_assert!(squared(a * axes - axes * DMat3::from_diagonal(values)).sqrt() < 1e-10);
            prop_assert!(squared(axes.transpose() * axes - DMat3::IDENTITY).sqrt() < 1e-12);
        }
    }

    #[test]
    fn every_law_has_its_moduli_at_small_strain_and_no_stress_at_rest() {
        for law in laws() {
            let (mu, kappa) = law.moduli();
            assert!(squared(law.stress(DMat3::IDENTITY)).sqrt() < 1e-14);
            let shear = DMat3::from_cols(DVec3::ZERO, DVec3::X, DVec3::ZERO);
            let found = law.stress_change(DMat3::IDENTITY, shear + shear.transpose());
            assert!((found.y_axis.x - 2.0 * mu).abs() < 1e-8, "{law:?}");
            let swell = law.stress_change(DMat3::IDENTITY, DMat3::IDENTITY);
            assert!((swell.x_axis.x - 3.0 * kappa).abs() < 1e-8, "{law:?}");
        }
    }

    /// `λ_i ∂W/∂λ_i`, written by hand from the principal stretches.
    fn principal_work(law: Law, stretch: DVec3) -> DVec3 {
        let (j, squares) = (stretch.x * stretch.y * stretch.z, stretch * stretch);
        let (i1, i2) = (squares.element_sum(), squares.x * squares.y + squares.y * squares.z + squares.z * squares.x);
        let one = DVec3::ONE;
        let bulk = |kappa: f64| one * (kappa * (j - 1.0) * j);
        match law {
            Law::NeoHookean(NeoHookean { mu, kappa }) => {
                (squares - one * (i1 / 3.0)) * (mu * j.powf(-2.0 / 3.0)) + bulk(kappa)
            }
            Law::StVenantKirchhoff { lambda, mu } => {
                let e = (squares - one) * 0.5;
                (one * (lambda * e.element_sum()) + e * (2.0 * mu)) * squares
            }
            Law::MooneyRivlin { c10, c01, kappa } => {
                (squares - one * (i1 / 3.0)) * (2.0 * c10 * j.powf(-2.0 / 3.0))
                    + (squares * (one * i1 - squares) - one * (2.0 * i2 / 3.0)) * (2.0 * c01 * j.powf(-4.0 / 3.0))
                    + bulk(kappa)
            }
            Law::Ogden { mu, alpha, kappa } => {
                let term = |p: usize| {
                    let powers = (stretch / j.cbrt()).powf(alpha[p]);
                    (powers - one * (powers.element_sum() / 3.0)) * (2.0 * mu[p] / alpha[p])
                };
                term(0) + term(1) + bulk(kappa)
            }
            Law::Stiffening(Stiffening { mu, share, bound, kappa }) => {
                let powers = (stretch / j.cbrt()).powf(-34.0);
                let slope = (1.0 + bound * (powers.element_sum() - 3.0)).powf(-15.0 / 16.0);
                let own = (powers - one * (powers.element_sum() / 3.0)) * ((share - 1.0) * mu / 17.0 * slope);
                own + (squares - one * (i1 / 3.0)) * (share * mu * j.powf(-2.0 / 3.0)) + bulk(kappa)
            }
        }
    }

    #[test]
    fn uniaxial_biaxial_and_shear_stress_are_those_of_the_closed_forms() {
        for law in laws() {
            for s in [0.7f64, 0.8, 0.9, 1.1, 1.4] {
                // Simple shear of amount γ has the principal stretches r, 1/r, 1 with r - 1/r = γ.
                for stretch in
                    [DVec3::new(s, 1.0, 1.0), DVec3::new(s, s, 1.0), DVec3::new(s, 1.0 / s, 1.0), DVec3::splat(s)]
                {
                    let found = law.stress(DMat3::from_diagonal(stretch));
                    let exact = principal_work(law, stretch) / stretch;
                    let found = DVec3::new(found.x_axis.x, found.y_axis.y, found.z_axis.z);
                    // Where the wall acts, a pressure comes on top, the same in all directions.
                    let more = (exact - found) * stretch / stretch.element_product();
                    let acts = matches!(law, Law::Stiffening(_)) && stretch.element_product() < 0.7;
                    let wall = if acts { more.x } else { 0.0 };
                    let is_exact = (more - DVec3::splat(wall)).length() < 1e-12 * (1.0 + exact.length());
                    assert!(is_exact && wall >= 0.0, "{law:?} {stretch} {found} {exact}");
                }
            }
        }
    }

    #[test]
    fn an_ogden_law_with_exponent_2_is_neo_hookean_and_a_falling_one_is_found_unstable() {
        let f = DMat3::from_cols(DVec3::new(1.1, 0.2, 0.0), DVec3::new(-0.1, 0.8, 0.3), DVec3::new(0.0, 0.1, 1.3));
        let ogden = Law::Ogden { mu: [0.7, 0.0], alpha: [2.0, 1.0], kappa: 3.0 };
        let neo = Law::NeoHookean(NeoHookean { mu: 0.7, kappa: 3.0 });
        assert!(squared(ogden.stress(f) - neo.stress(f)).sqrt() < 1e-12);
        assert!(laws()[2..].iter().all(Law::is_stable));
        assert!(!Law::Ogden { mu: [2.0, -1.3], alpha: [1.0, 4.0], kappa: 3.0 }.is_stable());
    }
}
