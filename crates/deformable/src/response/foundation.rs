//! The tissue's surface as an elastic foundation of the tool: each place is pressed away from the
//! tool's exact surface.
//!
//! # Theory
//! Points q with fixed weights wᵢ on the corners of their triangle cover the surface; each stands
//! for an area A_q, the present one, and not less than that at rest. With g the distance of q from
//! the tool, negative inside, n the direction from q to the tool's middle and ε the stiffness of
//! the foundation:
//!
//! ```text
//! p = ε max(0, -g)      fᵢ = Σ wᵢ A_q (t - p n)      hand: F = -Σ A_q (t - p n)
//! t ← t + ε (slip of the tool on q since the last step, across n),   |t| ≤ μ p
//! ```
//! Direction and size of the force come out of the sum alone: by symmetry a ball pressed along its
//! axis into a round block is pushed back along it. (One blended normal for all places, to which
//! their forces are turned, tilts the force by up to 30 degrees and pushes the tissue aside until
//! elements invert.) A stretched triangle keeps its pressure, so that the tip does not go through.
//!
//! Each node is given as one spring of weight 1 along its own force, with the row sum of the
//! foundation's stiffness, `ε Σ wᵢ A_q`. Row sums exceed the matrix that they stand for (Hughes
//! 2000), so what solvers take implicitly is never too little.
//!
//! Where tissue is taken away, the area counts by what is left of the tetrahedron behind it, and a
//! face that comes to light counts in full only after some steps. A triangle counts by how much it
//! faces the tool, and the touched normal is followed no faster than the tool moves. So the force
//! does not jump where tissue goes.
//!
//! # Practice
//! Points are a quarter of the ball's radius apart. A ball pressed deeper than half its radius,
//! which a hand can only do in a jump, grows upwards, its lowest point fixed, so that its centre
//! never comes down to the surface.
//!
//! # Sources
//! Elastic foundation: K. L. Johnson, Contact Mechanics, 1985, section 4.3. Friction as a return to
//! the cone: P. Wriggers, Computational Contact Mechanics, 2006, section 6.3. Row sums: T. J. R.
//! Hughes, The Finite Element Method, 2000, section 7.3.2.

use super::{
    finite_or_zero,
    rod::{Radii, Rod},
};
use crate::{extent::Extent, outcome::TissueStep, scene::Scene, surface::MovingSurface};
use trepan_contact::{MAX_SPRINGS, NodalContact, NodalContacts, SurfacePatch};
use trepan_geometry::{Aabb, Pose, Tool, Vec3};

/// The springs of the nodes near the tool, and where tool and tissue hold each other.
pub(crate) struct Foundation {
    law: Law,
    radii: Radii,
    springs: Vec<NodeSpring>,
    /// The spring of each node, or [`NONE`].
    spring_of: Vec<u32>,
    numbers: Vec<u32>,
    /// Places pressed now and in the last step, in the order of triangles and points.
    grips: [Vec<Grip>; 2],
    /// The tool's pose in the last step.
    before: Option<Pose>,
    /// Normal of the touched surface, followed, and how far the ball has grown, mm.
    touched: Vec3,
    grown: Vec3,
}

/// How places are pressed.
#[derive(Clone, Copy)]
pub(crate) struct Law {
    /// ε, N/mm³.
    pub stiffness_per_mm2: f32,
    /// μ.
    pub friction: f32,
    /// Damping of all places together, N ms/mm.
    pub damping: f32,
}

/// Sums over the points around one node.
#[derive(Default)]
struct NodeSpring {
    node: u32,
    /// Force on the node, N.
    force: Vec3,
    /// Sums of `w A n` and of `w A g`, pressed or not: mm² and mm³.
    normal: Vec3,
    gap_mm3: f32,
    area_mm2: f32,
}

/// A place in contact: its triangle and point, where it was, mm, and the drag on the tissue, MPa.
#[derive(Clone, Copy)]
struct Grip {
    at: [u32; 2],
    place: Vec3,
    drag: Vec3,
}

/// One step over the surface.
struct Pass<'a> {
    scene: &'a Scene<'a>,
    rod: Rod,
    /// Normal of the touched surface, zero where the ball touches none.
    touched: Vec3,
    /// Distance from the tool within which springs wait.
    waiting_mm: f32,
    /// The first grip of the last step that was not passed yet.
    last: usize,
    felt: ToolForce,
}

/// What the tool feels.
#[derive(Default)]
struct ToolForce {
    force: Vec3,
    /// About the tip, N mm.
    moment: Vec3,
}

impl ToolForce {
    fn add(&mut self, force: Vec3, arm: Vec3) {
        self.force += force;
        self.moment += arm.cross(force);
    }
}

impl Pass<'_> {
    /// Corners of a triangle that comes near and faces the tool, its points along an edge, and the
    /// area of each, mm².
    fn meets(&self, surface: &MovingSurface, number: u32) -> Option<([Vec3; 3], u32, f32)> {
        let corners = surface.corners(self.scene.positions, number);
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let width = corners.iter().map(|corner| corner.distance_squared(middle)).fold(0.0, f32::max).sqrt();
        let (gap_mm, inwards) = self.rod.gap(middle);
        let twice_area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let double_mm2 = twice_area.length();
        let facing = (twice_area.dot(inwards)).max(twice_area.dot(self.touched) - SAME_SIDE * double_mm2);
        let faces = (facing / (FACING * double_mm2)).clamp(0.0, 1.0);
        let rest_mm2 = surface.rest_area_mm2[number as usize];
        let along = ((2.0 * rest_mm2).sqrt() / (SPACING * self.scene.radius_mm)).ceil();
        let along = along.clamp(1.0, MOST_ALONG as f32) as u32;
        let area_mm2 = faces * surface.share(number) * rest_mm2.max(0.5 * double_mm2) / (along * along) as f32;
        (gap_mm < self.waiting_mm + width && faces > 0.0).then_some((corners, along, area_mm2))
    }
}

/// How far around the tool springs wait for tissue, radii of its tip.
pub(super) const WAITING: f32 = 0.25;
/// Depth from which the ball grows, radii.
const GROWS: f32 = 0.5;
/// Most that the touched normal and the ball, in radii, change in a step for a tool at rest;
/// numerical.
const FOLLOWS: f32 = 0.01;
/// Widest spacing of points, radii.
const SPACING: f32 = 0.25;
/// Most points along an edge.
const MOST_ALONG: u32 = 8;
/// How late the foundation follows the nodes, ms.
const LATE_MS: f32 = 1.0;
/// Most triangles near the tool, and most places in contact; others have no friction.
const MAX_NEAR: usize = 4096;
const MAX_GRIPS: usize = 16_384;
/// No spring yet.
const NONE: u32 = u32::MAX;

impl Foundation {
    pub(crate) fn new(nodes: usize, tool: &Tool, with_shaft: bool, law: Law) -> Self {
        Self {
            law,
            radii: Radii::of(tool, with_shaft),
            springs: Vec::with_capacity(MAX_SPRINGS),
            spring_of: vec![NONE; nodes],
            numbers: Vec::with_capacity(MAX_NEAR),
            grips: [Vec::with_capacity(MAX_GRIPS), Vec::with_capacity(MAX_GRIPS)],
            before: None,
            touched: Vec3::ZERO,
            grown: Vec3::ZERO,
        }
    }

    /// Makes room for so many nodes.
    pub(crate) fn make_room(&mut self, nodes: usize) {
        self.spring_of.resize(nodes, NONE);
    }

    /// Forgets where tool and tissue held each other.
    pub(crate) fn reset(&mut self) {
        self.grips.iter_mut().for_each(Vec::clear);
        (self.before, self.touched, self.grown) = (None, Vec3::ZERO, Vec3::ZERO);
    }

    /// Writes the springs of the surface near the tool, and what the hand feels of them. `out`
    /// holds the depth of the ball along one normal, if it touches.
    pub(crate) fn press(&mut self, scene: &Scene, surface: &mut MovingSurface, out: &mut TissueStep) {
        let (touched, depth_mm) = (out.manifold.normal, out.manifold.depth_mm);
        self.follow(scene, touched, depth_mm);
        let (touched, rod) = (self.touched, self.radii.at(scene.tool, self.grown));
        let mut pass =
            Pass { scene, rod, touched, waiting_mm: WAITING * scene.radius_mm, last: 0, felt: ToolForce::default() };
        self.springs.clear();
        self.grips.swap(0, 1);
        self.grips[0].clear();
        out.overflow += self.gather(&pass, surface);
        for at in 0..self.numbers.len() {
            out.overflow += self.sum(&mut pass, surface, self.numbers[at]);
        }
        self.springs.iter().for_each(|spring| self.spring_of[spring.node as usize] = NONE);
        self.before = Some(scene.tool.world_from_tool);
        self.write(scene, &mut out.surface_springs);
        if !out.surface_springs.is_empty() {
            self.feel(scene, &pass.felt, out);
        }
    }

    /// Follows the touched normal and grows the ball by what its depth asks for. Both jump where
    /// tissue goes, and the force would with them: they follow no faster than the tool moves.
    fn follow(&mut self, scene: &Scene, touched: Vec3, depth_mm: f32) {
        let moved_mm = self.before.map_or(f32::INFINITY, |before| before.translation.distance(scene.tool.tip()));
        let most = moved_mm / scene.radius_mm + FOLLOWS;
        let towards = |from: Vec3, to: Vec3, most: f32| match (to - from).clamp_length_max(most) {
            change if change.is_finite() && moved_mm < scene.radius_mm => from + change,
            _ => to,
        };
        self.touched = towards(self.touched, touched, most);
        let grown = self.touched * (depth_mm - GROWS * scene.radius_mm).max(0.0);
        self.grown = towards(self.grown, grown, most * scene.radius_mm);
    }

    /// Lists the triangles near the tool, each once, in order; returns how many did not fit.
    fn gather(&mut self, pass: &Pass, surface: &mut MovingSurface) -> u32 {
        let mut overflow = 0;
        self.numbers.clear();
        for (middle, half) in pass.rod.boxes(pass.waiting_mm) {
            let region: Extent = Aabb::of_sphere(middle, half).into();
            if region.overlaps(&surface.bounds) {
                overflow += surface.gather(pass.scene.positions, &region, &mut self.numbers);
            }
        }
        self.numbers.sort_unstable();
        self.numbers.dedup();
        overflow
    }

    /// Adds the points of a triangle; returns how many of its nodes did not fit.
    fn sum(&mut self, pass: &mut Pass, surface: &MovingSurface, number: u32) -> u32 {
        let Some((corners, along, area_mm2)) = pass.meets(surface, number) else { return 0 };
        let mut overflow = 0;
        for (k, weights) in points(along).enumerate() {
            let place = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
            let (gap_mm, inwards) = pass.rod.gap(place);
            if gap_mm.is_nan() || gap_mm >= pass.waiting_mm {
                continue;
            }
            let mut force = Vec3::ZERO;
            if gap_mm < 0.0 {
                let pressure = -gap_mm * self.law.stiffness_per_mm2;
                let drag = self.drag(pass, [number, k as u32], place, inwards, pressure);
                force = (drag - pressure * inwards) * area_mm2;
                pass.felt.add(-force, place - pass.scene.tool.tip());
            }
            for (&node, weight) in surface.triangles[number as usize].iter().zip(weights) {
                let Some(spring) = self.spring(node) else {
                    overflow += 1;
                    continue;
                };
                let area_mm2 = weight * area_mm2;
                spring.force += weight * force;
                spring.normal += inwards * area_mm2;
                spring.gap_mm3 += area_mm2 * gap_mm;
                spring.area_mm2 += area_mm2;
            }
        }
        overflow
    }

    /// Drag of the tool on a pressed place, MPa, which is kept for the next step.
    fn drag(&mut self, pass: &mut Pass, at: [u32; 2], place: Vec3, normal: Vec3, pressure: f32) -> Vec3 {
        if self.law.friction <= 0.0 {
            return Vec3::ZERO;
        }
        let [now, old] = &mut self.grips;
        while old.get(pass.last).is_some_and(|grip| grip.at < at) {
            pass.last += 1;
        }
        let held = old.get(pass.last).filter(|grip| grip.at == at);
        let drag = held.zip(self.before).map_or(Vec3::ZERO, |(grip, before)| {
            let on_tool = before.rotation.inverse() * (grip.place - before.translation);
            let slip = pass.scene.tool.world_from_tool * on_tool - place;
            let drag = (grip.drag + slip * self.law.stiffness_per_mm2).reject_from_normalized(normal);
            drag.clamp_length_max(self.law.friction * pressure)
        });
        let drag = if drag.is_finite() { drag } else { Vec3::ZERO };
        if now.len() < MAX_GRIPS {
            now.push(Grip { at, place, drag });
        }
        drag
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

    /// Writes the sums as springs.
    fn write(&self, scene: &Scene, out: &mut NodalContacts) {
        let Law { stiffness_per_mm2, damping, .. } = self.law;
        let area_mm2: f32 = self.springs.iter().map(|spring| spring.area_mm2).sum();
        let velocity: Vec3 =
            self.springs.iter().map(|sums| scene.velocities[sums.node as usize] * (sums.area_mm2 / area_mm2)).sum();
        for sums in &self.springs {
            let stiffness = stiffness_per_mm2 * sums.area_mm2;
            let place = scene.positions[sums.node as usize];
            let mut contact = NodalContact::none();
            contact.add(sums.node, 1.0);
            let (normal, depth_mm) = match -sums.force {
                Vec3::ZERO => (sums.normal.normalize_or_zero(), -sums.gap_mm3.max(0.0) / sums.area_mm2),
                force => (force.normalize_or_zero(), force.length() / stiffness),
            };
            contact.normal = normal;
            contact.offset_mm = depth_mm - place.dot(normal);
            (contact.stiffness, contact.damping) = (stiffness, damping * sums.area_mm2 / area_mm2);
            contact.tool_normal_velocity = finite_or_zero(scene.tool.velocity_at(place).dot(normal));
            contact.lateral_damping = LATE_MS * stiffness;
            contact.lateral_velocity = velocity;
            out.push(contact);
        }
    }

    /// Gives the hand the sum of what presses.
    fn feel(&self, scene: &Scene, felt: &ToolForce, out: &mut TissueStep) {
        let (time_ms, tip_mm) = (scene.tool.time_ms, scene.tool.tip());
        out.patch = SurfacePatch { time_ms, tip_mm, ..SurfacePatch::default() };
        let Some(normal) = felt.force.try_normalize() else { return };
        let force_n = felt.force.length();
        let speed = |sums: &NodeSpring| scene.velocities[sums.node as usize].dot(normal) * sums.force.length();
        let (speeds, total) = self
            .springs
            .iter()
            .fold((0.0, 0.0), |(speeds, total), sums| (speeds + speed(sums), total + sums.force.length()));
        out.patch.normal = normal;
        out.patch.force_n = force_n;
        out.patch.couple_mm = felt.moment / force_n;
        out.patch.normal_velocity = finite_or_zero(speeds / total);
    }
}

/// A triangle belongs to the touched side when its normal is within 70 degrees of the touched
/// normal.
const SAME_SIDE: f32 = 0.34;
/// Cosine from which a triangle counts in full, numerical.
const FACING: f32 = 0.2;

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
