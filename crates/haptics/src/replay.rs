//! Replays recorded tool states: each read returns the next one, regardless of the clock.
//!
//! # Practice
//! One state per read makes a replay produce bit-identical forces at any speed. The states keep
//! their recorded times. After the last one the tool stays there.

use crate::{Capabilities, Descriptor, DeviceError, HapticDevice, Listed, Motion, NameError, Reading, Status};
use trepan_contact::GuardedWrench;
use trepan_geometry::{Pose, ToolState, Twist, Wrench};

/// `replay:FILE`: the motion of a recorded session. Its tool states come with the recording.
pub static DEVICE: Descriptor = Descriptor {
    name: "replay",
    usage: ":FILE",
    source: "a session's recording",
    motion: Motion::Recording,
    argument: |name, file| match file {
        None => Err(NameError::lacks(name, "file", "session.mcap")),
        Some(file) => Ok(Some(file.to_owned())),
    },
    id: |file| file,
    probe: || Ok(vec![Listed::new("replay:FILE", "ready")]),
    open: |_, _| Err(DeviceError::open("replay", "its session must be read first", "replay it with `--device`")),
};

/// A recording used as a device.
#[derive(Clone, Debug)]
pub struct Replay {
    states: Vec<ToolState>,
    next: usize,
    applied: GuardedWrench,
    closed: bool,
}

impl Replay {
    /// Replays `states` in order. Without any, every read is [`Status::Finished`] at the origin.
    pub fn new(states: Vec<ToolState>) -> Self {
        Self { states, next: 0, applied: GuardedWrench::ZERO, closed: false }
    }

    /// The wrench last applied.
    pub fn applied(&self) -> Wrench {
        self.applied.wrench()
    }
}

impl HapticDevice for Replay {
    fn read(&mut self, time_ms: f64) -> Reading {
        if let Some(&tool) = self.states.get(self.next) {
            self.next += 1;
            return Reading { tool, status: Status::Fresh };
        }
        let last = self.states.last().copied().unwrap_or_else(|| ToolState::at(Pose::IDENTITY));
        Reading { tool: ToolState { twist: Twist::default(), time_ms, ..last }, status: Status::Finished }
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        if !self.closed {
            self.applied = wrench;
        }
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::passive("replay")
    }

    fn close(&mut self) {
        (self.applied, self.closed) = (GuardedWrench::ZERO, true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Buttons, Vec3};

    fn bits(tool: &ToolState) -> [u32; 8] {
        let p = tool.tip();
        let v = tool.twist.linear;
        let t = tool.time_ms.to_bits();
        [p.x, p.y, p.z, v.x, v.y, v.z]
            .map(f32::to_bits)
            .iter()
            .copied()
            .chain([t as u32, (t >> 32) as u32])
            .collect::<Vec<_>>()
            .try_into()
            .unwrap()
    }

    #[test]
    fn every_state_comes_back_bit_for_bit_then_it_rests() {
        let states: Vec<_> = (0..50u8)
            .map(|i| ToolState {
                twist: Twist { linear: Vec3::splat(0.1 / f32::from(i + 1)), angular: Vec3::ZERO },
                buttons: Buttons(u32::from(i % 3)),
                time_ms: f64::from(i) * 1.000_01,
                ..ToolState::at(Pose::from_translation(Vec3::splat(f32::from(i).sqrt())))
            })
            .collect();
        let mut replay = Replay::new(states.clone());
        for state in &states {
            let reading = replay.read(1e9);
            assert_eq!((bits(&reading.tool), reading.status), (bits(state), Status::Fresh));
            assert_eq!(reading.tool.buttons, state.buttons);
        }
        let end = replay.read(60.0);
        assert_eq!((end.status, end.tool.twist, end.tool.time_ms), (Status::Finished, Twist::default(), 60.0));
        assert_eq!(end.tool.tip(), states[49].tip());
    }

    #[test]
    fn an_empty_recording_is_over_at_once() {
        assert_eq!(Replay::new(Vec::new()).read(0.0).status, Status::Finished);
    }
}
