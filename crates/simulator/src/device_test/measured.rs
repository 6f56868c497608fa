//! What a test found: numbers from its samples.
//!
//! # Practice
//! mm, N, ms unless the name says otherwise.

use crate::device_test::findings::Finding;
use crate::device_test::trial::{FLOOR_N, FLOOR_N_PER_MM, Part};
use crate::report::summary::{GuardSummary, Machine, Quantiles};
use crate::run::Times;
use serde::Serialize;
use trepan_contact::ForceGuard;
use trepan_geometry::Vec3;

/// One tick of the test.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// When the device was read, ms.
    pub time_ms: f64,
    /// How long reading took, µs.
    pub read_us: f32,
    /// How long applying took, µs.
    pub apply_us: f32,
    /// Whether the position was new.
    pub fresh: bool,
    /// What the hand was asked to do.
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
    /// It ran to its end.
    Done,
    /// The script was over.
    Finished,
    /// Ctrl-C or a request to terminate.
    Stopped,
    /// The device was lost.
    Lost,
}

/// The whole of `device.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Name as asked for.
    pub device: String,
    /// Name as the device says.
    pub model: String,
    /// How it ended.
    pub ended: Ending,
    /// What was wrong with the device at the end, in words.
    pub fault: Option<String>,
    /// How many faults there were.
    pub faults: u64,
    /// What it all means.
    pub findings: Vec<Finding>,
    /// The loop.
    pub timing: Timing,
    /// From applied force to seen motion at most, ms; `null` where the device has no motors or
    /// nothing moved.
    pub delay_ms: Option<f64>,
    /// Ticks of delay that the driver states.
    pub stated_delay_ticks: u8,
    /// Where the hand was, mm: lowest, highest, device axes (x right, y up, z to the user).
    pub explored_mm: [[f32; 3]; 2],
    /// Where it could be, mm, by the driver; `null` without limits.
    pub workspace_mm: Option<[f32; 3]>,
    /// Smallest step of position by the driver, mm.
    pub resolution_mm: f32,
    /// Peak and continuous force by the driver, N.
    pub forces_n: [f32; 2],
    /// The floor.
    pub floor: Floor,
    /// Force at the very end, N.
    pub end_force_n: f32,
    /// What the system did not allow.
    pub remarks: Vec<String>,
    /// The machine.
    pub machine: Machine,
}

/// When ticks and positions came.
#[derive(Clone, Debug, Serialize)]
pub struct Timing {
    /// Length, s.
    pub seconds: f64,
    /// Ticks a second asked for.
    pub asked_hz: f64,
    /// Ticks a second.
    pub tick_hz: f64,
    /// New positions a second.
    pub fresh_hz: f64,
    /// Ticks that missed their time.
    pub late_ticks: u64,
    /// From one tick to the next, µs.
    pub tick_us: Quantiles,
    /// From one new position to the next, µs.
    pub gap_us: Quantiles,
    /// Distance of a tick from its time, µs.
    pub jitter_us: Quantiles,
    /// A call of read, µs.
    pub read_us: Quantiles,
    /// A call of apply, µs.
    pub apply_us: Quantiles,
}

/// The gentle wall.
#[derive(Clone, Debug, Serialize)]
pub struct Floor {
    /// Stiffness, N/mm.
    pub stiffness_n_per_mm: f32,
    /// Longest force, N.
    pub limit_n: f32,
    /// Its height, mm; `null` when the test ended before.
    pub height_mm: Option<f32>,
    /// Time in which it was touched, s.
    pub touched_s: f64,
    /// Deepest press, mm.
    pub depth_mm: f32,
    /// Largest force, N.
    pub force_n: f32,
    /// Most energy that it gave beyond what it got, mJ.
    pub energy_out_mj: f64,
    /// What the guard did, ticks.
    pub guard: GuardSummary,
}

/// What the test's end knows beside its samples.
pub struct Course<'a> {
    /// Every tick.
    pub samples: &'a [Sample],
    /// Length of a tick, ms.
    pub tick_ms: f64,
    /// Ticks that missed their time.
    pub late: u64,
    /// The floor's guard.
    pub guard: &'a ForceGuard,
    /// The floor's height.
    pub floor_y: Option<f32>,
}

impl Timing {
    /// From samples.
    pub fn of(course: &Course<'_>) -> Self {
        let samples = course.samples;
        let seconds = span_ms(samples) * 1e-3;
        let ticks = gaps(samples.iter());
        let jitter = ticks.iter().map(|gap| (gap - course.tick_ms).abs()).collect::<Vec<_>>();
        let times = |values: &mut dyn Iterator<Item = f32>| {
            let mut times = Times::default();
            values.for_each(|us| times.add_us(us));
            Quantiles::from(&times)
        };
        let ms = |gaps: &[f64]| times(&mut gaps.iter().map(|gap| (gap * 1e3) as f32));
        let rate = |count: usize| count.saturating_sub(1) as f64 / seconds.max(1e-3);
        Self {
            seconds,
            asked_hz: 1e3 / course.tick_ms,
            tick_hz: rate(samples.len()),
            fresh_hz: rate(samples.iter().filter(|s| s.fresh).count()),
            late_ticks: course.late,
            tick_us: ms(&ticks),
            gap_us: ms(&gaps(samples.iter().filter(|s| s.fresh))),
            jitter_us: ms(&jitter),
            read_us: times(&mut samples.iter().map(|s| s.read_us)),
            apply_us: times(&mut samples.iter().map(|s| s.apply_us)),
        }
    }
}

impl Floor {
    /// From samples.
    pub fn of(course: &Course<'_>) -> Self {
        let pressed = course.samples.iter().filter(|s| s.part == Part::Floor && s.force.y > 0.0);
        let depth = |s: &Sample| course.floor_y.map_or(0.0, |y| (y - s.tip.y).max(0.0));
        Self {
            stiffness_n_per_mm: FLOOR_N_PER_MM,
            limit_n: FLOOR_N.min(course.guard.config().max_force_n),
            height_mm: course.floor_y,
            touched_s: pressed.clone().count() as f64 * course.tick_ms * 1e-3,
            depth_mm: pressed.clone().map(depth).fold(0.0, f32::max),
            force_n: pressed.map(|s| s.force.length()).fold(0.0, f32::max),
            energy_out_mj: course.guard.passivity_observer().lowest_nmm().min(0.0).abs(),
            guard: (&course.guard.counters()).into(),
        }
    }
}

/// The box in which the hand was; a point at the origin without samples.
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

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::device_test::trial::Trial;
    use trepan_geometry::{Pose, ToolState};
    use trepan_haptics::replay::Replay;
    use trepan_haptics::simulated::{Config, HandModel, Simulated};
    use trepan_haptics::{Capabilities, HapticDevice};

    /// A whole test of a simulated device whose hand means to be at heights `intent(ms)`, without a
    /// clock.
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

    #[test]
    fn box_floor_and_timing_are_what_happened() {
        // Up and down by 20 mm while exploring, then pressing the floor, then still.
        let hand = |t: f64| match t {
            t if t < 4000.0 => 20.0 * (t * 2e-3).sin() as f32,
            t => (20.0 - 0.07 * (t - 4000.0) as f32).max(-15.0),
        };
        let (samples, trial, able) = tested(Config::default(), HandModel::FIRM, hand);
        let [low, high] = explored(&samples);
        assert!((high.y - 20.0).abs() < 2.0 && (low.y + 20.0).abs() < 2.0, "{low} {high}");
        let course =
            Course { samples: &samples, tick_ms: 1.0, late: 0, guard: trial.guard(), floor_y: trial.floor_y() };
        let floor = Floor::of(&course);
        assert!(floor.force_n > 0.9 && floor.touched_s > 1.5 && floor.energy_out_mj < 0.1, "{floor:?}");
        assert!((floor.height_mm.unwrap() + 8.0).abs() < 2.0, "three tenths of the way up from -20");
        let timing = Timing::of(&course);
        assert!((timing.tick_hz - 1000.0).abs() < 1.0 && (timing.gap_us.p99 - 1000.0).abs() < 2.0);
        assert!(timing.jitter_us.max < 0.1 && (timing.read_us.p50 - 2.0).abs() < 0.1);
        assert!(able.axes_driven == 3);
    }

    #[test]
    fn gaps_are_between_new_positions() {
        let (mut samples, trial, _) = tested(Config::default(), HandModel::FIRM, |_| 0.0);
        samples.iter_mut().enumerate().for_each(|(at, s)| s.fresh = at % 4 == 0);
        let course = Course { samples: &samples, tick_ms: 1.0, late: 7, guard: trial.guard(), floor_y: None };
        let timing = Timing::of(&course);
        assert!((timing.fresh_hz - 250.0).abs() < 1.0 && (timing.gap_us.p50 - 4000.0).abs() < 8.0);
        assert!((timing.tick_us.p50 - 1000.0).abs() < 2.0 && timing.late_ticks == 7);
    }
}
