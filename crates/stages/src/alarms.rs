//! Finds the causes of warnings in a tick.
//!
//! # Theory
//! The time until breakthrough is predicted from the remaining bone `a`: `t = a / v`, where v is
//! the feed rate (the decrease of a over time), smoothed over 50 ms. The warning therefore precedes
//! the breakthrough by the same time at any feed rate.
//!
//! # Sources
//! Forces on brain tissue in neurosurgery are mostly under 0.3 N: H. J. Marcus et al., *Forces
//! exerted during microneurosurgery*, Neurosurgery 2014.

use crate::drill::{BREAK_MM, THIN_MM};
use crate::notice::Warning;
use crate::score::cuts_into_brain;
use trepan_link::wire::TickRecord;
use trepan_measurements::{grip, hands};

/// Time until breakthrough under which a warning is raised, ms.
const SOON_MS: f32 = hands::WARNING_SOON.f32();
/// Time constant of the smoothing of the feed rate, ms.
const SMOOTH_MS: f32 = 50.0;

/// Weight of the smoothing from which the feed rate is used.
const MIN_WEIGHT: f32 = 0.4;

/// Smoothed feed rate: decrease of the remaining bone over time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Feed {
    last_mm: Option<f32>,
    mm_per_ms: f32,
    /// Weight of the samples in the smoothing so far, 0 to 1.
    weight: f32,
}

impl Feed {
    /// Updates the feed rate with the remaining bone, mm, and returns the time until breakthrough,
    /// ms. Bone from `reach_mm` on counts as unknown; without feed the time is infinite.
    pub fn follow(&mut self, ahead_mm: f32, reach_mm: f32, dt_ms: f32) -> f32 {
        let known = Some(ahead_mm).filter(|mm| *mm < reach_mm);
        let (Some(last), Some(now)) = (self.last_mm, known) else {
            *self = Self { last_mm: known, ..Self::default() };
            return f32::INFINITY;
        };
        let share = (dt_ms / SMOOTH_MS).clamp(0.0, 1.0);
        self.mm_per_ms += share * ((last - now) / dt_ms.max(1e-3) - self.mm_per_ms);
        self.weight += share * (1.0 - self.weight);
        self.last_mm = known;
        let feed = self.mm_per_ms / self.weight.max(1e-6);
        if self.weight > MIN_WEIGHT && feed > 1e-6 { now / feed } else { f32::INFINITY }
    }
}

/// Share of real time under which tissue counts as slow.
pub const REAL_TIME: f32 = 0.98;
/// Time over which the pace of tissue is taken, ms.
const PACE_MS: f64 = 1000.0;

/// Pace of the simulated tissue.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// When it was last taken, and the tissue's time then, ms.
    last_ms: Option<(f64, f64)>,
    share: f32,
}

impl Pace {
    /// Nothing known yet: in real time.
    pub const UNKNOWN: Self = Self { last_ms: None, share: 1.0 };

    /// Follows the tissue's time; returns that of the last second over a second. Tissue that nobody
    /// simulates stays at 0 and keeps pace.
    pub fn follow(&mut self, now_ms: f64, tissue_ms: f64) -> f32 {
        if tissue_ms <= 0.0 {
            return 1.0;
        }
        let (then_ms, was_ms) = *self.last_ms.get_or_insert((now_ms, tissue_ms));
        if now_ms >= then_ms + PACE_MS {
            self.share = ((tissue_ms - was_ms) / (now_ms - then_ms)) as f32;
            self.last_ms = Some((now_ms, tissue_ms));
        }
        self.share
    }
}

/// Inputs of the warnings that are not in a tick's record.
#[derive(Clone, Copy, Debug)]
pub struct WarningInputs {
    /// Whether the tool cuts bone and has no foot that protects the dura.
    pub bare_cutter: bool,
    /// Remaining bone ahead, mm.
    pub ahead_mm: f32,
    /// Time until breakthrough, ms.
    pub breach_ms: f32,
    /// Whether the tool is a craniotome.
    pub craniotome: bool,
    /// Force of the tissue, N.
    pub tissue_n: f32,
    /// Force of bone on a tool for the brain, N.
    pub rest_n: f32,
    /// Distance from the tool to the nearest forbidden structure, mm.
    pub forbidden_mm: f32,
    /// The desired force, N.
    pub desired_n: f32,
    /// Whether the drill has stalled under its load.
    pub stalled: bool,
    /// Age of the last collision result, ms.
    pub age_ms: f32,
    /// Simulated time of the tissue over time, without unit.
    pub tissue_pace: f32,
    /// Whether the motors are warm.
    pub warm: bool,
}

/// Thresholds of the warnings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Distance from a cutting tool to the brain, mm.
    pub near_mm: f32,
    /// Force on the brain, N.
    pub brain_force_n: f32,
    /// Distance from any tool to a forbidden structure, mm.
    pub forbidden_mm: f32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            near_mm: hands::WARNING_NEAR.f32(),
            brain_force_n: grip::BRAIN_FORCE_WARNING.f32(),
            forbidden_mm: hands::WARNING_FORBIDDEN.f32(),
        }
    }
}

impl WarningInputs {
    /// Returns every warning, whether its cause is present, and its distance, force, time or age.
    pub fn causes(&self, record: &TickRecord, limits: &Limits) -> [(Warning, bool, f32); Warning::ALL.len()] {
        let brain_mm = record.brain_distance_mm;
        let near = self.bare_cutter && brain_mm <= limits.near_mm;
        let drilling = record.has(TickRecord::DRILLING);
        [
            (Warning::BoneThin, self.ahead_mm <= THIN_MM, self.ahead_mm),
            (Warning::BreakThrough, self.ahead_mm <= BREAK_MM, self.ahead_mm),
            (Warning::BreachSoon, self.breach_ms <= SOON_MS, self.breach_ms),
            (Warning::BrainNear, near, brain_mm.max(0.0)),
            (Warning::BrainTouched, cuts_into_brain(record), -brain_mm),
            (Warning::BrainPressed, self.tissue_n > limits.brain_force_n, self.tissue_n),
            (Warning::ForbiddenNear, self.forbidden_mm <= limits.forbidden_mm, self.forbidden_mm),
            (Warning::DrillStalled, drilling && self.stalled, self.desired_n),
            (Warning::ForceLimit, record.has(TickRecord::CLAMPED), self.desired_n),
            (Warning::TissueLate, record.has(TickRecord::HELD), self.age_ms),
            (Warning::DeviceStale, record.has(TickRecord::STALE), 0.0),
            (Warning::MotorsWarm, self.warm, self.desired_n),
            (Warning::TissueSlow, self.tissue_pace < REAL_TIME, self.tissue_pace),
            (Warning::CutterJams, self.craniotome && drilling && record.has(TickRecord::CLAMPED), self.desired_n),
            (Warning::RestsOnBone, self.rest_n > limits.brain_force_n, self.rest_n),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tissue_that_falls_behind_is_slow_within_a_second() {
        let mut pace = Pace::UNKNOWN;
        let mut follow = |from: u32, tissue: f64| {
            (0..1001).map(|ms| pace.follow(f64::from(from + ms), tissue + 0.9 * f64::from(ms))).last().unwrap()
        };
        assert!((follow(100, 5.0) - 0.9).abs() < 1e-3);
        let mut nobody = Pace::UNKNOWN;
        assert!((0..3000).all(|ms| nobody.follow(f64::from(ms), 0.0) == 1.0));
    }

    #[test]
    fn breakthrough_is_predicted_at_a_steady_feed_for_bone_within_reach() {
        let mut feed = Feed::default();
        let mut soon = None;
        for ms in 0..1000u16 {
            let ahead = 4.0 - 0.005 * f32::from(ms);
            let left = feed.follow(ahead.min(2.0), 2.0, 1.0);
            let true_ms = ahead / 0.005;
            if ahead >= 2.0 {
                assert_eq!(left, f32::INFINITY);
            } else if ahead < 1.0 && ahead > 0.0 {
                assert!((left - true_ms).abs() < 0.05 * true_ms + 1.0, "{left} of {true_ms}");
            }
            soon = soon.or((left <= SOON_MS).then_some(true_ms));
        }
        assert!((soon.unwrap() - SOON_MS).abs() < 20.0, "{soon:?}");
        let mut still = Feed::default();
        assert!((0..500).all(|_| still.follow(0.7, 2.0, 1.0) == f32::INFINITY));
    }
}
