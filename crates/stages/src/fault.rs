//! Keeps the force off after a fault of the device until a deliberate action of the user.
//!
//! # Theory
//! ```text
//! lost, or stale for 100 ms ─→ off ─→ button pressed anew, or no contact for 200 ms ─→ on
//! ```
//! The user may have released or moved the device meanwhile: a force that returned by itself would
//! be unexpected. A button that was down before, or was pressed while the device could not be read,
//! does not count.
//!
//! # Practice
//! While the force is off nothing drills either. The guard fades the force out and ramps it in
//! again. A device that has never given a pose has no fault.

use trepan_contact::ForceGuard;
use trepan_geometry::{Buttons, ToolState, Twist};
use trepan_haptics::{Reading, Status};

/// Time of stale readings after which the device has a fault, ms.
const LONG_MS: f32 = 100.0;
/// Time without contact after which the force returns, ms.
const CLEAR_MS: f32 = 200.0;

/// Farthest place of a tool from the patient's origin, mm, numerical: no hand is there.
const FARTHEST_MM: f32 = 1e4;

/// Returns the reading of a device, or its last valid one at rest and `true` if it gave no usable
/// pose.
pub fn last_valid_state(reading: &Reading, last: ToolState) -> (ToolState, bool) {
    let is_sound = reading.tool.is_finite() && reading.tool.tip().abs().max_element() < FARTHEST_MM;
    let fresh = matches!(reading.status, Status::Fresh | Status::Finished) && is_sound;
    let at_rest = ToolState { twist: Twist::default(), time_ms: reading.tool.time_ms, ..last };
    (if fresh { reading.tool } else { at_rest }, !fresh)
}

/// Status of the device and its tool in a tick.
#[derive(Clone, Copy, Debug)]
pub struct DeviceStatus {
    /// The device is lost.
    pub lost: bool,
    /// The device gave no fresh pose.
    pub stale: bool,
    /// The tool touches something.
    pub touches: bool,
}

/// State of the force after faults of a device.
#[derive(Clone, Copy, Debug, Default)]
pub struct AfterFault {
    waits: bool,
    /// Whether the device has ever given a pose.
    known: bool,
    /// Whether it gave a pose in the last tick.
    fresh: bool,
    stale_ms: f32,
    clear_ms: f32,
    buttons: u32,
}

impl AfterFault {
    /// Whether the force is off and waits for an action of the user.
    pub fn waits(&self) -> bool {
        self.waits
    }

    /// Runs a tick, and switches the force off or on again; a `released` hand stays off. Returns a
    /// change: `true` when the force is switched off.
    pub fn follow(
        &mut self,
        tool: &ToolState,
        status: DeviceStatus,
        dt_ms: f32,
        guard: &mut ForceGuard,
        released: bool,
    ) -> Option<bool> {
        let waits = self.tick(tool, status, dt_ms)?;
        match waits {
            true => guard.release(),
            false if !released => guard.resume(),
            false => {}
        }
        Some(waits)
    }

    /// Runs a tick of `dt_ms`; returns a change: `true` when the force is switched off.
    fn tick(&mut self, tool: &ToolState, status: DeviceStatus, dt_ms: f32) -> Option<bool> {
        let before = self.waits;
        if status.stale || status.lost {
            (self.fresh, self.clear_ms) = (false, 0.0);
            self.stale_ms += dt_ms;
            self.waits |= self.known && (status.lost || self.stale_ms > LONG_MS);
        } else {
            let buttons = tool.buttons.0 & !Buttons::PAUSE.0;
            let pressed = self.fresh && buttons & !self.buttons != 0;
            self.clear_ms = if status.touches { 0.0 } else { self.clear_ms + dt_ms };
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
            (0..ticks).filter_map(|_| self.0.tick(&tool, DeviceStatus { lost, stale, touches }, 1.0)).collect()
        }
    }

    #[test]
    fn after_a_loss_the_force_is_off_until_a_button_is_pressed_anew_or_the_tool_is_clear() {
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
