//! Undoing and redoing strokes of the burr, a few bricks per tick.
//!
//! # Theory
//! The bricks of a stroke are exchanged with their stored copies. Where a tool of either hand lies
//! in bone that would be restored, the bricks restored so far are removed again, and a notice names
//! the tool in the way:
//!
//! ```text
//! undo ─→ returning ──(all bricks)──→ undone
//!             └──(tool in the way)──→ leaving ─→ refused
//! redo ─→ redoing ──(all bricks)──→ redone
//! ```
//!
//! A request refused for the first hand's tool is repeated while that tool is drawn out.
//!
//! # Practice
//! A tool is tested at its proxy with its tip and shaft, and a margin of one voxel. Meanwhile
//! nothing cuts, no tool is changed and no flap moves. The largest stroke takes half a second at 1
//! kHz, a burr hole a few ticks. The result depends on the ticks alone; nothing allocates.

use crate::notice::Hindrance;
use trepan_bone::{BoneVolume, MAX_STROKES};
use trepan_geometry::{Pose, Tool, Vec3};

/// Bricks exchanged in a tick: some 20 us.
const BRICKS: usize = 8;

/// Ticks in which a request refused for the tool is repeated, and ticks between two tries. At 1 kHz
/// 4 s and a tenth of a second, the time to draw a tool out. Numerical parameters.
const WAIT: [u32; 2] = [4000, 100];

/// Data of a stroke besides its bone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stroke {
    /// Bone removed, mm³.
    pub mm3: f32,
    /// Number of times that the burr came through.
    pub through: u32,
    /// Whether the flap was lifted.
    pub flap_away: bool,
}

/// Result of a request to undo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// The stroke is undone.
    Back(Stroke),
    /// The stroke that was undone last is redone.
    Again(Stroke),
    /// The request is refused.
    Not(Hindrance),
    /// The request to redo is refused.
    NotAgain(Hindrance),
}

/// Progress of undoing; the numbers count bricks.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Rest,
    /// Bricks restored so far.
    Returning(usize),
    /// Bricks removed again so far, of a stroke that is redone.
    Redoing(usize),
    /// Bricks still to be removed again, and the reason.
    Leaving(usize, Hindrance),
}

/// A tool and its pose.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The tool.
    pub tool: Tool,
    /// Pose of the proxy.
    pub world_from_tool: Pose,
    /// Reason to report when it is in the way.
    pub hindrance: Hindrance,
}

/// Strokes that can be undone.
#[derive(Clone, Debug)]
pub struct Undo {
    at: State,
    /// Whether undo and redo were pressed in the last tick.
    was_requested: [bool; 2],
    /// Ticks for which a request refused for the tool is still repeated.
    waits: u32,
    /// Ring buffer, indexed by the number of the stroke.
    strokes: Vec<Stroke>,
}

impl Default for Undo {
    /// Allocates all memory.
    fn default() -> Self {
        Self { at: State::Rest, was_requested: [false; 2], waits: 0, strokes: vec![Stroke::default(); MAX_STROKES] }
    }
}

impl Undo {
    /// Whether a stroke is being undone or redone.
    pub fn runs(&self) -> bool {
        self.at != State::Rest
    }

    /// Returns the newest stroke.
    pub fn newest(&mut self, bone: &BoneVolume) -> &mut Stroke {
        &mut self.strokes[bone.stroke_number() % MAX_STROKES]
    }

    /// Runs a tick. `pressed`: the buttons of undo and redo; `hinders`: reason why neither works
    /// now, and why no redo does; `flap_away`: the flap is
    /// lifted; `tools`: tools of both hands.
    pub fn tick(
        &mut self,
        bone: &BoneVolume,
        pressed: [bool; 2],
        (hinders, touches): (Option<Hindrance>, Option<Hindrance>),
        flap_away: bool,
        tools: &[Option<Place>],
    ) -> Option<Answer> {
        let before = std::mem::replace(&mut self.was_requested, pressed);
        match self.at {
            State::Rest if pressed[0] && !before[0] => {
                self.waits = 0;
                let hinders = hinders.or_else(|| self.lacks(bone, flap_away));
                hinders.map(Answer::Not).or_else(|| self.put_back(bone, tools, 0))
            }
            State::Rest if pressed[1] && !before[1] => {
                let hinders = hinders.or(touches).or_else(|| self.lacks_redo(bone, flap_away));
                hinders.map(Answer::NotAgain).or_else(|| self.redo(bone, 0))
            }
            State::Rest if self.waits > 0 => self.try_again(bone, hinders, flap_away, tools),
            State::Rest => None,
            State::Redoing(done) => self.redo(bone, done),
            State::Returning(done) => self.put_back(bone, tools, done),
            State::Leaving(left, why) => self.take_away(bone, left, why),
        }
    }

    /// Returns why no stroke fits the present state of the bone.
    fn lacks(&mut self, bone: &BoneVolume, flap_away: bool) -> Option<Hindrance> {
        match (bone.strokes(), bone.forgot_strokes(), self.newest(bone).flap_away) {
            (0, true, _) => Some(Hindrance::Forgotten),
            (0, false, _) => Some(Hindrance::NoStroke),
            (_, _, was_away) if was_away == flap_away => None,
            (_, _, true) => Some(Hindrance::FlapThere),
            (_, _, false) => Some(Hindrance::FlapAway),
        }
    }

    /// Returns why no undone stroke fits the present state of the bone.
    fn lacks_redo(&self, bone: &BoneVolume, flap_away: bool) -> Option<Hindrance> {
        let next = self.strokes[(bone.stroke_number() + 1) % MAX_STROKES];
        match (bone.undone_strokes(), next.flap_away) {
            (0, _) => Some(Hindrance::NothingUndone),
            (_, was_away) if was_away == flap_away => None,
            (_, true) => Some(Hindrance::FlapThere),
            (_, false) => Some(Hindrance::FlapAway),
        }
    }

    /// Removes the bone of the stroke that was undone last again.
    fn redo(&mut self, bone: &BoneVolume, done: usize) -> Option<Answer> {
        if done == 0 {
            bone.take_up_stroke();
        }
        let all = bone.stroke_bricks();
        let end = (done + BRICKS).min(all);
        (done..end).for_each(|n| bone.exchange_brick(n));
        self.at = if end == all { State::Rest } else { State::Redoing(end) };
        (end == all).then(|| Answer::Again(*self.newest(bone)))
    }

    fn put_back(&mut self, bone: &BoneVolume, tools: &[Option<Place>], done: usize) -> Option<Answer> {
        let all = bone.stroke_bricks();
        let end = (done + BRICKS).min(all);
        for n in done..end {
            if let Some(place) = tools.iter().flatten().find(|place| place.is_in_the_way(bone, n)) {
                return self.take_away(bone, n, place.hindrance);
            }
            bone.exchange_brick(n);
        }
        self.at = if end == all { State::Rest } else { State::Returning(end) };
        (end == all).then(|| {
            self.waits = 0;
            let stroke = *self.newest(bone);
            bone.drop_stroke();
            Answer::Back(stroke)
        })
    }

    /// Repeats a request until the tool is out; another hindrance ends it.
    fn try_again(
        &mut self,
        bone: &BoneVolume,
        hinders: Option<Hindrance>,
        flap_away: bool,
        tools: &[Option<Place>],
    ) -> Option<Answer> {
        self.waits -= 1;
        if hinders.or_else(|| self.lacks(bone, flap_away)).is_some() {
            self.waits = 0;
            return None;
        }
        let tries = self.waits > 0 && self.waits.is_multiple_of(WAIT[1]);
        if tries { self.put_back(bone, tools, 0) } else { None }
    }

    fn take_away(&mut self, bone: &BoneVolume, left: usize, why: Hindrance) -> Option<Answer> {
        let end = left.saturating_sub(BRICKS);
        (end..left).for_each(|n| bone.exchange_brick(n));
        self.at = if end == 0 { State::Rest } else { State::Leaving(end, why) };
        // A repeated request is refused without a word.
        let repeated = self.waits > 0;
        if end == 0 && !repeated && why == Hindrance::Tool {
            self.waits = WAIT[0];
        }
        (end == 0 && !repeated).then_some(Answer::Not(why))
    }
}

impl Place {
    /// Whether the tool lies where the `n`th brick of the newest stroke would restore bone.
    fn is_in_the_way(&self, bone: &BoneVolume, n: usize) -> bool {
        let Tool { tip_radius_mm, shaft_radius_mm, shaft_length_mm, .. } = self.tool;
        let (tip, axis) = (self.world_from_tool.translation, self.world_from_tool.rotation * Vec3::Z);
        let from_shaft = |p: Vec3| p.distance(tip + (p - tip).dot(axis).clamp(0.0, shaft_length_mm.max(0.0)) * axis);
        let room = bone.spacing_mm();
        bone.brings_back(
            n,
            |middle, half| from_shaft(middle) < tip_radius_mm.max(shaft_radius_mm) + room + half,
            |p| p.distance(tip) < tip_radius_mm + room || from_shaft(p) < shaft_radius_mm + room,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::IVec3;
    use trepan_volume::{AIR_HU, VoxelVolume};

    const UNDO: [bool; 2] = [true, false];
    const REDO: [bool; 2] = [false, true];
    const FREE: (Option<Hindrance>, Option<Hindrance>) = (None, None);

    #[test]
    fn an_undone_stroke_is_redone_over_several_ticks_unless_the_tool_touches() {
        let (bone, whole) = trench();
        let cut = bone.snapshot();
        let mut undo = Undo::default();
        undo.newest(&bone).mm3 = 5.0;
        let run = |undo: &mut Undo, pressed, why| {
            undo.tick(&bone, [false; 2], FREE, false, &[]);
            (0..9).find_map(|_| undo.tick(&bone, pressed, (None, why), false, &[]))
        };
        assert_eq!(run(&mut undo, REDO, None), Some(Answer::NotAgain(Hindrance::NothingUndone)));
        assert!(matches!(run(&mut undo, UNDO, None), Some(Answer::Back(_))) && bone.snapshot() == whole);
        let touches = Some(Hindrance::Touches);
        assert_eq!(run(&mut undo, REDO, touches), Some(Answer::NotAgain(Hindrance::Touches)));
        let again = run(&mut undo, REDO, None);
        assert_eq!(again, Some(Answer::Again(Stroke { mm3: 5.0, ..Stroke::default() })));
        assert!(bone.snapshot() == cut && !undo.runs());
        assert!(matches!(run(&mut undo, UNDO, None), Some(Answer::Back(_))) && bone.snapshot() == whole);
    }

    /// Makes a block with a trench of 40 bricks.
    fn trench() -> (BoneVolume, VoxelVolume<i16>) {
        let whole = VoxelVolume::isotropic([320, 16, 16], Vec3::ZERO, 1.0, 900i16);
        let bone = BoneVolume::new(&whole, 400).expect("all bone");
        bone.begin_stroke();
        (0..320).for_each(|x| (0..4).for_each(|z| bone.set_hu(IVec3::new(x, 4, z), AIR_HU)));
        bone.end_stroke();
        (bone, whole)
    }

    #[test]
    fn a_refused_request_is_done_once_the_tool_is_out() {
        let (bone, whole) = trench();
        let cut = bone.snapshot();
        let run = |undo: &mut Undo, ticks: usize, tool| {
            (0..ticks).filter_map(|_| undo.tick(&bone, [false; 2], FREE, false, &[tool])).collect::<Vec<_>>()
        };
        let refused = |undo: &mut Undo| (0..9).find_map(|_| undo.tick(&bone, UNDO, FREE, false, &[probe(150.0, 4.0)]));
        let mut undo = Undo::default();
        assert_eq!(refused(&mut undo), Some(Answer::Not(Hindrance::Tool)));
        assert_eq!(run(&mut undo, 1000, probe(150.0, 4.0)), [], "it waits without a word");
        assert!(bone.snapshot() == cut || undo.runs());
        assert_eq!(run(&mut undo, 300, None), [Answer::Back(Stroke::default())]);
        assert!(bone.snapshot() == whole);
    }

    #[test]
    fn a_new_stroke_or_time_ends_a_waiting_request() {
        let (bone, _) = trench();
        let cut = bone.snapshot();
        let refused = |undo: &mut Undo| (0..9).find_map(|_| undo.tick(&bone, UNDO, FREE, false, &[probe(150.0, 4.0)]));
        let mut undo = Undo::default();
        refused(&mut undo);
        let pedal = (Some(Hindrance::Pedal), None);
        undo.tick(&bone, [false; 2], pedal, false, &[]);
        assert!((0..500).all(|_| undo.tick(&bone, [false; 2], FREE, false, &[]).is_none()) && bone.snapshot() == cut);
        undo.tick(&bone, [false; 2], FREE, false, &[]);
        refused(&mut undo);
        let tool = [probe(150.0, 4.0)];
        assert!((0..2 * WAIT[0]).all(|_| undo.tick(&bone, [false; 2], FREE, false, &tool).is_none()));
        assert!((0..500).all(|_| undo.tick(&bone, [false; 2], FREE, false, &[]).is_none()) && bone.snapshot() == cut);
    }

    fn probe(x: f32, y: f32) -> Option<Place> {
        let world_from_tool = Pose::from_translation(Vec3::new(x, y, -1.0));
        Some(Place { tool: Tool::probe(1.0), world_from_tool, hindrance: Hindrance::Tool })
    }

    #[test]
    fn a_long_stroke_is_undone_over_several_ticks_each_of_bounded_work() {
        let (bone, whole) = trench();
        let mut undo = Undo::default();
        undo.newest(&bone).mm3 = 5.0;
        let mut seen = bone.seen();
        let mut ticks = 0;
        let answer = loop {
            ticks += 1;
            let answer = undo.tick(&bone, UNDO, FREE, false, &[probe(100.0, 12.0)]);
            let mut changed = 0;
            bone.changed(&mut seen, usize::MAX, |_| changed += 1);
            assert!(changed <= BRICKS, "{changed} bricks in a tick");
            if answer.is_some() || ticks == 100 {
                break answer;
            }
            assert!(undo.runs());
        };
        assert_eq!(answer, Some(Answer::Back(Stroke { mm3: 5.0, ..Stroke::default() })));
        assert_eq!((bone.snapshot() == whole, ticks, bone.strokes()), (true, 40usize.div_ceil(BRICKS), 0));
    }

    #[test]
    fn a_tool_that_moves_into_restored_bone_has_it_removed_again() {
        let (bone, whole) = trench();
        let cut = bone.snapshot();
        let mut undo = Undo::default();
        assert_eq!(undo.tick(&bone, UNDO, FREE, false, &[None, probe(300.0, 12.0)]), None);
        assert!(bone.snapshot() != cut);
        let into = |undo: &mut Undo| undo.tick(&bone, UNDO, FREE, false, &[None, probe(150.0, 4.0)]);
        let answer = (0..9).find_map(|_| into(&mut undo));
        assert_eq!(answer, Some(Answer::Not(Hindrance::Tool)));
        assert!(bone.snapshot() == cut && !undo.runs() && bone.strokes() == 1);
        assert_eq!(undo.tick(&bone, UNDO, FREE, false, &[]), None, "pressed once, it requests once");
        undo.tick(&bone, [false; 2], FREE, false, &[]);
        assert!((0..9).any(|_| undo.tick(&bone, UNDO, FREE, false, &[]).is_some()) && bone.snapshot() == whole);
    }

    #[test]
    fn a_tool_in_the_hole_prevents_undoing_with_its_shaft_and_its_ball() {
        let (bone, _) = trench();
        let answer_at = |place| {
            let mut undo = Undo::default();
            undo.tick(
                &bone,
                UNDO,
                (Some(Hindrance::FlapMoves).filter(|_| place == Vec3::ZERO), None),
                false,
                &[Some(Place {
                    tool: Tool::burr(3.0),
                    world_from_tool: Pose::from_translation(place),
                    hindrance: Hindrance::Tool,
                })],
            )
        };
        assert_eq!(answer_at(Vec3::ZERO), Some(Answer::Not(Hindrance::FlapMoves)));
        assert_eq!(answer_at(Vec3::new(60.0, 4.0, -20.0)), Some(Answer::Not(Hindrance::Tool)), "the shaft");
        assert_eq!(answer_at(Vec3::new(60.0, 4.0, 6.5)), Some(Answer::Not(Hindrance::Tool)), "the ball");
    }
}
