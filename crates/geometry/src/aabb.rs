//! Axis-aligned boxes.

use crate::Vec3;

/// An axis-aligned box in world mm, closed on all sides. Empty when any `min` exceeds its `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lowest corner, mm.
    pub min: Vec3,
    /// Highest corner, mm.
    pub max: Vec3,
}

impl Aabb {
    /// The empty box; the neutral element of [`Aabb::grown`].
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The bounding box of a sphere.
    #[inline]
    pub fn of_sphere(centre: Vec3, radius: f32) -> Self {
        Self { min: centre - radius, max: centre + radius }
    }

    /// The bounding box of some points; [`Aabb::EMPTY`] for none.
    pub fn of_points<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, &p| b.grown(p))
    }

    /// The box, extended to contain `point`.
    #[inline]
    pub fn grown(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The box, extended by `margin` mm on all sides.
    #[inline]
    pub fn inflated(self, margin: f32) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// The intersection of two boxes; empty if they are disjoint.
    #[inline]
    pub fn intersection(self, other: Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Whether the box contains no point. A box with a NaN corner is empty.
    #[inline]
    pub fn is_empty(self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Whether two boxes touch or overlap: not disjoint on any axis (thesis Eq 2.1, signs
    /// restored).
    #[inline]
    pub fn overlaps(self, other: Self) -> bool {
        !self.intersection(other).is_empty()
    }

    /// Whether `point` is inside or on the border.
    #[inline]
    pub fn contains(self, point: Vec3) -> bool {
        self.min.cmple(point).all() && point.cmple(self.max).all()
    }

    /// Centre of the box, mm.
    #[inline]
    pub fn centre(self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Edge lengths, mm.
    #[inline]
    pub fn size(self) -> Vec3 {
        self.max - self.min
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn boxes_that_touch_overlap_and_nan_is_empty() {
        let a = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        assert!(a.overlaps(Aabb { min: Vec3::X, max: Vec3::new(2.0, 1.0, 1.0) }));
        assert!(!a.overlaps(Aabb::of_sphere(Vec3::splat(3.0), 1.0)));
        assert!(Aabb { min: Vec3::NAN, max: Vec3::ONE }.is_empty());
        assert!(Aabb::of_points(&[]).is_empty());
    }

    proptest! {
        #[test]
        fn overlap_is_the_centre_distance_rule(c in prop::array::uniform6(-3.0f32..3.0), r1 in 0.1f32..2.0, r2 in 0.1f32..2.0) {
            let (c1, c2) = (Vec3::new(c[0], c[1], c[2]), Vec3::new(c[3], c[4], c[5]));
            let disjoint = (c1 - c2).abs().cmpgt(Vec3::splat(r1 + r2)).any();
            prop_assume!(((c1 - c2).abs() - (r1 + r2)).abs().min_element() > 1e-4);
            prop_assert_eq!(Aabb::of_sphere(c1, r1).overlaps(Aabb::of_sphere(c2, r2)), !disjoint);
        }
    }
}
