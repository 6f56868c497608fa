//! After a device's fault its force waits for a deliberate act of the hand.
//!
//! # Theory
//! ```text
//! lost, or stale for 100 ms ─→ waits ─→ a button pressed anew, or nothing touched for 200 ms ─→ force again
//! ```
//! The hand may have let the device go meanwhile, or rest somewhere else: a force that comes back
//! by itself would push what it does not expect. A button that was down before, or went down while
//! nothing could be read, is no act.
//!
//! # Practice
//! While it waits nothing drills either. The guard lets go and ramps in anew. A device that has
//! never been there waits for nothing.

use trepan_geometry::{Buttons, ToolState};

/// Stale for longer than this, a device counts as gone, ms.
const LONG_MS: f32 = 100.0;
/// So long the tool must touch nothing, ms.
const CLEAR_MS: f32 = 200.0;

/// What a tick of a device was like.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    /// The device is gone.
    pub lost: bool,
    /// It gave no fresh pose.
    pub stale: bool,
    /// The tool touches something.
    pub touches: bool,
}

/// Whether the force waits.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct AfterFault {
    waits: bool,
    /// Whether the device has ever given a pose.
    known: bool,
    /// Whether it gave one in the last tick.
    fresh: bool,
    stale_ms: f32,
    clear_ms: f32,
    buttons: u32,
}

impl AfterFault {
    /// Whether the force waits.
    pub fn waits(&self) -> bool {
        self.waits
    }

    /// One tick of `dt_ms`; says when it begins to wait (`true`) and when it ends.
    pub fn tick(&mut self, tool: &ToolState, seen: Seen, dt_ms: f32) -> Option<bool> {
        let before = self.waits;
        if seen.stale || seen.lost {
            (self.fresh, self.clear_ms) = (false, 0.0);
            self.stale_ms += dt_ms;
            self.waits |= self.known && (seen.lost || self.stale_ms > LONG_MS);
        } else {
            let buttons = tool.buttons.0 & !Buttons::PAUSE.0;
            let pressed = self.fresh && buttons & !self.buttons != 0;
            self.clear_ms = if seen.touches { 0.0 } else { self.clear_ms + dt_ms };
            self.waits &= !pressed && self.clear_ms < CLEAR_MS;
            (self.known, self.fresh, self.stale_ms, self.buttons) = (true, true, 0.0, buttons);
        }
        (self.waits != before).then_some(self.waits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Pose;

    const NOTHING: [bool; 0] = [];

    struct Hand(AfterFault);

    impl Hand {
        fn run(&mut self, ticks: usize, buttons: Buttons, lost: bool, stale: bool, touches: bool) -> Vec<bool> {
            let tool = ToolState { buttons, ..ToolState::at(Pose::IDENTITY) };
            (0..ticks).filter_map(|_| self.0.tick(&tool, Seen { lost, stale, touches }, 1.0)).collect()
        }
    }

    #[test]
    fn it_waits_after_a_loss_until_a_button_is_pressed_anew_or_the_tool_is_clear() {
        let (none, pedal) = (Buttons(0), Buttons::PEDAL);
        let mut hand = Hand(AfterFault::default());
        assert_eq!(hand.run(500, none, true, true, false), NOTHING, "it was never there");
        hand.run(10, pedal, false, false, true);
        assert_eq!(hand.run(99, pedal, false, true, true), NOTHING, "a short gap");
        hand.run(1, pedal, false, false, true);
        assert_eq!(hand.run(1, pedal, true, true, true), [true]);
        assert_eq!(hand.run(1000, pedal, false, false, true), NOTHING, "held since before");
        assert_eq!(hand.run(10, none, false, false, true), NOTHING);
        assert_eq!(hand.run(10, Buttons::PAUSE, false, false, true), NOTHING, "the teacher's is none of the hand's");
        assert_eq!(hand.run(2, pedal, false, false, true), [false]);
        assert_eq!(hand.run(300, none, false, true, true), [true], "stale for long");
        assert_eq!(hand.run(50, pedal, false, false, true), NOTHING, "pressed while nobody saw it");
        assert_eq!(hand.run(150, pedal, false, false, false), NOTHING);
        assert_eq!(hand.run(100, pedal, false, false, true), NOTHING, "clear for a moment only");
        assert_eq!(hand.run(210, pedal, false, false, false), [false]);
        assert!(!hand.0.waits());
    }
}
