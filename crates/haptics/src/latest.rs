//! The newest reading of a device that another thread reads, and its age.

use crate::{Reading, Status};
use trepan_geometry::ToolState;

/// The last valid reading.
pub(crate) struct Latest {
    reading: Reading,
    number: u64,
    fresh_ms: f64,
    time_ms: f64,
}

impl Latest {
    /// Starts with a tool that was not read yet.
    pub(crate) fn new(start: ToolState) -> Self {
        let reading = Reading { tool: start, status: Status::Stale };
        Self { reading, number: 0, fresh_ms: f64::NAN, time_ms: f64::NAN }
    }

    /// Returns the reading of this tick: the tool of a sample with a new `number`, or else the last
    /// one. `limit_ms` without a new one, it is lost.
    pub(crate) fn read(
        &mut self,
        time_ms: f64,
        number: u64,
        tool: impl FnOnce() -> ToolState,
        limit_ms: f64,
    ) -> Reading {
        if self.fresh_ms.is_nan() {
            self.fresh_ms = time_ms;
        }
        self.time_ms = time_ms;
        self.reading.status = Status::Stale;
        if number != self.number {
            self.number = number;
            let tool = tool();
            if tool.is_finite() {
                self.fresh_ms = time_ms;
                self.reading = Reading { tool, status: Status::Fresh };
            }
        }
        if self.age_ms() > limit_ms {
            self.reading.status = Status::Lost;
        }
        self.reading
    }

    /// Time since the last new one, ms.
    pub(crate) fn age_ms(&self) -> f64 {
        self.time_ms - self.fresh_ms
    }
}
