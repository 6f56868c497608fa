//! Constitutive laws of the kernels, in f32, for one element or several at once.
//!
//! # Theory
//! Every law is written as `P = F S + (q_iso + κ (J - 1 - p)) cof F`, S a symmetric tensor:
//! ```text
//! neo-Hookean          S = μ g I                                     q_iso = μ/2 g' I₁
//! St. Venant-Kirchhoff S = (λ tr E - μ) I + μ FᵀF                    q_iso = 0, no κ term
//! Mooney-Rivlin        S = (2 c₁₀ g + 2 c₀₁ h I₁) I - 2 c₀₁ h FᵀF    q_iso = c₁₀ g' I₁ + c₀₁ h' I₂
//! Ogden                S = Σ_i s_i n_i n_iᵀ, s_i = Σ_p μ_p'/α_p g_p λ_i^(α_p-2)   (μ' = 2 μ)
//! stiffening           S = s μ g I + 2 h Q ⨯ FᵀF        q_iso = s μ/2 g' I₁ + h' tr(Q cofᵀF cof F)
//! ```
//! `g = J^(-2/3)`, `h = J^(-4/3)`, `g_p = J^(-α_p/3)`, continued linearly below J = 0.3;
//! Q is the power of cofᵀF cof F in `stiffening.rs` of `trepan-soft`, ⨯ the cross product of
//! symmetric matrices; `p = w² (1 + b w²)` resists inversion, `w = (J₁ - J)/J₁` between 0 and 1
//! ([`VolumeWall`]).
//! Its reasons stand in `trepan_soft::Law`, the f64 version of this file.

use crate::principal::{Symmetric, principal};
use crate::symmetric::{cross, gram, scale, square, trace, trace_of_product};
use trepan_soft::simd::{Lane, squared};
use trepan_soft::{LEAST_STRETCH, Law, VolumeWall};

/// Deformation of an element as the laws need it.
#[derive(Clone, Copy)]
pub(crate) struct Deformation<L> {
    /// Rows of F.
    pub f: [[L; 3]; 3],
    /// Rows of cof F.
    pub c: [[L; 3]; 3],
    /// det F.
    pub j: L,
    /// max(J, 0.3) and its power -1/3.
    pub clamped: L,
    pub root: L,
}

/// An isochoric stress, times rest volume: `P V = F s + q cof F`.
pub(crate) struct Stress<L> {
    pub s: Symmetric<L>,
    pub q: L,
    /// Bound of the law's own stiffening beyond s, times rest volume; 0 where s shows it.
    pub stiffening: L,
}

/// Constitutive law with K constants per element.
pub(crate) trait Constitutive<const K: usize> {
    /// Constants of one element; moduli are multiplied by its rest volume, mm³.
    fn constants(law: &Law, volume_mm3: f64) -> [f32; K];
    /// Stress without the volumetric part.
    fn stress<L: Lane>(constants: &[L; K], d: &Deformation<L>) -> Stress<L>;
    /// Returns μ V and κ V, N mm. The latter multiplies `J - 1` in the volumetric part; it is zero
    /// if the law has no volumetric split.
    fn moduli<L: Lane>(constants: &[L; K]) -> (L, L);
    /// Returns the multiple of the unit tensor that s is at rest, N mm; q is its negative.
    fn stress_at_rest<L: Lane>(constants: &[L; K]) -> L;
    /// Returns [`Stress::stiffening`] at rest, N mm.
    #[inline(always)]
    fn stiffening_at_rest<L: Lane>(_: &[L; K]) -> L {
        L::splat(0.0)
    }
    /// Returns stress and stiffening at rest, N mm.
    #[inline(always)]
    fn at_rest<L: Lane>(constants: &[L; K]) -> (L, L) {
        (Self::stress_at_rest(constants), Self::stiffening_at_rest(constants))
    }
    /// Whether s is a multiple of the unit tensor, so that its other entries can be skipped.
    const ROUND: bool = false;
    /// What keeps elements from inversion.
    const WALL: VolumeWall = VolumeWall::USUAL;
}

pub(crate) struct NeoHookean;
pub(crate) struct StVenantKirchhoff;
pub(crate) struct MooneyRivlin;
pub(crate) struct Ogden;
pub(crate) struct Stiffening;

impl<L: Lane> Deformation<L> {
    /// J^n continued linearly below J = 0.3, and its slope, from `at = max(J, 0.3)^n`.
    #[inline(always)]
    fn continued(&self, at: L, n: L) -> (L, L) {
        let inverse = self.root * self.root * self.root;
        let slope = n * at * inverse;
        (at + slope * (self.j - self.clamped), slope)
    }

    /// How short of a volume ratio the element is, as a share of it, up to 1.
    #[inline(always)]
    fn short(&self, of: f64) -> L {
        let share = (L::splat(of as f32) - self.j).at_least(0.0) * L::splat((1.0 / of) as f32);
        share - (share - L::splat(1.0)).at_least(0.0)
    }

    /// Pressure that resists inversion, as a multiple of κ, and its slope against -J.
    #[inline(always)]
    pub fn resistance(&self, wall: VolumeWall) -> (L, L) {
        let short = self.short(wall.below);
        let squared = short * short;
        let steep = L::splat(wall.steepening as f32) * squared;
        let slope = short * (L::splat(2.0) + L::splat(4.0) * steep) * L::splat((1.0 / wall.below) as f32);
        (squared * (L::splat(1.0) + steep), slope)
    }

    /// `(cof F)ᵀ cof F / max(J, 0.3)`, which is J (FᵀF)⁻¹ where J is not clamped.
    #[inline(always)]
    pub fn inverse_green(&self) -> Symmetric<L> {
        let inverse = self.root * self.root * self.root;
        let [xx, yy, zz, xy, xz, yz] = gram(&self.c);
        [xx * inverse, yy * inverse, zz * inverse, xy * inverse, xz * inverse, yz * inverse]
    }
}

impl Constitutive<2> for NeoHookean {
    const ROUND: bool = true;

    fn constants(law: &Law, volume_mm3: f64) -> [f32; 2] {
        let (mu, kappa) = law.moduli();
        [mu * volume_mm3, kappa * volume_mm3].map(|c| c as f32)
    }

    #[inline(always)]
    fn stress<L: Lane>(&[mu, _]: &[L; 2], d: &Deformation<L>) -> Stress<L> {
        let zero = L::splat(0.0);
        let (g, dg) = d.continued(d.root * d.root, L::splat(-2.0 / 3.0));
        let along_f = mu * g;
        let q_iso = mu * L::splat(0.5) * dg * squared(&d.f);
        Stress { s: [along_f, along_f, along_f, zero, zero, zero], q: q_iso, stiffening: zero }
    }

    #[inline(always)]
    fn moduli<L: Lane>(constants: &[L; 2]) -> (L, L) {
        (constants[0], constants[1])
    }

    #[inline(always)]
    fn stress_at_rest<L: Lane>(constants: &[L; 2]) -> L {
        constants[0]
    }
}

impl Constitutive<2> for StVenantKirchhoff {
    fn constants(law: &Law, volume_mm3: f64) -> [f32; 2] {
        let (mu, kappa) = law.moduli();
        [(kappa - mu * 2.0 / 3.0) * volume_mm3, mu * volume_mm3].map(|c| c as f32)
    }

    #[inline(always)]
    fn stress<L: Lane>(&[lambda, mu]: &[L; 2], d: &Deformation<L>) -> Stress<L> {
        let b = gram(&d.f);
        let trace = ((b[0] - L::splat(1.0)) + (b[1] - L::splat(1.0)) + (b[2] - L::splat(1.0))) * L::splat(0.5);
        let along = lambda * trace - mu;
        let s = [along + mu * b[0], along + mu * b[1], along + mu * b[2], mu * b[3], mu * b[4], mu * b[5]];
        Stress { s, q: L::splat(0.0), stiffening: L::splat(0.0) }
    }

    #[inline(always)]
    fn moduli<L: Lane>(constants: &[L; 2]) -> (L, L) {
        (constants[0] + constants[1], L::splat(0.0))
    }

    #[inline(always)]
    fn stress_at_rest<L: Lane>(_: &[L; 2]) -> L {
        L::splat(0.0)
    }
}

impl Constitutive<3> for MooneyRivlin {
    fn constants(law: &Law, volume_mm3: f64) -> [f32; 3] {
        let Law::MooneyRivlin { c10, c01, kappa } = *law else { return [0.0; 3] };
        [c10 * volume_mm3, c01 * volume_mm3, kappa * volume_mm3].map(|c| c as f32)
    }

    #[inline(always)]
    fn stress<L: Lane>(&[c10, c01, _]: &[L; 3], d: &Deformation<L>) -> Stress<L> {
        let power = d.root * d.root;
        let (g, dg) = d.continued(power, L::splat(-2.0 / 3.0));
        let (h, dh) = d.continued(power * power, L::splat(-4.0 / 3.0));
        let (b, two) = (gram(&d.f), L::splat(2.0));
        let i1 = b[0] + b[1] + b[2];
        let second = two * c01 * h;
        let along = two * c10 * g + second * i1;
        let zero = L::splat(0.0);
        let s = [
            along - second * b[0],
            along - second * b[1],
            along - second * b[2],
            zero - second * b[3],
            zero - second * b[4],
            zero - second * b[5],
        ];
        Stress { s, q: c10 * dg * i1 + c01 * dh * squared(&d.c), stiffening: zero }
    }

    #[inline(always)]
    fn moduli<L: Lane>(constants: &[L; 3]) -> (L, L) {
        ((constants[0] + constants[1]) * L::splat(2.0), constants[2])
    }

    #[inline(always)]
    fn stress_at_rest<L: Lane>(constants: &[L; 3]) -> L {
        (constants[0] + constants[1] + constants[1]) * L::splat(2.0)
    }
}

impl Constitutive<5> for Ogden {
    fn constants(law: &Law, volume_mm3: f64) -> [f32; 5] {
        let Law::Ogden { mu, alpha, kappa } = *law else { return [0.0; 5] };
        let scale = |p: usize| if mu[p] == 0.0 { 0.0 } else { 2.0 * mu[p] / (alpha[p] * alpha[p]) * volume_mm3 };
        [scale(0), alpha[0], scale(1), alpha[1], kappa * volume_mm3].map(|c| c as f32)
    }

    #[inline(always)]
    fn stress<L: Lane>(&[scale1, alpha1, scale2, alpha2, _]: &[L; 5], d: &Deformation<L>) -> Stress<L> {
        let (squares, axes) = principal(&gram(&d.f));
        let (one, q1) = term(scale1, alpha1, &squares, d);
        let (two, q2) = term(scale2, alpha2, &squares, d);
        let along = [one[0] + two[0], one[1] + two[1], one[2] + two[2]];
        Stress { s: spread(&along, &axes), q: q1 + q2, stiffening: L::splat(0.0) }
    }

    #[inline(always)]
    fn moduli<L: Lane>(constants: &[L; 5]) -> (L, L) {
        let half = L::splat(0.5);
        let term = |scale: L, alpha: L| scale * alpha * alpha * half;
        (term(constants[0], constants[1]) + term(constants[2], constants[3]), constants[4])
    }

    #[inline(always)]
    fn stress_at_rest<L: Lane>(constants: &[L; 5]) -> L {
        constants[0] * constants[1] + constants[2] * constants[3]
    }
}

impl Constitutive<4> for Stiffening {
    const WALL: VolumeWall = VolumeWall::STIFFENING;

    fn constants(law: &Law, volume_mm3: f64) -> [f32; 4] {
        let Law::Stiffening(law) = *law else { return [0.0; 4] };
        let moduli = [law.share * law.mu, law.coefficient(), law.kappa].map(|c| (c * volume_mm3) as f32);
        [moduli[0], moduli[1], law.bound as f32, moduli[2]]
    }

    #[inline(always)]
    fn stress<L: Lane>(&[mu, coefficient, bound, _]: &[L; 4], d: &Deformation<L>) -> Stress<L> {
        let power = d.root * d.root;
        let (g, dg) = d.continued(power, L::splat(-2.0 / 3.0));
        let (h, dh) = d.continued(power * power, L::splat(-4.0 / 3.0));
        let (green, inverse) = (gram(&d.f), gram(&d.c));
        let b = scale(&inverse, h);
        let t = (trace(&b) * L::splat(1.0 / 3.0)).at_least(1.0);
        let fall = L::splat(1.0) / t;
        let n = scale(&b, fall);
        let n16 = square(&square(&square(&square(&n))));
        let fall4 = (fall * fall) * (fall * fall);
        let fall16 = (fall4 * fall4) * (fall4 * fall4);
        let w = (L::splat(1.0) - L::splat(3.0) * bound) * (fall16 * fall) + bound * trace_of_product(&n16, &n);
        let q = scale(&n16, coefficient * (t * w).sqrt().sqrt().sqrt().sqrt() / w);
        let across = scale(&cross(&q, &green), L::splat(2.0) * h);
        let (round, i1) = (mu * g, trace(&green));
        let s = [across[0] + round, across[1] + round, across[2] + round, across[3], across[4], across[5]];
        let through = trace_of_product(&q, &inverse);
        let q_iso = L::splat(0.5) * mu * dg * i1 + dh * through;
        let root3 = power * d.root;
        let swollen = through * trace(&inverse) * root3 * root3;
        Stress { s, q: q_iso, stiffening: L::splat(STIFFENING) * h * (trace(&q) * i1 + swollen) }
    }

    #[inline(always)]
    fn moduli<L: Lane>(constants: &[L; 4]) -> (L, L) {
        (constants[0] + L::splat(34.0) * constants[1], constants[3])
    }

    #[inline(always)]
    fn stress_at_rest<L: Lane>(constants: &[L; 4]) -> L {
        constants[0] + L::splat(4.0) * constants[1]
    }

    #[inline(always)]
    fn stiffening_at_rest<L: Lane>(constants: &[L; 4]) -> L {
        L::splat(18.0 * STIFFENING) * constants[1]
    }
}

/// Largest tangent of the stiffening term in a direction of rank one, found by sampling. It is over
/// `h (tr Q I₁ + tr(Q cofᵀF cof F) |cof F|²/J²)`.
const STIFFENING: f32 = 5.5;

/// One term of Ogden's law: s_i and its share of q_iso.
#[inline(always)]
fn term<L: Lane>(scale: L, alpha: L, squares: &[L; 3], d: &Deformation<L>) -> ([L; 3], L) {
    let (g, dg) = d.continued((alpha * L::splat(-1.0 / 3.0) * d.clamped.log2()).exp2(), alpha * L::splat(-1.0 / 3.0));
    let (v0, s0) = stretch_power(squares[0], alpha);
    let (v1, s1) = stretch_power(squares[1], alpha);
    let (v2, s2) = stretch_power(squares[2], alpha);
    let outer = L::splat(2.0) * scale * g;
    ([outer * s0, outer * s1, outer * s2], scale * dg * (v0 + v1 + v2))
}

/// `λ^α` as a function of λ², and its slope over λ²; the tangent line below the least stretch.
#[inline(always)]
fn stretch_power<L: Lane>(square: L, alpha: L) -> (L, L) {
    let at = square.at_least((LEAST_STRETCH * LEAST_STRETCH) as f32);
    let half = alpha * L::splat(0.5);
    let value = (half * at.log2()).exp2();
    let slope = half * value / at;
    (value + slope * (square - at), slope)
}

/// `Σ s_i n_i n_iᵀ`, n_i the columns of `axes`, given as rows here.
#[inline(always)]
fn spread<L: Lane>(s: &[L; 3], axes: &[[L; 3]; 3]) -> Symmetric<L> {
    let [a, b, c] = axes;
    [
        s[0] * a[0] * a[0] + s[1] * b[0] * b[0] + s[2] * c[0] * c[0],
        s[0] * a[1] * a[1] + s[1] * b[1] * b[1] + s[2] * c[1] * c[1],
        s[0] * a[2] * a[2] + s[1] * b[2] * b[2] + s[2] * c[2] * c[2],
        s[0] * a[0] * a[1] + s[1] * b[0] * b[1] + s[2] * c[0] * c[1],
        s[0] * a[0] * a[2] + s[1] * b[0] * b[2] + s[2] * c[0] * c[2],
        s[0] * a[1] * a[2] + s[1] * b[1] * b[2] + s[2] * c[1] * c[2],
    ]
}
