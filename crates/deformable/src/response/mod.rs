//! From what was found to one contact: normal, depth, and the nodes that feel it.

mod ball;
mod foundation;
mod friction;
mod near;
mod printed;
mod shaft;

pub(crate) use friction::Friction;
pub(crate) use shaft::Shaft;

use crate::{method::Response, narrow::Hits, outcome::TissueStep, scene::Scene, surface::MovingSurface};
use trepan_contact::{NodalContacts, SurfacePatch};
use trepan_geometry::Vec3;

/// A response with its memory.
pub(crate) enum Responder {
    Ball(ball::Ball),
    Faces(printed::Faces),
}

impl Responder {
    pub(crate) fn new(response: Response, nodes: usize) -> Self {
        match response {
            Response::Ball => Self::Ball(ball::Ball::on_nodes(nodes)),
            Response::Printed => Self::Faces(printed::Faces { nearest: false }),
            Response::NearestFace => Self::Faces(printed::Faces { nearest: true }),
        }
    }

    /// Whether it reads the moving surface.
    pub(crate) fn needs_surface(&self) -> bool {
        matches!(self, Self::Ball(_))
    }

    /// Fills the list and the nodes; normal and depth are the answer, `None` when nothing is
    /// touched.
    pub(crate) fn respond(
        &mut self,
        scene: &Scene,
        hits: &Hits,
        surface: &mut MovingSurface,
        out: &mut TissueStep,
    ) -> Option<Answer> {
        match self {
            Self::Ball(ball) => ball.respond(scene, hits, surface, out),
            Self::Faces(faces) => faces.respond(scene, hits, out),
        }
    }

    /// Writes the springs of the surface under the tool, if the response has any. Together they
    /// have the force of `spring` pressed `depth_mm` deep along the normal, and wait where that
    /// is 0. Returns what did not fit.
    pub(crate) fn press(
        &mut self,
        scene: &Scene,
        surface: &MovingSurface,
        contact: (Vec3, f32),
        spring: Spring,
        out: &mut NodalContacts,
    ) -> u32 {
        match self {
            Self::Ball(ball) => ball.press(scene, surface, contact, spring, out),
            Self::Faces(_) => 0,
        }
    }

    /// Forgets what was touched.
    pub(crate) fn reset(&mut self) {
        if let Self::Ball(ball) = self {
            ball.reset();
        }
    }
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
pub(crate) struct Answer {
    /// Unit vector out of the tissue.
    pub normal: Vec3,
    /// How deep, mm, above 0.
    pub depth_mm: f32,
}

/// Writes the answer into manifold, patch and nodal spring, whose nodes are already there; nothing,
/// and false, when a number is not finite.
pub(crate) fn finish(scene: &Scene, answer: &Answer, spring: Spring, out: &mut TissueStep) -> bool {
    out.nodal.normalise();
    let place = out.nodal.mean(|n| scene.positions[n as usize]);
    let tissue_velocity = out.nodal.mean(|n| scene.velocities[n as usize]).dot(answer.normal);
    let sound =
        answer.depth_mm > 0.0 && answer.depth_mm.is_finite() && answer.normal.is_normalized() && place.is_finite();
    if !sound || out.nodal.is_empty() {
        out.forget_contact();
        return false;
    }
    let tool_velocity = scene.tool_velocity_at(place).dot(answer.normal);
    (out.manifold.normal, out.manifold.depth_mm, out.manifold.point) = (answer.normal, answer.depth_mm, place);
    out.nodal.normal = answer.normal;
    out.nodal.offset_mm = answer.depth_mm - place.dot(answer.normal);
    (out.nodal.stiffness, out.nodal.damping) = (spring.stiffness, spring.damping);
    out.nodal.tool_normal_velocity = finite_or_zero(tool_velocity);
    out.patch = SurfacePatch {
        time_ms: scene.tool.time_ms,
        normal: answer.normal,
        tip_mm: scene.tool.tip(),
        depth_mm: answer.depth_mm,
        normal_velocity: finite_or_zero(tissue_velocity),
    };
    true
}

fn finite_or_zero(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}
