//! Whether what comes into the guard can be believed: numbers, age, speed.

use super::{GuardConfig, GuardCounters};
use trepan_geometry::{ToolState, Vec3, Wrench};

/// What is remembered of earlier ticks.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Input {
    /// The newest tip that can be believed; the next one starts a new track where there is none.
    pub tip: Option<Vec3>,
    time_ms: f64,
    age_ms: f32,
}

impl Input {
    /// Checks wrench, pose, speed and age, and counts the first fault.
    pub(super) fn is_sound(
        &mut self,
        wanted: &Wrench,
        tool: &ToolState,
        dt_ms: f32,
        config: &GuardConfig,
        counters: &mut GuardCounters,
    ) -> bool {
        if !wanted.is_finite() || !tool.is_finite() || !tool.time_ms.is_finite() {
            counters.non_finite += 1;
            return false;
        }
        self.age_ms = if tool.time_ms == self.time_ms { self.age_ms + dt_ms } else { 0.0 };
        self.time_ms = tool.time_ms;
        if tool.time_ms != 0.0 && self.age_ms > config.stale_ms {
            counters.stale += 1;
            return false;
        }
        let moved = self.tip.map_or(0.0, |last| last.distance(tool.tip()));
        // A sample that is late by a few ticks shows their motion at once; only a jump is a fault.
        let jumped = moved > config.max_speed * (dt_ms + config.stale_ms);
        if tool.twist.linear.length() > config.max_speed || jumped {
            counters.too_fast += 1;
            self.tip = None;
            return false;
        }
        true
    }
}
