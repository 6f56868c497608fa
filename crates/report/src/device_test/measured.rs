//! Computes the numbers of a device test from its samples.
//!
//! # Practice
//! Units are mm, N and ms unless a name says otherwise.

use crate::device_test::trial::{FLOOR_N, FLOOR_N_PER_MM, Part, Trial};
use crate::summary::Machine;
use serde::Serialize;
use trepan_contact::GuardCounters;
use trepan_geometry::Vec3;
use trepan_runtime::{Quantiles, Times};
use trepan_stages::by_cause;

/// One tick of the test.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Time of the reading, ms.
    pub time_ms: f64,
    /// Duration of reading the device, µs.
    pub read_us: f32,
    /// Duration of applying the force, µs.
    pub apply_us: f32,
    /// Whether the position was new.
    pub fresh: bool,
    /// Part of the test.
    pub part: Part,
    /// The tip, device axes, mm.
    pub tip: Vec3,
    /// The force applied, N.
    pub force: Vec3,
}

/// How a test ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Ending {
    /// The test was completed.
    Done,
    /// The device's script ended.
    Finished,
    /// Ctrl-C or a request to terminate.
    Stopped,
    /// The device was lost.
    Lost,
}

/// Contents of `device.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Requested name of the device.
    pub device: String,
    /// Name that the driver reports.
    pub model: String,
    /// How the test ended.
    pub ended: Ending,
    /// Last fault of the device.
    pub fault: Option<String>,
    /// Number of faults.
    pub faults: u64,
    /// Findings, with remedies.
    pub findings: Vec<Finding>,
    /// Timing of the haptic loop.
    pub timing: Timing,
    /// Upper bound of the delay from applied force to motion, ms; `null` if the device has no
    /// motors or did not move.
    pub delay_ms: Option<f64>,
    /// Delay that the driver states, ticks.
    pub stated_delay_ticks: u8,
    /// Bounding box of the tip, mm: lowest and highest corner, device axes (x right, y up, z to the
    /// user).
    pub explored_mm: [[f32; 3]; 2],
    /// Size of the workspace that the driver states, mm; `null` without limits.
    pub workspace_mm: Option<[f32; 3]>,
    /// Position resolution that the driver states, mm.
    pub resolution_mm: f32,
    /// Peak and continuous force that the driver states, N.
    pub forces_n: [f32; 2],
    /// Measurements at the virtual floor.
    pub floor: Floor,
    /// Force of the last tick, N.
    pub end_force_n: f32,
    /// Remarks, such as a refused real-time priority.
    pub remarks: Vec<String>,
    /// The computer.
    pub machine: Machine,
}

/// Timing of ticks and positions.
#[derive(Clone, Debug, Serialize)]
pub struct Timing {
    /// Duration of the test, s.
    pub seconds: f64,
    /// Requested tick rate, Hz.
    pub asked_hz: f64,
    /// Measured tick rate, Hz.
    pub tick_hz: f64,
    /// Rate of new positions, Hz.
    pub fresh_hz: f64,
    /// Ticks that missed their deadline.
    pub late_ticks: u64,
    /// Tick period, µs.
    pub tick_us: Quantiles,
    /// Time between new positions, µs.
    pub gap_us: Quantiles,
    /// Jitter: deviation of the tick period from the requested one, µs.
    pub jitter_us: Quantiles,
    /// Duration of a read, µs.
    pub read_us: Quantiles,
    /// Duration of an apply, µs.
    pub apply_us: Quantiles,
}

/// Measurements at the virtual floor, a soft wall.
#[derive(Clone, Debug, Serialize)]
pub struct Floor {
    /// Stiffness, N/mm.
    pub stiffness_n_per_mm: f32,
    /// Force limit, N.
    pub limit_n: f32,
    /// Height, mm; `null` if the test ended before this part.
    pub height_mm: Option<f32>,
    /// Contact time, s.
    pub touched_s: f64,
    /// Largest penetration depth, mm.
    pub depth_mm: f32,
    /// Largest force, N.
    pub force_n: f32,
    /// Largest net energy output, mJ.
    pub energy_out_mj: f64,
    /// Interventions of the force guard, ticks.
    #[serde(serialize_with = "by_cause")]
    pub guard: GuardCounters,
}

/// Samples of a test, with the state at its end.
pub(super) struct TestRun {
    /// Every tick.
    pub samples: Vec<Sample>,
    /// Tick period, ms.
    pub tick_ms: f64,
    /// Ticks that missed their deadline.
    pub late: u64,
    /// How the test ended.
    pub ended: Ending,
    /// The floor and its guard.
    pub trial: Trial,
    /// Remarks, such as a refused real-time priority.
    pub remarks: Vec<String>,
}

impl Timing {
    /// Computes the timing.
    pub fn of(run: &TestRun) -> Self {
        let samples = &run.samples;
        let seconds = span_ms(samples) * 1e-3;
        let ticks = gaps(samples.iter());
        let jitter = ticks.iter().map(|gap| (gap - run.tick_ms).abs()).collect::<Vec<_>>();
        let times = |values: &mut dyn Iterator<Item = f32>| {
            let mut times = Times::default();
            values.for_each(|us| times.add_us(us));
            Quantiles::from(&times)
        };
        let ms = |gaps: &[f64]| times(&mut gaps.iter().map(|gap| (gap * 1e3) as f32));
        let rate = |count: usize| count.saturating_sub(1) as f64 / seconds.max(1e-3);
        Self {
            seconds,
            asked_hz: 1e3 / run.tick_ms, // by definition
            tick_hz: rate(samples.len()),
            fresh_hz: rate(samples.iter().filter(|s| s.fresh).count()),
            late_ticks: run.late,
            tick_us: ms(&ticks),
            gap_us: ms(&gaps(samples.iter().filter(|s| s.fresh))),
            jitter_us: ms(&jitter),
            read_us: times(&mut samples.iter().map(|s| s.read_us)),
            apply_us: times(&mut samples.iter().map(|s| s.apply_us)),
        }
    }
}

impl Floor {
    /// Evaluates the samples of the floor part.
    pub fn of(run: &TestRun) -> Self {
        let pressed = run.samples.iter().filter(|s| s.part == Part::Floor && s.force.y > 0.0);
        let (guard, floor_y) = (&run.trial.floor, run.trial.floor_y);
        let depth = |s: &Sample| floor_y.map_or(0.0, |y| (y - s.tip.y).max(0.0));
        Self {
            stiffness_n_per_mm: FLOOR_N_PER_MM,
            limit_n: FLOOR_N.min(guard.config().max_force_n),
            height_mm: floor_y,
            touched_s: pressed.clone().count() as f64 * run.tick_ms * 1e-3,
            depth_mm: pressed.clone().map(depth).fold(0.0, f32::max),
            force_n: pressed.map(|s| s.force.length()).fold(0.0, f32::max),
            energy_out_mj: guard.passivity_observer().lowest_nmm().min(0.0).abs(),
            guard: guard.counters(),
        }
    }
}

/// Bounding box of the tip, mm; a point at the origin without samples.
pub fn explored(samples: &[Sample]) -> [Vec3; 2] {
    let tips = || samples.iter().filter(|s| s.fresh).map(|s| s.tip).filter(|tip| tip.is_finite());
    let low = tips().reduce(Vec3::min).unwrap_or(Vec3::ZERO);
    [low, tips().reduce(Vec3::max).unwrap_or(Vec3::ZERO)]
}

fn span_ms(samples: &[Sample]) -> f64 {
    samples.last().map_or(0.0, |last| last.time_ms - samples[0].time_ms)
}

fn gaps<'a>(samples: impl Iterator<Item = &'a Sample>) -> Vec<f64> {
    let times: Vec<f64> = samples.map(|s| s.time_ms).collect();
    times.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// One finding of a device test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Whether the device passes.
    pub good: bool,
    /// Description; with a remedy if the device fails.
    pub text: String,
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use trepan_geometry::{Pose, ToolState};
    use trepan_haptics::replay::Replay;
    use trepan_haptics::simulated::{Config, HandModel, Simulated};
    use trepan_haptics::{Capabilities, HapticDevice};

    /// Runs a whole test on a simulated device, without a clock. The hand aims at the height
    /// `intent(ms)`, mm.
    pub fn tested(config: Config, hand: HandModel, intent: impl Fn(f64) -> f32) -> (Vec<Sample>, Trial, Capabilities) {
        let at = |t: u32| ToolState::at(Pose::from_translation(Vec3::Y * intent(t.into())));
        let mut device = Simulated::new(config, hand, Box::new(Replay::new((0..10_000).map(at).collect())));
        let able = device.capabilities();
        let mut trial = Trial::new(&able, 1.0, 10_000.0);
        let sample = |t: u32| {
            let mut reading = device.read(t.into());
            reading.tool.time_ms = t.into();
            let (part, wrench) = trial.step(&reading, t.into());
            device.apply(wrench);
            let (tip, force) = (reading.tool.tip(), wrench.force());
            Sample { time_ms: t.into(), read_us: 2.0, apply_us: 1.0, fresh: true, part, tip, force }
        };
        ((0..10_000).map(sample).collect(), trial, able)
    }

    fn run(samples: Vec<Sample>, trial: Trial, late: u64) -> TestRun {
        TestRun { samples, tick_ms: 1.0, late, ended: Ending::Done, trial, remarks: Vec::new() }
    }

    #[test]
    fn box_floor_and_timing_match_the_motion() {
        // Up and down by 20 mm while exploring, then pressing the floor, then still.
        let hand = |t: f64| match t {
            t if t < 4000.0 => 20.0 * (t * 2e-3).sin() as f32,
            t => (20.0 - 0.07 * (t - 4000.0) as f32).max(-15.0),
        };
        let (samples, trial, able) = tested(Config::default(), HandModel::FIRM, hand);
        let [low, high] = explored(&samples);
        assert!((high.y - 20.0).abs() < 2.0 && (low.y + 20.0).abs() < 2.0, "{low} {high}");
        let run = run(samples, trial, 0);
        let floor = Floor::of(&run);
        assert!(floor.force_n > 0.9 && floor.touched_s > 1.5 && floor.energy_out_mj < 0.1, "{floor:?}");
        assert!((floor.height_mm.unwrap() + 8.0).abs() < 2.0, "three tenths of the way up from -20");
        let timing = Timing::of(&run);
        assert!((timing.tick_hz - 1000.0).abs() < 1.0 && (timing.gap_us.p99 - 1000.0).abs() < 2.0);
        assert!(timing.jitter_us.max < 0.1 && (timing.read_us.p50 - 2.0).abs() < 0.1);
        assert!(able.axes_driven == 3);
    }

    #[test]
    fn gaps_are_between_new_positions() {
        let (mut samples, trial, _) = tested(Config::default(), HandModel::FIRM, |_| 0.0);
        samples.iter_mut().enumerate().for_each(|(at, s)| s.fresh = at % 4 == 0);
        let run = run(samples, trial, 7);
        let timing = Timing::of(&run);
        assert!((timing.fresh_hz - 250.0).abs() < 1.0 && (timing.gap_us.p50 - 4000.0).abs() < 8.0);
        assert!((timing.tick_us.p50 - 1000.0).abs() < 2.0 && timing.late_ticks == 7);
    }
}
