//! What the hand asks for beside moving: cutting, another tool, the last stroke back, the flap.

use super::HapticStage;
use crate::program::Phase;
use crate::stages::drill::Drill;
use crate::stages::flap::Flap;
use crate::stages::notice::{Notice, What};
use crate::stages::tray::Change;
use trepan_geometry::{Buttons, ToolKind, ToolState};

impl HapticStage {
    /// Whether the tool cuts: a perforator's clutch lets go once it is through.
    pub(super) fn drills(&self, tool: &ToolState) -> bool {
        let kind = self.tool().kind;
        let slips = kind == ToolKind::Perforator && self.drill.lets_go();
        tool.buttons.has(Buttons::PEDAL) && kind.cuts() && !slips
    }

    /// Whether the tool touches nothing.
    fn is_free(&self) -> bool {
        !self.bone_step.manifold.touches() && self.tissue.depth_mm <= 0.0
    }

    /// Whether there is a way to the brain.
    fn is_open(&self) -> bool {
        let lifted = self.flap.as_ref().is_some_and(Flap::is_away);
        lifted || self.bone.is_none() || self.scores.times_through > 0 || !self.config.opening_needed
    }

    /// Another tool comes when it is asked for and the last one touches nothing.
    pub(super) fn change_tool(&mut self, tool: &ToolState, tick: u64, tell: &mut dyn FnMut(Notice)) {
        let mut say = |what| tell(Notice { tick, time_ms: tool.time_ms, what });
        let before = self.phase();
        let change = self.tray.change(tool.buttons, self.is_free(), self.is_open());
        match change {
            Some(Change::Refused) => say(What::NotOpen),
            Some(Change::Taken) => {
                if let Some(rigid) = &mut self.rigid[self.tray.slot()] {
                    rigid.reset(self.proxy);
                }
                self.drill = Drill::default();
                // The last stroke was another tool's.
                self.bone.iter().for_each(|bone| bone.begin_stroke());
            }
            None => {}
        }
        if tick <= 1 || before != self.phase() {
            say(What::Phase(self.phase()));
        }
        if tick <= 1 || change == Some(Change::Taken) {
            say(What::Taken(self.tool()));
        }
    }

    /// Looks after the flap.
    pub(super) fn follow_flap(&mut self, tool: &ToolState, drilling: bool, tick: u64, tell: &mut dyn FnMut(Notice)) {
        let free = self.is_free() && self.phase() == Phase::Craniotomy;
        let cut = self.bone_step.removed_mm3 > 0.0;
        if let (Some(bone), Some(flap)) = (&self.bone, &mut self.flap) {
            let what = flap.tick(bone, tool.buttons, drilling, cut, free);
            what.into_iter().for_each(|what| tell(Notice { tick, time_ms: tool.time_ms, what }));
        }
    }

    /// Lets the stroke begin or come back. Returns what came back, mm³.
    pub(super) fn undo(&mut self, tool: &ToolState, drilling: bool, tick: u64, tell: &mut dyn FnMut(Notice)) -> f32 {
        let Some(bone) = &self.bone else { return 0.0 };
        let flap_rests = self.flap.as_ref().is_none_or(|flap| !flap.moves());
        let may_undo = self.phase() == Phase::Craniotomy && !self.bone_step.manifold.touches() && flap_rests;
        let what = self.drill.stroke(bone, tool, drilling, may_undo);
        what.into_iter().for_each(|what| tell(Notice { tick, time_ms: tool.time_ms, what }));
        if let Some(What::Undone(mm3)) = what { mm3 } else { 0.0 }
    }
}
