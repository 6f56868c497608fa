//! Dry friction on top of spring and damper: the tool sticks, then slips.
//!
//! # Theory
//! ```text
//! F = Fₙ n - kₜ s ,   s = tangential way of the tip from its anchor
//! |kₜ s| ≤ μₛ Fₙ      sticks: the anchor stays
//! |kₜ s| > μₛ Fₙ      slips: the anchor follows so that |kₜ s| = μ Fₙ until the tip turns or rests
//! ```
//! The friction cone of Ruspini's proxy, with the anchor in the part of the proxy. The normal part
//! is [`Viscoelastic`].
//!
//! # Practice
//! kₜ N/mm; μ without unit. Steel on wet bone is about 0.2 to 0.3 (uncalibrated). The anchor is
//! forgotten when contact ends. Coefficients of 0 leave the normal part as it is. While the pedal
//! is down there is no friction: a spinning burr cuts and does not stick.
//!
//! # Sources
//! D. Ruspini, K. Kolarov, O. Khatib, *The haptic display of complex graphical environments*,
//! SIGGRAPH 1997; V. Hayward, B. Armstrong, *A new computational model of friction applied to
//! haptic rendering*, ISER 1999.

use crate::{ContactManifold, ForceModel, Viscoelastic};
use trepan_geometry::{Buttons, ToolState, Vec3, Wrench};
use trepan_measurements::drilling;

/// Spring, damper and Coulomb friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// The normal part.
    pub normal: Viscoelastic,
    /// Stiffness kₜ of sticking, N/mm.
    pub tangential_stiffness: f32,
    /// Friction coefficient μₛ at which sticking ends.
    pub sticking: f32,
    /// Friction coefficient μ while slipping; at most `sticking`.
    pub slipping: f32,
    anchor: Option<Vec3>,
    slips: bool,
}

impl Friction {
    /// Friction on a normal part; `sticking` and `slipping` are its coefficients.
    pub fn new(normal: Viscoelastic, tangential_stiffness: f32, sticking: f32, slipping: f32) -> Self {
        Self { normal, tangential_stiffness, sticking, slipping, anchor: None, slips: false }
    }

    /// The tangential force, N, for a normal force of `pressure` N, and the new anchor.
    fn drag(&mut self, tip: Vec3, normal: Vec3, pressure: f32) -> Vec3 {
        let anchor = *self.anchor.get_or_insert(tip);
        let way = (tip - anchor).reject_from_normalized(normal);
        let pull = self.tangential_stiffness * way.length();
        self.slips = pull > pressure * if self.slips { self.slipping } else { self.sticking };
        let limit = pressure * if self.slips { self.slipping.min(self.sticking) } else { self.sticking };
        let kept = if pull > limit { way * (limit / pull) } else { way };
        self.anchor = Some(tip - kept);
        -self.tangential_stiffness * kept
    }
}

impl Default for Friction {
    /// A steel ball on wet bone.
    fn default() -> Self {
        Self::new(Viscoelastic::BONE, 1.0, drilling::STICKING_FRICTION.f32(), drilling::SLIPPING_FRICTION.f32())
    }
}

impl ForceModel for Friction {
    fn wrench(&mut self, tool: &ToolState, manifold: &ContactManifold, dt_ms: f32) -> Wrench {
        let pressed = self.normal.wrench(tool, manifold, dt_ms);
        let spins = tool.buttons.has(Buttons::PEDAL);
        if self.sticking <= 0.0 || spins || pressed.force == Vec3::ZERO || !tool.tip().is_finite() {
            self.reset();
            return pressed;
        }
        let drag = self.drag(tool.tip(), manifold.normal, pressed.force.length());
        let wrench = pressed + Wrench { force: drag, torque: (manifold.point - tool.tip()).cross(drag) };
        if wrench.is_finite() { wrench } else { Wrench::ZERO }
    }

    fn reset(&mut self) {
        (self.anchor, self.slips) = (None, false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Contact;
    use trepan_geometry::Pose;

    fn touch() -> ContactManifold {
        ContactManifold::single(Contact { normal: Vec3::Z, depth_mm: 0.5, point: Vec3::ZERO })
    }

    fn dragged(model: &mut Friction, x: f32) -> Vec3 {
        model.wrench(&ToolState::at(Pose::from_translation(Vec3::X * x)), &touch(), 1.0).force
    }

    #[test]
    fn it_sticks_within_the_cone_and_slips_at_the_lower_coefficient() {
        let mut model = Friction::default();
        assert_eq!(dragged(&mut model, 0.0), Vec3::Z);
        assert!((dragged(&mut model, 0.25) - Vec3::new(-0.25, 0.0, 1.0)).length() < 1e-6, "sticks");
        assert!((dragged(&mut model, 0.35) - Vec3::new(-0.2, 0.0, 1.0)).length() < 1e-6, "slips");
        assert!((dragged(&mut model, 1.0) - Vec3::new(-0.2, 0.0, 1.0)).length() < 1e-6, "goes on slipping");
        assert!((dragged(&mut model, 0.9) - Vec3::new(-0.1, 0.0, 1.0)).length() < 1e-6, "turns back and sticks");
    }

    #[test]
    fn without_a_coefficient_or_with_the_burr_spinning_only_the_normal_part_is_left() {
        let tool = |x: f32, buttons| ToolState { buttons, ..ToolState::at(Pose::from_translation(Vec3::X * x)) };
        let mut none = Friction::new(Viscoelastic::BONE, 1.0, 0.0, 0.0);
        let touch = ContactManifold::single(Contact { normal: Vec3::Z, depth_mm: 0.5, point: Vec3::ZERO });
        let mut normal = Viscoelastic::BONE;
        for x in [0.0, 0.4] {
            let plain = normal.wrench(&tool(x, Buttons(0)), &touch, 1.0);
            assert_eq!(none.wrench(&tool(x, Buttons(0)), &touch, 1.0), plain);
            assert_eq!(Friction::default().wrench(&tool(x, Buttons::PEDAL), &touch, 1.0), plain);
        }
    }

    #[test]
    fn leaving_forgets_the_anchor() {
        let mut model = Friction::default();
        dragged(&mut model, 0.0);
        model.wrench(&ToolState::at(Pose::IDENTITY), &ContactManifold::default(), 1.0);
        assert_eq!(dragged(&mut model, 5.0), Vec3::Z);
    }
}
