//! Leads the tool by the mouse: over the surface, down on it, along it and into it.
//!
//! # Theory
//! ```text
//! pointer moves       the tool flies CLEARANCE_MM over what is under it; first up, then across
//! left button down    it comes down; at the surface a cutting tool begins to turn
//!   held still        the hand advances along the shaft at the set feed, FEED_LEAD_MM at most
//!                     ahead of the tool: the spring between the two is the pressure
//!   dragged           the hand moves with the pointer across the shaft, on the surface, or at its
//!                     depth in a hole; a craniotome keeps its foot under the bone
//! left button up      the tool rises; a craniotome in its cut stays
//! wheel               up or down by WHEEL_MM
//! ```
//!
//! # Practice
//! In free air the shaft turns to the smoothed normal of the surface, until the user tilts it. The
//! window's leash holds after all of this: the hand is never deeper past a surface than the leash.

use super::pointer::Pointer;
use super::surface::Surfaces;
use crate::View;
use glam::{Quat, Vec2, Vec3};
use trepan_geometry::{Pose, Tool};

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
/// Depth of the hand past a surface along which it slides, mm.
const SKIM_MM: f32 = 0.3;
/// Depth of the centre of a craniotome's foot below the bone, mm.
const FOOT_MM: f32 = 0.8;
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

/// A press of the left button.
#[derive(Clone, Copy, Debug)]
struct Press {
    /// Where the tip shall go across the shaft, world mm.
    goal: Vec3,
    /// The pointer's place in the plane through the tip, when it was last seen.
    grip: Option<Vec3>,
    /// Time since the pointer last moved, s.
    still_s: f32,
    /// Whether the tool has come down.
    landed: bool,
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
        self.drills && self.press.is_some_and(|press| press.landed)
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
        Some((point, around.surfaces.smooth_normal(point, along, SMOOTH_MM)))
    }

    /// The press after this picture; a release lets the tool rise, or rest in its cut.
    fn pressed(&mut self, hand: &mut Pose, pointer: &Pointer, around: &Around<'_>, inserted: bool) -> Option<Press> {
        let up = hand.rotation * Vec3::Z;
        let tip = around.world_from_tool.translation;
        if !pointer.held || pointer.tilt {
            if self.press.is_some() {
                (self.goal, self.wait) = (None, 0.0);
                if inserted {
                    hand.translation = tip;
                } else {
                    self.withdraws = true;
                }
            }
            return None;
        }
        let in_plane = pointer.at.and_then(|at| on_plane(around.view, at, tip, up));
        let Some(mut press) = self.press else {
            self.withdraws = false;
            let under = || self.under(pointer, around).map_or(tip, |(point, _)| seat(around, point, up));
            let goal = if inserted { tip } else { under() };
            return Some(Press { goal, grip: in_plane, still_s: REST_S, landed: inserted });
        };
        if pointer.left != Vec2::ZERO {
            let moved = in_plane.zip(press.grip).map_or(Vec3::ZERO, |(now, before)| now - before);
            press.goal += moved.reject_from(up);
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
        let way = (press.goal - hand.translation).reject_from(up);
        if !press.landed && way.length() > OVER_MM {
            self.fly_to(hand, press.goal, around);
            return;
        }
        let rest = around.surfaces.rest(hand.translation, up, around.tool.tip_radius_mm);
        let gap = rest.map_or(0.0, |mm| -mm);
        let craniotome = around.tool.cutting_mm > 0.0;
        press.landed |= gap < 0.5 * CLEARANCE_MM;
        let cuts = self.drills && around.tool.kind.cuts();
        let sliding = way.length() > 0.02 && (press.still_s < REST_S || inserted);
        if sliding {
            let step = SLIDE_MM_S[usize::from(cuts)] * around.dt_s;
            hand.translation += way.clamp_length_max(step);
        }
        let foot = craniotome.then(|| around.surfaces.inner(hand.translation, up, foot_ring(&around.tool))).flatten();
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
        hand.translation = tip + (hand.translation - tip).clamp_length_max(lead(gap));
    }

    /// Whether a craniotome's foot is under the bone.
    fn is_inserted(&self, around: &Around<'_>) -> bool {
        let Tool { cutting_mm, .. } = around.tool;
        let Pose { translation: tip, rotation, .. } = around.world_from_tool;
        if cutting_mm <= 0.0 {
            return false;
        }
        let up = rotation * Vec3::Z;
        let inner = around.surfaces.inner(tip, up, foot_ring(&around.tool));
        let outer = around.surfaces.rest(tip, up, foot_ring(&around.tool));
        inner.is_some_and(|mm| mm > -2.0) && outer.is_some_and(|mm| mm > HOLE_MM)
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
    if deep.is_empty() { place } else { place + deep.iter().sum::<Vec3>() / deep.len() as f32 }
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

/// Largest distance from the tool to the hand at a gap to the surface, mm.
fn lead(gap: f32) -> f32 {
    FEED_LEAD_MM + gap.max(0.0)
}

/// Where a line of sight meets the plane through a point across a direction.
fn on_plane(view: &View, at: Vec2, point: Vec3, across: Vec3) -> Option<Vec3> {
    let along = view.ray(at);
    let fall = along.dot(across);
    let distance = (point - view.eye).dot(across) / fall;
    (fall.abs() > 0.1 && distance > 0.0).then(|| view.eye + distance * along)
}

#[cfg(test)]
mod tests {
    use super::super::surface::tests::slab;
    use super::*;
    use crate::Camera;

    /// A hand over the slab, with a tool that goes wherever the hand goes outside bone.
    struct Bench {
        guide: Guide,
        hand: Pose,
        tip: Pose,
        tool: Tool,
        view: View,
    }

    impl Bench {
        fn with(tool: Tool) -> Self {
            let view = Camera::viewed_from(Vec3::ZERO, Vec3::new(0.3, 0.5, 1.0), 200.0).view(1.0);
            let start = Pose::from_translation(Vec3::new(30.0, 5.0, 40.0));
            Self { guide: Guide::default(), hand: start, tip: start, tool, view }
        }

        /// The pointer over a world point for some pictures.
        fn point(&mut self, at: Vec3, pointer: Pointer, pictures: usize) {
            for _ in 0..pictures {
                let now = self.view.project(at).0;
                let pointer = Pointer { at: Some(now), ..pointer };
                let around = Around {
                    surfaces: Surfaces::new(&slab, [true; 2], None),
                    view: &self.view,
                    tool: self.tool,
                    world_from_tool: self.tip,
                    dt_s: 0.05,
                    pedal: false,
                };
                self.guide.follow(&mut self.hand, &pointer, &around);
                self.tip = self.hand;
                // Bone beside the hole stops the tool.
                if self.tip.translation.truncate().length() > 3.5 {
                    self.tip.translation.z = self.tip.translation.z.max(self.tool.tip_radius_mm);
                }
            }
        }
    }

    const MOVES: Pointer = Pointer { moved: 20.0, ..Pointer::NONE };
    const HOLDS: Pointer = Pointer { held: true, ..Pointer::NONE };

    #[test]
    fn the_tool_flies_over_what_is_under_the_pointer() {
        let mut bench = Bench::with(Tool::burr(3.0));
        bench.point(Vec3::new(-20.0, 8.0, 0.0), MOVES, 60);
        let at = bench.hand.translation;
        assert!((at.truncate() - Vec2::new(-20.0, 8.0)).length() < 0.5, "{at}");
        assert!((at.z - 3.0 - CLEARANCE_MM).abs() < 0.5 && !bench.guide.pedal(), "{at}");
        bench.hand.translation.z = -3.0;
        bench.hand.translation.x = 0.0;
        bench.hand.translation.y = 0.0;
        bench.tip = bench.hand;
        bench.point(Vec3::new(-20.0, 8.0, 0.0), MOVES, 1);
        assert!(bench.hand.translation.truncate().length() < 0.1, "first up, then across");
    }

    #[test]
    fn a_held_button_lands_drills_and_pushes_gently_and_lets_the_tool_rise_again() {
        let mut bench = Bench::with(Tool::burr(3.0));
        let place = Vec3::new(20.0, 0.0, 0.0);
        bench.point(place, MOVES, 60);
        bench.point(place, HOLDS, 5);
        assert!(bench.guide.pedal());
        let before = bench.hand.translation.z;
        bench.guide.feed_mm_s = 0.5;
        bench.point(place, HOLDS, 4);
        assert!(before - bench.hand.translation.z < 0.11, "the feed is 0.5 mm/s");
        bench.point(place, HOLDS, 200);
        let lead = bench.tip.translation.z - bench.hand.translation.z;
        assert!((lead - FEED_LEAD_MM).abs() < 0.01, "{lead}");
        bench.guide.drills = false;
        assert!(!bench.guide.pedal(), "the switch is off");
        bench.point(place, Pointer::NONE, 40);
        assert!((bench.hand.translation.z - 3.0 - CLEARANCE_MM).abs() < 0.5 && !bench.guide.is_pressed());
    }

    #[test]
    fn a_drag_slides_on_the_surface() {
        let mut bench = Bench::with(Tool::probe(2.0));
        bench.point(Vec3::new(20.0, 0.0, 0.0), MOVES, 60);
        bench.point(Vec3::new(20.0, 0.0, 0.0), HOLDS, 20);
        let drag = Pointer { left: Vec2::ONE, ..HOLDS };
        for n in 0..40 {
            bench.point(Vec3::new(20.0 + 0.2 * n as f32, 0.0, 0.0), drag, 1);
        }
        let at = bench.tip.translation;
        assert!(at.x > 26.0 && (at.z - 2.0).abs() < 0.01, "{at}");
        assert!(bench.hand.translation.z > 2.0 - FEED_LEAD_MM);
    }

    #[test]
    fn a_craniotome_goes_under_the_bone_and_stays_in_its_cut() {
        let mut bench = Bench::with(Tool::craniotome());
        bench.point(Vec3::new(0.0, 0.0, -7.0), MOVES, 80);
        bench.point(Vec3::new(0.0, 0.0, -7.0), HOLDS, 60);
        let deep = bench.tip.translation;
        assert!(deep.z < -5.0 && deep.truncate().length() < 1.0, "{deep}");
        bench.hand.translation = Vec3::new(2.6, 0.0, -6.8);
        bench.tip = bench.hand;
        bench.point(Vec3::ZERO, Pointer::NONE, 3);
        bench.point(Vec3::new(-30.0, 0.0, 0.0), MOVES, 10);
        assert!((bench.hand.translation - Vec3::new(2.6, 0.0, -6.8)).length() < 0.1, "{}", bench.hand.translation);
        bench.guide.withdraws = true;
        bench.point(Vec3::new(-30.0, 0.0, 0.0), MOVES, 20);
        assert!(bench.hand.translation.z > 3.0, "{}", bench.hand.translation);
    }

    #[test]
    fn the_wheel_moves_finely_and_the_tool_stays_until_the_pointer_leaves() {
        let mut bench = Bench::with(Tool::burr(3.0));
        let place = Vec3::new(20.0, 0.0, 0.0);
        bench.point(place, MOVES, 60);
        let before = bench.hand.translation;
        bench.point(place, Pointer { wheel: 3.0 * NOTCH, ..Pointer::NONE }, 1);
        bench.point(place, Pointer { moved: 1.0, ..Pointer::NONE }, 3);
        assert!(((before - bench.hand.translation).length() - 3.0 * WHEEL_MM).abs() < 1e-3);
        bench.point(place, MOVES, 10);
        assert!((bench.hand.translation - before).length() < 0.6);
    }
}
