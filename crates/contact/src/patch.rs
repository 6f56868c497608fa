//! The tissue's surface near the tool, as the haptic tick needs it between two collision results: a
//! tangent plane.
//!
//! # Theory
//! The tool moves at 1 kHz and more, a collision step against tissue may take longer. Between two
//! results the tick holds on to the last force and its direction as to a tangent plane, and
//! measures its own, current depth against it (the intermediate representation of Adachi, Kumano
//! and Ogino 1995): with k the hand's stiffness, `F(tip) = F₀ + k (tip₀ - tip)·n`. So the force
//! follows the hand without the delay of a held force.
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
    /// Simulated time of the tissue in this result, ms; 0 where nobody simulates it.
    pub tissue_ms: f64,
    /// Direction of the tissue's force on the tool, a unit vector; zero when it did not touch.
    pub normal: Vec3,
    /// The tip (the tool's origin) that `force_n` belongs to, world mm.
    pub tip_mm: Vec3,
    /// Force of the tissue on the tool at that tip, N; 0 when the tool did not touch.
    pub force_n: f32,
    /// Normal velocity of the tissue there, mm/ms, along `normal`.
    pub normal_velocity: f32,
    /// Moment about the tip for each newton along `normal`, mm: of the shaft and of friction.
    pub couple_mm: Vec3,
}

impl SurfacePatch {
    /// Depth of a tool whose tip has moved to `tip`, mm, for a hand's spring of a stiffness, N/mm;
    /// 0 outside.
    pub fn depth_at(&self, tip: Vec3, stiffness: f32) -> f32 {
        if self.force_n <= 0.0 || stiffness <= 0.0 {
            return 0.0;
        }
        (self.force_n / stiffness + (self.tip_mm - tip).dot(self.normal)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_follows_the_tip_along_the_normal_only() {
        let patch = SurfacePatch { normal: Vec3::Z, force_n: 0.2, ..SurfacePatch::default() };
        assert_eq!(patch.depth_at(Vec3::new(3.0, 1.0, -0.25), 0.4), 0.75);
        assert_eq!(patch.depth_at(Vec3::new(0.0, 0.0, 2.0), 0.4), 0.0);
        assert_eq!(SurfacePatch::default().depth_at(Vec3::NEG_Z, 0.4), 0.0);
    }
}
