//! Synthesises the sounds of drill and alarm, sample by sample.
//!
//! # Theory
//! A drill hums at its spindle speed with overtones. Load slows the spindle, which lowers the
//! pitch, and drives the wave into saturation:
//!
//! ```text
//! hum(φ) = tanh(g (sin φ + sin(2φ)/2 + sin(3φ)/3))
//!          φ̇ = 2π · 420 Hz · spindle      g = 0.6 + 2.4 load
//! alarm  = two tones in turn, 880 and 1320 Hz, a quarter second each
//! ```
//!
//! # Practice
//! The sum stays within ±1. Pitch and loudness follow within some 10 ms, so that there are no
//! clicks; with the spindle at rest and no alarm there is silence. Nothing is allocated, since the
//! audio thread runs it.

use crate::Sound;
use std::f32::consts::TAU;

/// Pitch at the spindle's free speed, Hz.
const HUM_HZ: f32 = 420.0;
/// The alarm's two tones, Hz.
const ALARM_HZ: [f32; 2] = [880.0, 1320.0];
/// Length of each tone, s.
const TONE_S: f32 = 0.25;
/// Time constant of pitch and loudness, s.
const FOLLOW_S: f32 = 0.01;
/// Loudness of the drill.
const HUM: f32 = 0.45;
/// Loudness of the alarm.
const ALARM: f32 = 0.5;

/// State of the synthesis.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Synthesis {
    /// Phases of the hum and of the alarm's tone, and time in the alarm, s.
    hum: f32,
    tone: f32,
    alarm_s: f32,
    /// Smoothed spindle speed, load and alarm loudness.
    levels: [f32; 3],
}

impl Synthesis {
    /// The next sample, from -1 to 1, moving towards the target sound.
    pub fn sample(&mut self, wanted: Sound, rate_hz: f32) -> f32 {
        let dt_s = 1.0 / rate_hz.max(1.0);
        let sound = |value: f32| if value.is_finite() { value.clamp(0.0, 1.0) } else { 0.0 };
        let aims = [sound(wanted.spindle), sound(wanted.load), f32::from(u8::from(wanted.alarm))];
        let share = (dt_s / FOLLOW_S).min(1.0);
        for (level, aim) in self.levels.iter_mut().zip(aims) {
            *level += share * (aim - *level);
        }
        let [spindle, load, alarm] = self.levels;
        self.alarm_s = if wanted.alarm || alarm > 1e-3 { (self.alarm_s + dt_s) % (2.0 * TONE_S) } else { 0.0 };
        let tone_hz = ALARM_HZ[usize::from(self.alarm_s >= TONE_S)];
        self.hum = (self.hum + dt_s * HUM_HZ * spindle).fract();
        self.tone = (self.tone + dt_s * tone_hz).fract();
        let wave = |turn: f32| (TAU * turn).sin();
        let hum = wave(self.hum) + wave(2.0 * self.hum) / 2.0 + wave(3.0 * self.hum) / 3.0;
        // A spindle fades out under a tenth of its speed, to avoid crackle.
        let loud = HUM * (10.0 * spindle).min(1.0);
        loud * ((0.6 + 2.4 * load) * hum).tanh() + ALARM * alarm * wave(self.tone)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f32 = 48_000.0;

    fn samples(wanted: Sound, seconds: f32) -> Vec<f32> {
        let mut synthesis = Synthesis::default();
        (0..(RATE_HZ * seconds) as usize).map(|_| synthesis.sample(wanted, RATE_HZ)).collect()
    }

    /// The strongest frequency between 100 and 2000 Hz of the last half second, by a discrete
    /// Fourier transform.
    fn pitch_hz(samples: &[f32]) -> f32 {
        let last = &samples[samples.len() - (RATE_HZ / 2.0) as usize..];
        let power = |hz: f32| {
            let turn = |n: usize| TAU * hz * n as f32 / RATE_HZ;
            let sum = |wave: fn(f32) -> f32| last.iter().enumerate().map(|(n, x)| x * wave(turn(n))).sum::<f32>();
            sum(f32::sin).powi(2) + sum(f32::cos).powi(2)
        };
        (50..1000).map(|n| 2.0 * n as f32).max_by(|a, b| power(*a).total_cmp(&power(*b))).unwrap()
    }

    #[test]
    fn the_pitch_is_the_spindles_and_falls_with_it() {
        for spindle in [1.0, 0.7, 0.4] {
            let pitch = pitch_hz(&samples(Sound { spindle, load: 0.3, alarm: false }, 1.0));
            assert!((pitch - HUM_HZ * spindle).abs() <= 2.0, "{pitch} at {spindle}");
        }
    }

    #[test]
    fn load_makes_it_rougher() {
        let peak_to_mean = |load| {
            let sound = samples(Sound { spindle: 1.0, load, alarm: false }, 0.5);
            let square = sound.iter().map(|x| x * x).sum::<f32>() / sound.len() as f32;
            sound.iter().fold(0.0f32, |most, x| most.max(x.abs())) / square.sqrt()
        };
        assert!(peak_to_mean(1.0) < 0.9 * peak_to_mean(0.0), "{} {}", peak_to_mean(1.0), peak_to_mean(0.0));
    }

    #[test]
    fn the_alarm_has_two_tones_and_ends() {
        let alarm = Sound { alarm: true, ..Sound::default() };
        let sound = samples(alarm, 1.2);
        // The last half second contains half of each tone.
        assert!([880.0, 1320.0].iter().any(|hz| (pitch_hz(&sound) - hz).abs() < 10.0));
        let mut synthesis = Synthesis::default();
        (0..9600).for_each(|_| _ = synthesis.sample(alarm, RATE_HZ));
        let quiet: Vec<f32> = (0..24_000).map(|_| synthesis.sample(Sound::default(), RATE_HZ)).collect();
        assert!(quiet[12_000..].iter().all(|x| x.abs() < 1e-6));
    }

    #[test]
    fn it_never_clips_nor_clicks_whatever_is_asked() {
        let mut synthesis = Synthesis::default();
        let mut last = 0.0;
        for n in 0..96_000u32 {
            let jump = f32::from(u8::from(n / 4800 % 2 == 0));
            let spindle = if n > 48_000 && n < 52_000 { f32::NAN } else { 3.0 * jump };
            let now = synthesis.sample(Sound { spindle, load: jump, alarm: n / 9600 % 2 == 1 }, RATE_HZ);
            assert!(now.abs() <= 1.0 && (now - last).abs() < 0.35, "{last} {now} at {n}");
            last = now;
        }
        assert!(samples(Sound::default(), 0.1).iter().all(|x| *x == 0.0));
    }
}
