//! A self-retaining arm: it holds a blunt tool where the hand left it, so that one hand does the
//! work of two.
//!
//! # Practice
//! A button leaves the tool with the arm, and the hand takes another. That one lies where the first
//! stays, so that it does nothing until it is drawn away and out of the tissue. The same button
//! takes the arm away, with its tool. An arm is stiff: no force moves it, none reaches the hand.

use super::{HapticStage, TickInput};
use crate::notice::{NoArm, What};
use crate::second_hand::SecondHand;
use trepan_geometry::{Buttons, Pose, Tool, ToolKind, ToolState, Twist};

/// A tool beside that of the first hand: of the second hand, or of an arm.
#[derive(Clone, Copy, Debug)]
pub struct SecondTool {
    /// The tool.
    pub tool: Tool,
    /// Its slot in the tray; of a second hand with a device, the number of the tray's tools.
    pub slot: usize,
    /// Its state.
    pub state: ToolState,
}

/// Whether an arm holds tools of a kind: those that neither cut nor suck.
pub fn is_held_by_arms(kind: ToolKind) -> bool {
    matches!(kind, ToolKind::Spatula | ToolKind::Probe)
}

/// State of the arm.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Arm {
    held: Option<SecondTool>,
    /// Since when the hand draws back from it, ms; `None` once it has.
    leaves_ms: Option<f64>,
    /// Whether the button was down in the last tick.
    asked: bool,
}

impl Arm {
    /// Slot of the tool that it holds.
    pub fn slot(&self) -> Option<usize> {
        self.held.map(|held| held.slot)
    }

    /// Whether the hand still draws back from it.
    pub fn leaves(&self) -> bool {
        self.leaves_ms.is_some()
    }
}

impl HapticStage {
    /// Follows the button, and how far the hand has drawn back.
    pub(super) fn follow_arm(&mut self, tool: &ToolState, input: &TickInput<'_>, report: &mut dyn FnMut(What)) {
        // The patch is of the tool in the hand once that has been collided.
        let is_free = |since_ms: f64| input.patch.time_ms > since_ms && input.patch.force_n <= 0.0;
        let wide_mm = |held: &SecondTool| held.tool.tip_radius_mm + self.tool().tip_radius_mm;
        let is_apart = |held: &SecondTool| held.state.tip().distance(tool.tip()) > wide_mm(held);
        let is_out = |since_ms: f64| is_free(since_ms) && self.arm.held.as_ref().is_none_or(is_apart);
        self.arm.leaves_ms = self.arm.leaves_ms.filter(|since_ms| !is_out(*since_ms));
        let pressed = tool.buttons.has(Buttons::ARM);
        if !pressed || std::mem::replace(&mut self.arm.asked, pressed) {
            self.arm.asked = pressed;
            return;
        }
        match self.arm.held.take() {
            Some(_) => report(What::ArmGone),
            None if input.second.is_some() => report(What::NoArm(NoArm::SecondHand)),
            None if !is_held_by_arms(self.tool().kind) => report(What::NoArm(NoArm::Tool)),
            None => {
                self.hold(self.tray.slot(), self.proxy, tool.time_ms);
                let held = self.tool();
                self.tray.leave(ToolKind::Aspirator);
                self.begin_tool();
                self.arm.leaves_ms = Some(tool.time_ms);
                report(What::Taken(self.tool()));
                // Last, as the newest notice is shown.
                report(What::ArmHolds(held));
            }
        }
    }

    /// Holds the tool of a slot at a pose from a time on, ms.
    fn hold(&mut self, slot: usize, world_from_tool: Pose, time_ms: f64) {
        let state = ToolState { world_from_tool, twist: Twist::default(), buttons: Buttons(0), time_ms };
        self.arm.held = self.config.program.tray().get(slot).map(|tool| SecondTool { tool: *tool, slot, state });
    }

    /// Takes over what the arm of another session holds, before the first tick. Its button may
    /// still be down.
    pub fn restore_arm(&mut self, slot: usize, world_from_tool: Pose) {
        self.arm.asked = true;
        self.hold(slot, world_from_tool, 0.0);
    }

    /// The tool of the second hand, or of the arm, in this tick.
    pub(super) fn second_tool(&self, input: &TickInput<'_>) -> Option<SecondTool> {
        let time_ms = self.last_valid.time_ms;
        let held = self.arm.held.map(|held| SecondTool { state: ToolState { time_ms, ..held.state }, ..held });
        let slot = self.config.program.tray().len();
        input.second.map(|state| SecondTool { tool: SecondHand::tool(), slot, state }).or(held)
    }
}
