//! The dura over the opening: tools press it, a scalpel incises it, sutures hold it back.
//!
//! # Practice
//! It follows the collision step, with the tool that this saw, so that a replay has the same. Bone
//! is read only while a tool for the brain is used, when nothing is carved, and a few nodes in a
//! step. A scalpel cuts while its pedal is down. Once another tool is taken, the leaves are held
//! back. While it is closed, no tool takes tissue away.

use crate::haptic_tick::{SecondTool, ToolSample};
use crate::program::Phase;
use serde::Serialize;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_contact::SurfacePatch;
use trepan_dura::{Dura, Tip};
use trepan_geometry::{Buttons, ToolKind, Vec3};

/// Nodes for which bone is looked up in a step, numerical.
const LOOKED_UP: usize = 32;
/// Places above a node at which bone is looked up, mm, numerical.
const ABOVE_MM: [f32; 6] = [1.5, 3.0, 4.5, 6.0, 7.5, 9.0];

/// What was done to the dura, and how it lies.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DuraState {
    /// Length of all incisions, mm.
    pub incised_mm: f32,
    /// Area that was cut out, mm².
    pub cut_out_mm2: f32,
    /// Places where it tore or a tool went through.
    pub torn: u32,
    /// When the fluid below could leave, s; `null` while it is closed.
    pub opened_s: Option<f64>,
    /// World place of each node at rest, mm; there is room for those that cuts add.
    #[serde(skip)]
    pub rest: Vec<Vec3>,
    /// World place of each node, mm.
    #[serde(skip)]
    pub places: Vec<Vec3>,
    /// Triangles over the nodes, `[0; 3]` where one was taken away; empty without a dura.
    #[serde(skip)]
    pub triangles: Vec<[u32; 3]>,
}

impl DuraState {
    /// Takes another's state; does not allocate if there is room.
    pub fn copy_from(&mut self, other: &Self) {
        let &Self { incised_mm, cut_out_mm2, torn, opened_s, .. } = other;
        let (mut rest, mut places) = (std::mem::take(&mut self.rest), std::mem::take(&mut self.places));
        let mut triangles = std::mem::take(&mut self.triangles);
        rest.clone_from(&other.rest);
        places.clone_from(&other.places);
        triangles.clone_from(&other.triangles);
        *self = Self { incised_mm, cut_out_mm2, torn, opened_s, rest, places, triangles };
    }
}

/// The dura, the bone above it, and its account.
pub(crate) struct Membrane {
    pub dura: Dura,
    bone: Arc<BoneVolume>,
    /// The node whose bone is looked up next.
    next: usize,
    /// Whether the scalpel was in the hand.
    incised: bool,
    /// Slot of the tool in the hand, and of the second one.
    slots: (usize, Option<usize>),
    shown: u32,
}

impl Membrane {
    pub fn of(dura: Dura, bone: Arc<BoneVolume>) -> Self {
        Self { dura, bone, next: 0, incised: false, slots: (0, None), shown: 0 }
    }

    /// Whether fluid can leave.
    pub fn is_open(&self) -> bool {
        self.dura.is_open()
    }

    /// Whether it lies between the tool and the tissue.
    pub fn covers(&self) -> bool {
        !self.is_open()
    }

    /// Goes on to the tool's time, adds the forces on the tools to their patches, keeps account.
    pub fn step(&mut self, sample: &ToolSample, brain: &[Vec3], patches: &mut [SurfacePatch; 2], now: &mut DuraState) {
        self.dura.rest_on(brain);
        if sample.phase() == Phase::Brain {
            self.look_up();
        }
        let is_scalpel = sample.tool.kind == ToolKind::Scalpel;
        if std::mem::replace(&mut self.incised, is_scalpel) && !is_scalpel {
            self.dura.hold_back();
        }
        let slots = (sample.slot, sample.second.map(|second| second.slot));
        let before = std::mem::replace(&mut self.slots, slots);
        if before.1.is_none() && slots.1 == Some(before.0) {
            self.dura.hand_over();
        }
        let tips = sample.tools().map(|tool| {
            let SecondTool { tool, state, .. } = tool.filter(|tool| Phase::of(&tool.tool) == Phase::Brain)?;
            let cuts = tool.kind == ToolKind::Scalpel && state.buttons.has(Buttons::PEDAL);
            Some(Tip { at: state.tip(), radius_mm: tool.tip_radius_mm, cuts })
        });
        let forces = self.dura.step(sample.state.time_ms, tips);
        for (patch, force) in patches.iter_mut().zip(forces).filter(|(_, force)| *force != Vec3::ZERO) {
            let sum = patch.force_n * patch.normal + force;
            let share = patch.force_n / (patch.force_n + force.length()).max(1e-9);
            (patch.normal, patch.force_n) = (sum.normalize_or_zero(), sum.length());
            patch.couple_mm *= share;
            patch.normal_velocity *= share;
        }
        if self.dura.moves() {
            self.tell(now);
        }
    }

    /// Looks up for a few nodes whether bone holds them.
    fn look_up(&mut self) {
        let nodes = self.dura.nodes();
        let end = (self.next + LOOKED_UP).min(nodes);
        let bone = &self.bone;
        let is_held =
            |place: Vec3, outward: Vec3| ABOVE_MM.iter().any(|mm| bone.is_bone(bone.voxel_of(place + *mm * outward)));
        self.dura.pin(self.next..end, is_held);
        self.next = if end == nodes { 0 } else { end };
    }

    /// Tells what was done and how it lies.
    pub fn tell(&mut self, now: &mut DuraState) {
        let account = self.dura.account();
        (now.incised_mm, now.cut_out_mm2, now.torn) = (account.incised_mm, account.cut_out_mm2, account.torn);
        now.opened_s = account.opened_ms.map(|ms| 1e-3 * ms);
        let room = self.dura.room();
        now.places.resize(room, Vec3::ZERO);
        now.places.iter_mut().zip(self.dura.places()).for_each(|(shown, place)| *shown = place);
        if std::mem::replace(&mut self.shown, self.dura.changes()) != self.dura.changes() {
            now.rest.resize(room, Vec3::ZERO);
            now.rest.iter_mut().zip(self.dura.at_rest()).for_each(|(shown, rest)| *shown = rest);
            now.triangles.clear();
            now.triangles.extend(self.dura.triangles());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision_step::{CollisionStage, SoftFrame};
    use crate::program::Program;
    use trepan_deformable::Config;
    use trepan_geometry::{Pose, ToolState};
    use trepan_soft::boxes;
    use trepan_volume::VoxelVolume;

    /// A block of brain, 48 mm wide and 16 mm high, under bone with a hole of 12 mm.
    fn stage() -> (CollisionStage, SoftFrame) {
        let mesh = boxes::split_box([12, 12, 4], Vec3::new(48.0, 48.0, 16.0));
        let mut plate = VoxelVolume::isotropic([48, 48, 30], Vec3::ZERO, 1.0, 0i16);
        for (at, hu) in plate.data.iter_mut().enumerate() {
            let place = [at % 48, at / 48 % 48, at / (48 * 48)].map(|i| i as f32);
            let is_hole = (place[0] - 24.0).hypot(place[1] - 24.0) < 12.0;
            *hu = if (18.0..24.0).contains(&place[2]) && !is_hole { 1000 } else { 0 };
        }
        let bone = Arc::new(BoneVolume::new(&plate, 300).unwrap());
        let dura = Dura::over(&mesh, Vec3::new(24.0, 24.0, 24.0), Vec3::Z, 20.0).unwrap();
        let stage = CollisionStage::new(Program::Integrated, &mesh, &Config::default(), None).unwrap();
        let stage = stage.aspirating(&mesh, &vec![0.05; mesh.tets.len()]).unwrap().covered(dura, bone);
        let velocities = vec![Vec3::ZERO; mesh.positions.len()];
        (stage, SoftFrame { step: 1, positions: mesh.positions, velocities, ..SoftFrame::default() })
    }

    /// Leads a tool in a straight line in a second; the largest force.
    fn lead(stage: &mut CollisionStage, brain: &SoftFrame, slot: usize, way: [Vec3; 2], from: u64) -> f32 {
        let tool = Program::Integrated.tray()[slot];
        let mut most_n = 0.0f32;
        for tick in from..from + 1000 {
            let at = way[0].lerp(way[1], (tick - from) as f32 / 999.0);
            let mut state = ToolState::at(Pose::from_translation(at));
            (state.time_ms, state.buttons) = (tick as f64, Buttons::PEDAL);
            stage.step(&ToolSample { tick, state, tool, slot, drilling: false, second: None, idle: false }, brain);
            most_n = most_n.max(stage.patch().force_n);
        }
        most_n
    }

    #[test]
    fn an_aspirator_takes_nothing_until_a_scalpel_has_opened_the_dura() {
        let (mut stage, brain) = stage();
        let [aspirator, scalpel] = [6, 8];
        assert_eq!(Program::Integrated.tray()[scalpel].kind, ToolKind::Scalpel);
        let at = |x: f32, z: f32| Vec3::new(x, 24.3, z);
        let pressed_n = lead(&mut stage, &brain, aspirator, [at(24.0, 22.0), at(24.0, 15.5)], 1);
        assert!(stage.aspirated_mm3() == 0.0 && pressed_n > 0.5 && stage.wound().dura.opened_s.is_none());
        let up_n = lead(&mut stage, &brain, aspirator, [at(24.0, 15.5), at(24.0, 24.0)], 1001);
        assert!(up_n > 0.0 && stage.patch().force_n == 0.0, "free again");
        lead(&mut stage, &brain, scalpel, [at(14.0, 20.0), at(14.0, 15.0)], 2001);
        lead(&mut stage, &brain, scalpel, [at(14.0, 15.0), at(34.0, 15.0)], 3001);
        lead(&mut stage, &brain, scalpel, [at(34.0, 15.0), at(34.0, 30.0)], 4001);
        let dura = stage.wound().dura.clone();
        assert!(dura.incised_mm > 15.0 && dura.opened_s.is_some_and(|s| (3.0..4.0).contains(&s)), "{dura:?}");
        // Another tool: sutures hold the leaves back.
        lead(&mut stage, &brain, aspirator, [at(24.0, 40.0), at(24.0, 22.0)], 5001);
        lead(&mut stage, &brain, aspirator, [at(24.0, 22.0), at(24.0, 15.0)], 6001);
        assert!(stage.aspirated_mm3() > 1.0 && stage.wound().dura.torn == 0, "{} mm³", stage.aspirated_mm3());
        let moved = stage.wound().dura.places.iter().zip(&dura.places).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(moved > 2.0, "{moved} mm");
    }

    #[test]
    fn an_arm_takes_a_tool_over_the_dura_with_its_force() {
        let (mut stage, brain) = stage();
        let [spatula, aspirator] = [5, 6].map(|slot| (slot, Program::Integrated.tray()[slot]));
        let at = Vec3::new(24.0, 24.3, 17.5);
        let pressed_n = lead(&mut stage, &brain, spatula.0, [at + 6.0 * Vec3::Z, at], 1);
        let before_n = stage.patch().force_n;
        for tick in 1001..1500u64 {
            let mut state = ToolState::at(Pose::from_translation(at));
            state.time_ms = tick as f64;
            let second = Some(SecondTool { tool: spatula.1, slot: spatula.0, state });
            let (slot, tool) = aspirator;
            stage.step(&ToolSample { tick, state, tool, slot, drilling: false, second, idle: true }, &brain);
            let [hand, arm] = stage.patches();
            assert!((arm.force_n - before_n).abs() < 0.1 * before_n, "{} of {before_n} N at {tick}", arm.force_n);
            let of_brain_n = hand.force_n;
            assert!(of_brain_n < 0.2, "the hand's own tool feels no dura: {of_brain_n} N");
        }
        assert!(pressed_n > 0.8 && stage.wound().dura.torn == 0, "{pressed_n} N");
    }
}
