//! Symmetric 3×3 matrices in registers, as xx, yy, zz, xy, xz, yz.

use crate::principal::Symmetric;
use trepan_soft::simd::Lane;

/// `AᵀA`, A given by rows.
#[inline(always)]
pub(crate) fn gram<L: Lane>([a, b, c]: &[[L; 3]; 3]) -> Symmetric<L> {
    [
        a[0] * a[0] + b[0] * b[0] + c[0] * c[0],
        a[1] * a[1] + b[1] * b[1] + c[1] * c[1],
        a[2] * a[2] + b[2] * b[2] + c[2] * c[2],
        a[0] * a[1] + b[0] * b[1] + c[0] * c[1],
        a[0] * a[2] + b[0] * b[2] + c[0] * c[2],
        a[1] * a[2] + b[1] * b[2] + c[1] * c[2],
    ]
}

/// `A²`.
#[inline(always)]
pub(crate) fn square<L: Lane>(&[xx, yy, zz, xy, xz, yz]: &Symmetric<L>) -> Symmetric<L> {
    let (pxy, pxz, pyz) = (xy * xy, xz * xz, yz * yz);
    [
        xx * xx + pxy + pxz,
        yy * yy + pxy + pyz,
        zz * zz + pxz + pyz,
        (xx + yy) * xy + xz * yz,
        (xx + zz) * xz + xy * yz,
        (yy + zz) * yz + xy * xz,
    ]
}

/// The cross product `A ⨯ B` of matrices, which is twice the cofactor for A = B.
#[inline(always)]
pub(crate) fn cross<L: Lane>(a: &Symmetric<L>, b: &Symmetric<L>) -> Symmetric<L> {
    let two = L::splat(2.0);
    [
        a[1] * b[2] + a[2] * b[1] - two * a[5] * b[5],
        a[0] * b[2] + a[2] * b[0] - two * a[4] * b[4],
        a[0] * b[1] + a[1] * b[0] - two * a[3] * b[3],
        a[4] * b[5] + a[5] * b[4] - a[3] * b[2] - a[2] * b[3],
        a[3] * b[5] + a[5] * b[3] - a[4] * b[1] - a[1] * b[4],
        a[3] * b[4] + a[4] * b[3] - a[5] * b[0] - a[0] * b[5],
    ]
}

/// A times a number.
#[inline(always)]
pub(crate) fn scale<L: Lane>(a: &Symmetric<L>, by: L) -> Symmetric<L> {
    [a[0] * by, a[1] * by, a[2] * by, a[3] * by, a[4] * by, a[5] * by]
}

/// `tr A`.
#[inline(always)]
pub(crate) fn trace<L: Lane>(a: &Symmetric<L>) -> L {
    a[0] + a[1] + a[2]
}

/// `tr(A B)`.
#[inline(always)]
pub(crate) fn trace_of_product<L: Lane>(a: &Symmetric<L>, b: &Symmetric<L>) -> L {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + L::splat(2.0) * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
}
