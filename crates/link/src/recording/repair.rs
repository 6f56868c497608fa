//! Repairs a cut or damaged file, so that other programs open it too.
//!
//! # Practice
//! Every valid chunk is copied message by message, with its times, topics and schemas, also after a
//! damaged one; the index is rebuilt. [`crate::Recording::losses`] of the repaired file reports the
//! gaps and the earlier losses.

use super::scan::{Cursor, Record, index};
use super::{Recording, chunk};
use crate::LinkError;
use crate::recorder::{LOSSES_KEY, REPAIR_NAME, options, write_error};
use mcap::McapError;
use mcap::records::{Channel, MessageHeader, Metadata, SchemaHeader, op};
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;

/// Result of a repair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Repaired {
    /// Messages copied, of all topics.
    pub messages: u64,
    /// Whether the file was complete except for its index.
    pub was_whole: bool,
}

/// Copies the valid parts of the recording `from` to the new file `to`, atomically. A recording of
/// which no tick can be saved is an error, and nothing is written.
pub fn repair(from: &Path, to: &Path) -> Result<Repaired, LinkError> {
    let bytes = super::bytes_of(from)?;
    let body = bytes.strip_prefix(mcap::MAGIC).ok_or_else(|| LinkError::NotARecording { path: from.to_owned() })?;
    if from.canonicalize().ok().is_some_and(|same| to.canonicalize().is_ok_and(|to| to == same)) {
        return Err(LinkError::SameFile { path: to.to_owned() });
    }
    let failed = |error: McapError| write_error(to, &error);
    let mcap = options().create(io::Cursor::new(Vec::new())).map_err(failed)?;
    let mut copy = Copy { mcap, messages: 0 };
    // If the chunk with the topics is damaged, the index has them too.
    for record in index(&bytes).into_iter().flatten().filter(|r| matches!(r.opcode, op::SCHEMA | op::CHANNEL)) {
        copy.record(record.opcode, record.body).map_err(failed)?;
    }
    let was_whole = copy.walk(body, chunk::budget(bytes.len())).map_err(failed)?;
    if let Some(losses) = Recording::of_bytes(&bytes, from)?.losses() {
        let metadata = [(LOSSES_KEY.to_owned(), losses)].into();
        copy.mcap.write_metadata(&Metadata { name: REPAIR_NAME.to_owned(), metadata }).map_err(failed)?;
    }
    copy.mcap.finish().map_err(failed)?;
    let copied = copy.mcap.into_inner().into_inner();
    if Recording::of_bytes(&copied, from)?.ticks.is_empty() {
        return Err(LinkError::NothingToSave { path: from.to_owned() });
    }
    whole_file(to, &copied)?;
    Ok(Repaired { messages: copy.messages, was_whole })
}

/// Writes a file atomically.
fn whole_file(path: &Path, bytes: &[u8]) -> Result<(), LinkError> {
    let failed = |source| LinkError::Create { path: path.to_owned(), source };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    file.write_all(bytes).map_err(|error| write_error(path, &McapError::Io(error)))?;
    file.persist(path).map(drop).map_err(|error| failed(error.error))
}

struct Copy {
    mcap: mcap::Writer<io::Cursor<Vec<u8>>>,
    messages: u64,
}

impl Copy {
    /// Copies records up to the regular end, skipping damaged ones; returns whether there were
    /// none.
    fn walk(&mut self, body: &[u8], mut budget: u64) -> Result<bool, McapError> {
        let (mut rest, mut whole) = (Cursor(body), true);
        loop {
            let here = rest.0;
            let sound = match rest.record().filter(|record| KNOWN.contains(&record.opcode)) {
                Some(record) if record.opcode == op::DATA_END => return Ok(whole),
                Some(record) if record.opcode == op::CHUNK => self.chunk(&record, &mut budget)?,
                Some(record) => self.record(record.opcode, record.body).map(|()| true)?,
                None => false,
            };
            if !sound {
                whole = false;
                let Some(next) = here.get(1..).and_then(next_chunk) else { return Ok(whole) };
                rest = Cursor(next);
            }
        }
    }

    /// Copies all of a chunk, or nothing and returns false: its checksum is known only at its end.
    fn chunk(&mut self, chunk: &Record<'_>, budget: &mut u64) -> Result<bool, McapError> {
        let (mut records, mut left) = (Vec::new(), *budget);
        let sound = chunk::unpack(chunk, &mut left, |opcode, body| {
            records.push((opcode, body.to_vec()));
            Some(())
        });
        if sound.is_none() {
            return Ok(false);
        }
        *budget = left;
        for (opcode, body) in &records {
            self.record(*opcode, body)?;
        }
        self.mcap.flush()?;
        Ok(true)
    }

    /// Copies one record; skips it if damaged or useless without its position.
    fn record(&mut self, opcode: u8, body: &[u8]) -> Result<(), McapError> {
        let body = Cursor(body);
        match opcode {
            op::SCHEMA => {
                let Some((SchemaHeader { id, name, encoding }, data)) = body.whole_schema() else { return Ok(()) };
                tolerate(self.mcap.add_schema_with_id(id, &name, &encoding, data))
            }
            op::CHANNEL => {
                let Some(Channel { id, schema_id, topic, message_encoding, metadata }) = body.whole_channel() else {
                    return Ok(());
                };
                tolerate(self.mcap.add_channel_with_id(id, schema_id, &topic, &message_encoding, &metadata))
            }
            op::MESSAGE => {
                let Some((header, data)) = body.whole_message() else { return Ok(()) };
                self.messages += 1;
                tolerate(self.mcap.write_to_known_channel(&header, data))
            }
            op::METADATA => {
                let Some((name, entries)) = body.metadata().filter(|(name, _)| *name != REPAIR_NAME) else {
                    return Ok(());
                };
                self.mcap.write_metadata(&Metadata { name: name.to_owned(), metadata: owned(entries) })
            }
            _ => Ok(()),
        }
    }
}

/// Opcodes of MCAP's records.
const KNOWN: std::ops::RangeInclusive<u8> = op::HEADER..=op::DATA_END;

/// The bytes from the next likely start of a chunk.
pub(super) fn next_chunk(bytes: &[u8]) -> Option<&[u8]> {
    let starts = bytes.iter().enumerate().filter(|(_, byte)| **byte == op::CHUNK).map(|(at, _)| &bytes[at..]);
    starts.into_iter().find(|rest| Cursor(rest).record().is_some_and(|record| chunk::is_likely(&record)))
}

/// Passes on write errors only; records that contradict others are skipped.
fn tolerate<T>(result: Result<T, McapError>) -> Result<(), McapError> {
    match result {
        Err(error @ (McapError::Io(_) | McapError::AttemptedWriteAfterFailure)) => Err(error),
        _ => Ok(()),
    }
}

fn owned(entries: Vec<(&str, &str)>) -> BTreeMap<String, String> {
    entries.into_iter().map(|(key, value)| (key.to_owned(), value.to_owned())).collect()
}

impl<'a> Cursor<'a> {
    fn whole_schema(mut self) -> Option<(SchemaHeader, &'a [u8])> {
        let header = SchemaHeader { id: self.u16()?, name: self.text()?.to_owned(), encoding: self.text()?.to_owned() };
        let length = usize::try_from(self.u32()?).ok()?;
        Some((header, self.take(length)?))
    }

    fn whole_channel(mut self) -> Option<Channel> {
        Some(Channel {
            id: self.u16()?,
            schema_id: self.u16()?,
            topic: self.text()?.to_owned(),
            message_encoding: self.text()?.to_owned(),
            metadata: owned(self.map()?),
        })
    }

    fn whole_message(mut self) -> Option<(MessageHeader, &'a [u8])> {
        let (channel_id, sequence) = (self.u16()?, self.u32()?);
        let (log_time, publish_time) = (self.u64()?, self.u64()?);
        Some((MessageHeader { channel_id, sequence, log_time, publish_time }, self.0))
    }
}
