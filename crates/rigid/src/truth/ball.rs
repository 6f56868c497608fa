//! A ball that a led hand presses into bone: where it is held, and what it cuts.

use super::Bone;
use super::directions::{Directions, SHARE};
use super::price::price;
use crate::removal::{Pressed, RemovalLaw};
use glam::{DMat3, DVec3};

/// Longest step with one set of bounds, mm, where bone is near.
const STEP_MM: f64 = 0.02;
/// How far along its rays bone is looked for, mm: more than an edge between two of them stands out.
const NEAR_MM: f64 = 0.1;
/// A ball that moves less has come to rest, mm.
const REST_MM: f64 = 1e-7;
/// A ball that comes no nearer in so many steps has come to rest, mm.
const CREEP_STEPS: usize = 16;
/// See [`CREEP_STEPS`].
const CREEP_MM: f64 = 1e-5;
/// What bounds are kept to, mm.
const TIGHT_MM: f64 = 1e-8;
/// Distance at which bone touches, mm.
const TOUCHED_MM: f64 = 1e-3;
/// Overlap that is rounding, mm: that of a hand whose poses are f32.
const ROUNDING_MM: f64 = 2e-5;
/// Difference from its neighbours under which a direction needs no polish, mm: a quarter of it is
/// the most that bone stands out between them.
const FLAT_MM: f64 = 1e-3;
/// First and last turn of a polish, rad.
const TURNS: [f64; 2] = [0.03, 2e-5];
/// How far before the front bone is looked for, mm.
const AHEAD_MM: f64 = 1e-6;
/// Longest way with one integral over the front, mm.
const CUT_MM: f64 = 2e-3;
/// Most steps in a tick; the device is then out of reach, as after a teleport.
const MOST_STEPS: usize = 20_000;

/// A half-space that bounds the next step: `way · direction <= room`.
#[derive(Clone, Copy)]
struct Bound {
    direction: DVec3,
    room: f64,
    /// Room more, mm, as it is bent.
    bend: f64,
}

impl Bound {
    /// How far a step goes beyond it, mm. Rounding is no overlap.
    fn beyond(&self, way: DVec3) -> f64 {
        let room = if self.room < -ROUNDING_MM { self.room } else { self.room.max(0.0) };
        self.direction.dot(way) - room - self.bend
    }
}

/// The ball of one tool.
pub struct Ball {
    radius: f64,
    centre: DVec3,
    /// Of each direction: how far the ball may have travelled until bone may be at its surface, mm.
    clear_until: Vec<f64>,
    /// Whether bone was at its surface there when that was last found.
    touched: Vec<bool>,
    travelled: f64,
    stalled: bool,
    /// Bone of the reference density that the front met last, mm².
    rate: f64,
}

impl Ball {
    /// A ball in the free.
    pub fn new(radius_mm: f32, centre: DVec3) -> Self {
        let count = Directions::get().all.len();
        let (clear_until, touched) = (vec![0.0; count], vec![false; count]);
        Self { radius: radius_mm.into(), centre, clear_until, touched, travelled: 0.0, stalled: false, rate: 0.0 }
    }

    /// Where bone lets it be, mm.
    pub fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Puts it somewhere else, in the free.
    pub fn put(&mut self, centre: DVec3) {
        *self = Self::new(self.radius as f32, centre);
    }

    /// Slides as near to the device as bone lets it. Returns how far it is held from there, mm:
    /// depth and normal in one.
    pub fn follow(&mut self, bone: &Bone, device: DVec3) -> DVec3 {
        let mut before = f64::MAX;
        for step in 0..MOST_STEPS {
            let wanted = device - self.centre;
            if step % CREEP_STEPS == 0 {
                if before - wanted.length() < CREEP_MM {
                    break;
                }
                before = wanted.length();
            }
            let way = self.slide(bone, wanted);
            self.centre += way;
            self.travelled += way.length();
            if way == wanted || way.length() < REST_MM {
                break;
            }
        }
        self.centre - device
    }

    /// One step to the point nearest to the device within bounds of all directions.
    fn slide(&mut self, bone: &Bone, wanted: DVec3) -> DVec3 {
        // Where bone touches, as in a bore all around, it is looked for only when needed.
        for at in 0..self.clear_until.len() {
            if !self.touched[at] && self.clear(at) < NEAR_MM {
                self.renew(bone, at);
            }
        }
        if wanted.length() < self.free() {
            return wanted;
        }
        // On a way out of a hole bounds that are straight would hold the ball back.
        let straight = wanted.clamp_length_max(NEAR_MM);
        if self.fits(bone, self.centre + straight, wanted) {
            return straight;
        }
        let mut rooms: Vec<Option<f64>> = vec![None; self.clear_until.len()];
        if self.consistent(bone, wanted, &mut rooms, &[]).length() < REST_MM {
            return DVec3::ZERO;
        }
        let polished = self.look_around(bone, &mut rooms);
        self.consistent(bone, wanted, &mut rooms, &polished)
    }

    /// The way within bent bounds, mm. Around a point of bone the bound is a ball: over a step of s
    /// it leaves s²/2r more room than a straight one.
    fn consistent(&mut self, bone: &Bone, wanted: DVec3, rooms: &mut [Option<f64>], more: &[Bound]) -> DVec3 {
        let mut length = wanted.length().min(self.free().max(STEP_MM));
        loop {
            let bend = 0.5 * length * length / self.radius;
            let way = self.nearest(bone, wanted, rooms, more, bend).clamp_length_max(length);
            if way.length() >= 0.5 * length || length < REST_MM {
                return way;
            }
            length *= 0.25;
        }
    }

    /// Whether the ball has room somewhere; looks along `first` first.
    fn fits(&self, bone: &Bone, centre: DVec3, first: DVec3) -> bool {
        let free = |direction: DVec3| bone.within(centre + self.radius * direction, NEAR_MM) < ROUNDING_MM;
        free(first.normalize_or_zero()) && Directions::get().all.iter().all(|direction| free(*direction))
    }

    /// How far bone is at least from the ball's surface in the direction of that number, mm.
    fn clear(&self, at: usize) -> f64 {
        (self.clear_until[at] - self.travelled).max(0.0)
    }

    /// The least of all directions.
    fn free(&self) -> f64 {
        (0..self.clear_until.len()).map(|at| self.clear(at)).fold(f64::MAX, f64::min)
    }

    /// Finds anew how far bone is at least.
    fn renew(&mut self, bone: &Bone, at: usize) {
        let clear = -bone.within(self.centre + self.radius * Directions::get().all[at], f64::MAX);
        (self.clear_until[at], self.touched[at]) = (self.travelled + clear.max(0.0), clear < TOUCHED_MM);
    }

    /// Room along the direction of that number: at least what is known, or the ray's own.
    fn room_of(&mut self, bone: &Bone, at: usize) -> f64 {
        self.renew(bone, at);
        match self.clear(at) {
            clear if clear >= NEAR_MM => clear,
            _ => self.room(bone, Directions::get().all[at]).unwrap_or(NEAR_MM),
        }
    }

    /// Finds the room along all directions with bone near. Returns bounds by bone that stands out
    /// between them.
    fn look_around(&mut self, bone: &Bone, rooms: &mut [Option<f64>]) -> Vec<Bound> {
        for at in 0..rooms.len() {
            if rooms[at].is_none() && self.clear(at) < NEAR_MM {
                rooms[at] = Some(self.room_of(bone, at));
            }
        }
        let Directions { all, beside } = Directions::get();
        let polish = |at: usize| {
            let room = rooms[at].filter(|room| *room < NEAR_MM)?;
            let others = beside[at].map(|other| rooms[usize::from(other)].unwrap_or(NEAR_MM));
            let deepest = others.iter().all(|other| room <= *other);
            let stands_out = deepest && others.iter().any(|other| other - room > FLAT_MM);
            stands_out.then(|| self.polished(bone, Bound { direction: all[at], room, bend: 0.0 }))
        };
        (0..rooms.len()).filter_map(polish).collect()
    }

    /// The way to the point nearest to `wanted` within the bounds of all directions and some more.
    /// Rooms are found as they are needed.
    ///
    /// A dual active-set method: the bound that is most violated joins, and of it and those that
    /// hold the point, at most three hold the next. Bounds that contradict leave the ball where it
    /// is.
    fn nearest(&mut self, bone: &Bone, wanted: DVec3, rooms: &mut [Option<f64>], more: &[Bound], bend: f64) -> DVec3 {
        let (mut held, mut way) = (Vec::<Bound>::new(), wanted);
        let Directions { all, beside } = Directions::get();
        // In a hole of its own width those around the way that is wanted hold the ball.
        let along = |at: &usize| all[*at].dot(wanted);
        let front = (0..all.len()).max_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or(0);
        let mut asked: Vec<usize> = beside[front].iter().map(|at| usize::from(*at)).chain([front]).collect();
        for _ in 0..2 * all.len() {
            let (mut worst, mut beyond, mut unknown) = (None, TIGHT_MM, None);
            for &at in &asked {
                let room = rooms[at].unwrap_or(self.clear(at));
                let bound = Bound { direction: all[at], room, bend };
                if room < NEAR_MM && bound.beyond(way) > beyond {
                    (worst, beyond) = (Some(bound), bound.beyond(way));
                    unknown = rooms[at].is_none().then_some(at);
                }
            }
            for bound in more.iter().map(|bound| Bound { bend, ..*bound }) {
                if bound.beyond(way) > beyond {
                    (worst, beyond, unknown) = (Some(bound), bound.beyond(way), None);
                }
            }
            match (worst, unknown) {
                (None, _) if asked.len() == all.len() => return way,
                (None, _) => asked = (0..all.len()).collect(),
                (Some(_), Some(at)) => rooms[at] = Some(self.room_of(bone, at)),
                (Some(bound), None) => {
                    held.push(bound);
                    let Some(next) = hold(wanted, &held) else { return DVec3::ZERO };
                    (held, way) = next;
                }
            }
        }
        DVec3::ZERO
    }

    /// How far bone is from the ball's surface along a ray from the centre, mm, negative for an
    /// overlap; `None` where none is near.
    fn room(&self, bone: &Bone, direction: DVec3) -> Option<f64> {
        let within = |out: f64| bone.within(self.centre + (self.radius + out) * direction, NEAR_MM);
        let here = within(0.0);
        let (mut low, mut high, mut at_low, mut at_high);
        if here < 0.0 {
            (low, at_low, high) = (0.0, here, STEP_MM);
            at_high = within(high);
            if at_high < 0.0 {
                (low, at_low, high) = (high, at_high, NEAR_MM);
                at_high = within(high);
            }
            if at_high < 0.0 {
                return None;
            }
        } else {
            (low, high, at_high) = (-1e-5, 0.0, here);
            at_low = within(low);
            while at_low >= 0.0 {
                if low < -0.5 {
                    return Some(low);
                }
                (high, at_high, low) = (low, at_low, 4.0 * low);
                at_low = within(low);
            }
        }
        // The regula falsi of Illinois, with a bisection where it creeps.
        for turn in 0..80 {
            if high - low < 1e-10 {
                break;
            }
            let share = if turn % 8 == 7 { 0.5 } else { (at_low / (at_low - at_high)).clamp(1e-3, 1.0 - 1e-3) };
            let middle = low + share * (high - low);
            let value = within(middle);
            if value < 0.0 {
                (low, at_low, at_high) = (middle, value, 0.5 * at_high);
            } else {
                (high, at_high, at_low) = (middle, value, 0.5 * at_low);
            }
        }
        Some(low)
    }

    /// Turns a direction to where the bone is nearest.
    fn polished(&self, bone: &Bone, from: Bound) -> Bound {
        let (mut best, mut turn) = (from, TURNS[0]);
        while turn > TURNS[1] {
            let (a, b) = best.direction.any_orthonormal_pair();
            let tried = [a, -a, b, -b].map(|aside| (best.direction + turn * aside).normalize());
            let rays = tried
                .into_iter()
                .filter_map(|direction| Some(Bound { direction, room: self.room(bone, direction)?, bend: 0.0 }));
            match rays.min_by(|a, b| a.room.total_cmp(&b.room)).filter(|nearer| nearer.room < best.room) {
                Some(nearer) => best = nearer,
                None => turn *= 0.4,
            }
        }
        best
    }

    /// Cuts towards the device as far as the load earns in `dt_ms`, held along `axis`. Returns the
    /// volume, mm³.
    pub fn drill(&mut self, bone: &mut Bone, (device, axis): (DVec3, DVec3), law: &RemovalLaw, dt_ms: f32) -> f64 {
        let pressed = device - self.centre;
        let Some(forward) = pressed.try_normalize() else { return 0.0 };
        let (load_mm, cosine) = (pressed.length() as f32, forward.dot(axis) as f32);
        let at = Pressed { radius_mm: self.radius as f32, depth_mm: load_mm, cosine, dt_ms };
        let (earned, rpm) = law.turned(&at, &mut self.stalled);
        if rpm <= 0.0 {
            return 0.0;
        }
        let mut earned = f64::from(earned);
        let (mut left, mut removed) = (pressed.length(), 0.0);
        while earned > 1e-12 && left > 1e-12 {
            let longest = left.min(CUT_MM);
            // The front half way, as far as the last one lets one guess.
            let half = 0.5 * (earned / self.rate.max(1e-9)).min(longest);
            let [area, rate] = self.front(bone, self.centre + half * forward, forward, law);
            let way = (earned / rate.max(1e-9)).min(longest);
            (removed, earned, left, self.rate) = (removed + way * area, earned - way * rate, left - way, rate);
            let to = self.centre + way * forward;
            bone.cut.sweep(self.radius, self.centre, to);
            (self.centre, self.travelled) = (to, self.travelled + way);
        }
        removed
    }

    /// Area of the uncut bone that the front meets at `centre`, seen along `forward`, and the same
    /// times its price, mm².
    fn front(&self, bone: &Bone, centre: DVec3, forward: DVec3, law: &RemovalLaw) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for direction in &Directions::get().all {
            let facing = direction.dot(forward);
            if facing <= 0.0 {
                continue;
            }
            let place = centre + (self.radius + AHEAD_MM) * direction;
            if bone.within(place, 0.0) >= 0.0 {
                let area = self.radius * self.radius * SHARE * facing;
                sums[0] += area;
                sums[1] += area * price(law, bone.density.hu(place));
            }
        }
        sums
    }
}

/// The point nearest to `wanted` within at most four bounds, the last of which holds it, and the
/// bounds that hold it.
fn hold(wanted: DVec3, bounds: &[Bound]) -> Option<(Vec<Bound>, DVec3)> {
    let (last, rest) = bounds.split_last()?;
    let mut best: Option<(Vec<Bound>, DVec3)> = None;
    for chosen in 0..1u32 << rest.len() {
        let picked = rest.iter().enumerate().filter(|(at, _)| chosen >> at & 1 == 1).map(|(_, bound)| *bound);
        let held: Vec<Bound> = picked.chain([*last]).collect();
        let Some(point) = on_all(wanted, &held) else { continue };
        let fits = bounds.iter().all(|bound| bound.beyond(point) < 1.1 * TIGHT_MM);
        let nearer = best.as_ref().is_none_or(|(_, other)| wanted.distance(point) < wanted.distance(*other));
        if fits && nearer {
            best = Some((held, point));
        }
    }
    best
}

/// The point nearest to `wanted` on one, two or three planes.
fn on_all(wanted: DVec3, planes: &[Bound]) -> Option<DVec3> {
    let over = |bound: &Bound| bound.beyond(wanted);
    match planes {
        [a] => Some(wanted - over(a) * a.direction),
        [a, b] => {
            let (both, [da, db]) = (a.direction.dot(b.direction), [over(a), over(b)]);
            let det = 1.0 - both * both;
            let point = wanted - ((da - both * db) * a.direction + (db - both * da) * b.direction) / det;
            (det > 1e-12).then_some(point)
        }
        [a, b, c] => {
            let rows = DMat3::from_cols(a.direction, b.direction, c.direction).transpose();
            (rows.determinant().abs() > 1e-9).then(|| wanted - rows.inverse() * DVec3::new(over(a), over(b), over(c)))
        }
        _ => None,
    }
}
