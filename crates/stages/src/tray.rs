//! The present tool, and the conditions for changing it.
//!
//! # Practice
//! A tool can be changed only while it touches nothing. A tool for the brain requires an open bone:
//! a stroke that came through or a lifted flap. A tool for bone has no such condition. A request
//! counts once, however long its button is pressed; a requested slot is retried until the tool is
//! free. A tool that an arm holds cannot be taken.

use crate::program::{Phase, Program};
use trepan_geometry::{Buttons, Tool, ToolKind};

/// The program's tools and the present one.
#[derive(Clone, Copy, Debug)]
pub struct Tray {
    program: Program,
    slot: usize,
    last_request: (bool, Option<ToolKind>, Option<usize>),
}

/// Result of a request for a tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// The tool was changed.
    Taken,
    /// The request was refused: the bone is not open.
    Refused,
    /// The request was refused: the present tool touches something.
    Busy,
    /// The request was refused: an arm holds that tool.
    Held,
}

impl Tray {
    /// Makes a tray with the first tool taken.
    pub fn new(program: Program) -> Self {
        Self { program, slot: 0, last_request: (false, None, None) }
    }

    /// Returns the slot of the present tool.
    pub fn slot(&self) -> usize {
        self.slot
    }

    /// Returns the present tool.
    pub fn tool(&self) -> Tool {
        self.program.tray()[self.slot]
    }

    /// Returns the phase of the present tool.
    pub fn phase(&self) -> Phase {
        Phase::of(&self.tool())
    }

    /// Takes a tool of a kind, or else the next tool for the brain, in place of one that an arm
    /// holds from now on.
    pub fn leave(&mut self, kind: ToolKind) {
        let (slots, here) = (self.program.tray().len(), self.slot);
        let after = (1..slots).map(|step| (here + step) % slots);
        let brain = |slot: &usize| Phase::of(&self.program.tray()[*slot]) == Phase::Brain;
        let other = self.of_kind(kind).filter(|slot| *slot != here).or_else(|| after.into_iter().find(brain));
        self.slot = other.unwrap_or(here);
    }

    /// Changes the tool on request, if the tool is `free` and the bone is `open` where required.
    /// The tool in the slot `held` is left out.
    pub fn change(&mut self, buttons: Buttons, free: bool, open: bool, held: Option<usize>) -> Option<Change> {
        let request = (buttons.has(Buttons::NEXT_TOOL), buttons.taken(), buttons.in_slot());
        let before = std::mem::replace(&mut self.last_request, request);
        let slots = self.program.tray().len();
        let is_there = |slot: &usize| Some(*slot) != held;
        let turn = || (1..slots).map(|step| (self.slot + step) % slots).find(is_there);
        let next = || request.0.then(turn).flatten().filter(|_| !before.0);
        let kind = || request.1.filter(|_| before.1 != request.1).and_then(|kind| self.of_kind(kind));
        let target = next().or_else(kind).or(request.2.filter(|slot| *slot < slots))?;
        if target == self.slot {
            return None;
        }
        if !free || !is_there(&target) {
            let why = if free { Change::Held } else { Change::Busy };
            return (before != request).then_some(why);
        }
        let phase = Phase::of(&self.program.tray()[target]);
        if phase == Phase::Brain && self.phase() == Phase::Craniotomy && !open {
            return (before != request).then_some(Change::Refused);
        }
        self.slot = target;
        Some(Change::Taken)
    }

    /// Returns the slot of the next tool of a kind, cyclically after the present one.
    fn of_kind(&self, kind: ToolKind) -> Option<usize> {
        let tray = self.program.tray();
        (1..=tray.len()).map(|step| (self.slot + step) % tray.len()).find(|slot| tray[*slot].kind == kind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Buttons = Buttons(0);

    #[test]
    fn tools_are_taken_by_turn_kind_or_slot_once_for_each_request() {
        let mut tray = Tray::new(Program::Integrated);
        let mut ask = |buttons, free, open| (tray.change(buttons, free, open, None), tray.slot());
        assert_eq!(ask(Buttons::NEXT_TOOL, false, true), (Some(Change::Busy), 0), "touching");
        assert_eq!(ask(Buttons::NEXT_TOOL, true, true), (None, 0), "still held");
        ask(NONE, true, true);
        assert_eq!(ask(Buttons::NEXT_TOOL, true, true), (Some(Change::Taken), 1));
        assert_eq!(ask(Buttons::take(ToolKind::Burr), true, true), (Some(Change::Taken), 0), "the other burr");
        assert_eq!(ask(Buttons::take(ToolKind::Burr), true, true), (None, 0));
        assert_eq!(ask(Buttons::slot(3), false, true), (Some(Change::Busy), 0));
        assert_eq!(ask(Buttons::slot(3), false, true), (None, 0), "reported once");
        assert_eq!(ask(Buttons::slot(3), true, true), (Some(Change::Taken), 3), "tried until free");
        assert_eq!(ask(Buttons::slot(14), true, true), (None, 3));
        assert_eq!(ask(Buttons::take(ToolKind::Spatula), true, true), (Some(Change::Taken), 5));
        assert_eq!(ask(Buttons::take(ToolKind::Aspirator), true, true), (Some(Change::Taken), 6));
        ask(NONE, true, true);
        for tool in [7, 8, 9] {
            let taken = ask(Buttons::NEXT_TOOL, true, true);
            assert_eq!(taken, (Some(Change::Taken), tool), "the bipolar, the scalpel, the scissors");
            ask(NONE, true, true);
        }
        assert_eq!(ask(Buttons::NEXT_TOOL, true, false), (Some(Change::Taken), 0), "back to the bone");
    }

    #[test]
    fn a_tool_that_an_arm_holds_is_not_taken() {
        let mut tray = Tray::new(Program::Brain);
        let spatula = tray.of_kind(ToolKind::Spatula).unwrap();
        tray.change(Buttons::slot(spatula), true, true, None);
        tray.leave(ToolKind::Aspirator);
        assert_eq!(tray.tool().kind, ToolKind::Aspirator);
        let held = Some(spatula);
        let request = Buttons::take(ToolKind::Spatula);
        assert_eq!(tray.change(request, true, true, held), Some(Change::Held));
        assert_eq!(tray.change(request, true, true, held), None, "reported once");
        for _ in 0..4 {
            tray.change(NONE, true, true, held);
            assert_eq!(tray.change(Buttons::NEXT_TOOL, true, true, held), Some(Change::Taken));
            assert_ne!(tray.slot(), spatula);
        }
    }

    #[test]
    fn a_tool_for_the_brain_requires_an_opening() {
        let mut tray = Tray::new(Program::Integrated);
        let request = Buttons::take(ToolKind::Probe);
        assert_eq!(tray.change(request, true, false, None), Some(Change::Refused));
        assert_eq!(tray.change(request, true, false, None), None, "reported once");
        tray.change(NONE, true, false, None);
        assert_eq!((tray.change(request, true, true, None), tray.phase()), (Some(Change::Taken), Phase::Brain));
        let mut alone = Tray::new(Program::Brain);
        assert_eq!(alone.change(Buttons::NEXT_TOOL, true, false, None), Some(Change::Taken));
    }
}
