//! Bound on the stiffness of a deformed element, from which the stable step is updated.
//!
//! # Theory
//! The tangent `∂P/∂F` of `P = F S + (q + κ (J̄-1-p)) C` is at most
//! `A = Σ|S_ij| + (κ (1 - p') + 5/9 μ I₁ J₀^(-8/3)) λ_max(CᵀC) + |q + κ (J̄-1-p)| √I₁`: the
//! stress itself, the resistance to a change of volume, and its rotation. The largest eigenvalue of
//! a symmetric 3×3 matrix B is at most `m + 2 p`, `m = tr B/3`, `p² = |B - m I|²/6`, and exactly
//! that when two are equal. At rest S is `s I` and q is `-s`, so that
//! `A(rest) = (3 + √3) |s| + κ + 5/3 μ`. The element's ω² at rest grows by `A/A(rest)`.
//!
//! # Practice
//! About 50 operations an element. For Ogden's and Mooney-Rivlin's laws the second term is that of
//! a neo-Hookean solid with the same moduli; their additional stiffening is in the first term. The
//! stiffening law, whose tangent is many times its stress, gives a bound of its own in addition.

use crate::law::{Deformation, Stress};
use trepan_soft::simd::{Lane, dot, squared};

/// The bound A times rest volume, N mm. It takes isochoric stress, μ V and κ V, and `J̄ - 1 - p`
/// with the slope of p against -J.
#[inline(always)]
pub(crate) fn stiffness<L: Lane>(
    stress: &Stress<L>,
    (mu, kappa): (L, L),
    d: &Deformation<L>,
    (volume_change, slope): (L, L),
) -> L {
    let [xx, yy, zz, xy, xz, yz] = stress.s;
    let off = magnitude(xy) + magnitude(xz) + magnitude(yz);
    let itself = magnitude(xx) + magnitude(yy) + magnitude(zz) + off + off;
    let inverse = d.root * d.root * d.root;
    let power = inverse * inverse * d.root * d.root;
    let i1 = squared(&d.f);
    let volume = kappa * (L::splat(1.0) + slope) + L::splat(5.0 / 9.0) * mu * i1 * power;
    let turning = magnitude(stress.q + kappa * volume_change) * i1.sqrt();
    itself + stress.stiffening + volume * largest_eigenvalue(&d.c) + turning
}

/// The bound at rest times rest volume. `stress` is the multiple of the unit tensor that the
/// isochoric stress is there.
#[inline(always)]
pub(crate) fn stiffness_at_rest<L: Lane>((stress, stiffening): (L, L), (mu, kappa): (L, L)) -> L {
    L::splat(3.0 + 3f32.sqrt()) * magnitude(stress) + stiffening + kappa + L::splat(5.0 / 3.0) * mu
}

/// Upper bound of the largest eigenvalue of `CᵀC`, C given by rows.
#[inline(always)]
fn largest_eigenvalue<L: Lane>([a, b, c]: &[[L; 3]; 3]) -> L {
    let (xx, yy, zz) = (dot(a, a), dot(b, b), dot(c, c));
    let (xy, xz, yz) = (dot(a, b), dot(a, c), dot(b, c));
    let mean = (xx + yy + zz) * L::splat(1.0 / 3.0);
    let (dx, dy, dz) = (xx - mean, yy - mean, zz - mean);
    let off = xy * xy + xz * xz + yz * yz;
    let deviation = (dx * dx + dy * dy + dz * dz + off + off) * L::splat(1.0 / 6.0);
    mean + L::splat(2.0) * deviation.sqrt()
}

#[inline(always)]
fn magnitude<L: Lane>(x: L) -> L {
    x.with_sign_of(L::splat(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::deformation;
    use crate::law::{Constitutive, MooneyRivlin, NeoHookean, Ogden, StVenantKirchhoff, Stiffening};
    use glam::{DMat3, DVec3};
    use proptest::prelude::*;
    use trepan_soft::Law;

    const STIFFENING: Law = Law::Stiffening(trepan_soft::Stiffening { mu: 1.0, share: 0.3, bound: 0.02, kappa: 9.0 });

    fn at_rest<M: Constitutive<K>, const K: usize>(law: Law) -> [f32; 2] {
        let constants = M::constants(&law, 1.0);
        let rest = deformation(&[[0.0; 3]; 3], &[[0.0; 3]; 3]);
        let moduli = M::moduli(&constants);
        let general = stiffness(&M::stress(&constants, &rest), moduli, &rest, (0.0, 0.0));
        [general, stiffness_at_rest(M::at_rest(&constants), moduli)]
    }

    #[test]
    fn the_bound_at_rest_is_the_general_one_without_displacement() {
        let cases = [
            at_rest::<NeoHookean, 2>(Law::NeoHookean(trepan_soft::NeoHookean { mu: 1.0, kappa: 9.0 })),
            at_rest::<StVenantKirchhoff, 2>(Law::StVenantKirchhoff { lambda: 7.0, mu: 2.0 }),
            at_rest::<MooneyRivlin, 3>(Law::MooneyRivlin { c10: 0.3, c01: 0.2, kappa: 9.0 }),
            at_rest::<Ogden, 5>(Law::Ogden { mu: [0.8, 0.2], alpha: [-4.7, 2.0], kappa: 9.0 }),
            at_rest::<Stiffening, 4>(STIFFENING),
        ];
        for [general, closed] in cases {
            assert!((general / closed - 1.0).abs() < 1e-5, "{general} {closed}");
        }
    }

    fn bound<M: Constitutive<K>, const K: usize>(law: &Law, d: &Deformation<f32>) -> f32 {
        let constants = M::constants(law, 1.0);
        let (resistance, slope) = d.resistance(M::WALL);
        stiffness(&M::stress(&constants, d), M::moduli(&constants), d, (d.j - 1.0 - resistance, slope))
    }

    proptest! {
        #[test]
        fn no_direction_is_stiffer_than_the_bound(x in proptest::array::uniform9(-1.2f32..1.2), n in proptest::array::uniform6(-1.0f64..1.0)) {
            let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let d = deformation(&[[x[0], x[1], x[2]], [x[3], x[4], x[5]], [x[6], x[7], x[8]]], &unit);
            let round = Law::NeoHookean(trepan_soft::NeoHookean { mu: 1.0, kappa: 9.0 });
            let f = DMat3::from_cols_array(&[
                d.f[0][0], d.f[1][0], d.f[2][0], d.f[0][1], d.f[1][1], d.f[2][1], d.f[0][2], d.f[1][2], d.f[2][2],
            ].map(f64::from));
            let (a, b) = (DVec3::new(n[0], n[1], n[2]).normalize_or_zero(), DVec3::new(n[3], n[4], n[5]).normalize_or_zero());
            let change = DMat3::from_cols(a * b.x, a * b.y, a * b.z);
            for (law, bound) in [(round, bound::<NeoHookean, 2>(&round, &d)), (STIFFENING, bound::<Stiffening, 4>(&STIFFENING, &d))] {
                let along = law.stress_change(f, change);
                let computed = along.x_axis.dot(change.x_axis) + along.y_axis.dot(change.y_axis) + along.z_axis.dot(change.z_axis);
                prop_assert!(computed <= f64::from(bound) * 1.0001, "{law:?} {computed} {bound}");
            }
        }
    }
}
