//! Loads on the brain once the dura is open: weight where the fluid has drained, breathing and
//! pulsation.
//!
//! # Theory
//! In the scanner the brain floats in cerebrospinal fluid, and its rest shape is in equilibrium.
//! With the dura open fluid drains: a share `c` of the buoyancy is lost in the end, with the time
//! constant T that patients' shift against time gives. What lies above the fluid's level has its
//! weight, less what it weighs in fluid; what lies below floats on. The level is the height above
//! which the lost share of the brain's volume lies. The head is turned so that the opening lies
//! uppermost. Heart and lungs raise the pressure in the skull; in the opening it pushes the brain
//! outwards, as far as the tissue gives way:
//! ```text
//! level(t): volume above it = c (1 - e^(-k t/T)) of the whole      k: speed-up
//! p(t) = r(t) (p_b sin 2π f_b t + p_p sin 2π f_p t)
//! ```
//! r is a ramp from 0 to 1 in 2 s. Without a skull to drain, or in recordings of versions before
//! the level, weight and motion are a body force on the whole brain, down and along the outward
//! direction o of the opening, with uncalibrated shares of the weight:
//! ```text
//! a(t) = r(t) (c g  +  o (s_b sin 2π f_b t + s_p sin 2π f_p t) g)
//! ```
//!
//! # Practice
//! The dura counts as open from the first use of a tool for the brain. The loads depend on the
//! ticks' times alone, so that a replay has the same. Constants are rows of `support.csv`,
//! `pulse.csv` and `sag.csv` in `fixtures/measurements`.
//!
//! # Sources
//! Brain shift under gravity after loss of fluid: M. I. Miga et al., *In vivo quantification of a
//! homogeneous brain deformation model*, IEEE TMI 18 (1999). Shift against time: row
//! `shift/landmarks-during`.

use crate::program::Phase;
use trepan_geometry::{Vec3, units};
use trepan_measurements::{Row, pulse, sag, support};
use trepan_mesh::TetMesh;
use trepan_soft::{Fluid, LEVEL_BAND_MM, Loads};

/// Length of the ramp, ms; numerical.
const RAMP_MS: f64 = 2000.0;
/// Amplitude and frequency, 1/s, of breathing and pulsation: shares of the weight.
const SWAY: [[Row; 2]; 2] = [
    [support::BREATHING_WEIGHT, support::BREATHING_WEIGHT_FREQUENCY],
    [support::PULSE_WEIGHT, support::PULSE_WEIGHT_FREQUENCY],
];
/// The same as pressures in the skull, mmHg.
const WAVES: [[Row; 2]; 2] =
    [[pulse::BREATHING_PRESSURE, pulse::BREATHING_FREQUENCY], [pulse::PULSE_PRESSURE, pulse::PULSE_FREQUENCY]];
/// Levels in the table of a draining fluid, less one; numerical.
const LEVELS: usize = 64;

/// Loads on the brain with the dura open.
#[derive(Clone, Copy, Debug)]
pub struct Settling {
    force: Force,
    pub(crate) opened_ms: Option<f64>,
}

/// What acts.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "a session has one, and a step does not move it")]
enum Force {
    /// A body force on the whole brain.
    Uniform { sinks: Vec3, outward: Vec3 },
    /// Weight above the level of the fluid, and pressure in the opening.
    Draining(Draining),
}

/// A fluid that drains.
#[derive(Clone, Copy, Debug)]
struct Draining {
    up: Vec3,
    /// Level when equal parts of what drains have drained, from none to all, mm along `up`.
    levels_mm: [f32; LEVELS + 1],
    /// Time constant, ms.
    time_ms: f64,
}

impl Default for Settling {
    fn default() -> Self {
        Self::new(0.0, Vec3::NEG_Y, Vec3::ZERO)
    }
}

impl Settling {
    /// Makes the body force with the share `lost` of the fluid's buoyancy. `down` and `outward` are
    /// the unit vectors of gravity and of the opening.
    pub fn new(lost: f32, down: Vec3, outward: Vec3) -> Self {
        let weight = units::GRAVITY_MM_PER_MS2;
        Self { force: Force::Uniform { sinks: lost * weight * down, outward: weight * outward }, opened_ms: None }
    }

    /// Makes the loads of a brain whose fluid drains until the share `lost` of its buoyancy is
    /// gone. `up`: unit vector against gravity. The fluid drains `speed_up` times as fast as in a
    /// patient.
    pub fn draining(brain: &TetMesh, up: Vec3, lost: f32, speed_up: f32) -> Self {
        let time_ms = support::DRAIN_TIME.value * 60e3 / f64::from(speed_up);
        let levels_mm = levels(brain, up, lost);
        Self { force: Force::Draining(Draining { up, levels_mm, time_ms }), opened_ms: None }
    }

    /// Whether the dura is open.
    pub fn is_open(&self) -> bool {
        self.opened_ms.is_some()
    }

    /// Sets body force and fluid at a time of the session.
    pub fn load(&mut self, phase: Phase, time_ms: f64, loads: &mut Loads) {
        if phase == Phase::Brain {
            self.opened_ms.get_or_insert(time_ms);
        }
        let since_ms = self.opened_ms.map(|opened_ms| time_ms - opened_ms);
        let ramp = since_ms.map_or(0.0, |ms| (ms / RAMP_MS).clamp(0.0, 1.0) as f32);
        let since_ms = since_ms.unwrap_or(0.0);
        match &self.force {
            Force::Uniform { sinks, outward } => loads.gravity = ramp * (*sinks + wave(&SWAY, since_ms) * *outward),
            Force::Draining(fluid) => {
                loads.fluid = Fluid {
                    up: fluid.up,
                    level_mm: fluid.level_mm(since_ms),
                    weight: -dry_weight() * fluid.up,
                    opening_mpa: ramp * wave(&WAVES, since_ms) * pulse::MMHG.f32(),
                };
            }
        }
    }
}

/// Acceleration of tissue out of the fluid that was in equilibrium in it, mm/ms².
pub fn dry_weight() -> f32 {
    units::GRAVITY_MM_PER_MS2 * (1.0 - sag::WEIGHT_IN_FLUID.f32() / sag::WEIGHT.f32())
}

impl Draining {
    fn level_mm(&self, since_ms: f64) -> f32 {
        let drained = 1.0 - (-since_ms.max(0.0) / self.time_ms).exp();
        let at = (drained * LEVELS as f64) as f32;
        let low = (at as usize).min(LEVELS - 1);
        self.levels_mm[low] + (at - low as f32) * (self.levels_mm[low + 1] - self.levels_mm[low])
    }
}

/// Sum of two waves.
fn wave(waves: &[[Row; 2]; 2], since_ms: f64) -> f32 {
    let of = |[amplitude, frequency]: &[Row; 2]| {
        amplitude.value * (std::f64::consts::TAU * 1e-3 * frequency.value * since_ms).sin()
    };
    waves.iter().map(of).sum::<f64>() as f32
}

/// Heights above which equal parts of a share of the brain's volume lie, mm along `up`.
fn levels(brain: &TetMesh, up: Vec3, lost: f32) -> [f32; LEVELS + 1] {
    let highest = brain.positions.iter().map(|p| p.dot(up)).fold(f32::NEG_INFINITY, f32::max);
    let part = |tet: usize| (brain.corners(tet).iter().map(|p| p.dot(up)).sum::<f32>() / 4.0, brain.volume_mm3(tet));
    let mut parts: Vec<(f32, f64)> = (0..brain.tets.len()).map(part).collect();
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let whole: f64 = parts.iter().map(|(_, volume)| volume).sum();
    let (mut above, mut next) = (0.0, 0);
    std::array::from_fn(|level| {
        let share = f64::from(lost) * level as f64 / LEVELS as f64;
        while next < parts.len() && above + parts[next].1 <= share * whole {
            above += parts[next].1;
            next += 1;
        }
        let height = if level == 0 { highest } else { parts.get(next).or(parts.last()).map_or(highest, |part| part.0) };
        height + LEVEL_BAND_MM * 0.5 * (1.0 - level as f32 / LEVELS as f32)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_soft::boxes;

    fn at(settling: &mut Settling, phase: Phase, time_ms: f64) -> Loads {
        let mut loads = Loads::default();
        settling.load(phase, time_ms, &mut loads);
        loads
    }

    #[test]
    fn no_force_acts_before_the_dura_is_open_and_then_the_weight_ramps_up() {
        let mut settling = Settling::new(0.1, Vec3::NEG_Y, Vec3::Z);
        assert_eq!(at(&mut settling, Phase::Craniotomy, 5000.0), Loads::default());
        assert_eq!(at(&mut settling, Phase::Brain, 6000.0).gravity, Vec3::ZERO);
        let mut last = Vec3::ZERO;
        for ms in 6001..20_000 {
            let now = at(&mut settling, Phase::Brain, f64::from(ms)).gravity;
            assert!((now - last).length() < 2e-6, "a jump at {ms}");
            last = now;
        }
        assert!((last.y + 0.1 * 9.81e-3).abs() < 1e-6 && last.z.abs() <= 0.011 * 9.81e-3);
        let after = at(&mut settling, Phase::Craniotomy, 21_000.0);
        assert_ne!(after.gravity, Vec3::ZERO, "the dura stays open");
        assert_eq!(after.fluid, Fluid::default());
    }

    /// Of a box of 100 mm a fifth is dry in the end, 63 % of that after the time constant.
    #[test]
    fn the_level_falls_to_where_the_lost_share_is_dry() {
        let brain = boxes::split_box([2, 2, 50], Vec3::new(20.0, 20.0, 100.0));
        let mut settling = Settling::draining(&brain, Vec3::Z, 0.2, 60.0);
        let closed = at(&mut settling, Phase::Craniotomy, 5e5).fluid;
        assert!(brain.positions.iter().all(|p| closed.dryness(*p) == 0.0) && closed.opening_mpa == 0.0);
        let opened = at(&mut settling, Phase::Brain, 1e6).fluid;
        assert_eq!((opened.level_mm, opened.opening_mpa), (closed.level_mm, 0.0));
        let time_ms = support::DRAIN_TIME.value * 1e3;
        let level = |settling: &mut Settling, ms: f64| at(settling, Phase::Brain, 1e6 + ms).fluid.level_mm;
        assert!((level(&mut settling, time_ms) - 87.4).abs() < 1.5, "{}", level(&mut settling, time_ms));
        assert!((level(&mut settling, 20.0 * time_ms) - 80.0).abs() < 1.5);
        let mut last = opened;
        for ms in 1..40_000 {
            let now = at(&mut settling, Phase::Brain, 1e6 + f64::from(ms)).fluid;
            assert!(now.level_mm <= last.level_mm && last.level_mm - now.level_mm < 0.01, "a jump at {ms}");
            assert!((now.opening_mpa - last.opening_mpa).abs() < 1e-5);
            last = now;
        }
        assert!((last.weight.z / -9.81e-3 - 0.967).abs() < 1e-3, "a thirtieth of the weight is left in fluid");
    }
}
