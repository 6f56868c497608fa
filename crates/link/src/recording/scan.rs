//! Parses MCAP records with every length checked.
//!
//! # Sources
//! <https://mcap.dev/spec#records>. The `mcap` crate has these parsers too, but some trust lengths.

use super::Recording;
use crate::protobuf::{Fields, decode};
use crate::wire::{CollisionRecord, EventRecord, SecondRecord, SolverRecord, StateRecord, TickRecord};

/// The unread bytes.
#[derive(Clone, Copy)]
pub(super) struct Cursor<'a>(pub &'a [u8]);

/// A record in the file.
pub(super) struct Record<'a> {
    pub opcode: u8,
    pub body: &'a [u8],
    /// Opcode, length and body.
    pub whole: &'a [u8],
}

/// The record type of a channel's messages.
#[derive(Clone, Copy, Default)]
pub(super) enum Topic {
    Tick,
    Second,
    Collision,
    Solver,
    Event,
    State,
    /// Not used by a session.
    #[default]
    Other,
}

impl Topic {
    fn of_schema(name: &str) -> Self {
        match name {
            TickRecord::NAME => Self::Tick,
            SecondRecord::NAME => Self::Second,
            CollisionRecord::NAME => Self::Collision,
            SolverRecord::NAME => Self::Solver,
            EventRecord::NAME => Self::Event,
            StateRecord::NAME => Self::State,
            _ => Self::Other,
        }
    }

    pub(super) fn is_tick(self) -> bool {
        matches!(self, Self::Tick)
    }

    pub(super) fn read_into(self, message: &[u8], recording: &mut Recording) -> Option<()> {
        match self {
            Self::Tick => recording.ticks.push(decode(message)?),
            Self::Second => recording.second.push(decode(message)?),
            Self::Collision => recording.collisions.push(decode(message)?),
            Self::Solver => recording.solver.push(decode(message)?),
            Self::Event => recording.events.push(decode(message)?),
            Self::State => recording.state = Some(decode(message)?),
            Self::Other => {}
        }
        Some(())
    }
}

/// Message count of a channel in the index.
pub(super) struct MessageCount {
    pub channel: u16,
    pub messages: u64,
}

/// Length of the footer record before the final magic.
const FOOTER_BYTES: usize = 29;

/// The records of a file's index; `None` if it is missing or its checksum fails.
pub(super) fn index(bytes: &[u8]) -> Option<impl Iterator<Item = Record<'_>>> {
    let body = bytes.strip_suffix(mcap::MAGIC)?;
    let footer_at = body.len().checked_sub(FOOTER_BYTES)?;
    let footer = Cursor(&body[footer_at..]).record().filter(|record| record.opcode == mcap::records::op::FOOTER)?;
    let mut fields = Cursor(footer.body);
    let (start, _offsets, crc) = (usize::try_from(fields.u64()?).ok()?, fields.u64()?, fields.u32()?);
    let mut records = Cursor(body.get(start..footer_at).filter(|records| !records.is_empty())?);
    let sound = crc == 0 || crc == crc32fast::hash(&body[start..body.len() - size_of::<u32>()]);
    sound.then(|| std::iter::from_fn(move || records.record()))
}

impl<'a> Cursor<'a> {
    pub(super) fn record(&mut self) -> Option<Record<'a>> {
        let start = self.0;
        let opcode = self.u8()?;
        let length = usize::try_from(self.u64()?).ok()?;
        let body = self.take(length)?;
        Some(Record { opcode, body, whole: &start[..start.len() - self.0.len()] })
    }

    /// Parses a schema: id and record type.
    pub(super) fn schema(mut self) -> Option<(u16, Topic)> {
        let id = self.u16()?;
        Some((id, Topic::of_schema(self.text()?)))
    }

    /// Parses a channel: its id and its schema's.
    pub(super) fn channel(mut self) -> Option<(u16, u16)> {
        Some((self.u16()?, self.u16()?))
    }

    /// Parses a message: its channel and data.
    pub(super) fn message(mut self) -> Option<(u16, &'a [u8])> {
        let channel = self.u16()?;
        let (_sequence, _log_time, _publish_time) = (self.u32()?, self.u64()?, self.u64()?);
        Some((channel, self.0))
    }

    /// Parses a metadata record: its name and entries.
    pub(super) fn metadata(mut self) -> Option<(&'a str, Vec<(&'a str, &'a str)>)> {
        Some((self.text()?, self.map()?))
    }

    /// Parses pairs of strings, preceded by their length in bytes.
    pub(super) fn map(&mut self) -> Option<Vec<(&'a str, &'a str)>> {
        let length = usize::try_from(self.u32()?).ok()?;
        let mut map = Cursor(self.take(length)?);
        let mut entries = Vec::new();
        while !map.0.is_empty() {
            entries.push((map.text()?, map.text()?));
        }
        Some(entries)
    }

    /// Parses a statistics record: number of messages of each channel.
    pub(super) fn message_counts(mut self) -> Option<Vec<MessageCount>> {
        // Messages, schemas, channels, attachments, metadata, chunks, first and last time.
        self.take(8 + 2 + 4 * 4 + 2 * 8)?;
        let length = usize::try_from(self.u32()?).ok()?;
        let mut map = Cursor(self.take(length)?);
        let mut counts = Vec::new();
        while !map.0.is_empty() {
            counts.push(MessageCount { channel: map.u16()?, messages: map.u64()? });
        }
        Some(counts)
    }

    /// Unpacked size stated by a chunk.
    pub(super) fn chunk_size(mut self) -> Option<u64> {
        let (_start, _end) = (self.u64()?, self.u64()?);
        self.u64()
    }

    /// Name of a chunk's compression; empty for none.
    pub(super) fn compression(&self) -> Option<&'a str> {
        // After first and last time, unpacked size and checksum.
        Cursor(self.0.get(3 * 8 + 4..)?).text()
    }

    /// A chunk's compression, and whether its records fill the rest of it.
    pub(super) fn packed(mut self) -> Option<(&'a str, bool)> {
        let name = self.compression()?;
        self.take(3 * 8 + 4 + 4 + name.len())?;
        let records = self.u64()?;
        Some((name, records == self.0.len() as u64))
    }

    pub(super) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (head, tail) = self.0.split_at_checked(count)?;
        self.0 = tail;
        Some(head)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    fn u8(&mut self) -> Option<u8> {
        self.array().map(u8::from_le_bytes)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn text(&mut self) -> Option<&'a str> {
        let length = usize::try_from(self.u32()?).ok()?;
        str::from_utf8(self.take(length)?).ok()
    }
}
