//! Taking strokes of the burr back, the newest first: when it may be, a few bricks in a tick, and
//! why not.
//!
//! # Theory
//! The bricks of a stroke are exchanged with what was kept of them. Where a tool of either hand
//! lies in bone that would come back, what has come back goes again, and the trainee is told which
//! tool is in the way:
//!
//! ```text
//! asked ─→ returning ──(all bricks)──→ back
//!              └──(tool in the way)──→ leaving ─→ refused
//! ```
//!
//! # Practice
//! A tool counts with its tip and its shaft and a voxel of room around them, where contact lets it
//! be. Nothing cuts, no tool changes and no flap moves meanwhile. The largest stroke takes half a
//! second at 1 kHz, a burr hole a few ticks. All of it is a function of the ticks; nothing
//! allocates.

use crate::stages::notice::Hindrance;
use trepan_geometry::{Pose, Tool, Vec3};
use trepan_volume::{BoneVolume, MAX_STROKES};

/// Bricks put back in a tick: some 20 us.
const BRICKS: usize = 8;

/// What is known of a stroke beside its bone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Stroke {
    /// Bone that it removed, mm³.
    pub mm3: f32,
    /// How often the burr came through in it.
    pub through: u32,
    /// Whether the flap was away.
    pub flap_away: bool,
}

/// What came of asking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Answer {
    /// The bone of this stroke is back.
    Back(Stroke),
    /// It is not.
    Not(Hindrance),
}

/// How far it is; the numbers count bricks.
#[derive(Clone, Copy, Debug, PartialEq)]
enum At {
    Rest,
    /// So many are back.
    Returning(usize),
    /// So many are still to go again.
    Leaving(usize, Hindrance),
}

/// Where a tool is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// The tool.
    pub tool: Tool,
    /// Where contact lets it be.
    pub world_from_tool: Pose,
    /// What to say when it is in the way.
    pub said: Hindrance,
}

/// The strokes that can come back.
#[derive(Clone, Debug)]
pub(crate) struct Undo {
    at: At,
    asked: bool,
    /// By number, around.
    strokes: Vec<Stroke>,
}

impl Default for Undo {
    /// Takes all memory.
    fn default() -> Self {
        Self { at: At::Rest, asked: false, strokes: vec![Stroke::default(); MAX_STROKES] }
    }
}

impl Undo {
    /// Whether bone is on its way.
    pub fn runs(&self) -> bool {
        self.at != At::Rest
    }

    /// The newest stroke.
    pub fn newest(&mut self, bone: &BoneVolume) -> &mut Stroke {
        &mut self.strokes[bone.stroke_number() % MAX_STROKES]
    }

    /// One tick. `hinders`: why no stroke may come back now; `flap_away`: whether the flap is;
    /// `tools`: those in the hands.
    pub fn tick(
        &mut self,
        bone: &BoneVolume,
        asks: bool,
        hinders: Option<Hindrance>,
        flap_away: bool,
        tools: &[Option<Place>],
    ) -> Option<Answer> {
        let before = std::mem::replace(&mut self.asked, asks);
        match self.at {
            At::Rest if asks && !before => {
                let hinders = hinders.or_else(|| self.lacks(bone, flap_away));
                hinders.map(Answer::Not).or_else(|| self.put_back(bone, tools, 0))
            }
            At::Rest => None,
            At::Returning(done) => self.put_back(bone, tools, done),
            At::Leaving(left, why) => self.take_away(bone, left, why),
        }
    }

    /// Why there is no stroke that fits the bone as it is.
    fn lacks(&mut self, bone: &BoneVolume, flap_away: bool) -> Option<Hindrance> {
        match (bone.strokes(), bone.forgot_strokes(), self.newest(bone).flap_away) {
            (0, true, _) => Some(Hindrance::Forgotten),
            (0, false, _) => Some(Hindrance::NoStroke),
            (_, _, was_away) if was_away == flap_away => None,
            (_, _, true) => Some(Hindrance::FlapThere),
            (_, _, false) => Some(Hindrance::FlapAway),
        }
    }

    fn put_back(&mut self, bone: &BoneVolume, tools: &[Option<Place>], done: usize) -> Option<Answer> {
        let all = bone.stroke_bricks();
        let end = (done + BRICKS).min(all);
        for n in done..end {
            if let Some(place) = tools.iter().flatten().find(|place| place.is_in_the_way(bone, n)) {
                return self.take_away(bone, n, place.said);
            }
            bone.exchange_brick(n);
        }
        self.at = if end == all { At::Rest } else { At::Returning(end) };
        (end == all).then(|| {
            let stroke = *self.newest(bone);
            bone.drop_stroke();
            Answer::Back(stroke)
        })
    }

    fn take_away(&mut self, bone: &BoneVolume, left: usize, why: Hindrance) -> Option<Answer> {
        let end = left.saturating_sub(BRICKS);
        (end..left).for_each(|n| bone.exchange_brick(n));
        self.at = if end == 0 { At::Rest } else { At::Leaving(end, why) };
        (end == 0).then_some(Answer::Not(why))
    }
}

impl Place {
    /// Whether the tool lies where the `n`th brick of the newest stroke would bring bone back.
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

    /// A block with a trench of 40 bricks.
    fn trench() -> (BoneVolume, VoxelVolume<i16>) {
        let whole = VoxelVolume::isotropic([320, 16, 16], Vec3::ZERO, 1.0, 900i16);
        let bone = BoneVolume::new(&whole, 400).expect("all bone");
        bone.begin_stroke();
        (0..320).for_each(|x| (0..4).for_each(|z| bone.set_hu(IVec3::new(x, 4, z), AIR_HU)));
        bone.end_stroke();
        (bone, whole)
    }

    fn probe(x: f32, y: f32) -> Option<Place> {
        let world_from_tool = Pose::from_translation(Vec3::new(x, y, -1.0));
        Some(Place { tool: Tool::probe(1.0), world_from_tool, said: Hindrance::Tool })
    }

    #[test]
    fn a_long_stroke_comes_back_over_several_ticks_each_of_bounded_work() {
        let (bone, whole) = trench();
        let mut undo = Undo::default();
        undo.newest(&bone).mm3 = 5.0;
        let mut seen = bone.seen();
        let mut ticks = 0;
        let answer = loop {
            ticks += 1;
            let answer = undo.tick(&bone, true, None, false, &[probe(100.0, 12.0)]);
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
    fn a_tool_that_comes_into_the_way_gets_its_room_back() {
        let (bone, whole) = trench();
        let cut = bone.snapshot();
        let mut undo = Undo::default();
        assert_eq!(undo.tick(&bone, true, None, false, &[None, probe(300.0, 12.0)]), None);
        assert!(bone.snapshot() != cut);
        let into = |undo: &mut Undo| undo.tick(&bone, true, None, false, &[None, probe(150.0, 4.0)]);
        let answer = (0..9).find_map(|_| into(&mut undo));
        assert_eq!(answer, Some(Answer::Not(Hindrance::Tool)));
        assert!(bone.snapshot() == cut && !undo.runs() && bone.strokes() == 1);
        assert_eq!(undo.tick(&bone, true, None, false, &[]), None, "held down it asks once");
        undo.tick(&bone, false, None, false, &[]);
        assert!((0..9).any(|_| undo.tick(&bone, true, None, false, &[]).is_some()) && bone.snapshot() == whole);
    }

    #[test]
    fn a_shaft_in_the_hole_is_in_the_way_and_a_tool_beside_it_is_not() {
        let (bone, _) = trench();
        let asks = |place| {
            let mut undo = Undo::default();
            undo.tick(
                &bone,
                true,
                Some(Hindrance::FlapMoves).filter(|_| place == Vec3::ZERO),
                false,
                &[Some(Place {
                    tool: Tool::burr(3.0),
                    world_from_tool: Pose::from_translation(place),
                    said: Hindrance::Tool,
                })],
            )
        };
        assert_eq!(asks(Vec3::ZERO), Some(Answer::Not(Hindrance::FlapMoves)));
        assert_eq!(asks(Vec3::new(60.0, 4.0, -20.0)), Some(Answer::Not(Hindrance::Tool)), "the shaft");
        assert_eq!(asks(Vec3::new(60.0, 4.0, 6.5)), Some(Answer::Not(Hindrance::Tool)), "the ball");
    }
}
