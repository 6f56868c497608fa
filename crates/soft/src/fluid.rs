//! What surrounds a body: a fluid that carries it up to a level, and anchors to a rigid wall.
//!
//! # Theory
//! A body of nearly the fluid's density has no weight below the level and its own above it. With
//! `h = x·up - level` the share of a node that is dry, and with it the acceleration, is
//! ```text
//! s = clamp(h / 4 mm + 1/2, 0, 1)     a = s weight
//! ```
//! An anchor is a linear spring between a node and its place at rest, along a normal and across it.
//! A share of it holds only as far as the node is in fluid: a film between body and wall can
//! neither thin nor thicken while no air gets in. So with `w = 1 - s share`
//! ```text
//! f = -w (k_along (u·n) n + k_across (u - (u·n) n)) + p A n
//! ```
//! p is the pressure inside the wall less that outside, A the node's area in an opening.
//!
//! # Practice
//! [`trepan-tled`](https://docs.rs/trepan-tled) takes both; other solvers know gravity alone.

use trepan_geometry::Vec3;

/// Height over which tissue passes from floating to its whole weight, mm.
pub const LEVEL_BAND_MM: f32 = 4.0;

/// A fluid that carries a body below its level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fluid {
    /// Unit vector against gravity.
    pub up: Vec3,
    /// Height of the level, mm along `up` from the origin of world space.
    pub level_mm: f32,
    /// Acceleration of what lies above the level, mm/ms²; zero = none.
    pub weight: Vec3,
    /// Pressure inside the wall less that outside, MPa; pushes anchored nodes of an opening out.
    pub opening_mpa: f32,
}

/// No weight and no pressure.
impl Default for Fluid {
    fn default() -> Self {
        Self { up: Vec3::Z, level_mm: f32::MAX, weight: Vec3::ZERO, opening_mpa: 0.0 }
    }
}

impl Fluid {
    /// Share of a place that is above the level, 0 to 1.
    #[inline(always)]
    pub fn dryness(&self, place: Vec3) -> f32 {
        ((place.dot(self.up) - self.level_mm) / LEVEL_BAND_MM + 0.5).clamp(0.0, 1.0)
    }
}

/// Springs that hold a node near its place at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Anchor {
    /// The node.
    pub node: u32,
    /// Unit vector out of the body, or any axis.
    pub normal: Vec3,
    /// Stiffness along the normal, both ways, N/mm.
    pub along: f32,
    /// Stiffness across the normal, N/mm.
    pub across: f32,
    /// Share of both that holds only below the level of the [`Fluid`], 0 to 1.
    pub in_fluid: f32,
    /// Area of an opening on which [`Fluid::opening_mpa`] pushes along the normal, mm².
    pub open_mm2: f32,
}

impl Anchor {
    /// Whether every field is finite and nothing is negative.
    pub(crate) fn is_sound(&self) -> bool {
        let numbers = [self.along, self.across, self.in_fluid, self.open_mm2];
        numbers.iter().all(|x| *x >= 0.0 && x.is_finite()) && self.in_fluid <= 1.0 && self.normal.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tissue_gains_its_weight_over_the_band_around_the_level() {
        let fluid = Fluid { up: Vec3::Y, level_mm: 10.0, ..Fluid::default() };
        let at = |y: f32| fluid.dryness(Vec3::new(50.0, y, -3.0));
        assert_eq!([7.9, 10.0, 11.0, 12.1].map(at), [0.0, 0.5, 0.75, 1.0]);
        assert_eq!(Fluid::default().dryness(Vec3::splat(1e6)), 0.0);
    }
}
