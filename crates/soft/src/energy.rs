//! Neo-Hookean energy, stress and tangent in f64, finite for every deformation, turned over or not.
//!
//! # Theory
//! ```text
//! W(F) = μ/2 (g(J) I₁ - 3) + κ U(J)      g(J) = J^(-2/3) for J ≥ J₀, its tangent line below
//! P    = ∂W/∂F = μ g F + q C             q = μ/2 g' I₁ + κ U',   C = cof F = ∂J/∂F
//! U'   = J - 1 - w² (1 + b w²)           w = (J₁ - J)/J₁ between 0 and 1
//! ```
//! With `g = J^(-2/3)` throughout, W is infinite at J = 0 and undefined beyond. Continued linearly
//! below `J₀ = 0.3` it stays once differentiable, and its force always pushes J back towards 1: an
//! inverted element heals by itself. That line has no wall at J = 0, which the law itself has, so
//! `w² (1 + b w²)` stands in ([`VolumeWall`]): with `J₁ = J₀` and b = 4 a pressure up to 5 κ,
//! from J₀ down to 0 and constant beyond. With `w²` alone single elements under a probe 8 mm deep
//! still inverted. It acts along C alone. A steeper g would pull an inverted element towards F = 0,
//! and a body turned inside out would not come back.
//!
//! # Sources
//! The split energy is the one of Miller, Joldes, Lance and Wittek 2007 (TLED); continuing an
//! energy linearly beyond a threshold follows the idea of Irving, Teran and Fedkiw 2004.

use glam::{DMat3, DVec3};

/// Volume ratio below which the isochoric factor continues along its tangent line.
pub const FADE_BELOW: f64 = 0.3;

/// Pressure `κ w² (1 + b w²)` that keeps elements from inversion, w = (J₁ - J)/J₁ between 0 and 1.
/// Both are numerical choices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeWall {
    /// Volume ratio J₁ below which it resists.
    pub below: f64,
    /// Part b.
    pub steepening: f64,
}

impl VolumeWall {
    /// That of the laws that do not stiffen.
    pub const USUAL: Self = Self { below: FADE_BELOW, steepening: 4.0 };
    /// That of the law that stiffens. It resists a change of shape with many times κ, so elements
    /// would give up their volume instead: with the usual wall, those of 0.7 mm under a ball of
    /// 2 mm, pressed in by 5 to 6 mm, inverted 20,000 times, with this one never.
    pub const STIFFENING: Self = Self { below: 0.7, steepening: 16.0 };
}

/// The compressible neo-Hookean law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeoHookean {
    /// Shear modulus μ, MPa.
    pub mu: f64,
    /// Bulk modulus κ, MPa.
    pub kappa: f64,
}

impl NeoHookean {
    /// Energy per rest volume, N mm/mm³.
    pub fn energy(&self, f: DMat3) -> f64 {
        let j = f.determinant();
        let [g, ..] = power(j, -2.0 / 3.0);
        0.5 * self.mu * (g * squared(f) - 3.0) + self.kappa * volumetric(j, VolumeWall::USUAL)[0]
    }

    /// First Piola-Kirchhoff stress P, MPa.
    pub fn stress(&self, f: DMat3) -> DMat3 {
        let j = f.determinant();
        let [g, dg, _] = power(j, -2.0 / 3.0);
        f * (self.mu * g) + cofactor(f) * self.volumetric(f, j, dg)
    }

    /// The change of the stress, `∂P/∂F : dF`, for a change `df`, MPa.
    pub fn stress_change(&self, f: DMat3, df: DMat3) -> DMat3 {
        let j = f.determinant();
        let [g, dg, ddg] = power(j, -2.0 / 3.0);
        let c = cofactor(f);
        let (fd, cd) = (dot(f, df), dot(c, df));
        let along_c = self.mu * dg * fd
            + (0.5 * self.mu * ddg * squared(f) + self.kappa * volumetric(j, VolumeWall::USUAL)[2]) * cd;
        df * (self.mu * g) + f * (self.mu * dg * cd) + c * along_c + cofactor_change(f, df) * self.volumetric(f, j, dg)
    }

    fn volumetric(&self, f: DMat3, j: f64, dg: f64) -> f64 {
        0.5 * self.mu * dg * squared(f) + self.kappa * volumetric(j, VolumeWall::USUAL)[1]
    }
}

/// `J^n` with its first two derivatives, continued along its tangent line below [`FADE_BELOW`].
pub(crate) fn power(j: f64, n: f64) -> [f64; 3] {
    let at = j.max(FADE_BELOW);
    let g = at.powf(n);
    let dg = n * g / at;
    if j < FADE_BELOW { [g + dg * (j - at), dg, 0.0] } else { [g, dg, n * (n - 1.0) * g / (at * at)] }
}

/// Energy U of a change of volume for κ = 1, with its first two derivatives.
pub(crate) fn volumetric(j: f64, VolumeWall { below, steepening }: VolumeWall) -> [f64; 3] {
    let short = ((below - j) / below).clamp(0.0, 1.0);
    let squared = short * short;
    let wall = below * short * squared * (1.0 / 3.0 + steepening / 5.0 * squared) - (1.0 + steepening) * j.min(0.0);
    let change = if j > 0.0 { short / below * (2.0 + 4.0 * steepening * squared) } else { 0.0 };
    [0.5 * (j - 1.0).powi(2) + wall, j - 1.0 - squared * (1.0 + steepening * squared), 1.0 + change]
}

/// Cofactor matrix, the gradient of the determinant: `cof F = J F⁻ᵀ`, defined for singular F too.
pub fn cofactor(f: DMat3) -> DMat3 {
    DMat3::from_cols(f.y_axis.cross(f.z_axis), f.z_axis.cross(f.x_axis), f.x_axis.cross(f.y_axis))
}

pub(crate) fn cofactor_change(f: DMat3, df: DMat3) -> DMat3 {
    let mixed = |a: DVec3, b: DVec3, da: DVec3, db: DVec3| da.cross(b) + a.cross(db);
    DMat3::from_cols(
        mixed(f.y_axis, f.z_axis, df.y_axis, df.z_axis),
        mixed(f.z_axis, f.x_axis, df.z_axis, df.x_axis),
        mixed(f.x_axis, f.y_axis, df.x_axis, df.y_axis),
    )
}

pub(crate) fn dot(a: DMat3, b: DMat3) -> f64 {
    a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.z_axis.dot(b.z_axis)
}

pub(crate) fn squared(f: DMat3) -> f64 {
    dot(f, f)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LAW: NeoHookean = NeoHookean { mu: 0.7, kappa: 3.0 };

    proptest! {
        #[test]
        fn stress_is_the_gradient_of_the_energy_and_the_tangent_that_of_the_stress(
            entries in proptest::array::uniform9(-1.5f64..1.5), change in proptest::array::uniform9(-1.0f64..1.0),
        ) {
            let (f, df) = (DMat3::from_cols_array(&entries), DMat3::from_cols_array(&change));
            prop_assume!([FADE_BELOW, 0.0].iter().all(|at| (f.determinant() - at).abs() > 1e-3));
            let h = 1e-6;
            let slope = (LAW.energy(f + df * h) - LAW.energy(f - df * h)) / (2.0 * h);
            prop_assert!((slope - dot(LAW.stress(f), df)).abs() < 1e-4 * (1.0 + slope.abs()));
            let turn = (LAW.stress(f + df * h) - LAW.stress(f - df * h)) * (0.5 / h);
            let error = squared(turn - LAW.stress_change(f, df)).sqrt();
            prop_assert!(error < 1e-4 * (1.0 + squared(turn).sqrt()));
        }

        #[test]
        fn an_element_turned_inside_out_is_pushed_back(stretch in proptest::array::uniform3(0.2f64..1.5)) {
            let f = DMat3::from_diagonal(DVec3::new(-stretch[0], stretch[1], stretch[2]));
            let pushed = f - LAW.stress(f) * 1e-6;
            prop_assert!(pushed.determinant() > f.determinant());
        }
    }

    #[test]
    fn the_rest_state_is_free_of_stress_and_has_the_small_strain_moduli() {
        assert!(squared(LAW.stress(DMat3::IDENTITY)) < 1e-28);
        let shear = DMat3::from_cols(DVec3::ZERO, DVec3::X, DVec3::ZERO);
        let found = LAW.stress_change(DMat3::IDENTITY, shear + shear.transpose());
        assert!((found.y_axis.x - 2.0 * LAW.mu).abs() < 1e-12);
        let swell = LAW.stress_change(DMat3::IDENTITY, DMat3::IDENTITY);
        assert!((swell.x_axis.x - 3.0 * LAW.kappa).abs() < 1e-12);
    }
}
