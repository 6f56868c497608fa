//! From what was found to one contact: normal, depth, and the nodes that feel it.

mod ball;
mod friction;
mod near;
mod printed;
mod shaft;

pub(crate) use friction::Friction;
pub(crate) use shaft::Shaft;

use crate::{narrow::Hits, scene::Scene, step::TissueStep, surface::MovingSurface};
use trepan_contact::{NodalContact, NodalContacts, SurfacePatch};
use trepan_geometry::Vec3;

/// How normal and depth come out of the points inside the tissue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Response {
    /// The ball against the moving surface: continuous, and deeper is more.
    Ball,
    /// The thesis's Algorithm 2 as printed: the greatest distance to any surface face of the tetrahedra hit.
    Printed,
    /// Algorithm 2 with each point measured against the nearest surface face of its tetrahedron.
    NearestFace,
}

impl Response {
    /// The charted choice.
    pub const RECOMMENDED: Self = Self::Ball;
}

/// A response with its memory.
pub(crate) enum Responder {
    Ball(ball::Ball),
    Faces(printed::Faces),
}

impl Responder {
    pub(crate) fn new(response: Response) -> Self {
        match response {
            Response::Ball => Self::Ball(ball::Ball::new()),
            Response::Printed => Self::Faces(printed::Faces { nearest: false }),
            Response::NearestFace => Self::Faces(printed::Faces { nearest: true }),
        }
    }

    /// Whether it reads the moving surface.
    pub(crate) fn needs_surface(&self) -> bool {
        matches!(self, Self::Ball(_))
    }

    /// Fills the list and the nodes; normal and depth are the answer, `None` when nothing is touched.
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

/// Writes the answer into manifold, patch and nodal spring, whose nodes are already there; nothing when a number is not finite.
pub(crate) fn finish(scene: &Scene, answer: &Answer, spring: Spring, out: &mut TissueStep) {
    out.nodal.normalise();
    let place = out.nodal.mean(|n| scene.positions[n as usize]);
    let tissue_velocity = out.nodal.mean(|n| scene.velocities[n as usize]).dot(answer.normal);
    let sound =
        answer.depth_mm > 0.0 && answer.depth_mm.is_finite() && answer.normal.is_normalized() && place.is_finite();
    if !sound || out.nodal.is_empty() {
        out.dents.clear();
        return out.forget_contact();
    }
    let tool_velocity = scene.tool_velocity_at(place).dot(answer.normal);
    (out.manifold.normal, out.manifold.depth_mm, out.manifold.point) = (answer.normal, answer.depth_mm, place);
    out.nodal.normal = answer.normal;
    out.nodal.offset_mm = answer.depth_mm - place.dot(answer.normal);
    (out.nodal.stiffness, out.nodal.damping) = (spring.stiffness, spring.damping);
    out.nodal.tool_normal_velocity = finite_or_zero(tool_velocity);
    let whole: Vec3 = out.dents.iter().map(|dent| dent.normal).sum();
    finish_dents(scene, answer.depth_mm / whole.length().max(f32::MIN_POSITIVE), spring, &mut out.dents);
    out.patch = SurfacePatch {
        time_ms: scene.tool.time_ms,
        normal: answer.normal,
        tip_mm: scene.tool.tip(),
        depth_mm: answer.depth_mm,
        normal_velocity: finite_or_zero(tissue_velocity),
    };
}

/// Time in which the corners of a pressed triangle come to move alike, ms: what is found anew every millisecond must not make light nodes ring.
const CALM_MS: f32 = 2.0;

/// Adds a place under the ball to the springs: of a spring's weights, normal, depth and stiffness are the sums over its places so far, of the weights and normals by
/// depth, of the stiffness by number. A place that is not deep counts for its direction alone.
pub(crate) fn dent(spring: &mut NodalContact, nodes: [u32; 3], weights: [f32; 3], depth_mm: f32, normal: Vec3) {
    let load_mm = depth_mm.max(LEAST_LOAD_MM);
    let pressed = nodes.into_iter().zip(weights).filter(|(_, weight)| *weight > 0.0);
    pressed.for_each(|(node, weight)| spring.add(node, weight * load_mm));
    spring.normal += load_mm * normal;
    spring.offset_mm += depth_mm;
    spring.stiffness += 1.0;
}

/// What a place counts for that is not deep, mm.
const LEAST_LOAD_MM: f32 = 1e-4;

/// Writes that nothing touches; springs may wait, all together as strong as one.
pub(crate) fn finish_waiting(scene: &Scene, spring: Spring, out: &mut TissueStep) {
    out.forget_contact();
    let places: f32 = out.dents.iter().map(|dent| dent.stiffness).sum();
    finish_dents(scene, 1.0 / places.max(1.0), spring, &mut out.dents);
}

/// Makes springs of the sums: each as deep as its places in the mean, and with this share of the stiffness for each place.
fn finish_dents(scene: &Scene, share: f32, spring: Spring, dents: &mut NodalContacts) {
    let parts: f32 = dents.iter().map(|dent| dent.normal.length()).sum();
    for dent in dents.iter_mut() {
        let (load_mm, depth_mm, places) = (dent.normal, dent.offset_mm, dent.stiffness);
        dent.normalise();
        dent.normal = load_mm.normalize_or_zero();
        let place = dent.mean(|n| scene.positions[n as usize]);
        dent.offset_mm = depth_mm.min(load_mm.length()) / places - place.dot(dent.normal);
        dent.stiffness = spring.stiffness * share * places;
        dent.damping = spring.damping * load_mm.length() / parts.max(f32::MIN_POSITIVE);
        dent.calm_ms = CALM_MS;
        dent.tool_normal_velocity = finite_or_zero(scene.tool_velocity_at(place).dot(dent.normal));
    }
}

fn finite_or_zero(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}
