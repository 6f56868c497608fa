//! A ball that slides among discs towards a goal.
//!
//! # Theory
//! Each disc gives a half-space that the ball's centre must stay in: at its radius from the disc,
//! or where the ball overlaps the disc already, no nearer than it is. The centre is therefore
//! always allowed to stay, and since the projection of the goal on a convex set that holds the
//! centre is never further from the goal than the centre, no slide leads away from the goal.
//!
//! ```text
//! g·c ≥ g·y + min(ρ, d + push)      d: distance now, ρ: radius, push: what an overlap must lose
//! ```
//!
//! # Practice
//! All lengths are voxels, in the discs' frame.

use crate::disc::Disc;
use crate::half_spaces::{HalfSpace, HalfSpaces};
use crate::shaft::Shaft;
use trepan_geometry::Vec3;

/// Moves within one set of discs.
const MAX_SLIDES: usize = 12;
/// A slide shorter than this is rest.
const REST: f32 = 1e-3;
/// Overlap that each slide takes back: more than rounding brings in.
const PUSH: f32 = 2e-4;

/// A ball among discs, perhaps on a shaft.
#[derive(Clone, Copy)]
pub(crate) struct Ball {
    /// Radius that touches.
    pub radius: f32,
    /// Whether its centre is in bone: then a disc pushes along its own normal, which is the way
    /// out.
    pub inside: bool,
    /// The shaft, as seen from the ball's centre.
    pub shaft: Shaft,
}

/// Where a ball sees a disc.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Near {
    /// Distance from the disc to the centre; negative behind it when the centre is in bone.
    pub distance: f32,
    /// Unit vector from the disc to the centre.
    pub direction: Vec3,
}

/// A disc and where a ball sees it.
#[derive(Clone, Copy)]
struct DiscView {
    disc: Disc,
    near: Near,
}

/// The discs in reach of a ball.
#[derive(Default)]
pub(crate) struct InReach {
    list: Vec<DiscView>,
    /// Those of them that may touch, seen from another place.
    touched: Vec<DiscView>,
    /// Where the ball sees them from.
    at: Vec3,
    /// Whether its centre is in bone there.
    inside: bool,
}

impl InReach {
    pub fn with_capacity(count: usize) -> Self {
        Self { list: Vec::with_capacity(count), touched: Vec::with_capacity(count), ..Self::default() }
    }

    pub fn clear(&mut self) {
        self.list.clear();
    }

    /// The discs as `ball` with its centre at `at` sees them.
    pub fn seen_from(&mut self, ball: &Ball, at: Vec3) -> impl Iterator<Item = (&Disc, &Near)> {
        if (at, ball.inside) != (self.at, self.inside) {
            (self.at, self.inside) = (at, ball.inside);
            ball.see(&mut self.list, at);
        }
        self.list.iter().map(|seen| (&seen.disc, &seen.near))
    }

    /// Those that `ball`, its centre not in bone, touches with a tolerance of `most`.
    pub fn touching(&mut self, ball: &Ball, at: Vec3, most: f32) -> impl Iterator<Item = (&Disc, &Near)> {
        let Self { list, touched, .. } = self;
        let moved = if self.inside { f32::MAX } else { at.distance(self.at) };
        let may = list.iter().filter(|seen| seen.near.distance - moved <= ball.radius_at(&seen.disc) + most);
        touched.clear();
        touched.extend(may);
        ball.see(touched, at);
        let touch = touched.iter().filter(move |seen| seen.near.distance < ball.radius_at(&seen.disc) + most);
        touch.map(|seen| (&seen.disc, &seen.near))
    }

    /// Adds a disc that `ball` sees from where it saw the others; false when there is no room.
    pub fn push(&mut self, ball: &Ball, disc: Disc) -> bool {
        let has_room = self.list.len() < self.list.capacity();
        if has_room {
            self.list.push(DiscView { near: ball.nearest(&disc, self.at), disc });
        }
        has_room
    }
}

/// How far a ball may go.
#[derive(Clone, Copy)]
pub(crate) struct Limits {
    /// From the start, as far as the discs are known.
    pub reach: f32,
    /// Along the way.
    pub way: f32,
}

/// How a ball has moved.
pub(crate) struct Slide {
    /// Where it is.
    pub to: Vec3,
    /// Length of its way.
    pub way: f32,
    /// Whether it came to rest, not just to the end of what is known.
    pub rests: bool,
    /// Whether there was no place to go.
    pub contradiction: bool,
}

impl Ball {
    /// How near a disc may come to the part of the tool that it stands against.
    pub fn radius_at(&self, disc: &Disc) -> f32 {
        if disc.shaft { self.shaft.radius } else { self.radius }
    }

    /// The place on the shaft's axis nearest to a `point` of a disc, relative to the ball's centre.
    /// For discs that are not at the shaft it is the centre.
    #[inline]
    pub fn arm(&self, disc: &Disc, point: Vec3) -> Vec3 {
        if disc.shaft { self.shaft.at(self.shaft.along(point)) } else { Vec3::ZERO }
    }

    /// The disc as the tool with its ball at `centre` sees it: the ball, or the place on the
    /// shaft's axis that is nearest.
    #[inline(always)]
    pub fn nearest(&self, disc: &Disc, centre: Vec3) -> Near {
        let seen = centre + self.arm(disc, disc.centre - centre);
        let from_disc = seen - disc.centre;
        if self.inside && !disc.shaft {
            return Near { distance: from_disc.dot(disc.normal), direction: disc.normal };
        }
        let (mut rim, mut ahead) = disc.way_to(from_disc);
        if disc.shaft {
            // Across the axis from the point of the disc itself.
            let point = seen - rim - centre;
            rim = self.arm(disc, point) - point;
            ahead = rim;
        }
        let distance = rim.length();
        let direction = ahead.try_normalize().unwrap_or(disc.normal);
        Near { distance, direction }
    }

    /// Sees all of them with the ball at `centre`, eight at once: with the bits of
    /// [`nearest`](Self::nearest).
    fn see(&self, all: &mut [DiscView], centre: Vec3) {
        for eight in all.chunks_mut(8) {
            if self.inside || eight.iter().any(|seen| seen.disc.shaft) {
                eight.iter_mut().for_each(|seen| seen.near = self.nearest(&seen.disc, centre));
                continue;
            }
            let discs = core::array::from_fn(|n| &eight[n.min(eight.len() - 1)].disc);
            let (rim, ahead) = Disc::ways_to(discs, centre);
            let (distance, share) = (rim.length(), 1.0 / ahead.length());
            let direction = ahead * share;
            for (n, DiscView { disc, near }) in eight.iter_mut().enumerate() {
                let share = share.as_array()[n];
                let direction = if share.is_finite() && share > 0.0 { direction.lane(n) } else { disc.normal };
                *near = Near { distance: distance.as_array()[n], direction };
            }
        }
    }

    /// Copies those discs to `near` that a ball of radius `most` at `centre` has within `reach`.
    /// Returns the smallest distance.
    pub fn select(&self, discs: &[Disc], centre: Vec3, most: f32, reach: f32, all: &mut InReach) -> f32 {
        all.clear();
        (all.at, all.inside) = (centre, self.inside);
        // Cheaper than the disc's own distance and never greater.
        let may = discs.iter().filter(|disc| disc.least_distance(centre) <= most + reach);
        all.list.extend(may.map(|disc| DiscView { disc: *disc, near: Near::default() }));
        self.see(&mut all.list, centre);
        let smallest = all.list.iter().map(|seen| seen.near.distance).fold(f32::MAX, f32::min);
        all.list.retain(|seen| seen.near.distance <= most + reach);
        smallest
    }

    /// Distance of the nearest disc from the ball's centre.
    pub fn clearance(&self, all: &mut InReach, centre: Vec3) -> f32 {
        let ball = all.seen_from(self, centre).filter(|(disc, _)| !disc.shaft);
        ball.map(|(_, near)| near.distance).fold(f32::MAX, f32::min)
    }

    /// Where the ball at `centre` is nearest to `goal`, when overlaps must lose `push`, those of
    /// the shaft `lean`; `None` when that is nowhere.
    pub fn settle(
        &self,
        discs: &mut InReach,
        spaces: &mut HalfSpaces,
        centre: Vec3,
        goal: Vec3,
        (push, lean): (f32, f32),
    ) -> Option<Vec3> {
        spaces.clear();
        for (disc, near) in discs.seen_from(self, centre) {
            let clear = self.radius_at(disc).min(near.distance + if disc.shaft { lean } else { push });
            spaces
                .push(HalfSpace { normal: near.direction, offset: near.direction.dot(centre) - near.distance + clear });
        }
        spaces.nearest(goal)
    }

    /// Slides from `from` towards `goal`, no further than `limits`.
    pub fn slide(&self, discs: &mut InReach, spaces: &mut HalfSpaces, from: Vec3, goal: Vec3, limits: Limits) -> Slide {
        let mut slide = Slide { to: from, way: 0.0, rests: false, contradiction: false };
        for _ in 0..MAX_SLIDES {
            let at = slide.to;
            let no_further = |target: &Vec3| target.distance(goal) <= at.distance(goal) + 4.0 * PUSH;
            // Between walls even the least push would lever the ball away; without, it has room
            // where it is.
            let target = self
                .settle(discs, spaces, at, goal, (PUSH, PUSH))
                .filter(no_further)
                .or_else(|| self.settle(discs, spaces, at, goal, (-PUSH, -PUSH)));
            slide.contradiction |= target.is_none();
            let Some(target) = target else { break };
            let (way, left) = (target - at, limits.way - slide.way);
            let length = way.length();
            let share = share_within(at - from, way, limits.reach);
            let spent = length * share >= left;
            let share = if spent { left / length.max(1e-12) } else { share };
            slide.to = if share == 1.0 { target } else { at + share * way };
            slide.way += share * length;
            if spent || length < REST {
                break;
            }
            if share < 1.0 {
                return slide;
            }
        }
        slide.rests = true;
        slide
    }
}

/// The largest share t ≤ 1 of `way` with `|offset + t way| ≤ reach`.
fn share_within(offset: Vec3, way: Vec3, reach: f32) -> f32 {
    let (a, b, c) = (way.length_squared(), offset.dot(way), offset.length_squared() - reach * reach);
    if (offset + way).length_squared() <= reach * reach || a == 0.0 {
        return 1.0;
    }
    let root = (b * b - a * c).max(0.0).sqrt();
    ((root - b) / a).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit(v: [f32; 3]) -> Vec3 {
        Vec3::from(v).normalize_or(Vec3::Z)
    }

    proptest! {
        #[test]
        fn eight_at_once_have_the_bits_of_one(
            discs in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-1.0f32..1.0)), 1..40),
            centre in prop::array::uniform3(-3.0f32..3.0), flat in 0usize..4,
        ) {
            let (ball, centre) = (Ball { radius: 2.0, inside: false, shaft: Shaft::default() }, Vec3::from(centre));
            let disc = |(n, [c, normal, [k1, k2, rise]]): (usize, &[[f32; 3]; 3])| {
                let disc = Disc { centre: 4.0 * Vec3::from(*c), normal: unit(*normal), radius: 0.8, ..Disc::default() };
                if n % 4 < flat { disc } else { disc.bent([0.6 * k1, 0.6 * k2], 0.1 * rise) }
            };
            let mut discs: Vec<Disc> = discs.iter().enumerate().map(disc).collect();
            // One of them has the ball's centre in it.
            discs[0].centre = centre;
            let mut all: Vec<DiscView> = discs.iter().map(|disc| DiscView { disc: *disc, near: Near::default() }).collect();
            ball.see(&mut all, centre);
            for DiscView { disc, near } in all {
                let one = ball.nearest(&disc, centre);
                let bits = |near: Near| (near.distance.to_bits(), near.direction.to_array().map(f32::to_bits));
                prop_assert_eq!(bits(near), bits(one));
            }
        }
    }

    proptest! {
        #[test]
        fn no_slide_leads_away_from_its_goal(
            discs in prop::collection::vec((prop::array::uniform3(-4.0f32..4.0), prop::array::uniform3(-1.0f32..1.0)), 1..40),
            goal in prop::array::uniform3(-3.0f32..3.0), radius in 0.5f32..4.0, way in 0.0f32..1.0,
        ) {
            let discs: Vec<Disc> =
                discs.into_iter().map(|(c, n)| Disc { centre: Vec3::from(c), normal: unit(n), radius: 0.8, ..Disc::default() }).collect();
            let (ball, goal) = (Ball { radius, inside: false, shaft: Shaft::default() }, Vec3::from(goal));
            let mut all = InReach::default();
            // Discs through the centre have no side.
            prop_assume!(ball.select(&discs, Vec3::ZERO, radius, 9.0, &mut all) > 0.1);
            let slide = ball.slide(&mut all, &mut HalfSpaces::default(), Vec3::ZERO, goal, Limits { reach: 0.5, way });
            prop_assert!(slide.to.distance(goal) <= goal.length() + 0.011, "{} > {}", slide.to.distance(goal), goal.length());
            prop_assert!(slide.way <= way + 1e-5 && slide.to.length() <= 0.5 + 1e-4);
            for disc in &discs {
                let (was, is) = (ball.nearest(disc, Vec3::ZERO).distance, ball.nearest(disc, slide.to).distance);
                prop_assert!(is >= was.min(radius) - 0.01, "{is} < {was}, radius {radius}");
            }
        }
    }
}
