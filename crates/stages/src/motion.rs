//! Motion of the tip: path, idle time and smoothness, independent of the tick rate.
//!
//! # Theory
//! The position of the tip is averaged over equal windows of time, linear between two ticks, so
//! that neither tick rate nor encoder noise affects it. Windows begin at multiples of their length,
//! not at the first tick, and the tip counts as at rest before that tick. Over windows of 20 ms:
//!
//! ```text
//! path = Σ |xₖ₊₁ - xₖ|          idle = time with |xₖ₊₁ - xₖ| / h < 5 mm/s
//! ```
//!
//! Over windows of 100 ms, with v = Δx / h and the jerk j = Δ³x / h³, the smoothness of the whole
//! movement over T seconds:
//!
//! ```text
//! log dimensionless jerk = -ln( T³ / v_peak² · Σ |j|² h )
//! ```
//!
//! A larger value is smoother. One minimum-jerk movement of any length and duration has
//! -5.32 = -ln(720/1.875²); every stop and turn lowers it. Motion above 5 Hz, such as tremor, is
//! filtered out.
//!
//! # Sources
//! Log dimensionless jerk: Balasubramanian, Melendez-Calderon and Burdet 2012. Minimum jerk: Flash
//! and Hogan 1985. The speed limit of idle time was chosen here.

use glam::DVec3;
use trepan_geometry::Vec3;

/// Window for path and idle time, ms.
const FINE_MS: f64 = 20.0;
/// Window for smoothness, ms.
const COARSE_MS: f64 = 100.0;
/// Speed under which the tip is idle, mm/s.
const IDLE_MM_S: f64 = 5.0;
/// Pause between two ticks from which a new movement begins, ms.
const PAUSE_MS: f64 = 1000.0;

/// Sums over a movement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Length of the tip's path, mm.
    pub path_mm: f64,
    /// Time in which the tip moved slower than 5 mm/s, s.
    pub idle_s: f64,
    fine: Grid,
    last: Option<DVec3>,
    coarse: Grid,
    /// Newest mean positions on the coarse grid, the oldest first; `known` is their number.
    places: [DVec3; 4],
    known: usize,
    /// Steps of the coarse grid.
    steps: u64,
    peak_mm_s: f64,
    /// Σ |j|² h, mm²/s⁵.
    jerk2: f64,
}

/// Consecutive windows of time, with the mean position in each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Grid {
    before: Option<(f64, DVec3)>,
    /// End of the present window, ms; `sum` is the position integrated over it so far, mm ms.
    end_ms: f64,
    sum: DVec3,
}

impl Motion {
    /// Adds the position of the tip, mm, at a time, ms.
    pub fn add(&mut self, time_ms: f64, tip: Vec3) {
        let tip = tip.as_dvec3();
        let (mut fine, mut coarse) = (self.fine, self.coarse);
        if fine.breaks_off(time_ms) {
            (self.last, self.known) = (None, 0);
        }
        fine.add(FINE_MS, time_ms, tip, |x| self.step(x));
        coarse.add(COARSE_MS, time_ms, tip, |x| self.coarse_step(x));
        (self.fine, self.coarse) = (fine, coarse);
    }

    /// Returns the smoothness so far; `None` if it is not defined yet.
    pub fn log_dimensionless_jerk(&self) -> Option<f64> {
        let seconds = self.steps as f64 * COARSE_MS * 1e-3;
        let value = -(seconds.powi(3) / self.peak_mm_s.powi(2) * self.jerk2).ln();
        value.is_finite().then_some(value)
    }

    fn step(&mut self, at: DVec3) {
        if let Some(last) = self.last {
            let way = at.distance(last);
            self.path_mm += way;
            self.idle_s += if way < IDLE_MM_S * FINE_MS * 1e-3 { FINE_MS * 1e-3 } else { 0.0 };
        }
        self.last = Some(at);
    }

    fn coarse_step(&mut self, at: DVec3) {
        self.places.rotate_left(1);
        self.places[3] = at;
        self.known += 1;
        let h = COARSE_MS * 1e-3;
        let [a, b, c, d] = self.places;
        if self.known > 1 {
            self.steps += 1;
            self.peak_mm_s = self.peak_mm_s.max(d.distance(c) / h);
        }
        if self.known > 3 {
            let jerk = (d - 3.0 * c + 3.0 * b - a) / h.powi(3);
            self.jerk2 += jerk.length_squared() * h;
        }
    }
}

impl Grid {
    /// Whether there is a pause before this time, so that a new movement begins.
    fn breaks_off(&self, time_ms: f64) -> bool {
        self.before.is_some_and(|(before_ms, _)| time_ms - before_ms >= PAUSE_MS)
    }

    /// Calls `each` with the mean positions of the windows that end up to this time. Samples that
    /// are not finite or not later than the last are ignored.
    fn add(&mut self, step_ms: f64, time_ms: f64, tip: DVec3, mut each: impl FnMut(DVec3)) {
        if !tip.is_finite() || !time_ms.is_finite() {
            return;
        }
        match self.before {
            Some((before_ms, _)) if time_ms <= before_ms => return,
            Some((before_ms, from)) if time_ms - before_ms < PAUSE_MS => {
                let at = |ms: f64| from.lerp(tip, (ms - before_ms) / (time_ms - before_ms));
                let mut done_ms = before_ms;
                while self.end_ms <= time_ms {
                    self.sum += (self.end_ms - done_ms) * at(0.5 * (done_ms + self.end_ms));
                    each(self.sum / step_ms);
                    (done_ms, self.sum) = (self.end_ms, DVec3::ZERO);
                    self.end_ms += step_ms;
                }
                self.sum += (time_ms - done_ms) * at(0.5 * (done_ms + time_ms));
            }
            _ => {
                let start_ms = (time_ms / step_ms).floor() * step_ms;
                (self.end_ms, self.sum) = (start_ms + step_ms, (time_ms - start_ms) * tip);
            }
        }
        self.before = Some((time_ms, tip));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a minimum-jerk movement over `mm` in `seconds`, at `hz`.
    fn least_jerk(mm: f64, seconds: f64, hz: f64) -> Motion {
        let mut motion = Motion::default();
        for n in 0..=(seconds * hz) as usize {
            let s = n as f64 / hz / seconds;
            let x = mm * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            motion.add(1e3 * n as f64 / hz, Vec3::new(x as f32, 0.0, 3.0));
        }
        motion
    }

    #[test]
    fn a_minimum_jerk_movement_has_its_closed_form() {
        // The grid omits 0.2 s at the ends, where the jerk is largest: little of a long movement.
        for (mm, seconds) in [(100.0, 40.0), (300.0, 60.0)] {
            let motion = least_jerk(mm, seconds, 1000.0);
            assert!((motion.path_mm / mm - 1.0).abs() < 0.01, "{}", motion.path_mm);
            let smooth = motion.log_dimensionless_jerk().unwrap();
            assert!((smooth / -(720.0f64 / 1.875 / 1.875).ln() - 1.0).abs() < 0.01, "{smooth}");
        }
    }

    #[test]
    fn idle_time_is_the_time_at_rest() {
        let mut motion = Motion::default();
        for ms in 0..3000u16 {
            motion.add(f64::from(ms), Vec3::X * 0.05 * f32::from(ms.clamp(1000, 2000)));
        }
        assert!((motion.idle_s - 2.0).abs() < 0.07 && (motion.path_mm - 50.0).abs() < 0.1, "{motion:?}");
        assert_eq!(Motion::default().log_dimensionless_jerk(), None);
    }

    /// Makes twelve seconds of a curve that does not repeat, at `hz`.
    fn curve(hz: f64, mm: f64, turns_s: f64) -> Motion {
        let mut motion = Motion::default();
        for n in 0..(12.0 * hz) as usize {
            let s = n as f64 / hz;
            let phase = core::f64::consts::TAU * turns_s * s;
            motion.add(1e3 * s, Vec3::new((mm * phase.sin()) as f32, (0.6 * mm * (1.3 * phase).cos()) as f32, 0.0));
        }
        motion
    }

    #[test]
    fn the_tick_rate_does_not_affect_the_scores() {
        for (mm, turns_s) in [(5.0, 0.3), (12.0, 0.55), (30.0, 0.8)] {
            let exact = curve(1000.0, mm, turns_s);
            for hz in [60.0, 87.3, 240.0, 500.0] {
                let found = curve(hz, mm, turns_s);
                let apart = |a: f64, b: f64| (a / b - 1.0).abs();
                assert!(apart(found.path_mm, exact.path_mm) < 0.01, "{hz} Hz: {}", found.path_mm);
                let [a, b] = [found, exact].map(|m| m.log_dimensionless_jerk().unwrap());
                assert!(apart(a, b) < 0.01, "{hz} Hz: {a} for {b}");
            }
        }
    }

    #[test]
    fn pauses_and_invalid_samples_are_ignored() {
        let mut motion = Motion::default();
        motion.add(0.0, Vec3::ZERO);
        motion.add(1.0, Vec3::NAN);
        motion.add(f64::NAN, Vec3::ONE);
        motion.add(0.0, Vec3::splat(50.0));
        motion.add(40.0, Vec3::X);
        assert_eq!((motion.path_mm, motion.idle_s), (0.5, 0.0));
        (0..300u16).for_each(|ms| motion.add(1e9 + f64::from(ms), Vec3::X * 50.0));
        assert_eq!((motion.path_mm, motion.peak_mm_s, motion.jerk2), (0.5, 0.0, 0.0), "the way across a pause");
    }
}
