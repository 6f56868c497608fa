//! Boxes for the inner loops: built from corners, compared with few instructions.
//!
//! # Practice
//! The same box as [`Aabb`], kept as six numbers and inlined. A comparison with NaN is false, so a NaN corner neither grows a
//! box nor lies in one.

use trepan_geometry::{Aabb, Vec3};

/// A closed box, mm; empty when a `low` exceeds its `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    pub low: [f32; 3],
    pub high: [f32; 3],
}

impl Extent {
    /// Holds nothing.
    pub const EMPTY: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };
    /// Holds every point.
    pub const EVERYWHERE: Self = Self { low: [f32::NEG_INFINITY; 3], high: [f32::INFINITY; 3] };

    /// The box of some points.
    #[inline]
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> Self {
        let mut extent = Self::EMPTY;
        for p in points {
            extent.grow(*p);
        }
        extent
    }

    #[inline]
    pub fn grow(&mut self, p: Vec3) {
        let ([x, y, z], [u, v, w]) = (self.low, self.high);
        let less = |new: f32, old: f32| if new < old { new } else { old };
        let more = |new: f32, old: f32| if new > old { new } else { old };
        self.low = [less(p.x, x), less(p.y, y), less(p.z, z)];
        self.high = [more(p.x, u), more(p.y, v), more(p.z, w)];
    }

    /// The box of two boxes.
    #[inline]
    pub fn merge(&mut self, other: &Self) {
        for axis in 0..3 {
            let (low, high) = (other.low[axis], other.high[axis]);
            self.low[axis] = if low < self.low[axis] { low } else { self.low[axis] };
            self.high[axis] = if high > self.high[axis] { high } else { self.high[axis] };
        }
    }

    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        let apart = |axis: usize| {
            !((self.low[axis] <= other.high[axis])
                & (other.low[axis] <= self.high[axis])
                & (self.low[axis] <= self.high[axis])
                & (other.low[axis] <= other.high[axis]))
        };
        !(apart(0) || apart(1) || apart(2))
    }

    #[inline]
    pub fn contains(&self, p: Vec3) -> bool {
        let on = |axis: usize, x: f32| (self.low[axis] <= x) & (x <= self.high[axis]);
        on(0, p.x) & on(1, p.y) & on(2, p.z)
    }

    /// Whether `other` lies inside.
    pub fn holds(&self, other: &Self) -> bool {
        (0..3).all(|axis| self.low[axis] <= other.low[axis] && other.high[axis] <= self.high[axis])
    }

    /// What two boxes share.
    pub fn shared(&self, other: &Self) -> Self {
        Self {
            low: core::array::from_fn(|axis| self.low[axis].max(other.low[axis])),
            high: core::array::from_fn(|axis| self.high[axis].min(other.high[axis])),
        }
    }

    /// This box, moved outwards on all sides.
    #[inline]
    pub fn widened(&self, margin: f32) -> Self {
        let ([x, y, z], [u, v, w]) = (self.low, self.high);
        Self { low: [x - margin, y - margin, z - margin], high: [u + margin, v + margin, w + margin] }
    }

    /// The furthest that a side lies outside where it was; 0 for an empty box, since it holds nothing that could be missed.
    pub fn moved_from(&self, before: &Self) -> f32 {
        let outside = |axis: usize| (before.low[axis] - self.low[axis]).max(self.high[axis] - before.high[axis]);
        let most = (0..3).map(outside).fold(0.0, f32::max);
        if most.is_finite() { most } else { 0.0 }
    }

    /// Squared distance of a point from the box, mm²; infinite for an empty one.
    #[inline]
    pub fn distance2(&self, p: Vec3) -> f32 {
        let outside = |axis: usize, x: f32| (self.low[axis] - x).max(x - self.high[axis]).max(0.0);
        let (x, y, z) = (outside(0, p.x), outside(1, p.y), outside(2, p.z));
        x * x + y * y + z * z
    }
}

impl From<Aabb> for Extent {
    fn from(aabb: Aabb) -> Self {
        Self { low: aabb.min.to_array(), high: aabb.max.to_array() }
    }
}

impl From<Extent> for Aabb {
    fn from(extent: Extent) -> Self {
        Self { min: extent.low.into(), max: extent.high.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_agrees_with_the_plain_box(c in prop::array::uniform9(-2.0f32..2.0), r in 0.1f32..1.0) {
            let v = |i: usize| Vec3::new(c[3 * i], c[3 * i + 1], c[3 * i + 2]);
            let (plain, ball) = (Aabb::of_points(&[v(0), v(1)]), Aabb::of_sphere(v(2), r));
            let extent = Extent::of(&[v(0), v(1)]);
            prop_assert_eq!(extent, Extent::from(plain));
            prop_assert_eq!(extent.overlaps(&ball.into()), plain.overlaps(ball));
            prop_assert_eq!(extent.contains(v(2)), plain.contains(v(2)));
            prop_assert_eq!(extent.distance2(v(2)) == 0.0, plain.contains(v(2)));
        }
    }

    #[test]
    fn nan_neither_grows_nor_is_held_and_empty_meets_nothing() {
        let mut extent = Extent::of(&[Vec3::ZERO, Vec3::ONE]);
        extent.grow(Vec3::NAN);
        extent.merge(&Extent::EMPTY);
        assert_eq!(extent, Extent::of(&[Vec3::ZERO, Vec3::ONE]));
        assert!(!extent.contains(Vec3::NAN) && !Extent::EMPTY.overlaps(&Extent::EVERYWHERE));
    }
}
