//! Requests by buttons: cutting, changing the tool, undoing a stroke, moving the flap.

use super::{HapticStage, SecondTool};
use crate::drill::Drill;
use crate::flap::Flap;
use crate::notice::{Hindrance, What};
use crate::program::Phase;
use crate::tray::Change;
use crate::undo::{Answer, Place, Stroke};
use glam::IVec3;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::{Buttons, Pose, ToolKind, ToolState, Vec3};

/// Ends of the line along the shaft on which a piece of bone is lifted, from the tip, mm.
const ABOVE_MM: f32 = 5.0;
const BELOW_MM: f32 = 20.0;

impl HapticStage {
    /// Whether the tool cuts. A perforator's clutch disengages once it is through; nothing cuts
    /// while bone is restored or lifted, or while the force is off after a fault.
    pub(super) fn drills(&self, tool: &ToolState) -> bool {
        let kind = self.tool().kind;
        let slips = kind == ToolKind::Perforator && self.drill.lets_go();
        let may = !slips && !self.bone_moves() && !self.fault.waits();
        tool.buttons.has(Buttons::PEDAL) && kind.cuts() && may
    }

    /// Whether a stroke is being undone or the flap is moving.
    fn bone_moves(&self) -> bool {
        self.undo.runs() || self.flap.as_ref().is_some_and(Flap::moves)
    }

    /// Whether the tool touches nothing.
    pub(super) fn is_free(&self) -> bool {
        !self.bone_step.manifold.touches() && self.tissue.depth_mm <= 0.0
    }

    /// Whether the bone is open, or need not be.
    pub fn is_open(&self) -> bool {
        let lifted = self.flap.as_ref().is_some_and(Flap::is_away);
        lifted || self.bone.is_none() || self.holes > 0 || !self.config.opening_needed
    }

    /// Takes over the operation of another session before the first tick: the tool's proxy, whether
    /// the bone is open, what was removed, mm³. The voxels of a lifted flap come with what is there
    /// now, HU. What tools cut is in the bone already; no stroke of it can be undone.
    pub fn restore(&mut self, proxy: Pose, is_open: bool, removed_mm3: f64, lifted: &[(IVec3, i16)]) {
        if let (Some(bone), Some(flap)) = (&self.bone, &mut self.flap) {
            flap.restore(bone, lifted);
        }
        self.holes = is_open.into();
        self.scores.bone_removed_mm3 = removed_mm3;
        self.proxy = proxy;
        self.last_valid.world_from_tool = proxy;
        self.rigid.iter_mut().flatten().for_each(|rigid| rigid.reset(proxy));
    }

    /// The bone, which this stage writes.
    pub fn bone(&self) -> Option<&Arc<BoneVolume>> {
        self.bone.as_ref()
    }

    /// Changes the tool on request, if the present one touches nothing. The first tick reports
    /// phase and tool.
    pub(super) fn change_tool(&mut self, tool: &ToolState, is_first: bool, report: &mut dyn FnMut(What)) {
        let before = self.phase();
        let change =
            self.tray.change(tool.buttons, self.is_free() && !self.undo.runs(), self.is_open(), self.arm.slot());
        match change {
            Some(Change::Refused) => report(What::NotOpen),
            Some(Change::Busy) => report(What::NotChanged),
            Some(Change::Held) => report(What::HeldByArm),
            Some(Change::Taken) => self.begin_tool(),
            None => {}
        }
        if is_first || before != self.phase() {
            report(What::Phase(self.phase()));
        }
        if is_first || change == Some(Change::Taken) {
            report(What::Taken(self.tool()));
        }
    }

    /// Begins with the tool that was taken, where the last one was.
    pub(super) fn begin_tool(&mut self) {
        if let Some(rigid) = &mut self.rigid[self.tray.slot()] {
            rigid.reset(self.proxy);
        }
        self.drill = Drill::default();
        self.bone.iter().for_each(|bone| bone.end_stroke());
    }

    /// Runs the tick of the flap.
    pub(super) fn follow_flap(&mut self, tool: &ToolState, drilling: bool, report: &mut dyn FnMut(What)) {
        let hinders = [
            (self.phase() == Phase::Brain, Hindrance::BrainTool),
            (drilling, Hindrance::Pedal),
            (!self.is_free(), Hindrance::Touches),
            (self.undo.runs(), Hindrance::UndoRuns),
            (self.arm.slot().is_some(), Hindrance::SecondTool),
        ];
        let hinders = hinders.into_iter().find_map(|(stands, why)| stands.then_some(why));
        let cut = self.bone_step.removed_mm3 > 0.0;
        let pressed = tool.buttons.has(Buttons::FLAP);
        let before = std::mem::replace(&mut self.asked_flap, pressed);
        match (&self.bone, &mut self.flap) {
            (Some(bone), Some(flap)) => {
                let shaft = tool.world_from_tool.rotation * Vec3::Z;
                let below = [ABOVE_MM, -BELOW_MM].map(|mm| tool.tip() + mm * shaft);
                flap.tick(bone, tool.buttons, (drilling, cut), hinders, below).into_iter().for_each(report);
            }
            _ if pressed && !before => report(What::NoFlap),
            _ => {}
        }
    }

    /// Begins, ends, undoes and redoes strokes; `second` is the second hand's tool.
    /// Returns the restored bone, mm³, negative for a redo.
    pub(super) fn undo(
        &mut self,
        tool: &ToolState,
        drilling: bool,
        second: Option<SecondTool>,
        report: &mut dyn FnMut(What),
    ) -> f32 {
        let hinders = self.hinders_undo(tool);
        let touches = (!self.is_free()).then_some(Hindrance::Touches);
        let Some(bone) = &self.bone else { return 0.0 };
        let flap_away = self.flap.as_ref().is_some_and(Flap::is_away);
        if self.drill.stroke(bone, tool, drilling) {
            *self.undo.newest(bone) = Stroke { flap_away, ..Stroke::default() };
        }
        let place = |tool, world_from_tool, hindrance| Place { tool, world_from_tool, hindrance };
        let tools = [
            Some(place(self.tray.tool(), self.proxy, Hindrance::Tool)),
            second.map(|other| place(other.tool, other.state.world_from_tool, Hindrance::SecondTool)),
        ];
        let moved = self.undo.runs();
        let pressed = [Buttons::UNDO, Buttons::REDO].map(|button| tool.buttons.has(button));
        let answer = self.undo.tick(bone, pressed, (hinders, touches), flap_away, &tools);
        let Some(answer) = answer else { return 0.0 };
        if moved || matches!(answer, Answer::Back(_) | Answer::Again(_)) {
            self.flap.iter_mut().for_each(Flap::bone_came_back);
        }
        let (what, back_mm3) = match answer {
            Answer::Back(stroke) => {
                self.holes = self.holes.saturating_sub(stroke.through);
                (What::Undone(stroke.mm3), stroke.mm3)
            }
            Answer::Again(stroke) => {
                self.holes += stroke.through;
                (What::Redone(stroke.mm3), -stroke.mm3)
            }
            Answer::NotAgain(why) => (What::NotRedone(why), 0.0),
            Answer::Not(why) => (What::NotUndone(why), 0.0),
        };
        report(what);
        back_mm3
    }

    /// Returns why no stroke can be undone now.
    fn hinders_undo(&self, tool: &ToolState) -> Option<Hindrance> {
        if self.phase() == Phase::Brain {
            return Some(Hindrance::BrainTool);
        }
        if self.flap.as_ref().is_some_and(Flap::moves) {
            return Some(Hindrance::FlapMoves);
        }
        tool.buttons.has(Buttons::PEDAL).then_some(Hindrance::Pedal)
    }
}
