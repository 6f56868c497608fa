//! Which causes of warnings a tick finds.
//!
//! # Theory
//! Of the bone ahead `a` and its change the breach is foreseen: `t = a / v`, v the rate at which a
//! falls, smoothed over 50 ms. So a fast feed is told as early as a slow one, though less bone is
//! left.
//!
//! # Sources
//! Forces on brain tissue in neurosurgery are mostly under 0.3 N: H. J. Marcus et al., *Forces
//! exerted during microneurosurgery*, Neurosurgery 2014.

use crate::stages::drill::{BREAK_MM, THIN_MM};
use crate::stages::notice::Warning;
use crate::stages::score::cuts_into_brain;
use trepan_link::wire::TickRecord;

/// A breach this near in time is worth a warning, ms.
const SOON_MS: f32 = 300.0;
/// Time over which the feed is smoothed, ms.
const SMOOTH_MS: f32 = 50.0;

/// Share of the smoothing from which the feed is believed.
const SURE: f32 = 0.4;

/// How fast the bone ahead becomes less.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Feed {
    last_mm: Option<f32>,
    mm_per_ms: f32,
    /// Share of the smoothing that is there, 0 to 1.
    weight: f32,
}

impl Feed {
    /// Takes note of the bone left ahead, mm, of which `reach_mm` and more count alike; gives the
    /// time until the breach, ms, infinite while the bone does not give way.
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
        if self.weight > SURE && feed > 1e-6 { now / feed } else { f32::INFINITY }
    }
}

/// What a tick knows beside its record.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Signs {
    /// Whether a tool for bone is in the hand that has no foot to keep the dura off.
    pub bare_cutter: bool,
    /// Bone left ahead, mm.
    pub ahead_mm: f32,
    /// Time until it is gone, ms.
    pub breach_ms: f32,
    /// Force of the tissue, N.
    pub tissue_n: f32,
    /// Distance from the tool to the nearest forbidden structure, mm.
    pub forbidden_mm: f32,
    /// The force that is wanted, N.
    pub wanted_n: f32,
    /// Whether the drill stands still under its load.
    pub stalled: bool,
    /// Age of the last collision result, ms.
    pub age_ms: f32,
    /// Whether the motors are warm.
    pub warm: bool,
}

/// At what a trainee is warned.
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
        Self { near_mm: 2.0, brain_force_n: 0.5, forbidden_mm: 1.0 }
    }
}

impl Signs {
    /// Every warning, whether its cause is there, and how near, strong or old it is.
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
            (Warning::DrillStalled, drilling && self.stalled, self.wanted_n),
            (Warning::ForceLimit, record.has(TickRecord::CLAMPED), self.wanted_n),
            (Warning::TissueLate, record.has(TickRecord::HELD), self.age_ms),
            (Warning::DeviceStale, record.has(TickRecord::STALE), 0.0),
            (Warning::MotorsWarm, self.warm, self.wanted_n),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_feed_is_foreseen_and_bone_out_of_reach_is_not() {
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
