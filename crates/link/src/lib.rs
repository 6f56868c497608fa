//! What passes between Trepan's threads and into files: latest-value cells, bounded rings, wire
//! types, recordings.
//!
//! # Practice
//! Inside a process, loops of different rates exchange state through [`cell`] (only the newest
//! value counts) and streams through [`queue`] (every value counts, up to a limit). Neither locks,
//! waits or allocates. A [`Recorder`] on a thread of its own drains the queues into an MCAP file
//! that Foxglove and Rerun open; a [`Recording`] reads it back bit for bit, whole or cut anywhere.
//! With the feature `topics`, another process on the machine watches.
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
pub use recording::{Damage, Recording, Repaired, repair};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
