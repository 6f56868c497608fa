//! The buzz of a drill at work, on top of another force model.
//!
//! # Theory
//! A burr with few flutes, off centre by a little, pushes the hand sideways once a turn and once a
//! flute:
//! ```text
//! F = F₀ + (a/s) |F₀| (t₁ cos φ + t₂ sin φ) ,   φ̇ = 2π f s ,   t₁, t₂ ⊥ n
//! ```
//! s is the spindle's speed as a share of its free speed ([`Vibration::turn`]): a slower spindle
//! buzzes lower, and stronger, since each flute then cuts a thicker chip; one that has stalled is
//! still. The spindle itself (1000 Hz at 60 000/min) lies above what a hand feels and what a 1 kHz
//! loop can draw, so f is the frequency that chatter has on the hand, 100 to 300 Hz.
//!
//! # Practice
//! Only while the pedal is down and the tool touches. Amplitude and frequency are uncalibrated. The
//! mean over a turn is the force without vibration.
//!
//! # Sources
//! A. Petersik et al., *Realistic haptic interaction in volume sculpting for surgery simulation*,
//! IS4TM 2003: drill vibration at haptic rates.
//!
//! # When not to use it
//! Where the force is measured or compared: it adds a known disturbance.

use crate::{ContactManifold, ForceModel};
use trepan_geometry::{Buttons, ToolState, Wrench};
use trepan_measurements::drilling;

/// A force model that vibrates while drilling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vibration<M> {
    /// What makes the mean force.
    pub mean: M,
    /// Share a of the mean force that goes round.
    pub amplitude: f32,
    /// Frequency f, Hz. Keep it under a quarter of the tick rate.
    pub frequency_hz: f32,
    /// Speed of the spindle, share s of its free speed.
    speed: f32,
    phase: f32,
}

/// The least share that makes the buzz stronger.
const SLOWEST: f32 = drilling::VIBRATION_SLOWEST.f32();

impl<M: ForceModel> Vibration<M> {
    /// Vibration on top of `mean`.
    pub fn new(mean: M, amplitude: f32, frequency_hz: f32) -> Self {
        Self { mean, amplitude, frequency_hz, speed: 1.0, phase: 0.0 }
    }

    /// A drill held in the hand, lightly: 5 % of the force at 120 Hz. Uncalibrated.
    pub fn drill(mean: M) -> Self {
        Self::new(mean, drilling::VIBRATION_SHARE.f32(), drilling::VIBRATION_FREQUENCY.f32())
    }

    /// The spindle turns at this share of its free speed, 0 to 1.
    pub fn turn(&mut self, speed: f32) {
        self.speed = if speed.is_finite() { speed.clamp(0.0, 1.0) } else { 0.0 };
    }
}

impl<M: ForceModel> ForceModel for Vibration<M> {
    fn wrench(&mut self, tool: &ToolState, manifold: &ContactManifold, dt_ms: f32) -> Wrench {
        let mean = self.mean.wrench(tool, manifold, dt_ms);
        if self.speed == 0.0 || !tool.buttons.has(Buttons::PEDAL) || !manifold.normal.is_normalized() {
            return mean;
        }
        let turn = core::f32::consts::TAU * self.frequency_hz * self.speed * 1e-3 * dt_ms;
        self.phase = if turn.is_finite() { (self.phase + turn) % core::f32::consts::TAU } else { 0.0 };
        let (a, b) = manifold.normal.any_orthonormal_pair();
        let size = self.amplitude / self.speed.max(SLOWEST) * mean.force.length();
        let wrench = mean + Wrench { force: size * (self.phase.cos() * a + self.phase.sin() * b), ..Wrench::ZERO };
        if wrench.is_finite() { wrench } else { mean }
    }

    fn reset(&mut self) {
        self.mean.reset();
        self.phase = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Contact, Hooke};
    use trepan_geometry::{Pose, Vec3};

    #[test]
    fn it_buzzes_only_while_drilling_and_leaves_the_mean() {
        let mut model = Vibration::new(Hooke { stiffness: 2.0 }, 0.1, 100.0);
        let touch = ContactManifold::single(Contact { normal: Vec3::Z, depth_mm: 0.5, point: Vec3::ZERO });
        let mut tool = ToolState::at(Pose::IDENTITY);
        assert_eq!(model.wrench(&tool, &touch, 1.0).force, Vec3::Z);
        tool.buttons = Buttons::PEDAL;
        let turn: Vec<Vec3> = (0..10).map(|_| model.wrench(&tool, &touch, 1.0).force).collect();
        assert!(turn.iter().all(|f| ((*f - Vec3::Z).length() - 0.1).abs() < 1e-5));
        assert!((turn.iter().sum::<Vec3>() / 10.0 - Vec3::Z).length() < 1e-5);
        assert_eq!(model.wrench(&tool, &ContactManifold::default(), 1.0), Wrench::ZERO);
        model.turn(0.5);
        let slow: Vec<Vec3> = (0..20).map(|_| model.wrench(&tool, &touch, 1.0).force).collect();
        assert!(slow.iter().all(|f| ((*f - Vec3::Z).length() - 0.2).abs() < 1e-5), "twice as strong");
        assert!((slow.iter().sum::<Vec3>() / 20.0 - Vec3::Z).length() < 1e-5, "one turn in 20 ms");
        model.turn(0.0);
        assert_eq!(model.wrench(&tool, &touch, 1.0).force, Vec3::Z, "stalled");
    }
}
