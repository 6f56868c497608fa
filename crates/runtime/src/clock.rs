//! The session's clock, and the wait for the next tick.
//!
//! # Practice
//! A sleeping thread wakes late: by a few us at real-time priority, else by the kernel's timer
//! slack (about 0.06 ms), and by more on a busy machine. The wait therefore sleeps until shortly
//! before the deadline and spins for the rest, for as long as wakes were late lately: what spins
//! takes a core from the solver. Deadlines are absolute: a late tick does not delay later ones.
//! Missed ticks are counted, not made up for.

use std::time::{Duration, Instant};

/// Longest time before a deadline at which sleeping ends and spinning begins, ms.
const LONGEST_SPIN_MS: f64 = 0.12;
/// Spin beyond what wakes were late, ms.
const MARGIN_MS: f64 = 0.01;
/// What a wait leaves of the latest wake before it: half in 350 waits.
const KEPT: f64 = 0.998;

/// Milliseconds since the session began.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
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

    /// Sleeps until `time_ms`, to within the kernel's timer slack.
    pub fn sleep_until(&self, time_ms: f64) {
        let left = time_ms - self.now_ms();
        if left > 0.0 {
            std::thread::sleep(Duration::from_secs_f64(left * 1e-3));
        }
    }
}

/// A thread's waits, which end when they should.
#[derive(Clone, Copy, Debug)]
pub struct Waits {
    /// How late the thread has woken lately, ms.
    late_ms: f64,
}

impl Default for Waits {
    fn default() -> Self {
        Self { late_ms: LONGEST_SPIN_MS }
    }
}

impl Waits {
    /// Sleeps, then spins, until `time_ms` on a clock.
    pub fn until(&mut self, time_ms: f64, clock: &Clock) {
        let wake_ms = time_ms - self.spin_ms();
        if clock.now_ms() < wake_ms {
            clock.sleep_until(wake_ms);
            self.woke(clock.now_ms() - wake_ms);
        }
        while clock.now_ms() < time_ms {
            std::hint::spin_loop();
        }
    }

    fn spin_ms(&self) -> f64 {
        (self.late_ms + MARGIN_MS).min(LONGEST_SPIN_MS)
    }

    fn woke(&mut self, late_ms: f64) {
        self.late_ms = late_ms.max(self.late_ms * KEPT).min(LONGEST_SPIN_MS);
    }
}

/// Deadlines at a fixed rate.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
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
    fn a_wait_spins_as_long_as_wakes_are_late_and_begins_with_the_longest_spin() {
        let mut waits = Waits::default();
        assert_eq!(waits.spin_ms(), LONGEST_SPIN_MS);
        (0..5000).for_each(|_| waits.woke(0.005));
        assert!((waits.spin_ms() - 0.015).abs() < 1e-6, "{waits:?}");
        waits.woke(0.06);
        assert!(waits.spin_ms() > 0.065, "{waits:?}");
        waits.woke(3.0);
        assert_eq!(waits.spin_ms(), LONGEST_SPIN_MS);
    }

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
