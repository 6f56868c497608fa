//! The force of one tetrahedron, or of eight at once.
//!
//! # Theory
//! ```text
//! H = Σ_a (u_a - u_0) ⊗ ∇N_a, a = 1..3     F = I + H     C = cof F     J = det F
//! P = μ g F + q C      q = μ/2 g' I₁ + κ (J - 1)      g = J^(-2/3), continued linearly below J = 0.3
//! f_a = -V P ∇N_a, a = 1..3                 f_0 = -(f_1 + f_2 + f_3)
//! ```
//! The linear continuation needs no branch: with `J₀ = max(J, 0.3)`, `g = J₀^(-2/3) + g'(J₀) (J - J₀)`.

use crate::lane::Lane;

/// What an element's force depends on: differences of displacement, gradients, moduli times volume.
#[derive(Clone, Copy)]
pub(crate) struct Element<L> {
    /// `u_a - u_0` for a = 1..3, mm.
    pub edges: [[L; 3]; 3],
    /// `∇N_a` for a = 1..3, 1/mm.
    pub gradients: [[L; 3]; 3],
    /// μ V, N mm.
    pub mu_volume: L,
    /// κ V, N mm.
    pub kappa_volume: L,
}

impl<L: Lane> Element<L> {
    /// Forces on nodes 1 to 3, N, and the volume ratio J.
    #[inline(always)]
    pub fn forces(&self) -> ([[L; 3]; 3], L) {
        let f = self.deformation();
        let c = cofactor(&f);
        let j = dot(&f[0], &c[0]);
        let clamped = j.at_least(trepan_soft::FADE_BELOW as f32);
        let root = clamped.inverse_cube_root();
        let power = root * root;
        let slope = power * (power * root) * L::splat(-2.0 / 3.0);
        let g = power + slope * (j - clamped);
        let squared = dot(&f[0], &f[0]) + dot(&f[1], &f[1]) + dot(&f[2], &f[2]);
        let along_f = self.mu_volume * g;
        let along_c = self.mu_volume * L::splat(0.5) * slope * squared + self.kappa_volume * (j - L::splat(1.0));
        let stress = [0, 1, 2].map(|r| [0, 1, 2].map(|k| L::splat(0.0) - (along_f * f[r][k] + along_c * c[r][k])));
        (self.gradients.map(|g| [dot(&stress[0], &g), dot(&stress[1], &g), dot(&stress[2], &g)]), j)
    }

    /// Rows of F.
    #[inline(always)]
    fn deformation(&self) -> [[L; 3]; 3] {
        let (e, g) = (&self.edges, &self.gradients);
        [0, 1, 2].map(|r| {
            [0, 1, 2].map(|k| {
                let h = e[0][r] * g[0][k] + e[1][r] * g[1][k] + e[2][r] * g[2][k];
                if r == k { h + L::splat(1.0) } else { h }
            })
        })
    }
}

#[inline(always)]
fn dot<L: Lane>(a: &[L; 3], b: &[L; 3]) -> L {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross<L: Lane>(a: &[L; 3], b: &[L; 3]) -> [L; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Rows of cof F: each is the cross product of the other two rows.
#[inline(always)]
fn cofactor<L: Lane>(f: &[[L; 3]; 3]) -> [[L; 3]; 3] {
    [cross(&f[1], &f[2]), cross(&f[2], &f[0]), cross(&f[0], &f[1])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec3};
    use proptest::prelude::*;
    use trepan_soft::{NeoHookean, Shape};
    use wide::f32x8;

    const CORNERS: [DVec3; 4] =
        [DVec3::new(0.0, 0.0, 0.0), DVec3::new(8.0, 1.0, 0.0), DVec3::new(-1.0, 7.0, 2.0), DVec3::new(1.0, 2.0, 6.0)];

    fn element(edges: [[f32; 3]; 3]) -> Element<f32> {
        let shape = Shape::of(CORNERS);
        let gradients = [1, 2, 3].map(|a| shape.gradients[a].as_vec3().to_array());
        let volume = shape.volume_mm3 as f32;
        Element { edges, gradients, mu_volume: 0.001 * volume, kappa_volume: 0.01 * volume }
    }

    proptest! {
        #[test]
        fn forces_are_those_of_the_f64_law_also_when_turned_over(x in proptest::array::uniform9(-6.0f32..6.0)) {
            let edges = [[x[0], x[1], x[2]], [x[3], x[4], x[5]], [x[6], x[7], x[8]]];
            let (found, j) = element(edges).forces();
            let shape = Shape::of(CORNERS);
            let u = |a: usize| DVec3::from_array(edges[a].map(f64::from));
            let f = DMat3::IDENTITY + shape.gradient_of([DVec3::ZERO, u(0), u(1), u(2)]);
            let exact = shape.forces_of(NeoHookean { mu: 0.001, kappa: 0.01 }.stress(f));
            let scale = 1e-3 + exact.iter().map(|f| f.length()).fold(0.0, f64::max);
            prop_assert!((f64::from(j) - f.determinant()).abs() < 1e-4 * (1.0 + f.determinant().abs()));
            for a in 0..3 {
                let found = DVec3::from_array(found[a].map(f64::from));
                prop_assert!((found + exact[a + 1]).length() < 1e-4 * scale, "{found} {}", -exact[a + 1]);
            }
        }

        #[test]
        fn eight_lanes_give_the_bits_of_one(x in proptest::array::uniform9(-9.0f32..9.0)) {
            let edges = [[x[0], x[1], x[2]], [x[3], x[4], x[5]], [x[6], x[7], x[8]]];
            let one = element(edges);
            let eight = Element {
                edges: one.edges.map(|e| e.map(f32x8::splat)),
                gradients: one.gradients.map(|g| g.map(f32x8::splat)),
                mu_volume: f32x8::splat(one.mu_volume),
                kappa_volume: f32x8::splat(one.kappa_volume),
            };
            let ((one, j), (eight, jj)) = (one.forces(), eight.forces());
            prop_assert_eq!(jj.to_array(), [j; 8]);
            for (one, eight) in one.iter().flatten().zip(eight.iter().flatten()) {
                prop_assert_eq!(eight.to_array().map(f32::to_bits), [one.to_bits(); 8]);
            }
        }
    }
}
