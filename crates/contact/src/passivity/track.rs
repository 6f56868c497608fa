//! The hand's motion as far as encoder steps let one know it.
//!
//! # Theory
//! An encoder of step Δ shows x as a staircase: a hand that trembles across one edge seems to jump
//! by Δ, a slow hand seems to rest and to leap. Two estimates answer that:
//! ```text
//! sure way   x̂ ← x̂ while |x - x̂| ≤ Δ/2, else the point at Δ/2 from x towards x̂
//!            a play (hysteresis): at each encoder step it is where the edge is
//! velocity   (x(n) - x(n-L))/L, L the longest window whose chord passes all samples within Δ
//! ```
//! The window is short for a fast hand and long for a slow one.
//!
//! # Sources
//! F. Janabi-Sharifi, V. Hayward, C.-S. J. Chen, *Discrete-time adaptive windowing for velocity
//! estimation*, IEEE Trans. Control Systems Technology 8 (2000).

use trepan_geometry::Vec3;

/// Longest window, ticks.
const WINDOW: usize = 16;
/// How far from a chord a sample may be where encoder steps are finer, mm.
const SMOOTH_MM: f32 = 1e-4;

/// The last positions of a tip.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Track {
    /// As read, newest first.
    seen: [Vec3; WINDOW + 1],
    count: usize,
    /// The play's place.
    sure: Vec3,
    /// The play's last two ways, newest first.
    ways: [Vec3; 2],
    motion: Vec3,
}

/// What one tick moved, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// As read.
    pub seen: Vec3,
    /// As far as it is sure.
    pub sure: Vec3,
}

impl Track {
    /// Takes in the next position of the tip, read in steps of `quantum_mm`.
    pub fn follow(&mut self, tip: Vec3, quantum_mm: f32) -> Moved {
        if self.count == 0 {
            *self = Self { sure: tip, ..Self::default() };
        }
        self.seen.rotate_right(1);
        self.seen[0] = tip;
        self.count = (self.count + 1).min(WINDOW + 1);
        let offset = tip - self.sure;
        let way = offset - offset.clamp_length_max(0.5 * quantum_mm.max(0.0));
        self.sure += way;
        self.ways = [way, self.ways[0]];
        self.motion = self.chord(quantum_mm.max(SMOOTH_MM));
        Moved { seen: if self.count > 1 { tip - self.seen[1] } else { Vec3::ZERO }, sure: way }
    }

    /// Forgets where the tip was: it has jumped or was lost.
    pub fn lose(&mut self) {
        *self = Self::default();
    }

    /// The way of one tick by the adaptive window, mm.
    pub fn motion(&self) -> Vec3 {
        self.motion
    }

    /// How much the last two ways differ, mm.
    pub fn unevenness(&self) -> f32 {
        self.ways[0].distance(self.ways[1])
    }

    fn chord(&self, tolerance_mm: f32) -> Vec3 {
        let mut motion = Vec3::ZERO;
        for length in 1..self.count {
            let chord = (self.seen[0] - self.seen[length]) / length as f32;
            let fits = |i: usize| (self.seen[0] - chord * i as f32).distance(self.seen[i]) <= tolerance_mm;
            if !(1..length).all(fits) {
                break;
            }
            motion = chord;
        }
        motion
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_MM: f32 = 0.055;

    fn rounded(x: f32) -> Vec3 {
        Vec3::X * (x / STEP_MM).round() * STEP_MM
    }

    #[test]
    fn trembling_across_an_edge_is_no_motion() {
        let mut track = Track::default();
        let (mut seen, mut sure) = (0.0, 0.0);
        for t in 0..100 {
            let moved = track.follow(Vec3::X * STEP_MM * (t / 3 % 2) as f32, STEP_MM);
            seen += moved.seen.length();
            sure += moved.sure.length();
        }
        assert!(seen > 30.0 * STEP_MM && sure <= 0.5 * STEP_MM + 1e-6, "{seen} {sure}");
        assert!(track.motion().length() < 0.01, "{}", track.motion());
    }

    #[test]
    fn a_slow_and_a_fast_hand_are_measured_alike() {
        for (speed, tolerance) in [(0.012, 0.004), (0.1, 0.02), (0.5, 0.05)] {
            let mut track = Track::default();
            let mut sure = 0.0;
            for t in 0..60 {
                sure += track.follow(rounded(speed * t as f32), STEP_MM).sure.x;
                let late = t > 20;
                assert!(!late || (track.motion().x - speed).abs() < tolerance, "{speed}: {}", track.motion().x);
            }
            assert!((sure - speed * 59.0).abs() <= STEP_MM, "{speed}: {sure}");
        }
    }

    #[test]
    fn a_lost_tip_starts_anew() {
        let mut track = Track::default();
        for t in 0..5 {
            track.follow(Vec3::X * t as f32, 0.0);
        }
        assert_eq!(track.motion(), Vec3::X);
        track.lose();
        let moved = track.follow(Vec3::Y * 100.0, 0.0);
        assert_eq!((moved.seen, moved.sure, track.motion()), (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO));
    }
}
