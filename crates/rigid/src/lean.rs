//! What a tool's shaft leans on: the discs around it, kept while the tool moves little.
//!
//! # Theory
//! A disc y against the shaft, nearest to the axis at `c + s a`, gives the tip's centre c a
//! half-space as a disc against the ball does:
//! ```text
//! g·(c + s a) ≥ g·y + ρ        ρ: radius of the shaft, g: unit vector from the disc to the axis
//! ```
//! The orientation is the hand's; only the place of the tip gives way. So the solution's
//! multipliers λᵢ are the contacts' forces, and those of the shaft turn the tool about its tip:
//! `τ = k Σ λᵢ s a × gᵢ`.
//!
//! # Practice
//! Gathered for [`AHEAD`] voxels of motion, of the tip or of the far end as the tool turns. Nothing
//! happens where no brick near the shaft has ever held bone.

use crate::RigidStep;
use crate::ball::{Ball, InReach};
use crate::disc::Disc;
use crate::shaft::Shaft;
use crate::surface::Discs;
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;

/// How far the tool may move before discs are gathered anew, voxels.
const AHEAD: f32 = 1.5;

/// The surface around a shaft.
pub(crate) struct Lean {
    discs: Discs,
    /// Start and axis for which the discs were gathered.
    known: Option<(Vec3, Vec3)>,
}

impl Lean {
    /// Room for `limit` discs of at most `radius` voxels.
    pub fn new(limit: usize, radius: f32) -> Self {
        Self { discs: Discs::new(limit, radius), known: None }
    }

    /// The bone is another.
    pub fn renew(&mut self) {
        self.known = None;
        self.discs.renew();
    }

    /// The bone has been opened within `reach` voxels of the shaft's start.
    pub fn opened(&mut self, reach: f32) {
        let from = self.known.map_or(Vec3::ZERO, |(start, _)| start - self.discs.base.as_vec3());
        if self.discs.list().iter().any(|disc| disc.centre.distance(from) < reach) {
            self.renew();
        }
    }

    /// Adds the discs that the shaft of `ball` at `from` has within `reach` to `near`. All is in
    /// nodes of the cut, in the frame shifted to `base`.
    pub fn select(
        &mut self,
        bone: &BoneVolume,
        (ball, from): (&Ball, Vec3),
        reach: f32,
        base: Vec3,
        near: &mut InReach,
        out: &mut RigidStep,
    ) {
        let nodes = bone.cut_nodes() as f32;
        let shaft = Shaft { start: base + from, ..ball.shaft };
        let (shaft, reach) = (&shaft.scaled(1.0 / nodes), reach / nodes);
        let still = |(start, axis): (Vec3, Vec3)| {
            start.distance(shaft.start) + shaft.span.1 * axis.distance(shaft.axis) <= AHEAD
        };
        if !self.known.is_some_and(still) {
            self.discs.gather_along(bone, shaft, shaft.radius + reach + AHEAD + 1.0);
            self.known = Some((shaft.start, shaft.axis));
            out.voxels_swept += self.discs.visited;
            out.fallbacks += u32::from(self.discs.overflow > 0);
        }
        let own = self.discs.base.as_vec3();
        let axis_near = |place: Vec3| shaft.at(shaft.along(place + own)) - own;
        let far = shaft.radius + reach;
        self.discs.shape(bone, axis_near, far);
        let within = |disc: &&Disc| disc.least_distance(axis_near(disc.centre)) <= far;
        for disc in self.discs.list().iter().filter(within) {
            let seen = disc.scaled(nodes);
            if !near.push(ball, Disc { centre: seen.centre + nodes * own - base, ..seen }) {
                out.fallbacks += 1;
            }
        }
    }
}
