//! Data for general viewers: the tool's frame and a log, in Foxglove's schemas.
//!
//! # Practice
//! Written from the ticks at 60 Hz at most; a replay ignores them.
//!
//! # Sources
//! <https://docs.foxglove.dev/docs/visualization/message-schemas/frame-transform>, `.../log`.

use crate::wire::EventRecord;
use foxglove::messages::log::Level;
use foxglove::messages::{FrameTransform, Log, Quaternion, Timestamp, Vector3};
use trepan_geometry::Pose;

/// Frame of the patient, RAS+; positions are written in metres, as viewers expect.
const WORLD: &str = "patient";

/// A pose `world_from_tool` at a session time, as a transform of the frame `child`.
pub(crate) fn frame(world_from_tool: &Pose, child: &str, log_time_ns: u64) -> FrameTransform {
    let metres = world_from_tool.translation.as_dvec3() * 1e-3;
    let q = world_from_tool.rotation.as_dquat();
    FrameTransform {
        timestamp: Some(timestamp(log_time_ns)),
        parent_frame_id: WORLD.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(Vector3 { x: metres.x, y: metres.y, z: metres.z }),
        rotation: Some(Quaternion { x: q.x, y: q.y, z: q.z, w: q.w }),
    }
}

/// An event as a log line.
pub(crate) fn log(event: &EventRecord, log_time_ns: u64) -> Log {
    let level = match event.kind.as_str() {
        "error" => Level::Error,
        "warning" => Level::Warning,
        _ => Level::Info,
    };
    Log {
        timestamp: Some(timestamp(log_time_ns)),
        level: level.into(),
        message: event.text.clone(),
        name: event.kind.clone(),
        ..Log::default()
    }
}

fn timestamp(log_time_ns: u64) -> Timestamp {
    let seconds = u32::try_from(log_time_ns / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (log_time_ns % 1_000_000_000) as u32)
}
