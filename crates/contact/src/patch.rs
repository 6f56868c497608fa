//! The tissue's surface near the tool, as the haptic tick needs it between two collision results: a
//! tangent plane.
//!
//! # Theory
//! The tool moves at 1 kHz and more, a collision step against tissue may take longer. Between two
//! results the tick holds on to the last tangent plane and measures its own, current depth against
//! it (the intermediate representation of Adachi, Kumano and Ogino 1995):
//! `depth(tip) = depth₀ + (tip₀ - tip)·n`. So the force follows the hand without the delay of a
//! held force.
//!
//! # When not to use it
//! Far from `tip_mm`: past a few tip radii the plane says nothing. A stale plane must fade: its age
//! is the user's to check.

use trepan_geometry::Vec3;

/// A tangent plane to the tissue near the tool. Plain data, 64 bytes, copied whole between threads.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfacePatch {
    /// When the tool pose of this result was read, session ms.
    pub time_ms: f64,
    /// Unit vector out of the tissue; zero when the tool did not touch.
    pub normal: Vec3,
    /// The tip (the tool's origin) that `depth_mm` belongs to, world mm.
    pub tip_mm: Vec3,
    /// Depth at that tip, mm; positive inside, 0 when the tool did not touch.
    pub depth_mm: f32,
    /// Normal velocity of the tissue there, mm/ms, along `normal`.
    pub normal_velocity: f32,
    /// Slip of the tool on the tissue since it last stuck, at that tip, mm; zero without friction.
    pub slip_mm: Vec3,
    /// Moment about the tip for each newton along `normal`, mm: what the shaft adds.
    pub couple_mm: Vec3,
}

impl SurfacePatch {
    /// Depth of a tool whose tip has moved to `tip`, mm; 0 outside.
    pub fn depth_at(&self, tip: Vec3) -> f32 {
        if self.depth_mm <= 0.0 {
            return 0.0;
        }
        (self.depth_mm + (self.tip_mm - tip).dot(self.normal)).max(0.0)
    }

    /// Slip of a tool whose tip has moved to `tip`, mm, across the normal.
    pub fn slip_at(&self, tip: Vec3) -> Vec3 {
        let way = self.slip_mm + (tip - self.tip_mm);
        way - way.dot(self.normal) * self.normal
    }

    /// Adds a second contact of the same tool, `arm_mm` from its tip, which turns the tool. Two
    /// equal springs pull like one along the sum of their depths.
    #[must_use]
    pub fn with(&self, normal: Vec3, depth_mm: f32, arm_mm: Vec3) -> Self {
        let second = normal * depth_mm.max(0.0);
        let sum = self.normal * self.depth_mm.max(0.0) + second;
        let normal = sum.try_normalize().unwrap_or(Vec3::ZERO);
        let (normal_velocity, depth_mm) = (self.normal_velocity * self.normal.dot(normal), sum.dot(normal));
        let couple_mm = if depth_mm > 0.0 { arm_mm.cross(second) / depth_mm } else { Vec3::ZERO };
        Self { normal, depth_mm, normal_velocity, couple_mm, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_contacts_pull_like_their_sum() {
        let tip = SurfacePatch { normal: Vec3::Z, depth_mm: 0.3, normal_velocity: 0.1, ..SurfacePatch::default() };
        let both = tip.with(Vec3::X, 0.4, Vec3::Z * 10.0);
        assert!((both.normal * both.depth_mm - Vec3::new(0.4, 0.0, 0.3)).length() < 1e-6);
        // 0.4 mm at 10 mm from the tip, of 0.5 mm together.
        assert!((both.couple_mm - Vec3::Y * 8.0).length() < 1e-5, "{}", both.couple_mm);
        let free = tip.with(Vec3::X, 0.0, Vec3::Z);
        assert_eq!((free.depth_mm, free.normal, free.couple_mm), (0.3, Vec3::Z, Vec3::ZERO));
        assert_eq!(SurfacePatch::default().with(Vec3::X, 0.2, Vec3::ZERO).depth_mm, 0.2);
        assert_eq!(tip.with(Vec3::NEG_Z, 0.3, Vec3::X).couple_mm, Vec3::ZERO);
    }

    #[test]
    fn slip_follows_the_tip_across_the_normal_only() {
        let patch = SurfacePatch { normal: Vec3::Z, slip_mm: Vec3::X * 0.1, ..SurfacePatch::default() };
        assert!((patch.slip_at(Vec3::new(0.2, 0.5, 3.0)) - Vec3::new(0.3, 0.5, 0.0)).length() < 1e-6);
    }

    #[test]
    fn depth_follows_the_tip_along_the_normal_only() {
        let patch = SurfacePatch { normal: Vec3::Z, depth_mm: 0.5, ..SurfacePatch::default() };
        assert_eq!(patch.depth_at(Vec3::new(3.0, 1.0, -0.25)), 0.75);
        assert_eq!(patch.depth_at(Vec3::new(0.0, 0.0, 2.0)), 0.0);
        assert_eq!(SurfacePatch::default().depth_at(Vec3::NEG_Z), 0.0);
    }
}
