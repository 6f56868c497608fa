//! A clutch for any device: while its second button is held, the tool stays and the hand moves
//! freely.
//!
//! # Theory
//! ```text
//!             short press                                   long press
//!  button  ___╱▔▔╲_______________          button  ___╱▔▔▔▔▔▔▔▔▔▔▔▔▔╲_______
//!  next tool ____╱▔▔▔╲__________           tool    ~~~~~~~────────────~~~~~~
//!                                          the tip stays, the shaft still rotates
//! ```
//! After a long press the tip is at the hand's position plus the motion during the press:
//! `t = x + Σ (x_before - x_after)`. So the tip never jumps.
//!
//! # Practice
//! The second button requests the next tool when released within 250 ms, and acts as the clutch
//! when held longer. The force fades within 50 ms of the clutch and returns over 300 ms after it:
//! by then the touched wall is elsewhere relative to the hand.
//!
//! # When not to use it
//! With scripts and replays: their buttons already have a fixed meaning.

use crate::{Capabilities, HapticDevice, Reading, Status};
use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, Twist, Vec3};

/// Longest press that requests the next tool, ms.
const SHORT_MS: f64 = 250.0;
/// How long the next-tool button is reported, ms.
const ASK_MS: f64 = 50.0;
/// Time in which the force fades out, ms.
const FADE_MS: f32 = 50.0;
/// Time in which the force returns, ms.
const RETURN_MS: f32 = 300.0;

/// A device with a clutch.
pub struct Clutch {
    device: Box<dyn HapticDevice>,
    pressed_ms: Option<f64>,
    asks_until_ms: f64,
    /// Position of the tip while the clutch is held.
    held: Option<Vec3>,
    offset: Vec3,
    share: f32,
    last_ms: f64,
    tick_ms: f32,
}

impl Clutch {
    /// Wraps `device` in a clutch.
    pub fn new(device: Box<dyn HapticDevice>) -> Self {
        Self {
            device,
            pressed_ms: None,
            asks_until_ms: f64::NEG_INFINITY,
            held: None,
            offset: Vec3::ZERO,
            share: 1.0,
            last_ms: f64::NAN,
            tick_ms: 0.0,
        }
    }

    /// Whether the clutch holds the tool.
    pub fn is_held(&self) -> bool {
        self.held.is_some()
    }

    /// Processes the button; `tip` is the tool's position in this tick without a clutch.
    fn follow(&mut self, pressed: bool, tip: Vec3, time_ms: f64) {
        match (pressed, self.pressed_ms) {
            (true, None) => self.pressed_ms = Some(time_ms),
            (true, Some(since)) if time_ms - since > SHORT_MS && self.held.is_none() => self.held = Some(tip),
            (false, Some(_)) => {
                self.pressed_ms = None;
                match self.held.take() {
                    Some(held) => self.offset += held - tip,
                    None => self.asks_until_ms = time_ms + ASK_MS,
                }
            }
            _ => {}
        }
    }
}

impl HapticDevice for Clutch {
    fn read(&mut self, time_ms: f64) -> Reading {
        let Reading { mut tool, status } = self.device.read(time_ms);
        self.tick_ms = if self.last_ms.is_nan() { 0.0 } else { (time_ms - self.last_ms).clamp(0.0, 10.0) as f32 };
        self.last_ms = time_ms;
        tool.world_from_tool.translation += self.offset;
        // A lost device keeps reporting its last buttons: ignore them.
        let pressed = tool.buttons.has(Buttons::NEXT_TOOL) && status != Status::Lost;
        let before = self.offset;
        self.follow(pressed, tool.tip(), time_ms);
        tool.world_from_tool.translation += self.offset - before;
        if let Some(held) = self.held {
            tool.world_from_tool.translation = held;
            tool.twist = Twist { linear: Vec3::ZERO, ..tool.twist };
        }
        let asks = if time_ms < self.asks_until_ms { Buttons::NEXT_TOOL.0 } else { 0 };
        tool.buttons = Buttons(tool.buttons.0 & !Buttons::NEXT_TOOL.0 | asks);
        Reading { tool, status }
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        let change = if self.is_held() { -self.tick_ms / FADE_MS } else { self.tick_ms / RETURN_MS };
        self.share = (self.share + change).clamp(0.0, 1.0);
        self.device.apply(wrench.faded(self.share));
    }

    fn capabilities(&self) -> Capabilities {
        self.device.capabilities()
    }

    fn close(&mut self) {
        self.device.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};
    use trepan_contact::{ForceGuard, GuardConfig};
    use trepan_geometry::{Pose, Quat, ToolState, Wrench};

    /// Position and buttons of the hand, and the force applied to it.
    type Shared = Arc<Mutex<(Vec3, u32, Vec3)>>;

    /// A device whose motion the test sets.
    struct Puppet(Shared);

    impl HapticDevice for Puppet {
        fn read(&mut self, time_ms: f64) -> Reading {
            let (tip, buttons, _) = *self.0.lock().unwrap();
            let mut tool = ToolState { time_ms, ..ToolState::at(Pose::from_parts(tip, Quat::from_rotation_x(tip.x))) };
            (tool.buttons, tool.twist.linear) = (Buttons(buttons), Vec3::X);
            Reading { tool, status: Status::Fresh }
        }

        fn apply(&mut self, wrench: GuardedWrench) {
            self.0.lock().unwrap().2 = wrench.force();
        }

        fn capabilities(&self) -> Capabilities {
            Capabilities::passive("puppet")
        }

        fn close(&mut self) {}
    }

    struct Bench {
        clutch: Clutch,
        hand: Shared,
        guard: ForceGuard,
        time_ms: f64,
    }

    impl Bench {
        fn new() -> Self {
            let hand = Shared::default();
            let config = GuardConfig { ramp_in_ms: 0.0, slew_n_per_ms: 10.0, ..GuardConfig::default() };
            let clutch = Clutch::new(Box::new(Puppet(hand.clone())));
            Self { clutch, hand, guard: ForceGuard::new(config), time_ms: 0.0 }
        }

        /// Applies a hand position and buttons for some ticks; returns the last tool and the force.
        fn run(&mut self, tip: Vec3, buttons: Buttons, ticks: u32) -> (ToolState, f32) {
            {
                let mut hand = self.hand.lock().unwrap();
                (hand.0, hand.1) = (tip, buttons.0);
            }
            let mut tool = ToolState::at(Pose::IDENTITY);
            for _ in 0..ticks {
                self.time_ms += 1.0;
                tool = self.clutch.read(self.time_ms).tool;
                let still = ToolState { time_ms: self.time_ms, ..ToolState::at(Pose::IDENTITY) };
                self.clutch.apply(self.guard.guard(Wrench { force: Vec3::Y, torque: Vec3::ZERO }, &still, 1.0));
            }
            (tool, self.hand.lock().unwrap().2.y)
        }
    }

    #[test]
    fn a_short_press_asks_for_the_next_tool_once_it_is_let_go() {
        let mut bench = Bench::new();
        let none = Buttons::default();
        assert_eq!(bench.run(Vec3::ONE, Buttons(3), 200).0.buttons, Buttons::PEDAL, "not yet");
        assert_eq!(bench.run(Vec3::ONE, none, 10).0.buttons, Buttons::NEXT_TOOL);
        let (tool, force) = bench.run(Vec3::ONE, none, 50);
        assert_eq!((tool.buttons, tool.tip(), force), (none, Vec3::ONE, 1.0));
    }

    #[test]
    fn a_long_press_holds_the_tip_and_nothing_jumps() {
        let mut bench = Bench::new();
        bench.run(Vec3::ONE, Buttons::NEXT_TOOL, 300);
        assert!(bench.clutch.is_held());
        let (tool, _) = bench.run(Vec3::splat(5.0), Buttons::NEXT_TOOL, 10);
        assert_eq!((tool.tip(), tool.twist.linear, tool.buttons), (Vec3::ONE, Vec3::ZERO, Buttons::default()));
        assert_eq!(tool.world_from_tool.rotation, Quat::from_rotation_x(5.0), "the shaft turns on");
        let (tool, _) = bench.run(Vec3::splat(5.0), Buttons::default(), 1);
        assert_eq!((tool.tip(), tool.buttons), (Vec3::ONE, Buttons::default()), "let go where it was");
        assert_eq!(bench.run(Vec3::splat(6.0), Buttons::default(), 1).0.tip(), Vec3::splat(2.0));
        bench.run(Vec3::splat(6.0), Buttons::NEXT_TOOL, 300);
        bench.run(Vec3::splat(-6.0), Buttons::NEXT_TOOL, 10);
        assert_eq!(bench.run(Vec3::splat(-6.0), Buttons::default(), 1).0.tip(), Vec3::splat(2.0), "again and again");
    }

    #[test]
    fn the_force_fades_while_it_is_held_and_comes_back_slowly() {
        let mut bench = Bench::new();
        assert_eq!(bench.run(Vec3::ZERO, Buttons::NEXT_TOOL, 250).1, 1.0);
        let fading: Vec<f32> = (0..60).map(|_| bench.run(Vec3::ZERO, Buttons::NEXT_TOOL, 1).1).collect();
        assert!(fading.windows(2).all(|f| f[0] - f[1] < 0.021) && fading[59] == 0.0, "{fading:?}");
        let back: Vec<f32> = (0..320).map(|_| bench.run(Vec3::ZERO, Buttons::default(), 1).1).collect();
        assert!(back.windows(2).all(|f| f[1] - f[0] < 0.004) && back[319] == 1.0, "{back:?}");
    }
}
