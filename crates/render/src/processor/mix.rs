//! Values between grid points.

use glam::{Vec3, Vec3A};
use std::array;
use std::ops::{Add, Mul, Sub};

/// The lesser of two numbers that are numbers: one instruction, where `min` also answers for NaN.
#[inline(always)]
pub(crate) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater of two numbers that are numbers.
#[inline(always)]
pub(crate) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The least of three numbers that are numbers.
#[inline(always)]
pub(crate) fn least(of: Vec3A) -> f32 {
    lesser(lesser(of.x, of.y), of.z)
}

/// The greatest of three numbers that are numbers.
#[inline(always)]
pub(crate) fn greatest(of: Vec3A) -> f32 {
    greater(greater(of.x, of.y), of.z)
}

/// Trilinear interpolation between values at whole coordinates, clamped at the border.
#[inline(always)]
pub(crate) fn trilinear<V: Mix>(dims: [usize; 3], at: Vec3, value: impl Fn(usize) -> V) -> V {
    let strides = [1, dims[0], dims[0] * dims[1]];
    let places = array::from_fn(|n| between(at[n], dims[n], strides[n]));
    // A grid of one layer has no next one.
    mixed(places, array::from_fn(|n| if dims[n] > 1 { strides[n] } else { 0 }), value)
}

/// What can be interpolated.
pub(crate) trait Mix: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<f32, Output = Self> {}
impl<V: Copy + Add<Output = V> + Sub<Output = V> + Mul<f32, Output = V>> Mix for V {}

/// Where a coordinate lies along an axis of `count` values `stride` apart, clamped: position of the
/// value before it, and the share of the next.
#[inline(always)]
pub(crate) fn between(x: f32, count: usize, stride: usize) -> (usize, f32) {
    let last = count - 1;
    let x = lesser(greater(x, 0.0), last as f32);
    // Cutting off is rounding down for what is not negative; the library's `floor` is a call.
    let low = (x as i32 as usize).min(last.saturating_sub(1));
    (low * stride, x - low as f32)
}

/// The values around places along three axes, mixed by their shares.
#[inline(always)]
pub(crate) fn mixed<V: Mix>(
    [(x, u), (y, v), (z, w)]: [(usize, f32); 3],
    next: [usize; 3],
    value: impl Fn(usize) -> V,
) -> V {
    let mix = |a: V, b: V, share: f32| a + (b - a) * share;
    let line = |start: usize| mix(value(start), value(start + next[0]), u);
    let plane = |start: usize| mix(line(start), line(start + next[1]), v);
    mix(plane(x + y + z), plane(x + y + z + next[2]), w)
}
