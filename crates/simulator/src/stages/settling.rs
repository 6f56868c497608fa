//! Body force on the brain once the dura is open: brain shift under gravity, pulsation and
//! breathing.
//!
//! # Theory
//! In the scanner the brain floats in cerebrospinal fluid, and its rest shape is in equilibrium.
//! With the dura open, fluid is lost: the share `c` of the weight that it no longer carries acts as
//! a body force. Breathing and pulsation are two more body forces along the outward direction of
//! the opening:
//! ```text
//! a(t) = r(t) (c g  +  o (0.008 sin 2π 0.25 t + 0.003 sin 2π 1.2 t) 9.81e-3)
//! ```
//! a in mm/ms², t in s, o the outward unit vector, r a ramp from 0 to 1 in 2 s.
//!
//! # Practice
//! The dura counts as open from the first use of a tool for the brain. The force depends on the
//! ticks' times alone, so that a replay has the same loads. **Uncalibrated**: the shares of the
//! weight are chosen for motions of the order of those seen at craniotomies: breathing some 0.3 mm,
//! pulsation 0.1 mm, shift some millimetres.
//!
//! # Sources
//! Brain shift under gravity after loss of fluid: M. I. Miga et al., *In vivo quantification of a
//! homogeneous brain deformation model*, IEEE TMI 18 (1999).

use crate::program::Phase;
use trepan_geometry::{Vec3, units};

/// Length of the ramp, ms.
const RAMP_MS: f64 = 2000.0;
/// Share of the weight and frequency, 1/ms, of breathing and pulsation.
const SWAY: [(f64, f64); 2] = [(0.008, 0.25e-3), (0.003, 1.2e-3)];

/// Body force on the whole brain.
#[derive(Clone, Copy, Debug, Default)]
pub struct Settling {
    sinks: Vec3,
    outward: Vec3,
    opened_ms: Option<f64>,
}

impl Settling {
    /// Makes the body force with the share `lost` of the fluid's buoyancy. `down` and `outward` are
    /// the unit vectors of gravity and of the opening.
    pub fn new(lost: f32, down: Vec3, outward: Vec3) -> Self {
        let weight = units::GRAVITY_MM_PER_MS2;
        Self { sinks: lost * weight * down, outward: weight * outward, opened_ms: None }
    }

    /// Whether the dura is open.
    pub fn is_open(&self) -> bool {
        self.opened_ms.is_some()
    }

    /// Returns the acceleration at a time of the session, mm/ms².
    pub fn at(&mut self, phase: Phase, time_ms: f64) -> Vec3 {
        if phase == Phase::Brain {
            self.opened_ms.get_or_insert(time_ms);
        }
        let Some(opened_ms) = self.opened_ms else { return Vec3::ZERO };
        let since_ms = time_ms - opened_ms;
        let ramp = (since_ms / RAMP_MS).clamp(0.0, 1.0) as f32;
        let sway: f64 = SWAY.iter().map(|(share, hz)| share * (std::f64::consts::TAU * hz * since_ms).sin()).sum();
        ramp * (self.sinks + sway as f32 * self.outward)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_force_acts_before_the_dura_is_open_and_then_the_weight_ramps_up() {
        let mut settling = Settling::new(0.1, Vec3::NEG_Y, Vec3::Z);
        assert_eq!(settling.at(Phase::Craniotomy, 5000.0), Vec3::ZERO);
        assert_eq!(settling.at(Phase::Brain, 6000.0), Vec3::ZERO);
        let mut last = Vec3::ZERO;
        for ms in 6001..20_000 {
            let now = settling.at(Phase::Brain, f64::from(ms));
            assert!((now - last).length() < 2e-6, "a jump at {ms}");
            last = now;
        }
        assert!((last.y + 0.1 * 9.81e-3).abs() < 1e-6 && last.z.abs() <= 0.011 * 9.81e-3);
        assert_ne!(settling.at(Phase::Craniotomy, 21_000.0), Vec3::ZERO, "the dura stays open");
    }
}
