//! Measures the delay from an applied force to the first motion of the hand, from taps.
//!
//! # Theory
//! A tap pushes the hand; the delay ends at the first new position displaced along the tap. A hand
//! of 0.2 kg needs 2 to 3 ms to move by one encoder step, so the result is an upper bound: it
//! includes the delays of driver, link, motors and hand. The median over the taps rejects tremor;
//! taps during voluntary motion are left out.

use crate::device_test::measured::Sample;
use crate::device_test::trial::{Part, TAP_MS};
use trepan_geometry::{Vec3, quantile};

/// Smallest displacement that counts as motion, mm, for encoders with finer steps.
const MIN_MOTION_MM: f32 = 0.01;

/// Motion below which a hand counts as still, mm, and the time before a tap that it covers, ms.
const STILL: (f32, f64) = (0.15, 20.0);

/// Median delay from a tap to the first motion along it, ms, over taps on a still hand. `None` if
/// most taps caused no motion.
pub fn median_ms(samples: &[Sample]) -> Option<f64> {
    let begins = |at: &usize| {
        let (before, now) = (&samples[at - 1], &samples[*at]);
        now.part == Part::Tap && before.force == Vec3::ZERO && now.force != Vec3::ZERO && is_still(&samples[..=*at])
    };
    let delay = |at: usize| first_motion_ms(&samples[at..]).unwrap_or(f64::INFINITY);
    let mut delays: Vec<f64> = (1..samples.len()).filter(begins).map(delay).collect();
    Some(quantile(&mut delays, 0.5)).filter(|delay| delay.is_finite())
}

/// Whether the hand was still before the last sample.
fn is_still(samples: &[Sample]) -> bool {
    let (within_mm, time_ms) = STILL;
    let Some(last) = samples.last() else { return false };
    let recent = samples.iter().rev().take_while(|s| last.time_ms - s.time_ms < time_ms);
    recent.map(|s| (s.tip.y - last.tip.y).abs()).fold(0.0, f32::max) < within_mm
}

/// Delay of the first motion along the tap that begins the samples, ms; the midpoint of two
/// readings.
fn first_motion_ms(samples: &[Sample]) -> Option<f64> {
    let begin = samples[0];
    let mut last_ms = begin.time_ms;
    for now in samples[1..].iter().take_while(|s| s.time_ms - begin.time_ms < 2.0 * TAP_MS).filter(|s| s.fresh) {
        if (now.tip.y - begin.tip.y) * begin.force.y > MIN_MOTION_MM * begin.force.y.abs() {
            return Some(0.5 * (last_ms + now.time_ms) - begin.time_ms);
        }
        last_ms = now.time_ms;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device_test::measured::tests::tested;
    use trepan_haptics::simulated::{Config, HandModel};

    #[test]
    fn taps_find_the_delay_of_the_device() {
        for (name, hand) in [("light", HandModel::LIGHT), ("firm", HandModel::FIRM)] {
            for friction_n in [0.0, 0.26] {
                let found = [0, 2, 5, 8].map(|delay_ticks| {
                    let config = Config { delay_ticks, friction_n, ..Config::default() };
                    median_ms(&tested(config, hand, |_| 0.0).0).unwrap()
                });
                for (found, delay) in found.into_iter().zip([0.0, 2.0, 5.0, 8.0]) {
                    assert!((1.0..4.0).contains(&(found - delay)), "{name}, {friction_n} N: {found} for {delay}");
                }
            }
        }
    }

    #[test]
    fn a_hand_that_moves_by_itself_gives_no_delay() {
        let (samples, ..) = tested(Config::default(), HandModel::FIRM, |t| 0.02 * t as f32 % 40.0);
        assert_eq!(median_ms(&samples), None);
    }

    #[test]
    fn a_device_that_does_not_move_has_no_delay() {
        let (mut samples, ..) = tested(Config::default(), HandModel::FIRM, |_| 0.0);
        samples.iter_mut().for_each(|s| s.tip = Vec3::ONE);
        assert_eq!(median_ms(&samples), None);
        assert_eq!(median_ms(&[]), None);
    }
}
