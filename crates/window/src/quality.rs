//! Chooses what each picture of the window costs: coarse while something moves, sharp at rest.
//!
//! # Practice
//! While the camera, a tool, the brain or the bone moves, the fraction of pixels follows the frame
//! time: coarser when it is too long, finer when there is time. Before a camera that stands still
//! the processor draws only what changed, so there is a fraction of its own for that. After a short
//! rest one picture with every pixel is drawn, then its edges are smoothed sample by sample, then
//! nothing until something moves again.

use crate::Pace;
use glam::Vec3;
use trepan_geometry::{Pose, Tool};
use trepan_render::{Camera, Cut, Frame, SliceLook, Stereo};

/// Selectable fractions of the 3-D view's pixels along an edge.
const DETAILS: [f32; 7] = [1.0, 0.75, 0.5, 0.4, 0.3, 0.22, 0.16];

/// Coarsest of them before a view that stands still, drawn by the processor. It draws only what
/// changed there, so that fewer pixels save little.
const COARSEST_STANDING: usize = 2;

/// A numerical parameter: frame time above which the picture is too slow, s: 15 pictures a second
/// with some room.
const SLOW_S: f64 = 0.058;

/// A numerical parameter: frame time at which one more step at once is needed, s.
const VERY_SLOW_S: f64 = 0.120;

/// A numerical parameter: frame time below which a finer picture is tried, s.
const FAST_S: f64 = 0.85 * SLOW_S;

/// A numerical parameter: time for drawing below which fewer pixels would not help, s.
const SHORT_S: f64 = 0.018;

/// A numerical parameter: share of the time between pictures below which drawing is short.
const SHORT_SHARE: f64 = 0.33;

/// Consecutive slow pictures before the picture gets coarser.
const PATIENCE_SLOW: u32 = 2;

/// Consecutive fast pictures before the picture gets finer; twice as many after each finer picture
/// that was too slow, up to the second number.
const PATIENCE_FAST: [u32; 2] = [20, 640];

/// A numerical parameter: time without motion before the sharp picture, s.
const REST_S: f64 = 0.25;

/// A numerical parameter: motion of tools, brain and arrows that is none to the eye, mm.
const STILL_MM: f32 = 0.05;

/// A numerical parameter: rate of the window at rest, Hz. Input wakes it at once.
const AT_REST_HZ: f32 = 10.0;

/// Nodes of the brain that are compared, at most.
const NODES: usize = 512;

/// What to do for a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Step {
    /// Draw with this fraction of the 3-D view's pixels along an edge.
    Draw(f32),
    /// Smooth the edges of the last picture by one more sample.
    Refine,
    /// Show the last picture again.
    Keep,
}

/// How far the picture at rest is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Rest {
    #[default]
    Moving,
    Sharp,
    Smooth,
}

/// The current resolution level, and what moves.
#[derive(Debug, Default)]
pub(crate) struct Quality {
    /// Of [`DETAILS`], while the view moves and while it stands still.
    levels: [usize; 2],
    /// Which of them counts.
    stands: usize,
    /// The last that may be chosen, for each.
    coarsest: [usize; 2],
    slow: u32,
    fast: u32,
    /// Fast pictures needed for a finer one.
    patience: u32,
    /// Pictures since it got finer.
    since_finer: u32,
    seen: Option<PictureState>,
    moved_at: f64,
    rest: Rest,
    last: f64,
    /// Whether something moved in the last picture too.
    paced: bool,
    /// Mean time between pictures while something moves, s.
    interval_s: f64,
    /// The last picture, if something moved in it and in the one before.
    pub pace: Option<Pace>,
}

impl Quality {
    /// Starts at the coarser of `detail` and the default: the finest level on a graphics card, a
    /// coarse one without.
    pub fn new(software: bool, detail: f32) -> Self {
        let wanted = DETAILS.iter().position(|&d| d <= detail).unwrap_or(DETAILS.len() - 1);
        let (level, patience) = (wanted.max(if software { 3 } else { 0 }), PATIENCE_FAST[0]);
        let last = DETAILS.len() - 1;
        let coarsest = [last, if software { COARSEST_STANDING } else { last }];
        Self {
            levels: coarsest.map(|last| level.min(last)),
            coarsest,
            patience,
            since_finer: u32::MAX,
            ..Self::default()
        }
    }

    /// Chooses the next step for a frame in an area of `size` pixels at a time, s; `pending` says
    /// that bone has changed.
    pub fn step(&mut self, frame: &Frame, size: [u32; 2], pending: bool, now: f64) -> Step {
        let moved = pending || frame.drilling || self.seen.as_ref().is_none_or(|seen| seen.differs(frame, size));
        if moved {
            let stands = self.seen.as_ref().is_some_and(|seen| seen.size == size && seen.fixed == fixed(frame));
            if usize::from(stands) != std::mem::replace(&mut self.stands, stands.into()) {
                (self.slow, self.fast, self.paced) = (0, 0, false);
            }
            self.seen = Some(PictureState::of(frame, size));
            (self.moved_at, self.rest) = (now, Rest::Moving);
            return Step::Draw(self.detail());
        }
        match self.rest {
            Rest::Moving if now - self.moved_at < REST_S => Step::Keep,
            Rest::Moving => {
                self.seen = Some(PictureState::of(frame, size));
                self.rest = Rest::Sharp;
                Step::Draw(1.0)
            }
            Rest::Sharp => Step::Refine,
            Rest::Smooth => Step::Keep,
        }
    }

    /// Records that no further sample changes the picture.
    pub fn complete(&mut self) {
        self.rest = Rest::Smooth;
    }

    /// Processes a picture that took `drawing_s` to draw, at a time, s.
    pub fn note(&mut self, drawing_s: f64, now: f64) {
        let interval = now - std::mem::replace(&mut self.last, now);
        let moves = self.rest == Rest::Moving;
        self.pace = None;
        // A sharp picture before says nothing of the pace.
        if !std::mem::replace(&mut self.paced, moves) || !moves || self.moved_at != now {
            return;
        }
        self.pace = Some(Pace { interval_s: interval, detail: self.detail() });
        self.interval_s += (interval - self.interval_s) * if self.interval_s == 0.0 { 1.0 } else { 0.15 };
        // Where drawing is short, others keep the window waiting: fewer pixels would not help.
        let short = SHORT_S.max(SHORT_SHARE * interval);
        self.slow = if interval > SLOW_S && drawing_s > short { self.slow + 1 } else { 0 };
        self.fast = if interval < FAST_S { self.fast + 1 } else { 0 };
        self.since_finer = self.since_finer.saturating_add(1);
        if self.slow >= PATIENCE_SLOW {
            let in_vain = self.since_finer < PATIENCE_FAST[0];
            self.patience = if in_vain { (2 * self.patience).min(PATIENCE_FAST[1]) } else { PATIENCE_FAST[0] };
            let level = &mut self.levels[self.stands];
            *level = (*level + 1 + usize::from(interval > VERY_SLOW_S)).min(self.coarsest[self.stands]);
            (self.slow, self.fast) = (0, 0);
        } else if self.fast >= self.patience && self.levels[self.stands] > 0 {
            self.levels[self.stands] -= 1;
            (self.slow, self.fast, self.since_finer) = (0, 0, 0);
        }
    }

    /// Fraction of the 3-D view's pixels along an edge while something moves.
    pub fn detail(&self) -> f32 {
        DETAILS[self.levels[self.stands]]
    }

    /// Highest rate of the window, Hz: low while nothing moves. Without a graphics card even the
    /// same picture costs a third of a core at 30 Hz.
    pub fn most_hz(&self) -> f32 {
        if self.rest == Rest::Smooth { AT_REST_HZ } else { f32::INFINITY }
    }

    /// The picture rate and the sharpness, as text.
    pub fn text(&self) -> String {
        match self.rest {
            Rest::Moving if self.interval_s > 0.0 => {
                format!("{:.0} pictures/s, {:.0} % sharp", 1.0 / self.interval_s, 100.0 * self.detail())
            }
            Rest::Moving => String::new(),
            Rest::Sharp => "at rest: smoothing edges".into(),
            Rest::Smooth => "at rest: sharp".into(),
        }
    }
}

/// What a picture showed, as far as it moves.
#[derive(Debug)]
struct PictureState {
    size: [u32; 2],
    fixed: Fixed,
    tools: [Option<(Tool, Pose)>; 2],
    force: Option<[Vec3; 2]>,
    ghost: Option<(Tool, Pose)>,
    nodes: Vec<Vec3>,
}

/// What is compared exactly: camera, cut, stereo, slices, versions of paints, switches, markers.
type Fixed = (Camera, Option<Cut>, Option<Stereo>, SliceLook, [Option<u64>; 2], [bool; 2], usize);

fn fixed(frame: &Frame) -> Fixed {
    let paints = [frame.bone_paint, frame.brain_paint].map(|paint| paint.map(|paint| paint.version));
    let shown = [frame.show_bone, frame.show_brain];
    (frame.camera, frame.cut, frame.stereo, frame.slices, paints, shown, frame.overlay.markers.len())
}

fn tools(frame: &Frame) -> [Option<(Tool, Pose)>; 2] {
    [frame.tool.map(|tool| (tool, frame.world_from_tool)), frame.second]
}

/// Some of the brain's nodes, evenly spread.
fn nodes<'a>(frame: &Frame<'a>) -> impl Iterator<Item = Vec3> + 'a {
    let all = frame.brain_positions.unwrap_or_default();
    all.iter().step_by(all.len().div_ceil(NODES).max(1)).copied()
}

fn same_tool(a: &Option<(Tool, Pose)>, b: &Option<(Tool, Pose)>) -> bool {
    let Some(((tool, pose), (other, moved))) = a.as_ref().zip(b.as_ref()) else { return a.is_none() && b.is_none() };
    // The far end of the shaft shows a turn.
    let end = |pose: &Pose| pose.translation + tool.shaft_length_mm * (pose.rotation * Vec3::Z);
    let still = |a: Vec3, b: Vec3, mm: f32| a.distance(b) < mm;
    tool == other
        && still(pose.translation, moved.translation, STILL_MM)
        && still(end(pose), end(moved), 4.0 * STILL_MM)
}

impl PictureState {
    fn of(frame: &Frame, size: [u32; 2]) -> Self {
        let nodes = nodes(frame).collect();
        let (force, ghost) = (frame.overlay.force, frame.overlay.ghost);
        Self { size, fixed: fixed(frame), tools: tools(frame), force, ghost, nodes }
    }

    /// Whether a frame looks different to the eye.
    fn differs(&self, frame: &Frame, size: [u32; 2]) -> bool {
        let arrows = match (self.force, frame.overlay.force) {
            // An arrow is 12 mm a newton: it trembles with the hand.
            (Some(a), Some(b)) => (0..2).any(|n| a[n].distance(b[n]) > 10.0 * STILL_MM),
            (a, b) => a.is_some() != b.is_some(),
        };
        let tools = tools(frame).iter().zip(&self.tools).any(|(a, b)| !same_tool(a, b));
        let mut nodes = nodes(frame);
        let brain = self.nodes.iter().any(|was| nodes.next().is_none_or(|now| now.distance(*was) > STILL_MM));
        size != self.size
            || fixed(frame) != self.fixed
            || arrows
            || tools
            || !same_tool(&frame.overlay.ghost, &self.ghost)
            || brain
            || nodes.next().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [64, 48];

    fn frame(turn: u32) -> Frame<'static> {
        let mut camera = Camera::viewed_from(Vec3::ZERO, Vec3::Y, 100.0);
        camera.orbit(0.01 * turn as f32, 0.0);
        Frame::of(camera)
    }

    /// Detail after some pictures of a moving camera, with a time of `full` seconds at the finest
    /// and proportional to the pixels.
    fn settled(full: f64, pictures: u32) -> f32 {
        let mut quality = Quality::new(false, 1.0);
        let mut now = 0.0;
        for n in 0..pictures {
            let Step::Draw(detail) = quality.step(&frame(n), SIZE, false, now) else { panic!("the camera moves") };
            let cost = full * f64::from(detail.powi(2));
            quality.note(cost, now);
            now += cost.max(0.033);
        }
        quality.detail()
    }

    #[test]
    fn quality_converges_to_the_frame_time() {
        assert_eq!(settled(0.01, 500), 1.0);
        assert_eq!(settled(0.08, 500), 0.75);
        assert_eq!(settled(0.3, 500), 0.4);
        assert_eq!(settled(50.0, 500), 0.16);
    }

    #[test]
    fn a_finer_picture_that_is_too_slow_is_tried_ever_more_rarely() {
        let mut quality = Quality::new(false, 0.75);
        let (mut now, mut tries) = (0.0, Vec::new());
        for n in 0..2000 {
            quality.step(&frame(n), SIZE, false, now);
            let cost = 0.08 * f64::from(quality.detail().powi(2));
            let before = quality.detail();
            quality.note(cost, now);
            tries.extend((quality.detail() > before).then_some(n));
            now += cost;
        }
        let apart: Vec<u32> = tries.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(apart.len() >= 4 && apart.windows(2).all(|pair| pair[1] > pair[0].min(640)), "{apart:?}");
    }

    #[test]
    fn it_starts_at_the_given_detail() {
        let starts = [(false, 1.0), (true, 1.0), (false, 0.5), (true, 0.25), (false, 0.1)]
            .map(|(s, d)| Quality::new(s, d).detail());
        assert_eq!(starts, [1.0, 0.4, 0.5, 0.22, 0.16]);
    }

    #[test]
    fn waiting_for_others_makes_the_picture_no_coarser() {
        let mut quality = Quality::new(false, 0.5);
        for n in 0..50u32 {
            let now = 0.2 * f64::from(n);
            quality.step(&frame(n), SIZE, false, now);
            quality.note(0.01, now);
        }
        assert_eq!((quality.detail(), quality.text()), (0.5, "5 pictures/s, 50 % sharp".into()));
    }

    #[test]
    fn a_view_that_stands_keeps_half_of_an_edge_on_the_processor() {
        for (software, coarsest) in [(true, 0.5), (false, 0.16)] {
            let mut quality = Quality::new(software, 1.0);
            let mut now = 0.0;
            for n in 0..40 {
                let tool = Pose::from_translation(n as f32 * Vec3::X);
                let pressing = Frame { tool: Some(Tool::burr(3.0)), world_from_tool: tool, ..frame(0) };
                quality.step(&pressing, SIZE, false, now);
                quality.note(0.2, now);
                now += 0.2;
            }
            assert_eq!(quality.detail(), coarsest);
            quality.step(&frame(1), SIZE, false, now);
            assert_eq!(quality.detail(), if software { 0.4 } else { 1.0 }, "the moving view's is its own");
        }
    }

    #[test]
    fn a_sharp_picture_between_changes_nothing() {
        let mut quality = Quality::new(false, 0.5);
        for n in 0..50u32 {
            let now = f64::from(n);
            quality.step(&frame(n), SIZE, false, now);
            quality.note(0.03, now);
            assert_eq!(quality.step(&frame(n), SIZE, false, now + 0.3), Step::Draw(1.0));
            quality.note(0.5, now + 0.3);
        }
        assert_eq!(quality.detail(), 0.5);
    }

    #[test]
    fn one_slow_picture_changes_nothing() {
        let mut quality = Quality::new(true, 1.0);
        let start = quality.detail();
        for (n, now) in [0.0, 0.5, 0.54, 0.58].into_iter().enumerate() {
            quality.step(&frame(n as u32), SIZE, false, now);
            quality.note(0.03, now);
        }
        assert_eq!(quality.detail(), start);
    }

    #[test]
    fn at_rest_the_picture_is_sharp_then_smooth_then_kept_until_something_moves() {
        let mut quality = Quality::new(true, 1.0);
        let still = frame(0);
        assert_eq!(quality.step(&still, SIZE, false, 0.0), Step::Draw(0.4));
        assert_eq!(quality.step(&still, SIZE, false, 0.1), Step::Keep);
        assert_eq!(quality.step(&still, SIZE, false, 0.3), Step::Draw(1.0));
        assert_eq!(quality.step(&still, SIZE, false, 0.4), Step::Refine);
        assert_eq!(quality.most_hz(), f32::INFINITY);
        quality.complete();
        assert_eq!(quality.step(&still, SIZE, false, 0.5), Step::Keep);
        assert_eq!(quality.most_hz(), 10.0);
        let brain = [Vec3::splat(3.0); 9];
        let tool = Frame { tool: Some(Tool::burr(3.0)), ..still };
        let cut = Cut { point: Vec3::ZERO, normal: Vec3::X, bone: false };
        let arrow = trepan_render::Overlay { force: Some([Vec3::ZERO, Vec3::X]), ..Default::default() };
        let changes = [
            frame(1),
            Frame { drilling: true, ..still },
            tool,
            Frame { world_from_tool: Pose::from_translation(0.1 * Vec3::X), ..tool },
            Frame { brain_positions: Some(&brain), ..still },
            Frame { show_bone: false, ..still },
            Frame { cut: Some(cut), ..still },
            Frame { overlay: arrow, ..still },
        ];
        for (n, changed) in changes.iter().enumerate() {
            // In three of them the view is that of the one before.
            let detail = if (2..5).contains(&n) { 0.5 } else { 0.4 };
            assert_eq!(quality.step(changed, SIZE, false, 1.0 + n as f64), Step::Draw(detail), "{n}");
        }
        assert_eq!(quality.step(&changes[7], [64, 49], false, 9.0), Step::Draw(0.4));
        assert_eq!(quality.step(&changes[7], [64, 49], true, 9.0), Step::Draw(0.5), "bone has changed");
        assert_eq!(quality.step(&changes[7], [64, 49], false, 9.1), Step::Keep);
    }

    #[test]
    fn a_slow_drift_of_the_brain_is_motion_in_the_end() {
        let mut quality = Quality::new(false, 1.0);
        let mut drawn = 0;
        for n in 0..20 {
            let brain = [Vec3::splat(0.01 * n as f32); 4];
            let frame = Frame { brain_positions: Some(&brain), ..frame(0) };
            drawn += u32::from(matches!(quality.step(&frame, SIZE, false, 0.01 * f64::from(n)), Step::Draw(_)));
        }
        assert!((4..10).contains(&drawn), "{drawn}");
    }
}
