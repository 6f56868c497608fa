//! The tissue's surface as an elastic foundation under the ball: how deep it is pressed at each
//! node.
//!
//! # Theory
//! Points q with fixed weights wᵢ on the corners of their triangle cover the surface; each stands
//! for the area A_q that it has at rest. With c the ball's centre, R its radius and m a margin, q
//! is pressed by `e = R + m - |x_q - c|` along `n = (c - x_q)/|c - x_q|`, where e > 0:
//!
//! ```text
//! fᵢ = -K Σ wᵢ A_q e n        K such that |Σ K A_q e n| is the force that the hand feels
//! ```
//! Nothing in it jumps or wanders as the tissue moves: weights and areas are constants of the mesh,
//! e is continuous, and without K the forces are the gradient of one energy. Each node is given as
//! one spring of weight 1, with the row sums of the foundation's stiffness, twice the ball's in
//! all. Row sums exceed the matrix that they stand for (Hughes 2000), so what solvers take
//! implicitly is never too little.
//!
//! # Practice
//! Triangles larger than half a radius have several points. A ball pressed deeper than half its
//! radius grows upwards, its lowest point fixed, so that its centre never comes down to the
//! surface.
//!
//! # Sources
//! Elastic foundation: K. L. Johnson, Contact Mechanics, 1985, section 4.3. Row sums: T. J. R.
//! Hughes, The Finite Element Method, 2000, section 7.3.2.

use super::{
    Answer, Spring, finite_or_zero,
    near::{Near, NearTriangle},
};
use crate::{scene::Scene, surface::MovingSurface};
use trepan_contact::{MAX_SPRINGS, NodalContact, NodalContacts};
use trepan_geometry::{Quat, Vec3};

/// The springs of the nodes near the ball.
pub(crate) struct Foundation {
    spring: Spring,
    springs: Vec<NodeSpring>,
    /// The spring of each node, or [`NONE`].
    spring_of: Vec<u32>,
}

/// Sums over the points around one node.
#[derive(Default)]
struct NodeSpring {
    node: u32,
    /// Sum of `w A e n` of what is pressed, mm³.
    push: Vec3,
    /// Sums of `w A n` and of `w A e`, pressed or not: mm² and mm³.
    normal: Vec3,
    depth_mm3: f32,
    area_mm2: f32,
}

/// How far around the ball springs wait for tissue, radii.
pub(crate) const WAITING: f32 = 0.25;
/// Margin m around a ball that touches, radii.
const MARGIN: f32 = 0.1;
/// Depth from which the ball grows, radii.
const GROWS: f32 = 0.5;
/// Widest spacing of points, radii.
const SPACING: f32 = 0.5;
/// Most points along an edge.
const MOST_ALONG: u32 = 8;
/// How late the foundation follows the nodes, ms.
const LATE_MS: f32 = 1.0;
/// No spring yet.
const NONE: u32 = u32::MAX;

impl Foundation {
    pub(crate) fn on_nodes(nodes: usize, spring: Spring) -> Self {
        Self { spring, springs: Vec::with_capacity(MAX_SPRINGS), spring_of: vec![NONE; nodes] }
    }

    /// Writes the springs of the ball on the triangles near it. Together they have the force of
    /// the ball's spring pressed as the answer says; at depth 0 all wait. Returns how many nodes
    /// did not fit.
    pub(crate) fn press(
        &mut self,
        scene: &Scene,
        near: &Near,
        surface: &MovingSurface,
        &Answer { normal, depth_mm }: &Answer,
        out: &mut NodalContacts,
    ) -> u32 {
        let grown_mm = (depth_mm - GROWS * scene.radius_mm).max(0.0);
        let margin_mm = if depth_mm > 0.0 { MARGIN * scene.radius_mm } else { 0.0 };
        let ball = Ball {
            centre: scene.tool.tip() + grown_mm * normal,
            reach_mm: scene.radius_mm + grown_mm + margin_mm,
            waiting_mm: (1.0 + WAITING) * scene.radius_mm + grown_mm,
        };
        let mut overflow = 0;
        self.springs.clear();
        for triangle in near.within(ball.centre, ball.waiting_mm) {
            overflow += self.sum(&ball, triangle, surface, scene.radius_mm);
        }
        self.springs.iter().for_each(|spring| self.spring_of[spring.node as usize] = NONE);
        self.write(scene, normal * depth_mm, out);
        overflow
    }

    /// Adds the points of a triangle; returns how many of its nodes did not fit.
    fn sum(&mut self, ball: &Ball, triangle: &NearTriangle, surface: &MovingSurface, radius_mm: f32) -> u32 {
        let area_mm2 = surface.rest_area_mm2[triangle.number as usize];
        let along = ((2.0 * area_mm2).sqrt() / (SPACING * radius_mm)).ceil().clamp(1.0, MOST_ALONG as f32) as u32;
        let area_mm2 = area_mm2 / (along * along) as f32;
        let mut overflow = 0;
        for weights in points(along) {
            let away = ball.centre - triangle.point(weights);
            let distance = away.length();
            if !(distance > f32::MIN_POSITIVE && distance < ball.waiting_mm) {
                continue;
            }
            let (normal, depth_mm) = (away / distance, ball.reach_mm - distance);
            for (&node, weight) in surface.triangles[triangle.number as usize].iter().zip(weights) {
                let Some(spring) = self.spring(node) else {
                    overflow += 1;
                    continue;
                };
                let area_mm2 = weight * area_mm2;
                spring.push += normal * (area_mm2 * depth_mm.max(0.0));
                spring.normal += normal * area_mm2;
                spring.depth_mm3 += area_mm2 * depth_mm;
                spring.area_mm2 += area_mm2;
            }
        }
        overflow
    }

    /// The spring of a node; `None` when there is no room for it.
    fn spring(&mut self, node: u32) -> Option<&mut NodeSpring> {
        let at = &mut self.spring_of[node as usize];
        if *at == NONE && self.springs.len() < MAX_SPRINGS {
            *at = self.springs.len() as u32;
            self.springs.push(NodeSpring { node, ..NodeSpring::default() });
        }
        self.springs.get_mut(*at as usize)
    }

    /// Scales the sums to the ball's `depth`, along its normal, mm, and turns them to that normal.
    fn write(&self, scene: &Scene, depth: Vec3, out: &mut NodalContacts) {
        let spring = self.spring;
        let push: Vec3 = self.springs.iter().map(|spring| spring.push).sum();
        let area_mm2: f32 = self.springs.iter().map(|spring| spring.area_mm2).sum();
        let pressed = depth != Vec3::ZERO && push.length() > f32::MIN_POSITIVE;
        if depth != Vec3::ZERO && !pressed {
            return;
        }
        let turn = match (pressed, depth.try_normalize(), push.try_normalize()) {
            (true, Some(normal), Some(push)) => Quat::from_rotation_arc(push, normal),
            _ => Quat::IDENTITY,
        };
        let modulus = if pressed { spring.stiffness * depth.length() / push.length() } else { 0.0 };
        let velocity: Vec3 =
            self.springs.iter().map(|sums| scene.velocities[sums.node as usize] * (sums.area_mm2 / area_mm2)).sum();
        for sums in &self.springs {
            let share = sums.area_mm2 / area_mm2;
            let force_n = modulus * sums.push.length();
            let along = if force_n > 0.0 { turn * sums.push } else { sums.normal };
            let stiffness = 2.0 * spring.stiffness * share;
            let place = scene.positions[sums.node as usize];
            let mut contact = NodalContact::none();
            contact.add(sums.node, 1.0);
            contact.normal = along.normalize_or_zero();
            let depth_mm = if force_n > 0.0 { force_n / stiffness } else { sums.depth_mm3.min(0.0) / sums.area_mm2 };
            contact.offset_mm = depth_mm - place.dot(contact.normal);
            (contact.stiffness, contact.damping) = (stiffness, spring.damping * share);
            contact.tool_normal_velocity = finite_or_zero(scene.tool.velocity_at(place).dot(contact.normal));
            contact.lateral_damping = LATE_MS * stiffness;
            contact.lateral_velocity = velocity;
            out.push(contact);
        }
    }
}

/// The ball as the foundation meets it.
struct Ball {
    centre: Vec3,
    /// From the centre, mm: nearer points are pressed.
    reach_mm: f32,
    /// From the centre, mm: nearer points have springs.
    waiting_mm: f32,
}

/// Centroids of a triangle split into `along²` equal ones, as weights on its corners.
fn points(along: u32) -> impl Iterator<Item = [f32; 3]> {
    let third = 1.0 / (3 * along) as f32;
    let upright = move |i: u32, j: u32| (j < along - i).then_some([3 * i + 1, 3 * j + 1]);
    let inverted = move |i: u32, j: u32| (j + 1 < along - i).then_some([3 * i + 2, 3 * j + 2]);
    (0..along).flat_map(move |i| (0..along).flat_map(move |j| [upright(i, j), inverted(i, j)])).flatten().map(
        move |[a, b]| {
            let (a, b) = (a as f32 * third, b as f32 * third);
            [a, b, 1.0 - a - b]
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_points_of_a_triangle_are_inside_it_and_their_mean_is_its_middle() {
        for along in 1..=MOST_ALONG {
            let all: Vec<_> = points(along).collect();
            assert_eq!(all.len() as u32, along * along);
            assert!(all.iter().flatten().all(|w| *w > 0.0 && *w < 1.0));
            for corner in 0..3 {
                let mean = all.iter().map(|w| w[corner]).sum::<f32>() / all.len() as f32;
                assert!((mean - 1.0 / 3.0).abs() < 1e-5, "{mean} with {along} along");
            }
        }
    }
}
