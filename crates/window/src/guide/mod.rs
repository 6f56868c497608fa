//! Leads the tool by the mouse: over the surface, down on it, along it and into it.
//!
//! # Theory
//! ```text
//! pointer moves       the tool flies CLEARANCE_MM over what is under it; first up, then across
//! left button down    it comes down; at the surface a cutting tool begins to turn
//!   held still        the hand advances along the shaft at the set feed, FEED_LEAD_MM at most
//!                     ahead of the tool: the spring between the two is the pressure. Near the
//!                     inner table it pushes less; where the bone below comes to be open it stops,
//!                     and a new press goes on
//!   dragged           the hand goes the pointer's way across the shaft, on the surface, or at its
//!                     depth in a hole; a craniotome keeps its foot under the bone. A cutting tool
//!                     is slower than the pointer: it follows the way, not the chord
//!   the feed ends     a craniotome's foot rides FOOT_MM below the inner table; others stop
//!                     where it touches the brain, a tool for the brain PRESS_MM deeper, a scalpel
//!                     INCISE_MM. Where no brain is known, a ball stops at the inner table
//! left button up      the tool rises, a craniotome out of its cut
//! wheel               up or down by WHEEL_MM
//! ```
//!
//! # Practice
//! In free air the shaft turns to the smoothed normal of the surface, until the user tilts it. The
//! window's leash holds after all of this: the hand is never deeper past a surface than the leash.

use crate::pointer::Pointer;
use crate::surface::Surfaces;
use glam::{Quat, Vec2, Vec3};
use trepan_geometry::{Pose, Tool, ToolKind};
use trepan_render::View;

/// Height at which a tool flies over a surface, mm.
const CLEARANCE_MM: f32 = 4.0;
/// Width of the air around a flying tool, mm.
const MARGIN_MM: f32 = 1.0;
/// Speed in free air, mm/s.
const FLIGHT_MM_S: f32 = 120.0;
/// Speed on the way down to a surface, mm/s.
const LANDING_MM_S: f32 = 25.0;
/// Speed along a surface, mm/s, and while the tool cuts.
const SLIDE_MM_S: [f32; 2] = [40.0, 4.0];
/// Largest lead of the hand over the tool while it pushes, mm.
const FEED_LEAD_MM: f32 = 2.0;
/// Largest way of the hand past the inner table of closed bone, and while a hole is widened, mm.
const PAST_MM: [f32; 2] = [0.5, 1.0];
/// Depth below a drill down to which bone is before it, mm.
const BEFORE_MM: f32 = 15.0;
/// Thickness under which bone is a shell, mm.
const THIN_MM: f32 = 0.3;
/// Shares of a drill's radius. A hole begins within the first; a wide one reaches up to the second,
/// or up to the third for a new press.
const WIDE: [f32; 3] = [0.35, 0.8, 0.6];
/// Depth of the hand past a surface along which it slides, mm.
const SKIM_MM: f32 = 0.3;
/// Points of the pointer's way that the tool still has to go, and their least distance, mm.
const TRAIL: usize = 64;
const TRAIL_MM: f32 = 0.5;
/// Depth of the centre of a craniotome's foot below the bone, mm.
const FOOT_MM: f32 = 0.8;
/// Radii of the rings around a tool in which the inner table is sought beside its own, mm: up to
/// the radius of a flap. A numerical parameter.
const TABLE_MM: [f32; 4] = [0.0, 6.0, 10.0, 16.0];
/// Way of a tool for the brain from its first touch on, mm: the deepest press of the scripts. It is
/// a depth, as a mouse does not feel a force that could stop a hand.
const PRESS_MM: f32 = 6.0;
/// The same of a scalpel, mm, numerical: through the dura and no further.
const INCISE_MM: f32 = 1.2;
/// Depth at which scissors close in a press, mm.
const SNIP_MM: f32 = 2.0;
/// Height of a ball's centre over the inner table where the feed ends without a brain, in radii.
/// The hole is then wider than the second of [`WIDE`].
const END: f32 = 0.5;
/// Distance at which a craniotome finds a hole, mm.
const SEAT_MM: f32 = 4.5;
/// Steps of that search to each side: numerical.
const SEAT_STEPS: i32 = 6;
/// Depth under its surroundings at which a tool counts as in a hole, mm.
const HOLE_MM: f32 = 1.0;
/// Move of a notch of the wheel, mm.
const WHEEL_MM: f32 = 0.1;
/// Points scrolled per notch of the wheel.
const NOTCH: f32 = 40.0;
/// Time after a drag in which the tool is not pushed, s.
const REST_S: f32 = 0.25;
/// Distance across the shaft under which the tool is over its goal, mm.
const OVER_MM: f32 = 0.3;
/// Distance that the pointer moves before the tool leaves a place set by the wheel, points.
const AWAY: f32 = 12.0;
/// Fastest turn of the shaft to the surface's normal, rad/s.
const TURN_RAD_S: f32 = 2.5;
/// Radius over which the surface's normal is smoothed, mm.
const SMOOTH_MM: f32 = 8.0;
/// Step in which a flight is checked for surfaces, mm.
const STEP_MM: f32 = 2.0;

/// Slowest and fastest feed, mm/s.
pub(crate) const FEEDS: std::ops::RangeInclusive<f32> = 0.2..=4.0;

/// What the guide knows of the scene in one picture.
#[derive(Clone, Copy)]
pub(crate) struct Around<'a> {
    pub surfaces: Surfaces<'a>,
    pub view: &'a View,
    pub tool: Tool,
    /// The tool's pose as contact allows it.
    pub world_from_tool: Pose,
    /// Time since the last picture, s.
    pub dt_s: f32,
    /// Whether the pedal is down without the mouse.
    pub pedal: bool,
}

/// How far the bone below a drill is open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Below {
    /// There is bone.
    Closed,
    /// A hole begins below the middle of the drill.
    Pierced,
    /// The hole is as wide as the drill.
    Open,
}

/// A press of the left button.
#[derive(Clone, Copy, Debug)]
struct Press {
    /// Where the tip shall go across the shaft.
    trail: Trail,
    /// The tip in the last picture, world mm.
    tip: Vec3,
    /// The pointer's place in the plane through the tip, when it was last seen.
    grip: Option<Vec3>,
    /// Time since pointer or tool last moved, s.
    still_s: f32,
    /// Whether the tool has come down.
    landed: bool,
    /// How far the bone below the drill was open when it came down.
    at_first: Option<Below>,
    /// How far the bone was opened by this press: the feed stops.
    through: Option<Below>,
    /// Height of the tip along the shaft at its first touch of the brain, mm.
    touched: Option<f32>,
    /// Whether scissors are still to close, deeper.
    goes_in: bool,
}

/// The pointer's way that the tool has not gone yet.
#[derive(Clone, Copy, Debug)]
struct Trail {
    points: [Vec3; TRAIL],
    count: usize,
}

impl Trail {
    fn to(point: Vec3) -> Self {
        Self { points: [point; TRAIL], count: 1 }
    }

    /// Lengthens the way; a full one ends straight.
    fn extend(&mut self, by: Vec3) {
        let end = self.points[self.count - 1] + by;
        let far = self.count < 2 || end.distance(self.points[self.count - 2]) > TRAIL_MM;
        self.count += usize::from(far && self.count < TRAIL);
        self.points[self.count - 1] = end;
    }

    /// The next place on the way.
    fn next(&self) -> Vec3 {
        self.points[0]
    }

    /// Goes along the way across the shaft by at most `step_mm`.
    fn go(&mut self, from: Vec3, up: Vec3, mut step_mm: f32) -> Vec3 {
        let mut at = from;
        loop {
            let way = (self.next() - at).reject_from(up);
            at += way.clamp_length_max(step_mm);
            if way.length() >= step_mm || self.count == 1 {
                return at;
            }
            step_mm -= way.length();
            self.points.copy_within(1..self.count, 0);
            self.count -= 1;
        }
    }
}

/// The state of the mouse's lead.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Guide {
    /// Feed while the button is held, mm/s.
    pub feed_mm_s: f32,
    /// Whether the left button runs a cutting tool.
    pub drills: bool,
    /// Whether the tool is being drawn back.
    pub withdraws: bool,
    /// The surface under the pointer and its smoothed normal.
    goal: Option<(Vec3, Option<Vec3>)>,
    press: Option<Press>,
    tilted: bool,
    /// Distance that the pointer must still move before the tool follows it, points.
    wait: f32,
}

impl Default for Guide {
    fn default() -> Self {
        let (goal, press) = (None, None);
        Self { feed_mm_s: 1.0, drills: true, withdraws: false, goal, press, tilted: false, wait: AWAY }
    }
}

impl Guide {
    /// Whether the left button runs the drill now.
    pub fn pedal(&self) -> bool {
        self.drills && self.press.is_some_and(|press| press.landed && press.through.is_none() && !press.goes_in)
    }

    /// What to do once the press has opened the bone.
    pub fn through(&self) -> Option<&'static str> {
        match self.press?.through? {
            Below::Open => Some("the hole is open: let go of the button"),
            _ => Some("through the bone: let go; press again to widen the hole"),
        }
    }

    /// Whether the left button leads the tool.
    pub fn is_pressed(&self) -> bool {
        self.press.is_some()
    }

    /// Keeps the shaft as the user tilted it, or lets it follow the surface again.
    pub fn tilt(&mut self, tilted: bool) {
        self.tilted = tilted;
    }

    /// Keeps the tool where keys or wheel have put it until the pointer moves away.
    pub fn stay(&mut self) {
        (self.wait, self.withdraws, self.goal) = (AWAY, false, None);
    }

    /// Moves the hand by a picture's input.
    pub fn follow(&mut self, hand: &mut Pose, pointer: &Pointer, around: &Around<'_>) {
        let up = hand.rotation * Vec3::Z;
        let inserted = self.is_inserted(around);
        if pointer.wheel != 0.0 {
            hand.translation -= WHEEL_MM * pointer.wheel / NOTCH * up;
            self.stay();
        }
        self.press = self.pressed(hand, pointer, around, inserted);
        if let Some(mut press) = self.press {
            self.work(hand, &mut press, around, inserted);
            self.press = Some(press);
            return;
        }
        self.wait = (self.wait - pointer.moved).max(0.0);
        let away = inserted && !self.withdraws || around.pedal || self.wait > 0.0 && !self.withdraws;
        if away {
            return;
        }
        if pointer.moved > 0.0 && !self.withdraws {
            self.goal = self.under(pointer, around);
        }
        self.fly(hand, around);
    }

    /// The surface under the pointer and its smoothed normal.
    fn under(&self, pointer: &Pointer, around: &Around<'_>) -> Option<(Vec3, Option<Vec3>)> {
        let (eye, along) = (around.view.eye, around.view.ray(pointer.at?));
        let (point, _) = around.surfaces.seen(eye, along)?;
        let Some((middle, normal)) = around.surfaces.smooth(point, along, SMOOTH_MM) else {
            return Some((point, None));
        };
        // A line of sight into a hole means the hole, not the wall or the floor that it meets.
        let is_hole = (point - middle).dot(normal) < -HOLE_MM;
        let at_rim = eye + (middle - eye).dot(normal) / along.dot(normal).min(-0.1) * along;
        Some((if is_hole { at_rim } else { point }, Some(normal)))
    }

    /// The press after this picture; a release lets the tool rise, or rest in its cut.
    fn pressed(&mut self, hand: &mut Pose, pointer: &Pointer, around: &Around<'_>, inserted: bool) -> Option<Press> {
        let up = hand.rotation * Vec3::Z;
        let tip = around.world_from_tool.translation;
        if !pointer.held || pointer.tilt {
            if self.press.is_some() {
                (self.goal, self.wait, self.withdraws) = (None, 0.0, true);
            }
            return None;
        }
        let in_plane = pointer.at.and_then(|at| on_plane(around.view, at, tip, up));
        let Some(mut press) = self.press else {
            self.withdraws = false;
            let under = || self.under(pointer, around).map_or(tip, |(point, _)| seat(around, point, up));
            let trail = Trail::to(if inserted { tip } else { under() });
            let (at_first, through, touched) = (None, None, None);
            let (grip, still_s, landed) = (in_plane, REST_S, inserted);
            let goes_in = around.tool.kind == ToolKind::Scissors;
            return Some(Press { trail, tip, grip, still_s, landed, at_first, through, touched, goes_in });
        };
        if pointer.left != Vec2::ZERO {
            let moved = in_plane.zip(press.grip).map_or(Vec3::ZERO, |(now, before)| now - before);
            press.trail.extend(moved.reject_from(up));
            press.still_s = 0.0;
        }
        press.grip = in_plane;
        press.still_s += around.dt_s;
        Some(press)
    }

    /// Comes down, slides or pushes.
    fn work(&self, hand: &mut Pose, press: &mut Press, around: &Around<'_>, inserted: bool) {
        let up = hand.rotation * Vec3::Z;
        let tip = around.world_from_tool.translation;
        let way = (press.trail.next() - hand.translation).reject_from(up);
        if !press.landed && way.length() > OVER_MM {
            self.fly_to(hand, press.trail.next(), around);
            return;
        }
        let rest = around.surfaces.rest(hand.translation, up, around.tool.tip_radius_mm);
        let gap = rest.map_or(0.0, |mm| -mm);
        let craniotome = around.tool.cutting_mm > 0.0;
        press.landed |= gap < 0.5 * CLEARANCE_MM;
        let cuts = self.drills && around.tool.kind.cuts();
        let is_drill = cuts && !craniotome;
        let lead_mm = FEED_LEAD_MM + gap.max(0.0);
        let lead_mm = if is_drill && press.landed { lead_mm.min(press.stops(around)) } else { lead_mm };
        if press.through.is_some() {
            hand.translation = tip;
            return;
        }
        let step = SLIDE_MM_S[usize::from(cuts)] * around.dt_s;
        let gone = (tip - std::mem::replace(&mut press.tip, tip)).reject_from(up).length();
        let is_far = way.length() > 0.02 || press.trail.count > 1;
        if is_far && press.still_s < REST_S && gone > 0.2 * step {
            press.still_s = 0.0;
        }
        let sliding = is_far && (press.still_s < REST_S || inserted);
        if sliding {
            hand.translation = press.trail.go(hand.translation, up, step);
        }
        let foot = craniotome.then(|| table(around, hand.translation, up)).flatten();
        let lowest_mm = press.lowest(around, cuts, sliding && gap > -HOLE_MM);
        let step_mm = LANDING_MM_S * around.dt_s;
        let rise = match foot {
            Some(inner) if inserted || gap < -HOLE_MM => (inner - FOOT_MM).clamp(-step_mm, step_mm),
            _ if sliding && gap > -HOLE_MM => (-gap - SKIM_MM).clamp(-step_mm, step_mm),
            _ if sliding => 0.0,
            _ if gap > 0.0 => -step_mm.min(gap + self.feed_mm_s * around.dt_s),
            _ => -self.feed_mm_s * around.dt_s,
        };
        hand.translation += rise * up;
        // Sliding in a cut leads by as much as pushing.
        hand.translation = tip + (hand.translation - tip).clamp_length_max(lead_mm);
        hand.translation += (lowest_mm - hand.translation.dot(up)).clamp(0.0, step_mm) * up;
    }

    /// Whether a craniotome's foot is under the bone.
    fn is_inserted(&self, around: &Around<'_>) -> bool {
        let Tool { cutting_mm, .. } = around.tool;
        let Pose { translation: tip, rotation, .. } = around.world_from_tool;
        if cutting_mm <= 0.0 {
            return false;
        }
        let up = rotation * Vec3::Z;
        let is_in_hole = || around.surfaces.rest(tip, up, foot_ring(&around.tool)).is_some_and(|mm| mm > HOLE_MM);
        table(around, tip, up).is_some_and(|mm| mm > 0.0 || mm > -2.0 && is_in_hole())
    }

    /// Flies to the goal under the pointer, or rises where there is none.
    fn fly(&mut self, hand: &mut Pose, around: &Around<'_>) {
        let up = hand.rotation * Vec3::Z;
        let tip = around.world_from_tool.translation;
        let clear = |hand: &Pose| height(around, hand).is_none_or(|mm| mm > -0.5);
        let goal = self.goal.map_or(hand.translation, |(point, _)| point);
        if self.goal.is_some() || self.withdraws {
            self.fly_to(hand, goal, around);
        }
        if self.withdraws && clear(hand) && (hand.translation - tip).length() < CLEARANCE_MM {
            self.withdraws = false;
        }
        if let Some((_, Some(normal))) = self.goal.filter(|_| !self.tilted && clear(hand)) {
            let turn = Quat::from_rotation_arc(up, normal);
            let angle = turn.to_axis_angle().1.max(1e-6);
            let share = (TURN_RAD_S * around.dt_s / angle).min(1.0);
            hand.rotation = (Quat::IDENTITY.slerp(turn, share) * hand.rotation).normalize();
        }
    }

    /// Flies up until the air around is clear, then across, then down to the clearance.
    fn fly_to(&self, hand: &mut Pose, goal: Vec3, around: &Around<'_>) {
        let up = hand.rotation * Vec3::Z;
        let steps = (FLIGHT_MM_S * around.dt_s / STEP_MM).ceil().clamp(1.0, 12.0) as usize;
        for _ in 0..steps {
            let high = height(around, hand);
            if let Some(low) = high.filter(|mm| *mm < -0.25) {
                hand.translation += (-low).min(STEP_MM) * up;
                continue;
            }
            let aside = (goal - hand.translation).reject_from(up);
            hand.translation += aside.clamp_length_max(STEP_MM);
            let over = height(around, hand).or(high).unwrap_or(0.0);
            hand.translation -= over.clamp(0.0, STEP_MM) * up;
        }
    }
}

impl Press {
    /// Sees whether the press has opened the bone; returns how far the hand may lead the drill, mm.
    fn stops(&mut self, around: &Around<'_>) -> f32 {
        let Pose { translation: tip, rotation, .. } = around.world_from_tool;
        let (up, radius_mm) = (rotation * Vec3::Z, around.tool.tip_radius_mm);
        let bone = around.surfaces.tables(tip, up, BEFORE_MM);
        let widths = [WIDE[0], WIDE[if self.at_first.is_some() { 1 } else { 2 }]];
        let [begun, wide] = widths.map(|share| around.surfaces.open_share(tip, up, (share * radius_mm, BEFORE_MM)));
        let below = match bone {
            Some(_) if begun == 0.0 => Below::Closed,
            None if wide == 1.0 => Below::Open,
            _ => Below::Pierced,
        };
        // A shell that the last press left counts as pierced.
        let is_thin = bone.is_none_or(|[outer_mm, inner_mm]| inner_mm - outer_mm < THIN_MM);
        let at_first = *self.at_first.get_or_insert(if is_thin { below.max(Below::Pierced) } else { below });
        self.through = self.through.or((below > at_first).then_some(below));
        match (at_first, bone) {
            (Below::Closed, Some([_, mm])) => (mm - radius_mm).max(0.0) + PAST_MM[0],
            (Below::Pierced, _) => PAST_MM[1],
            _ => f32::INFINITY,
        }
    }

    /// The lowest height along the shaft to which the hand may feed the tool, mm. `skims`: the tool
    /// slides over a surface, and touches it anew.
    fn lowest(&mut self, around: &Around<'_>, cuts: bool, skims: bool) -> f32 {
        let Tool { kind, cutting_mm, tip_radius_mm, .. } = around.tool;
        let Pose { translation: tip, rotation, .. } = around.world_from_tool;
        let up = rotation * Vec3::Z;
        let (here, craniotome) = (tip.dot(up), cutting_mm > 0.0);
        let brain = if craniotome { None } else { around.surfaces.brain(tip, up) };
        if brain.is_some_and(|mm| mm + tip_radius_mm >= 0.0) && (skims || self.touched.is_none()) {
            self.touched = Some(here);
        }
        if let Some(touched) = self.touched {
            self.goes_in &= here > touched - SNIP_MM;
            let deep_mm = if kind == ToolKind::Scalpel { INCISE_MM } else { PRESS_MM };
            return touched - if cuts { 0.0 } else { deep_mm };
        }
        let lowest = if craniotome { -FOOT_MM } else { END * tip_radius_mm };
        match table(around, tip, up) {
            _ if brain.is_some() => f32::NEG_INFINITY,
            Some(mm) => here + mm + lowest,
            // Thick bone has no inner table within reach yet.
            None if around.surfaces.is_bone_around(tip, up, foot_ring(&around.tool)) => f32::NEG_INFINITY,
            None => here,
        }
    }
}

/// Height along `up` over a place of the inner table around it, mm; `None` without bone around.
fn table(around: &Around<'_>, place: Vec3, up: Vec3) -> Option<f32> {
    let radii = TABLE_MM.map(|mm| mm.max(foot_ring(&around.tool)));
    radii.into_iter().find_map(|radius_mm| around.surfaces.inner(place, up, radius_mm))
}

/// Where a craniotome's foot goes in near a place: the middle of the hole there, if there is one.
fn seat(around: &Around<'_>, place: Vec3, up: Vec3) -> Vec3 {
    let Tool { cutting_mm, tip_radius_mm, .. } = around.tool;
    let rest = |at: Vec3| around.surfaces.rest(at, up, tip_radius_mm);
    let Some(here) = rest(place).filter(|_| cutting_mm > 0.0) else { return place };
    let (right, front) = up.any_orthonormal_pair();
    let steps = (-SEAT_STEPS..=SEAT_STEPS).flat_map(|i| (-SEAT_STEPS..=SEAT_STEPS).map(move |j| (i as f32, j as f32)));
    let asides = steps.map(|(i, j)| SEAT_MM / SEAT_STEPS as f32 * (i * right + j * front));
    let deep: Vec<Vec3> =
        asides.filter(|aside| rest(place + *aside).is_some_and(|mm| mm < here.min(0.0) - HOLE_MM)).collect();
    let middle = deep.iter().sum::<Vec3>() / deep.len().max(1) as f32;
    // The middle of a bent cut may lie beside it.
    let nearest = deep.into_iter().min_by(|a, b| a.distance(middle).total_cmp(&b.distance(middle)));
    place + nearest.unwrap_or(Vec3::ZERO)
}

/// Height of a pose over the clearance above the surfaces below it, mm.
fn height(around: &Around<'_>, hand: &Pose) -> Option<f32> {
    let up = hand.rotation * Vec3::Z;
    let rest = around.surfaces.rest(hand.translation, up, around.tool.tip_radius_mm + MARGIN_MM)?;
    Some(-rest - CLEARANCE_MM + MARGIN_MM)
}

/// Radius around a craniotome's foot at which bone is sought, mm.
fn foot_ring(tool: &Tool) -> f32 {
    2.0 * tool.tip_radius_mm + 1.0
}

/// Where a line of sight meets the plane through a point across a direction.
fn on_plane(view: &View, at: Vec2, point: Vec3, across: Vec3) -> Option<Vec3> {
    let along = view.ray(at);
    let fall = along.dot(across);
    let distance = (point - view.eye).dot(across) / fall;
    (fall.abs() > 0.1 && distance > 0.0).then(|| view.eye + distance * along)
}

#[cfg(test)]
mod tests;
