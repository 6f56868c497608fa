//! Which tool is in the hand, and when another may be taken.
//!
//! # Practice
//! A tool is laid down only while it touches nothing. From bone to brain there is a guard: the bone
//! must be open, by a stroke that came through or a flap that was lifted. Back to the bone there is
//! none. A request counts once, however long it is held; a slot that is asked for is tried until
//! the tool is free.

use crate::program::{Phase, Program};
use trepan_geometry::{Buttons, Tool, ToolKind};

/// The tray and what is missing from it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tray {
    program: Program,
    slot: usize,
    asked: (bool, Option<ToolKind>, Option<usize>),
}

/// What came of a request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Change {
    /// Another tool is in the hand.
    Taken,
    /// The bone is not open.
    Refused,
}

impl Tray {
    /// The first tool is in the hand.
    pub fn new(program: Program) -> Self {
        Self { program, slot: 0, asked: (false, None, None) }
    }

    /// Place of the tool in the tray.
    pub fn slot(&self) -> usize {
        self.slot
    }

    /// The tool in the hand.
    pub fn tool(&self) -> Tool {
        self.program.tray()[self.slot]
    }

    /// The phase of the tool in the hand.
    pub fn phase(&self) -> Phase {
        Phase::of(&self.tool())
    }

    /// Changes the tool if that is asked for, the tool is `free`, and the bone `open` where it must
    /// be.
    pub fn change(&mut self, buttons: Buttons, free: bool, open: bool) -> Option<Change> {
        let asks = (buttons.has(Buttons::NEXT_TOOL), buttons.taken(), buttons.in_slot());
        let before = std::mem::replace(&mut self.asked, asks);
        let slots = self.program.tray().len();
        let next = || asks.0.then(|| (self.slot + 1) % slots).filter(|_| !before.0);
        let kind = || asks.1.filter(|_| before.1 != asks.1).and_then(|kind| self.of_kind(kind));
        let wanted = next().or_else(kind).or(asks.2.filter(|slot| *slot < slots))?;
        if wanted == self.slot || !free {
            return None;
        }
        let phase = Phase::of(&self.program.tray()[wanted]);
        if phase == Phase::Brain && self.phase() == Phase::Craniotomy && !open {
            return (before != asks).then_some(Change::Refused);
        }
        self.slot = wanted;
        Some(Change::Taken)
    }

    /// The next tool of a kind after the one in the hand, around the tray.
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
        let mut ask = |buttons, free, open| (tray.change(buttons, free, open), tray.slot());
        assert_eq!(ask(Buttons::NEXT_TOOL, false, true), (None, 0), "touching");
        assert_eq!(ask(Buttons::NEXT_TOOL, true, true), (None, 0), "still held");
        ask(NONE, true, true);
        assert_eq!(ask(Buttons::NEXT_TOOL, true, true), (Some(Change::Taken), 1));
        assert_eq!(ask(Buttons::take(ToolKind::Burr), true, true), (Some(Change::Taken), 0), "the other burr");
        assert_eq!(ask(Buttons::take(ToolKind::Burr), true, true), (None, 0));
        assert_eq!(ask(Buttons::take(ToolKind::Aspirator), true, true), (None, 0), "not in the tray");
        assert_eq!(ask(Buttons::slot(3), false, true), (None, 0));
        assert_eq!(ask(Buttons::slot(3), true, true), (Some(Change::Taken), 3), "tried until free");
        assert_eq!(ask(Buttons::slot(14), true, true), (None, 3));
        assert_eq!(ask(Buttons::take(ToolKind::Spatula), true, true), (Some(Change::Taken), 5));
        ask(NONE, true, true);
        assert_eq!(ask(Buttons::NEXT_TOOL, true, false), (Some(Change::Taken), 0), "back to the bone");
    }

    #[test]
    fn the_brain_waits_for_an_opening() {
        let mut tray = Tray::new(Program::Integrated);
        let asks = Buttons::take(ToolKind::Probe);
        assert_eq!(tray.change(asks, true, false), Some(Change::Refused));
        assert_eq!(tray.change(asks, true, false), None, "told once");
        tray.change(NONE, true, false);
        assert_eq!((tray.change(asks, true, true), tray.phase()), (Some(Change::Taken), Phase::Brain));
        let mut alone = Tray::new(Program::Brain);
        assert_eq!(alone.change(Buttons::NEXT_TOOL, true, false), Some(Change::Taken));
    }
}
