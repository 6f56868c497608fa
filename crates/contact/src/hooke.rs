//! The plain spring: force in proportion to depth.
//!
//! # Theory
//! `F = k p n` (Hooke; thesis Eq 3.2), with stiffness k, depth p and the normal n out of the
//! obstacle.
//!
//! # When not to use it
//! On a real device at high stiffness: a sampled spring without damping makes energy at every tick
//! (a passive wall needs device damping `b > K T / 2`). [`Viscoelastic`](crate::Viscoelastic) is
//! the default.

use crate::{ContactManifold, ForceModel, viscoelastic::pressed};
use trepan_geometry::{ToolState, Wrench};

/// `F = k p n`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hooke {
    /// Stiffness k, N/mm. Higher feels harder and is stable for fewer devices.
    pub stiffness: f32,
}

impl Default for Hooke {
    /// The thesis's bone: 2 N/mm.
    fn default() -> Self {
        Self { stiffness: trepan_measurements::drilling::CONTACT_STIFFNESS.f32() }
    }
}

impl ForceModel for Hooke {
    fn wrench(&mut self, tool: &ToolState, manifold: &ContactManifold, _dt_ms: f32) -> Wrench {
        pressed(tool, manifold, self.stiffness * manifold.depth_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Contact;
    use trepan_geometry::{Pose, Vec3};

    #[test]
    fn force_is_stiffness_times_depth_along_the_normal() {
        let tool = ToolState::at(Pose::IDENTITY);
        let manifold = ContactManifold::single(Contact { normal: Vec3::Y, depth_mm: 0.25, point: Vec3::ZERO });
        assert_eq!(Hooke { stiffness: 2.0 }.wrench(&tool, &manifold, 1.0).force, Vec3::Y * 0.5);
        assert_eq!(Hooke::default().wrench(&tool, &ContactManifold::default(), 1.0), Wrench::ZERO);
    }
}
