//! Writes a session to an MCAP file; a cut at any byte loses at most the last quarter of a second.
//!
//! # Practice
//! Each record type has a topic in Trepan's protobuf schemas (`/tick`, `/second`, `/collision`,
//! `/solver`, `/event`, `/score`, and `/state` where a session joined another); `/tool` and `/log`
//! use Foxglove's for viewers. The fields of `/score` are named in the file, as a session has them.
//! Chunks are compressed with LZ4 and closed after [`MAX_CHUNK_BYTES`] or [`MAX_CHUNK_MS`] of
//! session time, whichever comes first, then handed to the operating system: a killed process loses
//! the open chunk only. A tick takes 2 µs and 80 to 250 B, but 5 ms or the disk's latency when a
//! chunk closes. So a recorder runs on its own thread, behind [`crate::queue`].
//!
//! # Sources
//! MCAP: <https://mcap.dev/spec>.

use crate::protobuf::{Fields, encode, encode_numbers, file_descriptor_set, numbers_descriptor_set};
use crate::wire::{CollisionRecord, EventRecord, SecondRecord, SessionHeader, SolverRecord, StateRecord, TickRecord};
use crate::{LinkError, viewer};
use foxglove::Encode;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, McapError, WriteOptions};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

/// A chunk is closed when it holds this many bytes before compression.
pub const MAX_CHUNK_BYTES: u64 = 256 * 1024;
/// A chunk is closed when it spans this much session time, ms.
pub const MAX_CHUNK_MS: f64 = 200.0;
/// Session time between two poses for viewers, ms.
const VIEW_PERIOD_MS: f64 = 16.0;

/// File format version, raised when an older reader would misread a newer file.
pub(crate) const FORMAT: u32 = 1;
/// Name of the metadata record that holds the session header.
pub(crate) const HEADER_NAME: &str = "trepan.session";
pub(crate) const HEADER_KEY: &str = "json";
/// Name of the metadata record that lists the losses of a repaired file.
pub(crate) const REPAIR_NAME: &str = "trepan.repair";
pub(crate) const LOSSES_KEY: &str = "losses";
pub(crate) const FORMAT_KEY: &str = "format";
const PROFILE: &str = "trepan";

/// A session file being written.
///
/// After the first error every call fails; flushed data stay readable. Dropping a recorder finishes
/// the file as well as possible; [`Recorder::finish`] also returns errors.
pub struct Recorder<W: Write + Seek = BufWriter<File>> {
    path: PathBuf,
    mcap: mcap::Writer<W>,
    channels: Channels,
    bytes: Vec<u8>,
    newest_ms: f64,
    chunk_began_ms: f64,
    next_view_ms: f64,
    next_second_view_ms: f64,
    sequences: [u32; CHANNELS],
}

/// Number of channels.
const CHANNELS: usize = 9;
/// Name of the message of scores.
const SCORE: &str = "trepan.Score";

/// Channel ids.
struct Channels {
    tick: u16,
    collision: u16,
    solver: u16,
    event: u16,
    tool: u16,
    log: u16,
    second: u16,
    /// Added with the first scores, whose names it has.
    score: Option<u16>,
}

impl Recorder {
    /// Creates or truncates the file, and writes the header.
    pub fn create(path: &Path, header: &SessionHeader) -> Result<Self, LinkError> {
        let file = File::create(path).map_err(|source| LinkError::Create { path: path.to_owned(), source })?;
        Self::to(BufWriter::new(file), path, header)
    }
}

impl<W: Write + Seek> Recorder<W> {
    /// Records into any stream; `path` is only used in error messages.
    pub fn to(stream: W, path: &Path, header: &SessionHeader) -> Result<Self, LinkError> {
        let failed = |error: McapError| write_error(path, &error);
        let mut mcap = options().create(stream).map_err(failed)?;
        mcap.write_metadata(&metadata(header)).map_err(failed)?;
        let channels = Channels::add_to(&mut mcap).map_err(failed)?;
        mcap.flush().map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            mcap,
            channels,
            bytes: Vec::with_capacity(512),
            newest_ms: 0.0,
            chunk_began_ms: 0.0,
            next_view_ms: f64::NEG_INFINITY,
            next_second_view_ms: f64::NEG_INFINITY,
            sequences: [0; CHANNELS],
        })
    }

    /// Records a haptic tick.
    pub fn tick(&mut self, record: &TickRecord) -> Result<(), LinkError> {
        self.advance(record.time_ms)?;
        if record.time_ms >= self.next_view_ms {
            self.next_view_ms = record.time_ms + VIEW_PERIOD_MS;
            let time_ns = nanoseconds(record.time_ms);
            self.foxglove(self.channels.tool, &viewer::frame(&record.device, "device", time_ns))?;
            self.foxglove(self.channels.tool, &viewer::frame(&record.proxy, "tool", time_ns))?;
        }
        self.message(self.channels.tick, record)
    }

    /// Records a tick of the second hand.
    pub fn second(&mut self, record: &SecondRecord) -> Result<(), LinkError> {
        self.advance(record.time_ms)?;
        if record.time_ms >= self.next_second_view_ms {
            self.next_second_view_ms = record.time_ms + VIEW_PERIOD_MS;
            let time_ns = nanoseconds(record.time_ms);
            self.foxglove(self.channels.tool, &viewer::frame(&record.proxy, "second_tool", time_ns))?;
        }
        self.message(self.channels.second, record)
    }

    /// Records a collision step, at the session time of the latest tick.
    pub fn collision(&mut self, record: &CollisionRecord) -> Result<(), LinkError> {
        self.message(self.channels.collision, record)
    }

    /// Records a solver step, at the session time of the latest tick.
    pub fn solver(&mut self, record: &SolverRecord) -> Result<(), LinkError> {
        self.message(self.channels.solver, record)
    }

    /// Records an event.
    pub fn event(&mut self, record: &EventRecord) -> Result<(), LinkError> {
        self.advance(record.time_ms)?;
        self.foxglove(self.channels.log, &viewer::log(record, nanoseconds(record.time_ms)))?;
        self.message(self.channels.event, record)
    }

    /// Records the state that a session begins with: what another session had done before.
    pub fn state(&mut self, record: &StateRecord) -> Result<(), LinkError> {
        let channel = own_channel::<StateRecord, W>(&mut self.mcap, "/state");
        self.message(channel.map_err(|error| write_error(&self.path, &error))?, record)
    }

    /// Records the present scores by name. The names of the first call count; later calls give
    /// their values in the same order.
    pub fn scores(&mut self, tick: u64, time_ms: f64, scores: &[(String, f64)]) -> Result<(), LinkError> {
        self.advance(time_ms)?;
        let channel = match self.channels.score {
            Some(channel) => channel,
            None => {
                let names: Vec<String> = scores.iter().map(|(name, _)| name.clone()).collect();
                let added = score_channel(&mut self.mcap, &names).map_err(|error| write_error(&self.path, &error))?;
                *self.channels.score.insert(added)
            }
        };
        self.bytes.clear();
        encode_numbers(tick, time_ms, scores.iter().map(|(_, value)| *value), &mut self.bytes);
        self.write(channel)
    }

    /// Closes the open chunk and hands everything to the operating system.
    pub fn flush(&mut self) -> Result<(), LinkError> {
        self.chunk_began_ms = self.newest_ms;
        self.mcap.flush().map_err(|error| write_error(&self.path, &error))
    }

    /// Writes the index and closes the file.
    pub fn finish(mut self) -> Result<(), LinkError> {
        self.mcap.finish().map_err(|error| write_error(&self.path, &error))?;
        self.mcap.into_inner().flush().map_err(|error| write_error(&self.path, &McapError::Io(error)))
    }

    /// Advances the session time and closes a chunk that spans enough of it.
    fn advance(&mut self, time_ms: f64) -> Result<(), LinkError> {
        if time_ms.is_finite() {
            self.newest_ms = self.newest_ms.max(time_ms);
        }
        if self.newest_ms - self.chunk_began_ms >= MAX_CHUNK_MS { self.flush() } else { Ok(()) }
    }

    fn message<T: Fields>(&mut self, channel: u16, record: &T) -> Result<(), LinkError> {
        self.bytes.clear();
        encode(record, &mut self.bytes);
        self.write(channel)
    }

    fn foxglove<T: Encode>(&mut self, channel: u16, message: &T) -> Result<(), LinkError> {
        self.bytes.clear();
        message
            .encode(&mut self.bytes)
            .map_err(|error| LinkError::Write { path: self.path.clone(), reason: error.to_string() })?;
        self.write(channel)
    }

    /// Writes `self.bytes`.
    fn write(&mut self, channel: u16) -> Result<(), LinkError> {
        let sequence = &mut self.sequences[usize::from(channel - 1) % CHANNELS];
        let time_ns = nanoseconds(self.newest_ms);
        let header =
            MessageHeader { channel_id: channel, sequence: *sequence, log_time: time_ns, publish_time: time_ns };
        *sequence = sequence.wrapping_add(1);
        self.mcap.write_to_known_channel(&header, &self.bytes).map_err(|error| write_error(&self.path, &error))
    }
}

impl Channels {
    fn add_to<W: Write + Seek>(mcap: &mut mcap::Writer<W>) -> Result<Self, McapError> {
        Ok(Self {
            tick: own_channel::<TickRecord, W>(mcap, "/tick")?,
            collision: own_channel::<CollisionRecord, W>(mcap, "/collision")?,
            solver: own_channel::<SolverRecord, W>(mcap, "/solver")?,
            event: own_channel::<EventRecord, W>(mcap, "/event")?,
            tool: foxglove_channel::<foxglove::messages::FrameTransform, W>(mcap, "/tool")?,
            log: foxglove_channel::<foxglove::messages::Log, W>(mcap, "/log")?,
            second: own_channel::<SecondRecord, W>(mcap, "/second")?,
            score: None,
        })
    }
}

/// Chunks are built in memory and written as a whole, so that a cut never leaves a chunk of unknown
/// length.
pub(crate) fn options() -> WriteOptions {
    WriteOptions::new()
        .compression(Some(Compression::Lz4))
        .chunk_size(Some(MAX_CHUNK_BYTES))
        .disable_seeking(true)
        .profile(PROFILE)
        .library(concat!("trepan-link ", env!("CARGO_PKG_VERSION")))
}

fn own_channel<T: Fields, W: Write + Seek>(mcap: &mut mcap::Writer<W>, topic: &str) -> Result<u16, McapError> {
    let schema = mcap.add_schema(T::NAME, "protobuf", &file_descriptor_set::<T>())?;
    mcap.add_channel(schema, topic, "protobuf", &BTreeMap::new())
}

fn score_channel<W: Write + Seek>(mcap: &mut mcap::Writer<W>, names: &[String]) -> Result<u16, McapError> {
    let schema = mcap.add_schema(SCORE, "protobuf", &numbers_descriptor_set(SCORE, names))?;
    mcap.add_channel(schema, "/score", "protobuf", &BTreeMap::new())
}

fn foxglove_channel<T: Encode, W: Write + Seek>(mcap: &mut mcap::Writer<W>, topic: &str) -> Result<u16, McapError> {
    let schema = match T::get_schema() {
        Some(schema) => mcap.add_schema(&schema.name, &schema.encoding, &schema.data)?,
        None => 0,
    };
    mcap.add_channel(schema, topic, &T::get_message_encoding(), &BTreeMap::new())
}

pub(crate) fn metadata(header: &SessionHeader) -> Metadata {
    // Serialising a struct of strings and maps of strings cannot fail.
    let json = serde_json::to_string(header).unwrap_or_default();
    let entries = [(FORMAT_KEY.to_owned(), FORMAT.to_string()), (HEADER_KEY.to_owned(), json)];
    Metadata { name: HEADER_NAME.to_owned(), metadata: BTreeMap::from(entries) }
}

/// Session time in MCAP's unit; NaN and negative times become 0.
fn nanoseconds(time_ms: f64) -> u64 {
    (time_ms * 1e6) as u64
}

pub(crate) fn write_error(path: &Path, error: &McapError) -> LinkError {
    let reason = match error {
        McapError::Io(error) => error.to_string(),
        McapError::AttemptedWriteAfterFailure => "an earlier write failed".to_owned(),
        other => other.to_string(),
    };
    LinkError::Write { path: path.to_owned(), reason }
}
