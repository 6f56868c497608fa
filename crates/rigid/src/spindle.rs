//! The spindle of a drill: how fast it turns under load, and when it stalls.
//!
//! # Theory
//! A motor held at its voltage or pressure loses speed in proportion to torque:
//! ```text
//! ω = ω₀ (1 - τ/τₛ) ,   P = τ ω ≤ τₛ ω₀ / 4
//! ```
//! so that its greatest power gives τₛ. Under a least speed it stalls: it stops at once, and starts
//! again when the load has gone down to half.
//!
//! # Practice
//! Speeds in 1/min, torques in N mm, power in W (= N mm/ms). Run-up is not modelled: a burr's
//! inertia is some g mm², which 20 N mm bring to speed within tens of ms.
//!
//! # When not to use it
//! For motors with a speed control: they hold ω₀ up to their greatest power and give way at once.

use core::f32::consts::TAU;
use trepan_measurements::drilling;

/// A motor. The numbers are those of a type, not of a product: uncalibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spindle {
    /// Speed ω₀ without load, revolutions per minute.
    pub free_rpm: f32,
    /// Greatest power, W. More keeps the speed up under load.
    pub power_w: f32,
    /// Speed under which it stalls, revolutions per minute.
    pub stall_rpm: f32,
}

impl Spindle {
    /// A pneumatic or electric drill of 60 000/min.
    pub const DRILL: Self = Self {
        free_rpm: drilling::BURR_SPEED.f32(),
        power_w: drilling::BURR_POWER.f32(),
        stall_rpm: drilling::BURR_STALL_SPEED.f32(),
    };

    /// The slow drill of a cranial perforator.
    pub const PERFORATOR: Self = Self {
        free_rpm: drilling::PERFORATOR_SPEED.f32(),
        power_w: drilling::PERFORATOR_POWER.f32(),
        stall_rpm: drilling::PERFORATOR_STALL_SPEED.f32(),
    };

    /// Torque that would stop it, N mm.
    fn stopping_nmm(&self) -> f32 {
        4.0 * self.power_w / per_ms(self.free_rpm)
    }

    /// Torque at which it stalls, N mm.
    pub fn stall_nmm(&self) -> f32 {
        self.stopping_nmm() * (1.0 - self.stall_rpm / self.free_rpm)
    }

    /// Speed under a torque, revolutions per minute; 0 when that stalls it.
    pub fn rpm(&self, torque_nmm: f32) -> f32 {
        let rpm = self.free_rpm * (1.0 - torque_nmm / self.stopping_nmm());
        if rpm >= self.stall_rpm && rpm.is_finite() { rpm } else { 0.0 }
    }

    /// Speed under a torque of a spindle that is perhaps `stalled`, and takes note of whether it is
    /// then.
    pub fn turn(&self, torque_nmm: f32, stalled: &mut bool) -> f32 {
        let waits = *stalled && torque_nmm > 0.5 * self.stall_nmm();
        let rpm = if waits { 0.0 } else { self.rpm(torque_nmm) };
        *stalled = rpm == 0.0;
        rpm
    }
}

/// Revolutions per minute as radians per ms.
pub(crate) fn per_ms(rpm: f32) -> f32 {
    TAU * rpm / 60_000.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_falls_with_load_to_the_stall_and_power_has_its_greatest() {
        let spindle = Spindle { stall_rpm: 0.0, ..Spindle::DRILL };
        let power = |torque: f32| torque * per_ms(spindle.rpm(torque));
        let half = 0.5 * spindle.stopping_nmm();
        assert!((power(half) - 120.0).abs() < 1e-3 && power(0.9 * half) < 120.0 && power(1.1 * half) < 120.0);
        assert_eq!((spindle.rpm(0.0), Spindle::DRILL.rpm(1.01 * Spindle::DRILL.stall_nmm())), (60_000.0, 0.0));
        assert!((Spindle::DRILL.rpm(0.999 * Spindle::DRILL.stall_nmm()) - 20_000.0).abs() < 100.0);
    }

    #[test]
    fn a_stalled_spindle_starts_again_at_half_the_load() {
        let (spindle, mut stalled) = (Spindle::DRILL, false);
        let stall = spindle.stall_nmm();
        let speeds = [0.9, 1.1, 0.9, 0.6, 0.49, 0.9].map(|share| spindle.turn(share * stall, &mut stalled) > 0.0);
        assert_eq!(speeds, [true, false, false, false, true, true]);
        assert_eq!(spindle.turn(f32::NAN, &mut stalled), 0.0);
    }
}
