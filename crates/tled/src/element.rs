//! Nodal forces of one tetrahedron, or of several at once.
//!
//! # Theory
//! ```text
//! H = Σ_a (u_a - u_0) ⊗ ∇N_a, a = 1..3     F = I + H     C = cof F     J = det F
//! P = F S + (q + κ (J̄ - 1 - p)) C      f_a = -V P ∇N_a, a = 1..3     f_0 = -(f_1 + f_2 + f_3)
//! ```
//! S and q come from the material. J̄ is J, or with averaged pressure the mean volume ratio of the
//! corners' node groups; p resists inversion (`law.rs`).

use crate::law::{Deformation, Stress};
use trepan_soft::simd::{Lane, dot};

/// Computes the deformation from `u_a - u_0` and ∇N_a, a = 1..3.
#[inline(always)]
pub(crate) fn deformation<L: Lane>(edges: &[[L; 3]; 3], gradients: &[[L; 3]; 3]) -> Deformation<L> {
    let (f, one) = (displacement_gradient(edges, gradients), L::splat(1.0));
    let [[f00, f01, f02], [f10, f11, f12], [f20, f21, f22]] = f;
    let f = [[f00 + one, f01, f02], [f10, f11 + one, f12], [f20, f21, f22 + one]];
    let c = cofactor(&f);
    with_ratio(f, c, dot(&f[0], &c[0]))
}

/// The deformation with these rows of F and this det F.
#[inline(always)]
pub(crate) fn deformation_of<L: Lane>(f: [[L; 3]; 3], j: L) -> Deformation<L> {
    with_ratio(f, cofactor(&f), j)
}

/// Rows of cof F.
#[inline(always)]
fn cofactor<L: Lane>(f: &[[L; 3]; 3]) -> [[L; 3]; 3] {
    [cross(&f[1], &f[2]), cross(&f[2], &f[0]), cross(&f[0], &f[1])]
}

#[inline(always)]
fn with_ratio<L: Lane>(f: [[L; 3]; 3], c: [[L; 3]; 3], j: L) -> Deformation<L> {
    let clamped = j.at_least(trepan_soft::FADE_BELOW as f32);
    Deformation { f, c, j, clamped, root: clamped.inverse_cube_root() }
}

/// Forces on nodes 1 to 3, N, from stress times volume; `q` includes the volumetric part.
#[inline(always)]
pub(crate) fn forces<L: Lane>(
    stress: &Stress<L>,
    round: bool,
    d: &Deformation<L>,
    gradients: &[[L; 3]; 3],
) -> [[L; 3]; 3] {
    let rows = if round {
        [scaled(stress, &d.f[0], &d.c[0]), scaled(stress, &d.f[1], &d.c[1]), scaled(stress, &d.f[2], &d.c[2])]
    } else {
        [
            multiplied(stress, &d.f[0], &d.c[0]),
            multiplied(stress, &d.f[1], &d.c[1]),
            multiplied(stress, &d.f[2], &d.c[2]),
        ]
    };
    [times(&rows, &gradients[0]), times(&rows, &gradients[1]), times(&rows, &gradients[2])]
}

/// Rows of the displacement gradient H.
#[inline(always)]
fn displacement_gradient<L: Lane>([a, b, c]: &[[L; 3]; 3], [g, h, i]: &[[L; 3]; 3]) -> [[L; 3]; 3] {
    [moved(a[0], b[0], c[0], g, h, i), moved(a[1], b[1], c[1], g, h, i), moved(a[2], b[2], c[2], g, h, i)]
}

#[inline(always)]
fn moved<L: Lane>(a: L, b: L, c: L, g: &[L; 3], h: &[L; 3], i: &[L; 3]) -> [L; 3] {
    [a * g[0] + b * h[0] + c * i[0], a * g[1] + b * h[1] + c * i[1], a * g[2] + b * h[2] + c * i[2]]
}

/// A row of `-V P` where S is a multiple of the unit tensor.
#[inline(always)]
fn scaled<L: Lane>(stress: &Stress<L>, f: &[L; 3], c: &[L; 3]) -> [L; 3] {
    let (zero, s, q) = (L::splat(0.0), stress.s[0], stress.q);
    [zero - (s * f[0] + q * c[0]), zero - (s * f[1] + q * c[1]), zero - (s * f[2] + q * c[2])]
}

/// A row of `-V P` for any S.
#[inline(always)]
fn multiplied<L: Lane>(stress: &Stress<L>, f: &[L; 3], c: &[L; 3]) -> [L; 3] {
    let (zero, q) = (L::splat(0.0), stress.q);
    let [xx, yy, zz, xy, xz, yz] = stress.s;
    [
        zero - (f[0] * xx + f[1] * xy + f[2] * xz + q * c[0]),
        zero - (f[0] * xy + f[1] * yy + f[2] * yz + q * c[1]),
        zero - (f[0] * xz + f[1] * yz + f[2] * zz + q * c[2]),
    ]
}

#[inline(always)]
fn times<L: Lane>(rows: &[[L; 3]; 3], v: &[L; 3]) -> [L; 3] {
    [dot(&rows[0], v), dot(&rows[1], v), dot(&rows[2], v)]
}

#[inline(always)]
fn cross<L: Lane>(a: &[L; 3], b: &[L; 3]) -> [L; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Constitutive, MooneyRivlin, NeoHookean, Ogden, StVenantKirchhoff, Stiffening};
    use glam::{DMat3, DVec3};
    use proptest::prelude::*;
    use trepan_soft::{Law, Shape};
    use wide::f32x8;

    const CORNERS: [DVec3; 4] =
        [DVec3::new(0.0, 0.0, 0.0), DVec3::new(8.0, 1.0, 0.0), DVec3::new(-1.0, 7.0, 2.0), DVec3::new(1.0, 2.0, 6.0)];

    fn of_law<L: Lane, M: Constitutive<K>, const K: usize>(law: &Law, edges: [[f32; 3]; 3]) -> [[L; 3]; 3] {
        let shape = Shape::of(CORNERS);
        let gradients = [1, 2, 3].map(|a| shape.gradients[a].as_vec3().to_array().map(L::splat));
        let constants = M::constants(law, shape.volume_mm3).map(L::splat);
        let d = deformation(&edges.map(|e| e.map(L::splat)), &gradients);
        let mut stress = M::stress(&constants, &d);
        stress.q = stress.q + M::moduli(&constants).1 * (d.j - L::splat(1.0) - d.resistance(M::WALL).0);
        forces(&stress, M::ROUND, &d, &gradients)
    }

    fn by_kernel<L: Lane>(law: &Law, edges: [[f32; 3]; 3]) -> [[L; 3]; 3] {
        match law {
            Law::NeoHookean(_) => of_law::<L, NeoHookean, 2>(law, edges),
            Law::StVenantKirchhoff { .. } => of_law::<L, StVenantKirchhoff, 2>(law, edges),
            Law::MooneyRivlin { .. } => of_law::<L, MooneyRivlin, 3>(law, edges),
            Law::Ogden { .. } => of_law::<L, Ogden, 5>(law, edges),
            Law::Stiffening(_) => of_law::<L, Stiffening, 4>(law, edges),
        }
    }

    fn laws() -> [Law; 5] {
        [
            Law::NeoHookean(trepan_soft::NeoHookean { mu: 0.001, kappa: 0.01 }),
            Law::StVenantKirchhoff { lambda: 0.01, mu: 0.001 },
            Law::MooneyRivlin { c10: 3e-4, c01: 2e-4, kappa: 0.01 },
            Law::Ogden { mu: [8e-4, 2e-4], alpha: [-4.7, 2.0], kappa: 0.01 },
            Law::Stiffening(trepan_soft::Stiffening { mu: 0.001, share: 0.4, bound: 0.02, kappa: 0.01 }),
        ]
    }

    fn edges_of(x: [f32; 9]) -> [[f32; 3]; 3] {
        [[x[0], x[1], x[2]], [x[3], x[4], x[5]], [x[6], x[7], x[8]]]
    }

    fn exact(law: &Law, edges: [[f32; 3]; 3]) -> ([DVec3; 4], DMat3) {
        let shape = Shape::of(CORNERS);
        let u = |a: usize| DVec3::from_array(edges[a].map(f64::from));
        let f = DMat3::IDENTITY + shape.gradient_of([DVec3::ZERO, u(0), u(1), u(2)]);
        (shape.forces_of(law.stress(f)), f)
    }

    proptest! {
        #[test]
        fn forces_are_those_of_the_f64_law(x in proptest::array::uniform9(-2.5f32..2.5)) {
            for law in laws() {
                let found = by_kernel::<f32>(&law, edges_of(x));
                let (exact, f) = exact(&law, edges_of(x));
                prop_assume!(f.determinant() > 0.1);
                let scale = 1e-3 + exact.iter().map(|f| f.length()).fold(0.0, f64::max);
                for a in 0..3 {
                    let found = DVec3::from_array(found[a].map(f64::from));
                    prop_assert!((found + exact[a + 1]).length() < 1e-4 * scale, "{law:?} {found} {}", -exact[a + 1]);
                }
            }
        }

        #[test]
        fn neo_hookean_forces_are_those_of_the_f64_law_also_when_turned_over(x in proptest::array::uniform9(-6.0f32..6.0)) {
            let law = laws()[0];
            let (found, (exact, _)) = (by_kernel::<f32>(&law, edges_of(x)), exact(&law, edges_of(x)));
            let scale = 1e-3 + exact.iter().map(|f| f.length()).fold(0.0, f64::max);
            for a in 0..3 {
                let found = DVec3::from_array(found[a].map(f64::from));
                prop_assert!((found + exact[a + 1]).length() < 1e-4 * scale, "{found} {}", -exact[a + 1]);
            }
        }

        #[test]
        fn eight_lanes_give_the_bits_of_one(x in proptest::array::uniform9(-9.0f32..9.0)) {
            for law in laws() {
                let (one, eight) = (by_kernel::<f32>(&law, edges_of(x)), by_kernel::<f32x8>(&law, edges_of(x)));
                for (one, eight) in one.iter().flatten().zip(eight.iter().flatten()) {
                    prop_assert_eq!(eight.to_array().map(f32::to_bits), [one.to_bits(); 8]);
                }
            }
        }
    }
}
