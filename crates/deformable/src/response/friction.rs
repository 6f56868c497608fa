//! Dry friction between tool and tissue: the slip since the touch, held by a tangential spring up
//! to the cone.
//!
//! # Theory
//! ```text
//! s ← s + (motion of the tool - motion of the tissue under it), tangential part
//! |k s| ≤ μ Fₙ   sticks        |k s| > μ Fₙ   slips: s is shortened to μ Fₙ / k
//! ```
//! The tissue's motion is that of the nodes that carried the load one step ago, so a tool that
//! rests on moving tissue is carried along and feels it. The tool's is that of the point of its
//! body that lay at the contact, so a turning tool rubs.
//!
//! # Practice
//! k is the contact's normal stiffness. The force on the tool is `-k s`; the nodes take the same,
//! opposite, by the weights of the normal load, so that momentum is conserved. Forgotten when
//! contact ends. For a hand at 1 kHz, `trepan_contact::Friction` does the same in the tick.
//!
//! # Sources
//! Ruspini, Kolarov and Khatib 1997 (the cone); stick and slip as Hayward and Armstrong 1999.

use crate::{outcome::TissueStep, scene::Scene};
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;

/// The slip so far, and the contact of the last step.
#[derive(Default)]
pub(crate) struct Friction {
    slip: Vec3,
    last: Option<Touch>,
}

struct Touch {
    nodal: NodalContact,
    tissue: Vec3,
    /// The contact's point in the tool's frame.
    on_tool: Vec3,
    point: Vec3,
}

impl Friction {
    pub(crate) fn reset(&mut self) {
        (self.slip, self.last) = (Vec3::ZERO, None);
    }

    /// Slip, mm, for the contact in `out` and a friction coefficient; at most what the cone holds.
    pub(crate) fn slip(&mut self, scene: &Scene, coefficient: f32, out: &TissueStep) -> Vec3 {
        if coefficient <= 0.0 || !out.manifold.touches() {
            self.reset();
            return Vec3::ZERO;
        }
        let (normal, point) = (out.manifold.normal, out.manifold.point);
        let mean = |nodal: &NodalContact| nodal.mean(|n| scene.positions[n as usize]);
        let pose = &scene.tool.world_from_tool;
        if let Some(last) = &self.last {
            let moved = (*pose * last.on_tool - last.point) - (mean(&last.nodal) - last.tissue);
            self.slip = (self.slip + moved).reject_from_normalized(normal);
        }
        let limit_mm = coefficient * out.manifold.depth_mm;
        self.slip = self.slip.clamp_length_max(limit_mm);
        if !self.slip.is_finite() {
            self.reset();
            return Vec3::ZERO;
        }
        let on_tool = pose.rotation.inverse() * (point - pose.translation);
        self.last = Some(Touch { nodal: out.nodal, tissue: mean(&out.nodal), on_tool, point });
        self.slip
    }
}
