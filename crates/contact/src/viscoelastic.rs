//! Spring and damper along the normal: the default force of bone and tissue.
//!
//! # Theory
//! ```text
//! F = max(0, k p - b v·n) n        v velocity of the tool at the contact point
//! ```
//! The thesis's Eq 3.3 with the sign of the viscous part put right: it opposes the motion. The cut
//! at zero keeps it from pulling the tool into the surface when the hand leaves fast. Only the
//! normal part is damped, so that sliding stays free.
//!
//! # Practice
//! `k` in N/mm, `b` in N ms/mm (= N s/m). A sampled wall on a device with own damping `b₀` is
//! stable for `k < (b₀ + b) / (T/2 + delay)`: 2 N/mm at 1 ms without delay asks for 1 N ms/mm. Too
//! much `b` is unstable in its turn.
//!
//! # Sources
//! J. E. Colgate, G. Schenkel, *Passivity of a class of sampled-data systems*, J. Robotic Systems
//! 14 (1997); J. J. Gil et al., *Stability analysis of a 1 DOF haptic interface using the
//! Routh-Hurwitz criterion*, IEEE Trans. Control Syst. Technol. 12 (2004).
//!
//! # When not to use it
//! For friction: it pushes along the normal only.

use crate::{ContactManifold, ForceModel};
use trepan_geometry::{ToolState, Wrench};
use trepan_measurements::{drilling, hands};

/// `F = k p n - b vₙ n`, never pulling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viscoelastic {
    /// Stiffness k, N/mm.
    pub stiffness: f32,
    /// Damping b along the normal, N ms/mm.
    pub damping: f32,
}

impl Viscoelastic {
    /// Bone: the thesis's 2 N/mm, with the damping that makes it stable at 1 kHz without delay.
    pub const BONE: Self =
        Self { stiffness: drilling::CONTACT_STIFFNESS.f32(), damping: drilling::CONTACT_DAMPING.f32() };

    /// Brain: the thesis's 0.3 N/mm, lightly damped.
    pub const BRAIN: Self = Self { stiffness: hands::TISSUE_STIFFNESS.f32(), damping: hands::TISSUE_DAMPING.f32() };
}

impl Default for Viscoelastic {
    fn default() -> Self {
        Self::BONE
    }
}

impl ForceModel for Viscoelastic {
    fn wrench(&mut self, tool: &ToolState, manifold: &ContactManifold, _dt_ms: f32) -> Wrench {
        let leaving = tool.velocity_at(manifold.point).dot(manifold.normal);
        pressed(tool, manifold, self.stiffness * manifold.depth_mm - self.damping * leaving)
    }
}

/// The wrench of a force of `size` N along the manifold's normal: nothing for no contact, a pull,
/// or what is not finite.
pub(crate) fn pressed(tool: &ToolState, manifold: &ContactManifold, size: f32) -> Wrench {
    let force = manifold.normal * size;
    let wrench = Wrench { force, torque: (manifold.point - tool.tip()).cross(force) + size * manifold.couple_mm };
    if manifold.touches() && size > 0.0 && wrench.is_finite() { wrench } else { Wrench::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Contact;
    use proptest::prelude::*;
    use trepan_geometry::{Pose, Twist, Vec3};

    fn tool(linear: Vec3) -> ToolState {
        ToolState { twist: Twist { linear, angular: Vec3::ZERO }, ..ToolState::at(Pose::IDENTITY) }
    }

    #[test]
    fn the_viscous_part_opposes_motion_and_never_pulls() {
        let mut model = Viscoelastic { stiffness: 2.0, damping: 1.0 };
        let manifold = ContactManifold::single(Contact { normal: Vec3::Z, depth_mm: 0.1, point: Vec3::ZERO });
        assert!((model.wrench(&tool(Vec3::NEG_Z * 0.1), &manifold, 1.0).force.z - 0.3).abs() < 1e-6);
        assert!((model.wrench(&tool(Vec3::Z * 0.1), &manifold, 1.0).force.z - 0.1).abs() < 1e-6);
        assert_eq!(model.wrench(&tool(Vec3::Z * 5.0), &manifold, 1.0).force, Vec3::ZERO);
        assert!((model.wrench(&tool(Vec3::X * 5.0), &manifold, 1.0).force - Vec3::Z * 0.2).length() < 1e-6);
    }

    #[test]
    fn a_contact_on_the_shaft_gives_torque() {
        let manifold = ContactManifold::single(Contact { normal: Vec3::X, depth_mm: 0.5, point: Vec3::Z * 20.0 });
        let wrench = Viscoelastic { stiffness: 2.0, damping: 0.0 }.wrench(&tool(Vec3::ZERO), &manifold, 1.0);
        assert_eq!((wrench.force, wrench.torque), (Vec3::X, Vec3::Y * 20.0));
    }

    #[test]
    fn a_couple_turns_the_tool_in_proportion_to_the_force() {
        let mut manifold = ContactManifold::single(Contact { normal: Vec3::X, depth_mm: 0.5, point: Vec3::ZERO });
        manifold.couple_mm = Vec3::Y * 20.0;
        let wrench = Viscoelastic { stiffness: 2.0, damping: 0.0 }.wrench(&tool(Vec3::ZERO), &manifold, 1.0);
        assert_eq!((wrench.force, wrench.torque), (Vec3::X, Vec3::Y * 20.0));
    }

    proptest! {
        #[test]
        fn any_manifold_gives_a_finite_push(n in prop::array::uniform3(any::<f32>()), p in prop::array::uniform3(any::<f32>()),
                                           depth in any::<f32>(), v in prop::array::uniform3(any::<f32>())) {
            let manifold = ContactManifold::single(Contact { normal: n.into(), depth_mm: depth, point: p.into() });
            let wrench = Viscoelastic::default().wrench(&tool(v.into()), &manifold, 1.0);
            prop_assert!(wrench.is_finite());
            let along = wrench.force.as_dvec3().dot(manifold.normal.as_dvec3());
            prop_assert!(wrench == Wrench::ZERO || along >= 0.0);
        }
    }
}
