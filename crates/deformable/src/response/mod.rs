//! From what was found to one contact: normal, depth, and the nodes that feel it.

mod ball;
mod foundation;
mod near;
mod printed;
mod rod;

pub(crate) use ball::Ball;
pub(crate) use foundation::{Foundation, Law};

use crate::{method::Response, narrow::Hits, outcome::TissueStep, scene::Scene, surface::MovingSurface};
use printed::Faces;
use trepan_contact::{NodalContact, SurfacePatch};
use trepan_geometry::Vec3;

/// Makes a response.
pub(crate) fn responder(response: Response) -> Box<dyn Respond> {
    match response {
        Response::Ball => Box::new(Ball::new()),
        Response::Printed => Box::new(Faces { nearest: false }),
        Response::NearestFace => Box::new(Faces { nearest: true }),
    }
}

/// A response with its memory.
pub(crate) trait Respond: Send {
    /// Whether it reads the moving surface.
    fn needs_surface(&self) -> bool {
        false
    }

    /// Fills the list and the nodes; normal and depth are the answer, `None` when nothing is
    /// touched.
    fn respond(
        &mut self,
        scene: &Scene,
        hits: &Hits,
        surface: &mut MovingSurface,
        out: &mut TissueStep,
    ) -> Option<Answer>;

    /// Forgets what was touched.
    fn reset(&mut self) {}
}

/// The spring between tool and tissue.
#[derive(Clone, Copy)]
pub(crate) struct Spring {
    /// N/mm.
    pub stiffness: f32,
    /// Along the normal, N ms/mm.
    pub damping: f32,
}

/// What every response ends in.
#[derive(Clone, Copy)]
pub(crate) struct Answer {
    /// Unit vector out of the tissue.
    pub normal: Vec3,
    /// How deep, mm.
    pub depth_mm: f32,
}

impl Spring {
    /// Makes `nodal`, whose nodes are already there, the spring pressed as the answer says. Returns
    /// where it acts, mm; `None` when it does not press or a number is not finite.
    fn load(&self, scene: &Scene, answer: &Answer, nodal: &mut NodalContact) -> Option<Vec3> {
        let &Answer { normal, depth_mm } = answer;
        nodal.normalise();
        let place = nodal.mean(|n| scene.positions[n as usize]);
        let sound = depth_mm > 0.0 && depth_mm.is_finite() && normal.is_normalized() && place.is_finite();
        if !sound || nodal.is_empty() {
            return None;
        }
        (nodal.normal, nodal.offset_mm) = (normal, depth_mm - place.dot(normal));
        (nodal.stiffness, nodal.damping) = (self.stiffness, self.damping);
        nodal.tool_normal_velocity = finite_or_zero(scene.tool.velocity_at(place).dot(normal));
        Some(place)
    }

    /// Writes the answer into manifold, patch and nodal spring, whose nodes are already there;
    /// nothing, and false, when a number is not finite.
    pub(crate) fn finish(&self, scene: &Scene, answer: &Answer, out: &mut TissueStep) -> bool {
        let Some(place) = self.load(scene, answer, &mut out.nodal) else {
            out.forget_contact();
            return false;
        };
        let &Answer { normal, depth_mm } = answer;
        let velocity = out.nodal.mean(|n| scene.velocities[n as usize]).dot(normal);
        (out.manifold.normal, out.manifold.depth_mm, out.manifold.point) = (normal, depth_mm, place);
        let (time_ms, tip_mm) = (scene.tool.time_ms, scene.tool.tip());
        let (force_n, normal_velocity) = (self.stiffness * depth_mm, finite_or_zero(velocity));
        out.patch = SurfacePatch { time_ms, normal, tip_mm, force_n, normal_velocity, ..SurfacePatch::default() };
        true
    }
}

fn finite_or_zero(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}
