//! Audio output on the sound system's thread; it never waits for the window.
//!
//! # Practice
//! The current sound is passed through one atomic word. A machine without a sound system stays
//! silent and reports why in the panel; nothing else depends on it.
//!
//! # When not to use it
//! Without ALSA's headers on Linux: leave the feature `sound` off.

use crate::Sound;
use crate::synthesis::Synthesis;
use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use cpal::{FromSample, SampleFormat, SizedSample, Stream, StreamConfig};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Why there is no sound.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AudioError {
    /// The machine has no sound device.
    #[error("there is no sound device")]
    NoDevice,
    /// The sound device takes no samples that this program can make.
    #[error("the sound device wants samples of {0}")]
    Samples(SampleFormat),
    /// The sound system failed.
    #[error(transparent)]
    System(#[from] cpal::Error),
}

/// An open sound device.
pub(crate) struct Loudspeaker {
    wanted: Arc<AtomicU64>,
    /// Plays until dropped.
    _stream: Stream,
}

impl Loudspeaker {
    /// Opens the default device.
    pub fn open() -> Result<Self, AudioError> {
        let device = cpal::default_host().default_output_device().ok_or(AudioError::NoDevice)?;
        let config = device.default_output_config()?;
        let wanted = Arc::new(AtomicU64::new(0));
        let stream = match config.sample_format() {
            SampleFormat::F32 => stream::<f32>(&device, config.into(), wanted.clone()),
            SampleFormat::I16 => stream::<i16>(&device, config.into(), wanted.clone()),
            SampleFormat::I32 => stream::<i32>(&device, config.into(), wanted.clone()),
            SampleFormat::U16 => stream::<u16>(&device, config.into(), wanted.clone()),
            other => return Err(AudioError::Samples(other)),
        };
        let stream = stream?;
        stream.play()?;
        Ok(Self { wanted, _stream: stream })
    }

    /// Sets the current sound.
    pub fn sound(&self, sound: Sound) {
        self.wanted.store(packed(sound), Ordering::Relaxed);
    }
}

/// Audio output, opened at the first sound.
#[derive(Default)]
pub(crate) struct AudioOutput {
    /// Whether sound is muted.
    pub muted: bool,
    loudspeaker: Option<Result<Loudspeaker, AudioError>>,
}

impl AudioOutput {
    /// Sets the current sound; returns an error message, if any.
    pub fn play(&mut self, sound: Sound) -> Option<String> {
        let sound = if self.muted { Sound::default() } else { sound };
        if self.loudspeaker.is_none() && sound == Sound::default() {
            return None;
        }
        match self.loudspeaker.get_or_insert_with(Loudspeaker::open) {
            Ok(loudspeaker) => loudspeaker.sound(sound),
            Err(why) => return Some(why.to_string()),
        }
        None
    }
}

fn stream<T: SizedSample + FromSample<f32>>(
    device: &cpal::Device,
    config: StreamConfig,
    wanted: Arc<AtomicU64>,
) -> Result<Stream, cpal::Error> {
    let (rate_hz, channels) = (config.sample_rate as f32, usize::from(config.channels).max(1));
    let mut synthesis = Synthesis::default();
    let fill = move |data: &mut [T], _: &cpal::OutputCallbackInfo| {
        let sound = unpacked(wanted.load(Ordering::Relaxed));
        for frame in data.chunks_mut(channels) {
            frame.fill(T::from_sample(synthesis.sample(sound, rate_hz)));
        }
    };
    // An unplugged device falls silent.
    device.build_output_stream(config, fill, |_| (), None)
}

/// Packs spindle and load in thousandths, and the alarm, in one word.
fn packed(Sound { spindle, load, alarm }: Sound) -> u64 {
    let part = |value: f32| (1e3 * value.clamp(0.0, 1.0)) as u64;
    part(spindle) | part(load) << 16 | u64::from(alarm) << 32
}

fn unpacked(word: u64) -> Sound {
    let part = |shift: u32| (word >> shift & 0xffff) as f32 / 1e3;
    Sound { spindle: part(0), load: part(16), alarm: word >> 32 == 1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sound_passes_through_one_word() {
        let sound = Sound { spindle: 0.75, load: 0.125, alarm: true };
        assert_eq!(unpacked(packed(sound)), sound);
        assert_eq!(unpacked(packed(Sound::default())), Sound::default());
        let odd = unpacked(packed(Sound { spindle: f32::NAN, load: 9.0, alarm: false }));
        assert_eq!((odd.spindle, odd.load), (0.0, 1.0));
    }
}
