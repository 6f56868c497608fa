//! Communication between threads and recording to files: latest-value cells, bounded rings, wire
//! types, recordings.
//!
//! # Practice
//! Within a process, loops of different rates exchange state through [`cell`] (newest value only)
//! and streams through [`queue`] (every value, up to a limit). Neither locks, waits or allocates. A
//! [`Recorder`] on its own thread drains the queues into an MCAP file that Foxglove and Rerun open;
//! a [`Recording`] reads it bit for bit, complete or cut. With the feature `topics`, another
//! process on the machine can observe a session.
//!
//! # When not to use it
//! Never call a [`Recorder`] from a haptic tick: closing a chunk takes up to milliseconds.

pub mod cell;
mod error;
mod protobuf;
pub mod queue;
mod recorder;
mod recording;
#[cfg(feature = "topics")]
pub mod topics;
mod viewer;
pub mod wire;

pub use error::LinkError;
pub use recorder::{MAX_CHUNK_BYTES, MAX_CHUNK_MS, Recorder};
pub use recording::{
    Damage, NODE_STEP_MM, Recording, Repaired, SceneChange, SceneRecord, SceneWriter, Streamed, read_scene, repair,
    stream,
};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
