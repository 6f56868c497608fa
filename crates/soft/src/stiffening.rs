//! A law that stiffens with strain, more under compression than in tension, without eigenvalues.
//!
//! # Theory
//! ```text
//! W = s μ/2 (g I₁ - 3) + A/(17 q ε) (v^q - 1) + κ U(J)        B = h cofᵀF cof F,  h = J^(-4/3)
//! v = 1 + ε (tr B¹⁷ - 3)      q = 1/16      A = (1 - s) μ/34
//! P = s μ g F + 2 h (cof F Q) ⨯ F + (h' tr(Q cofᵀF cof F) + s μ/2 g' I₁ + κ U') cof F
//! Q = A v^(q-1) B¹⁶            ⨯ the cross product of matrices, of which cof F = ½ F ⨯ F
//! ```
//! The eigenvalues of B are `λ_i^(-2)`, so that `tr B¹⁷ = Σ λ_i^(-34)`: for ε = 0 this is a term of
//! Ogden's law with the exponent -34, which makes compression stiffer than tension. ε bounds its
//! stiffening: far from rest `v^q` grows as `λ^(-2 17 q)`, little more than the second invariant of
//! Mooney and Rivlin. Ogden's law with an exponent near -20 fits brain as well, and at half the
//! height demands a thousand times the stress that was ever measured there. The principal stresses
//! are ordered as the stretches (Baker and Ericksen), whatever the constants. With
//! `t = max(1, tr B/3)` and `N = B/t` no power overflows: `Q = A (t w)^(1/16)/w N¹⁶`,
//! `w = (1 - 3ε) t⁻¹⁷ + ε tr N¹⁷`.
//!
//! # Sources
//! Form chosen here for the curves of Budday et al., Acta Biomater. 48 (2017), 319-340, tension,
//! compression and shear at once. Cross product of matrices: Bonet, Gil and Ortigosa, Comput.
//! Methods Appl. Mech. Eng. 283 (2015).
//!
//! # When not to use it
//! Where a whole body may be turned inside out. A block comes back from a twentieth of its height
//! and with a tenth of its elements inside out, but not mirrored whole, from which a neo-Hookean
//! one does (`cargo xtask validate tled --quick`, its map). Ogden's law comes back from less.

use crate::energy::{NeoHookean, VolumeWall, cofactor, cofactor_change, dot, power, volumetric};
use glam::DMat3;

/// Exponent n - 1 of B in the stress; the principal stretches have -2 n.
pub const STIFFENING_POWER: i32 = 16;

/// The stiffening law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffening {
    /// Shear modulus μ at small strain, MPa.
    pub mu: f64,
    /// Share s of the shear modulus that is neo-Hookean, 0 to 1.
    pub share: f64,
    /// Bound ε of the stiffening, over 0 and at most 0.3.
    pub bound: f64,
    /// Bulk modulus κ, MPa.
    pub kappa: f64,
}

/// What energy and stress are made of.
struct Powers {
    /// N, N², N⁴, N⁸ and N¹⁶.
    n: [DMat3; 5],
    t: f64,
    w: f64,
}

impl Stiffening {
    /// Coefficient A of the stiffening term, MPa.
    pub fn coefficient(&self) -> f64 {
        (1.0 - self.share) * self.mu / f64::from(2 * STIFFENING_POWER + 2)
    }

    /// Its part without stiffening and without resistance to a change of volume.
    fn round(&self) -> NeoHookean {
        NeoHookean { mu: self.share * self.mu, kappa: 0.0 }
    }

    fn powers(&self, b: DMat3) -> Powers {
        let t = ((b.x_axis.x + b.y_axis.y + b.z_axis.z) / 3.0).max(1.0);
        let mut n = [b * t.recip(); 5];
        (1..5).for_each(|k| n[k] = n[k - 1] * n[k - 1]);
        let w = (1.0 - 3.0 * self.bound) * t.powi(-STIFFENING_POWER - 1) + self.bound * dot(n[4], n[0]);
        Powers { n, t, w }
    }

    /// Q over N¹⁶.
    fn factor(&self, Powers { t, w, .. }: &Powers) -> f64 {
        self.coefficient() * (t * w).powf(1.0 / f64::from(STIFFENING_POWER)) / w
    }

    /// Energy per rest volume, N mm/mm³.
    pub fn energy(&self, f: DMat3) -> f64 {
        let c = cofactor(f);
        let Powers { t, w, .. } = self.powers(c.transpose() * c * power(f.determinant(), -4.0 / 3.0)[0]);
        let order = f64::from(STIFFENING_POWER);
        // v^q - 1 without loss near v = 1.
        let grown = (((order + 1.0) * t.ln() + w.ln()) / order).exp_m1();
        self.coefficient() * order / ((order + 1.0) * self.bound) * grown
            + self.round().energy(f)
            + self.kappa * volumetric(f.determinant(), VolumeWall::STIFFENING)[0]
    }

    /// First Piola-Kirchhoff stress P, MPa.
    pub fn stress(&self, f: DMat3) -> DMat3 {
        let c = cofactor(f);
        let (gram, [h, dh, _]) = (c.transpose() * c, power(f.determinant(), -4.0 / 3.0));
        let powers = self.powers(gram * h);
        let q = powers.n[4] * self.factor(&powers);
        let pressure = self.kappa * volumetric(f.determinant(), VolumeWall::STIFFENING)[1];
        cofactor_change(f, c * q * (2.0 * h)) + c * (dh * dot(q, gram) + pressure) + self.round().stress(f)
    }

    /// The change of the stress, `∂P/∂F : dF`, for a change `df`, MPa.
    pub fn stress_change(&self, f: DMat3, df: DMat3) -> DMat3 {
        let (c, dc) = (cofactor(f), cofactor_change(f, df));
        let (gram, dgram, dj) = (c.transpose() * c, dc.transpose() * c + c.transpose() * dc, dot(c, df));
        let [h, dh, ddh] = power(f.determinant(), -4.0 / 3.0);
        let powers = self.powers(gram * h);
        // Q does not depend on t, which only scales: it counts as constant.
        let mut change = (gram * (dh * dj) + dgram * h) * powers.t.recip();
        let dw = self.bound * f64::from(STIFFENING_POWER + 1) * dot(powers.n[4], change);
        powers.n[..4].iter().for_each(|n| change = *n * change + change * *n);
        let (factor, share) = (self.factor(&powers), 1.0 - 1.0 / f64::from(STIFFENING_POWER));
        let q = powers.n[4] * factor;
        let dq = change * factor - q * (share * dw / powers.w);
        let through = c * q * (2.0 * h);
        let dthrough = c * q * (2.0 * dh * dj) + (dc * q + c * dq) * (2.0 * h);
        let [_, pressure, dpressure] = volumetric(f.determinant(), VolumeWall::STIFFENING);
        let along = dh * dot(q, gram) + self.kappa * pressure;
        let dalong = (ddh * dot(q, gram) + self.kappa * dpressure) * dj + dh * (dot(dq, gram) + dot(q, dgram));
        cofactor_change(df, through)
            + cofactor_change(f, dthrough)
            + dc * along
            + c * dalong
            + self.round().stress_change(f, df)
    }
}
