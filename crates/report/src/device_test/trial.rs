//! Parts of a device test and their forces: explore freely, press a virtual floor, hold still for
//! taps.
//!
//! # Theory
//! ```text
//!  explore ──────> floor: F = k (y₀ - y) up, where y < y₀ ──────> tap ± ± ± ±
//!  no force        0.3 N/mm, at most 1 N                          0.8 N, 25 ms each
//! ```
//! The floor lies at 0.3 of the height range that the hand explored, but at least 1 mm below the
//! hand, so that the force begins at zero.
//!
//! # Practice
//! A function of readings and times, without clock and device. Device axes: x right, y up, z to the
//! user. Every force passes a force guard. That of the taps has no passivity controller, because a
//! tap adds energy on purpose: at most 0.8 N over the fraction of a millimetre that a hand yields
//! in 25 ms.

use serde::Serialize;
use trepan_contact::{ForceGuard, GuardConfig, GuardedWrench};
use trepan_geometry::{ToolState, Vec3, Wrench};
use trepan_haptics::{Capabilities, Reading, Status};

/// Stiffness of the floor, N/mm.
pub const FLOOR_N_PER_MM: f32 = 0.3;
/// Force limit of the floor, N.
pub const FLOOR_N: f32 = 1.0;
/// Force of a tap, N.
const TAP_N: f32 = 0.8;
/// Duration of a tap, ms.
pub const TAP_MS: f64 = 25.0;
/// Period of the taps, ms: a light hand oscillates for a third of a second after a tap.
const TAP_PERIOD_MS: f64 = 400.0;
/// Duration of all taps, ms: an even number of periods.
const TAPS_MS: f64 = 8.0 * TAP_PERIOD_MS;
/// Time in which the floor's force fades before the taps, ms.
const FADE_MS: f64 = 100.0;
/// Share of the test for exploring.
const EXPLORE: f64 = 0.4;

/// Part of a device test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[repr(u8)]
pub enum Part {
    /// Move through the whole range.
    Explore,
    /// Press down.
    Floor,
    /// Hold still.
    Tap,
    /// The test is over.
    Over,
}

impl Part {
    /// Instruction to the user.
    pub fn instruction(self) -> &'static str {
        match self {
            Self::Explore => "move the tool slowly through its whole range: left, right, up, down, to you, away",
            Self::Tap => "hold the tool still in the middle: you will feel some light taps",
            Self::Floor => "press down: a soft floor of 0.3 N/mm and at most 1 N lies beneath your hand",
            Self::Over => "the test is over",
        }
    }

    /// Part with a number; the inverse of `part as u8`.
    pub fn of(number: u8) -> Self {
        [Self::Explore, Self::Floor, Self::Tap].get(usize::from(number)).copied().unwrap_or(Self::Over)
    }
}

/// State of one test.
pub struct Trial {
    end_ms: f64,
    tick_ms: f32,
    driven: bool,
    height: [f32; 2],
    /// Height of the floor, mm; `None` before its part begins.
    pub floor_y: Option<f32>,
    taps: ForceGuard,
    /// The guard of the floor.
    pub floor: ForceGuard,
}

impl Trial {
    /// Prepares a test that lasts until `end_ms`.
    pub fn new(device: &Capabilities, tick_ms: f32, end_ms: f64) -> Self {
        let limits = device.guard_config();
        let upto = |force_n: f32| limits.max_force_n.min(force_n);
        let taps = GuardConfig { max_force_n: upto(TAP_N), ramp_in_ms: 0.0, passivity: None, ..limits };
        let floor = GuardConfig { max_force_n: upto(FLOOR_N), ..limits };
        Self {
            end_ms,
            tick_ms,
            driven: device.axes_driven > 0,
            height: [f32::INFINITY, f32::NEG_INFINITY],
            floor_y: None,
            taps: ForceGuard::new(taps),
            floor: ForceGuard::new(floor),
        }
    }

    /// Part of the test at a time, and the guarded force.
    pub fn step(&mut self, reading: &Reading, time_ms: f64) -> (Part, GuardedWrench) {
        let (tool, lost) = (&reading.tool, reading.status == Status::Lost);
        let (part, since_ms) = self.part(time_ms);
        let force = match part {
            Part::Explore => self.explore(tool),
            _ if lost => Vec3::ZERO,
            Part::Tap => tap(since_ms),
            Part::Floor => self.floor_force(tool),
            Part::Over => Vec3::ZERO,
        };
        let desired = Wrench { force, torque: Vec3::ZERO };
        // The floor's force fades in the pause before the first tap.
        let tapping = part == Part::Tap && since_ms > FADE_MS;
        let guard = if tapping { &mut self.taps } else { &mut self.floor };
        (part, guard.guard(desired, tool, self.tick_ms))
    }

    /// Fades every force to zero.
    pub fn release(&mut self) {
        self.taps.release();
        self.floor.release();
    }

    fn part(&self, time_ms: f64) -> (Part, f64) {
        let floor_ms = EXPLORE * self.end_ms;
        let tap_ms = self.end_ms - if self.driven { TAPS_MS } else { 0.0 };
        match time_ms {
            t if t >= self.end_ms => (Part::Over, t - self.end_ms),
            t if t >= tap_ms => (Part::Tap, t - tap_ms),
            t if t >= floor_ms => (Part::Floor, t - floor_ms),
            t => (Part::Explore, t),
        }
    }

    fn explore(&mut self, tool: &ToolState) -> Vec3 {
        let y = tool.tip().y;
        self.height = [self.height[0].min(y), self.height[1].max(y)];
        Vec3::ZERO
    }

    fn floor_force(&mut self, tool: &ToolState) -> Vec3 {
        let [low, high] = self.height;
        let y = tool.tip().y;
        let floor_y = *self.floor_y.get_or_insert_with(|| (low + 0.3 * (high - low)).min(y - 1.0));
        Vec3::Y * (FLOOR_N_PER_MM * (floor_y - y)).max(0.0)
    }
}

/// Force of the taps, N: up and down alternately, each after a pause.
fn tap(since_ms: f64) -> Vec3 {
    let (number, within_ms) = ((since_ms / TAP_PERIOD_MS) as u32, since_ms % TAP_PERIOD_MS);
    let sign = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
    if (TAP_PERIOD_MS - TAP_MS - 25.0..TAP_PERIOD_MS - 25.0).contains(&within_ms) {
        Vec3::Y * (sign * TAP_N)
    } else {
        Vec3::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Pose;

    fn capabilities(axes_driven: u8) -> Capabilities {
        Capabilities {
            name: "bench".into(),
            peak_force_n: 3.3,
            continuous_force_n: 0.9,
            rate_hz: 1000.0,
            workspace_mm: Vec3::splat(100.0),
            axes_driven,
            position_resolution_mm: 0.0,
            delay_ticks: 0,
            moving_mass_g: 0.0,
            damping: 0.0,
        }
    }

    fn reading(y: f32, time_ms: f64, status: Status) -> Reading {
        let tool = ToolState { time_ms, ..ToolState::at(Pose::from_translation(Vec3::Y * y)) };
        Reading { tool, status }
    }

    /// Parts and forces of a hand at `y(t)`.
    fn run(axes_driven: u8, y: impl Fn(f64) -> f32, status: Status) -> Vec<(Part, f32)> {
        let mut trial = Trial::new(&capabilities(axes_driven), 1.0, 10_000.0);
        (1..10_200u32)
            .map(|t| {
                let (part, wrench) = trial.step(&reading(y(t.into()), t.into(), status), t.into());
                (part, wrench.force().y)
            })
            .collect()
    }

    #[test]
    fn the_parts_follow_each_other_and_forces_stay_gentle() {
        let ticks = run(3, |t| 20.0 * (t * 1e-3).sin() as f32, Status::Fresh);
        let forces = |part| ticks.iter().filter(move |t| t.0 == part).map(|t| t.1);
        assert!(forces(Part::Explore).all(|f| f == 0.0));
        assert!(forces(Part::Tap).all(|f| f.abs() <= 0.8) && forces(Part::Tap).any(|f| f < -0.79));
        let floor: Vec<f32> = forces(Part::Floor).collect();
        assert!(floor.iter().all(|f| (0.0..=1.0).contains(f)) && floor.iter().any(|f| *f > 0.9), "{floor:?}");
        assert_eq!(forces(Part::Over).next_back(), Some(0.0));
        assert!(ticks.windows(2).all(|t| (t[1].1 - t[0].1).abs() <= 0.51), "no jump between the parts");
        assert!(run(0, |_| 0.0, Status::Fresh).iter().all(|t| t.0 != Part::Tap), "nothing to tap without motors");
    }

    #[test]
    fn the_floor_begins_beneath_the_hand() {
        let mut trial = Trial::new(&capabilities(3), 1.0, 10_000.0);
        trial.step(&reading(50.0, 1.0, Status::Fresh), 1.0);
        trial.step(&reading(-50.0, 2.0, Status::Fresh), 2.0);
        trial.step(&reading(-30.0, 5000.0, Status::Fresh), 5000.0);
        assert_eq!(trial.floor_y, Some(-31.0));
    }

    #[test]
    fn a_lost_device_gets_no_force() {
        let down = |t: f64| if t < 4000.0 { 0.0 } else { -20.0 };
        assert!(run(3, down, Status::Fresh).iter().any(|t| t.1 > 0.0));
        assert!(run(3, down, Status::Lost).iter().all(|t| t.1 == 0.0));
    }
}
