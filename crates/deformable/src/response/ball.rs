//! The tool's ball against the moving surface: one depth, one smooth normal.
//!
//! # Theory
//! Let c be the ball's centre, R its radius, q the closest surface point, s = +1 outside and -1
//! inside. Then `depth = R - s |c - q|`: a distance, so it never jumps when a point crosses a
//! border between tetrahedra, and one millimetre of push is one millimetre of depth. While the
//! centre is inside, q is not searched anew but followed: from the last triangle downhill, and only
//! over triangles that face the same way. So the far side of a thin structure never takes the
//! contact over, and deeper stays deeper through the whole thickness. A tool that moved by more
//! than R in one step jumped: q is searched anew.
//!
//! The normal is the mean over the centre and every fourth point inside, each with the blended
//! surface normal at its own closest point (`near.rs`) and weighted with its own depth:
//! `f = Σ dᵢ nᵢ`, `n = f / |f|`. A weight is zero where a point enters, so nothing jumps. In a
//! groove whose walls push against each other the coherence `κ = |f| / Σ dᵢ` falls to 0, and the
//! depth is scaled by `min(1, 2κ)`: opposite walls cancel, everything else is left alone.
//!
//! ```text
//!        ( c )           n  from the points inside, weighted with depth
//!   ____  \|/  ____      q  closest point; the nodes of the triangles under
//!       \__q__/             the points inside carry the load
//! ```
//!
//! # Sources
//! Followed closest feature: after Ho, Basdogan and Srinivasan 1999. Blended normals: the aim of
//! force shading (Morgenbesser and Srinivasan 1996).
//!
//! # When not to use it
//! For a tool that is not a ball at its tip; for a surface that folds within the ball's radius so
//! sharply that one normal says nothing.

use super::{
    Answer, Respond,
    near::{Near, Sample},
};
use crate::{
    extent::Extent,
    narrow::{Hits, NONE},
    outcome::TissueStep,
    scene::Scene,
    surface::{Foot, MovingSurface},
};
use trepan_contact::{Contact, MAX_CONTACTS};
use trepan_geometry::{Aabb, Vec3};

/// The triangle touched last, and room for those near the contact.
pub(crate) struct Ball {
    anchor: u32,
    last_centre: Vec3,
    numbers: Vec<u32>,
    near: Near,
}

/// Most triangles near one contact.
const MAX_NEAR: usize = 1024;
/// A triangle belongs to the touched side when its normal is within 70 degrees of the touched
/// triangle's.
const SAME_SIDE: f32 = 0.34;
/// Every fourth point inside is sampled: the shell is even, so a quarter of it is too.
const SAMPLE_EVERY: usize = 4;
/// Normals blend over this many radii.
const BLEND: f32 = 0.5;

impl Ball {
    pub(crate) fn new() -> Self {
        let (numbers, near) = (Vec::with_capacity(MAX_NEAR), Near::with_capacity(MAX_NEAR));
        Self { anchor: NONE, last_centre: Vec3::ZERO, numbers, near }
    }

    /// Puts load on the nodes under a sample.
    fn load(surface: &MovingSurface, sample: &Sample, load: f32, out: &mut TissueStep) {
        let nodes = surface.triangles[sample.triangle as usize];
        for (node, weight) in nodes.into_iter().zip(sample.weights).filter(|(_, weight)| *weight > 0.0) {
            out.nodal.add(node, weight * load);
        }
    }

    /// What the surface says about the ball's centre, and the ball's depth there, mm.
    fn touch(
        &mut self,
        scene: &Scene,
        hits: &Hits,
        surface: &mut MovingSurface,
        out: &mut TissueStep,
    ) -> Option<(Sample, f32)> {
        let (positions, centre) = (scene.positions, scene.tool.tip());
        let inside = hits.tet[scene.centre()] != NONE;
        let jumped = self.last_centre.distance(centre) > scene.radius_mm;
        self.last_centre = centre;
        if self.anchor != NONE && !surface.live[self.anchor as usize] {
            self.anchor = NONE;
        }
        let foot = match (inside, self.anchor) {
            (false, _) => surface.closest_here(positions, centre, scene.radius_mm),
            (true, NONE) => surface.closest(positions, centre),
            (true, _) if jumped => surface.closest(positions, centre),
            (true, anchor) => surface.descend(positions, anchor, centre),
        }?;
        let signed = |distance: f32| scene.radius_mm + if inside { distance } else { -distance };
        let region = self.region(scene, hits, &foot, signed(foot.distance2.sqrt()));
        self.numbers.clear();
        out.overflow += surface.gather(positions, &region, &mut self.numbers);
        self.keep_touched_side(scene, surface, &foot);
        let sample = self.near.sample(centre, BLEND * scene.radius_mm)?;
        let depth_mm = signed(sample.distance);
        Some((sample, depth_mm))
    }

    /// The region in which triangles matter. It reaches as far from the centre as the closest
    /// triangle, as far from the points inside as they are deep, and further as normals blend,
    /// never beyond a diameter around the foot.
    fn region(&self, scene: &Scene, hits: &Hits, foot: &Foot, depth_mm: f32) -> Extent {
        let blend_mm = BLEND * scene.radius_mm;
        let mut points = Extent::EMPTY;
        points_inside(hits).for_each(|i| points.grow(scene.points[i]));
        let mut region = points.widened(depth_mm.max(0.0) + blend_mm);
        let around_mm = foot.distance2.sqrt() + blend_mm;
        region.merge(&Extent::of(&[scene.tool.tip()]).widened(around_mm));
        region.shared(&Aabb::of_sphere(foot.point, 2.0 * scene.radius_mm).into())
    }

    /// Takes triangles that the centre sees from outside, and those that face as the touched one
    /// does.
    fn keep_touched_side(&mut self, scene: &Scene, surface: &MovingSurface, foot: &Foot) {
        let touched = surface.flat_normal(scene.positions, foot.triangle);
        let centre = scene.tool.tip();
        self.near.fill(surface, scene.positions, &self.numbers, |normal, corner| {
            normal.dot(touched) > SAME_SIDE || (centre - corner).dot(normal) > 0.0
        });
    }
}

impl Respond for Ball {
    fn needs_surface(&self) -> bool {
        true
    }

    fn reset(&mut self) {
        self.anchor = NONE;
    }

    fn respond(
        &mut self,
        scene: &Scene,
        hits: &Hits,
        surface: &mut MovingSurface,
        out: &mut TissueStep,
    ) -> Option<Answer> {
        let touch = self.touch(scene, hits, surface, out);
        self.anchor = touch.as_ref().map_or(NONE, |(sample, _)| sample.triangle);
        let (centre, depth_mm) = touch?;
        if depth_mm <= 0.0 {
            return None;
        }
        let mut sum = Sum::default();
        sum.add(depth_mm, centre.normal);
        Self::load(surface, &centre, depth_mm, out);
        let stride = points_inside(hits).count().div_ceil(SAMPLE_EVERY * MAX_CONTACTS).max(1);
        for (k, i) in points_inside(hits).filter(|i| i % SAMPLE_EVERY == 0).enumerate() {
            let p = scene.points[i];
            let Some(sample) = self.near.sample(p, BLEND * scene.radius_mm) else { break };
            sum.add(sample.distance, sample.normal);
            Self::load(surface, &sample, sample.distance, out);
            if k % stride == 0 {
                let normal = sample.normal.normalize_or_zero();
                out.manifold.push(Contact { point: p, normal, depth_mm: sample.distance });
            }
        }
        let fallback = surface.flat_normal(scene.positions, centre.triangle);
        Some(sum.answer(depth_mm, fallback))
    }
}

/// Depth-weighted normals.
#[derive(Default)]
struct Sum {
    force: Vec3,
    total: f32,
}

impl Sum {
    fn add(&mut self, depth_mm: f32, normal: Vec3) {
        self.force += normal * depth_mm;
        self.total += depth_mm;
    }

    /// `fallback` is the normal where all normals cancel.
    fn answer(&self, depth_mm: f32, fallback: Vec3) -> Answer {
        let coherence = self.force.length() / self.total;
        let normal = self.force.try_normalize().unwrap_or(fallback);
        Answer { normal, depth_mm: depth_mm * (2.0 * coherence).min(1.0) }
    }
}

/// Numbers of the points inside, the centre not among them.
fn points_inside(hits: &Hits) -> impl Iterator<Item = usize> + '_ {
    (0..hits.tet.len() - 1).filter(|&i| hits.tet[i] != NONE)
}
