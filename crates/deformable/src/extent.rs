//! Boxes for the inner loops: built from corners, compared with few instructions.
//!
//! # Practice
//! The same box as [`Aabb`], its corners in four-lane registers: SSE2, NEON or WebAssembly's, by
//! glam. A comparison with NaN is false and a minimum with NaN on the left is the right side, so a
//! NaN corner neither grows a box nor lies in one.

use glam::Vec3A;
use trepan_geometry::{Aabb, Vec3};

/// A closed box, mm; empty when a `low` exceeds its `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// The lowest corner.
    pub low: Vec3A,
    /// The highest corner.
    pub high: Vec3A,
}

impl Extent {
    /// Holds nothing.
    pub const EMPTY: Self = Self { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };
    /// Holds every point.
    pub const EVERYWHERE: Self = Self { low: Vec3A::NEG_INFINITY, high: Vec3A::INFINITY };

    /// The box of some points.
    #[inline]
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> Self {
        let mut extent = Self::EMPTY;
        for p in points {
            extent.grow(*p);
        }
        extent
    }

    /// Takes in a point.
    #[inline]
    pub fn grow(&mut self, p: Vec3) {
        let p = Vec3A::from(p);
        (self.low, self.high) = (p.min(self.low), p.max(self.high));
    }

    /// The box of two boxes.
    #[inline]
    pub fn merge(&mut self, other: &Self) {
        (self.low, self.high) = (other.low.min(self.low), other.high.max(self.high));
    }

    /// Whether two boxes meet; an empty one meets none.
    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        let meet = self.low.cmple(other.high) & other.low.cmple(self.high);
        (meet & self.low.cmple(self.high) & other.low.cmple(other.high)).all()
    }

    /// Whether a point lies inside.
    #[inline]
    pub fn contains(&self, p: Vec3) -> bool {
        let p = Vec3A::from(p);
        (self.low.cmple(p) & p.cmple(self.high)).all()
    }

    /// Whether `other` lies inside.
    pub fn holds(&self, other: &Self) -> bool {
        (self.low.cmple(other.low) & other.high.cmple(self.high)).all()
    }

    /// What two boxes share.
    pub fn shared(&self, other: &Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.min(other.high) }
    }

    /// This box, moved outwards on all sides.
    #[inline]
    pub fn widened(&self, margin: f32) -> Self {
        Self { low: self.low - margin, high: self.high + margin }
    }

    /// The furthest that a side lies outside where it was; 0 for an empty box, since it holds
    /// nothing that could be missed.
    pub fn moved_from(&self, before: &Self) -> f32 {
        let most = (before.low - self.low).max(self.high - before.high).max_element().max(0.0);
        if most.is_finite() { most } else { 0.0 }
    }

    /// Squared distance of a point from the box, mm²; infinite for an empty one.
    #[inline]
    pub fn distance2(&self, p: Vec3) -> f32 {
        let p = Vec3A::from(p);
        (self.low - p).max(p - self.high).max(Vec3A::ZERO).length_squared()
    }
}

impl From<Aabb> for Extent {
    fn from(aabb: Aabb) -> Self {
        Self { low: aabb.min.into(), high: aabb.max.into() }
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
