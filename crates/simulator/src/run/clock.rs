//! The session's clock, and the wait for the next tick.
//!
//! # Practice
//! A sleeping thread wakes late by the kernel's timer slack (about 0.06 ms), and by more on a busy
//! machine. The wait therefore sleeps until shortly before the deadline and spins for the rest.
//! Deadlines are absolute: a late tick does not delay later ones. Missed ticks are counted, not
//! made up for.

use std::time::{Duration, Instant};

/// Time before a deadline at which sleeping ends and spinning begins, ms.
const SPIN_MS: f64 = 0.12;

/// Milliseconds since the session began.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    start: Instant,
}

impl Clock {
    /// A clock that starts now.
    pub fn start() -> Self {
        Self { start: Instant::now() }
    }

    /// Now, ms.
    pub fn now_ms(&self) -> f64 {
        self.start.elapsed().as_secs_f64() * 1e3
    }

    /// Sleeps, then spins, until `time_ms`.
    pub fn spin_until(&self, time_ms: f64) {
        self.sleep_until(time_ms - SPIN_MS);
        while self.now_ms() < time_ms {
            std::hint::spin_loop();
        }
    }

    /// Sleeps until `time_ms`, to within the kernel's timer slack.
    pub fn sleep_until(&self, time_ms: f64) {
        let left = time_ms - self.now_ms();
        if left > 0.0 {
            std::thread::sleep(Duration::from_secs_f64(left * 1e-3));
        }
    }
}

/// Deadlines at a fixed rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Schedule {
    period_ms: f64,
    next_ms: f64,
}

impl Schedule {
    /// Deadlines every `period_ms`, the first one period from `now_ms`.
    pub fn new(period_ms: f64, now_ms: f64) -> Self {
        Self { period_ms, next_ms: now_ms + period_ms }
    }

    /// The next deadline, ms.
    pub fn next_ms(&self) -> f64 {
        self.next_ms
    }

    /// Moves to the first deadline after `now_ms`; true when one or more were missed.
    pub fn advance(&mut self, now_ms: f64) -> bool {
        self.next_ms += self.period_ms;
        let missed = now_ms >= self.next_ms;
        if missed {
            self.next_ms += ((now_ms - self.next_ms) / self.period_ms).floor() * self.period_ms + self.period_ms;
        }
        missed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missed_deadline_is_skipped_and_the_grid_is_kept() {
        let mut schedule = Schedule::new(1.0, 0.0);
        assert!(!schedule.advance(1.4));
        assert_eq!(schedule.next_ms(), 2.0);
        assert!(schedule.advance(5.5));
        assert_eq!(schedule.next_ms(), 6.0);
        assert!(!schedule.advance(6.2));
        assert_eq!(schedule.next_ms(), 7.0);
    }
}
