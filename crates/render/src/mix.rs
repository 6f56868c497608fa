//! Interpolation between grid points.

use glam::{Vec3, Vec3A};
use std::array;
use std::ops::{Add, Mul, Sub};

/// The minimum of two non-NaN numbers in one instruction; `min` also handles NaN.
#[inline(always)]
pub(crate) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The maximum of two non-NaN numbers.
#[inline(always)]
pub(crate) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The minimum of three non-NaN numbers.
#[inline(always)]
pub(crate) fn least(of: Vec3A) -> f32 {
    lesser(lesser(of.x, of.y), of.z)
}

/// The maximum of three non-NaN numbers.
#[inline(always)]
pub(crate) fn greatest(of: Vec3A) -> f32 {
    greater(greater(of.x, of.y), of.z)
}

/// Trilinear interpolation between values at integer coordinates, clamped at the border.
#[inline(always)]
pub(crate) fn trilinear<V: Mix>(dims: [usize; 3], at: Vec3, value: impl Fn(usize) -> V) -> V {
    let strides = [1, dims[0], dims[0] * dims[1]];
    let places = array::from_fn(|n| between(at[n], dims[n], strides[n]));
    // A grid of one layer has no next one.
    mixed(places, array::from_fn(|n| if dims[n] > 1 { strides[n] } else { 0 }), value)
}

/// Types that can be interpolated.
pub(crate) trait Mix: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<f32, Output = Self> {}
impl<V: Copy + Add<Output = V> + Sub<Output = V> + Mul<f32, Output = V>> Mix for V {}

/// Index of the value before a coordinate and the weight of the next; the axis has `count` values
/// `stride` apart, clamped.
#[inline(always)]
pub(crate) fn between(x: f32, count: usize, stride: usize) -> (usize, f32) {
    let last = count - 1;
    let x = lesser(greater(x, 0.0), last as f32);
    // Truncation equals rounding down for non-negative values; the library's `floor` is a call.
    let low = (x as i32 as usize).min(last.saturating_sub(1));
    (low * stride, x - low as f32)
}

/// Interpolates the values around indices along three axes by their weights.
#[inline(always)]
pub(crate) fn mixed<V: Mix>(
    [(x, u), (y, v), (z, w)]: [(usize, f32); 3],
    next: [usize; 3],
    value: impl Fn(usize) -> V,
) -> V {
    // Written out: closures within closures become calls.
    let (lower, upper) = (x + y + z, x + y + z + next[2]);
    let [a, b, c, d] = [value(lower), value(lower + next[0]), value(lower + next[1]), value(lower + next[0] + next[1])];
    let [e, f, g, h] = [value(upper), value(upper + next[0]), value(upper + next[1]), value(upper + next[0] + next[1])];
    let (ab, cd, ef, gh) = (a + (b - a) * u, c + (d - c) * u, e + (f - e) * u, g + (h - g) * u);
    let (near, far) = (ab + (cd - ab) * v, ef + (gh - ef) * v);
    near + (far - near) * w
}
