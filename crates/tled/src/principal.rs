//! Eigenvalues and eigenvectors of symmetric 3×3 matrices, several at once, without branches.
//!
//! # Theory
//! Jacobi's method: each rotation makes one off-diagonal entry zero,
//! `t = 2 a_pq / (d ± √(d² + 4 a_pq²))`, `d = a_qq - a_pp`, with the sign of d; four sweeps reach
//! f32 precision. Equal eigenvalues need no special case.

use trepan_soft::simd::Lane;

/// A symmetric tensor as xx, yy, zz, xy, xz, yz.
pub(crate) type Symmetric<L> = [L; 6];

/// Computes eigenvalues and unit eigenvectors, unsorted.
#[inline(always)]
pub(crate) fn principal<L: Lane>(a: &Symmetric<L>) -> ([L; 3], [[L; 3]; 3]) {
    let [mut xx, mut yy, mut zz, mut xy, mut xz, mut yz] = *a;
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let (mut u, mut v, mut w) = ([one, zero, zero], [zero, one, zero], [zero, zero, one]);
    for _ in 0..4 {
        let (c, s) = rotation(&mut xx, &mut yy, &mut xy);
        (xz, yz) = turned(xz, yz, c, s);
        (u, v) = turned_axes(&u, &v, c, s);
        let (c, s) = rotation(&mut xx, &mut zz, &mut xz);
        (xy, yz) = turned(xy, yz, c, s);
        (u, w) = turned_axes(&u, &w, c, s);
        let (c, s) = rotation(&mut yy, &mut zz, &mut yz);
        (xy, xz) = turned(xy, xz, c, s);
        (v, w) = turned_axes(&v, &w, c, s);
    }
    ([xx, yy, zz], [u, v, w])
}

/// Rotates so that `pq` becomes zero; returns cosine and sine.
#[inline(always)]
fn rotation<L: Lane>(pp: &mut L, qq: &mut L, pq: &mut L) -> (L, L) {
    let (one, two) = (L::splat(1.0), L::splat(2.0));
    let apart = *qq - *pp;
    let twice = two * *pq;
    let root = (apart * apart + twice * twice).sqrt() + L::splat(1e-30);
    let t = twice / (apart + root.with_sign_of(apart));
    let change = t * *pq;
    *pp = *pp - change;
    *qq = *qq + change;
    *pq = L::splat(0.0);
    let c = one / (one + t * t).sqrt();
    (c, t * c)
}

#[inline(always)]
fn turned<L: Lane>(p: L, q: L, c: L, s: L) -> (L, L) {
    (c * p - s * q, s * p + c * q)
}

#[inline(always)]
fn turned_axes<L: Lane>(p: &[L; 3], q: &[L; 3], c: L, s: L) -> ([L; 3], [L; 3]) {
    let (p0, q0) = turned(p[0], q[0], c, s);
    let (p1, q1) = turned(p[1], q[1], c, s);
    let (p2, q2) = turned(p[2], q[2], c, s);
    ([p0, p1, p2], [q0, q1, q2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Mat3, Vec3};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_matrix_is_rebuilt_from_its_principal_axes(x in proptest::array::uniform6(-2.0f32..2.0)) {
            let (values, [u, v, w]) = principal(&x);
            let axes = Mat3::from_cols(Vec3::from(u), Vec3::from(v), Vec3::from(w));
            let back = axes * Mat3::from_diagonal(Vec3::from(values)) * axes.transpose();
            let given = Mat3::from_cols_array(&[x[0], x[3], x[4], x[3], x[1], x[5], x[4], x[5], x[2]]);
            prop_assert!((back - given).to_cols_array().iter().all(|e| e.abs() < 2e-6));
        }
    }

    #[test]
    fn equal_eigenvalues_and_zero_are_no_special_case() {
        for scale in [0.0, 1.0, 1e-12] {
            let (values, axes) = principal(&[scale, scale, scale, 0.0, 0.0, 0.0]);
            assert_eq!(values, [scale; 3]);
            assert!(axes.iter().flatten().all(|a| a.is_finite()));
        }
    }
}
