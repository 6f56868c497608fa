//! Makes a sound file of a cut one, so that other programs open it too.
//!
//! # Practice
//! Every complete chunk is copied message by message, with its times, topics and schemas; the index is made anew. What
//! [`crate::Recording`] reads from the repaired file is what it reads from the cut one.

use super::chunk;
use super::scan::Cursor;
use crate::LinkError;
use crate::recorder::{options, write_error};
use mcap::McapError;
use mcap::records::{MessageHeader, Metadata, op};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// What a repair found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Repaired {
    /// Messages copied, of all topics.
    pub messages: u64,
    /// Whether the file was whole already.
    pub was_whole: bool,
}

/// Copies what is sound of the recording `from` to the new file `to`.
pub fn repair(from: &Path, to: &Path) -> Result<Repaired, LinkError> {
    let bytes = super::bytes_of(from)?;
    let body = bytes.strip_prefix(mcap::MAGIC).ok_or_else(|| LinkError::NotARecording { path: from.to_owned() })?;
    if from.canonicalize().ok().is_some_and(|same| to.canonicalize().is_ok_and(|to| to == same)) {
        return Err(LinkError::SameFile { path: to.to_owned() });
    }
    let file = File::create(to).map_err(|source| LinkError::Create { path: to.to_owned(), source })?;
    let failed = |error: McapError| write_error(to, &error);
    let mut copy = Copy { mcap: options().create(BufWriter::new(file)).map_err(failed)?, messages: 0 };
    let was_whole = copy.walk(body, chunk::budget(bytes.len())).map_err(failed)?;
    copy.mcap.finish().map_err(failed)?;
    copy.mcap.into_inner().flush().map_err(|error| failed(McapError::Io(error)))?;
    Ok(Repaired { messages: copy.messages, was_whole })
}

struct Copy {
    mcap: mcap::Writer<BufWriter<File>>,
    messages: u64,
}

impl Copy {
    /// Copies records up to the regular end (true) or to where the bytes end or make no sense (false).
    fn walk(&mut self, body: &[u8], mut budget: u64) -> Result<bool, McapError> {
        let mut rest = Cursor(body);
        while let Some(record) = rest.record() {
            match record.opcode {
                op::DATA_END => return Ok(true),
                op::CHUNK => {
                    // All of a chunk or nothing: its checksum is known at its end.
                    let mut records = Vec::new();
                    let sound = chunk::unpack(&record, &mut budget, |opcode, body| {
                        records.push((opcode, body.to_vec()));
                        Some(())
                    });
                    if sound.is_none() {
                        return Ok(false);
                    }
                    for (opcode, body) in &records {
                        self.record(*opcode, body)?;
                    }
                    self.mcap.flush()?;
                }
                opcode => self.record(opcode, record.body)?,
            }
        }
        Ok(false)
    }

    /// Copies one record; passes over what is damaged or of no use without its place.
    fn record(&mut self, opcode: u8, body: &[u8]) -> Result<(), McapError> {
        let body = Cursor(body);
        match opcode {
            op::SCHEMA => {
                let Some(schema) = body.whole_schema() else { return Ok(()) };
                tolerate(self.mcap.add_schema_with_id(schema.id, schema.name, schema.encoding, schema.data))
            }
            op::CHANNEL => {
                let Some(channel) = body.whole_channel() else { return Ok(()) };
                let metadata = channel.metadata.into_iter().map(|(k, v)| (k.to_owned(), v.to_owned())).collect();
                let (id, schema) = (channel.id, channel.schema);
                tolerate(self.mcap.add_channel_with_id(id, schema, channel.topic, channel.encoding, &metadata))
            }
            op::MESSAGE => {
                let Some((header, data)) = body.whole_message() else { return Ok(()) };
                self.messages += 1;
                tolerate(self.mcap.write_to_known_channel(&header, data))
            }
            op::METADATA => {
                let Some((name, entries)) = body.metadata() else { return Ok(()) };
                let metadata = entries.into_iter().map(|(k, v)| (k.to_owned(), v.to_owned())).collect();
                self.mcap.write_metadata(&Metadata { name: name.to_owned(), metadata })
            }
            _ => Ok(()),
        }
    }
}

/// Only a failure to write ends a repair; a record that contradicts others is left out.
fn tolerate<T>(result: Result<T, McapError>) -> Result<(), McapError> {
    match result {
        Err(error @ (McapError::Io(_) | McapError::AttemptedWriteAfterFailure)) => Err(error),
        _ => Ok(()),
    }
}

/// A schema record.
pub(super) struct Schema<'a> {
    pub id: u16,
    pub name: &'a str,
    pub encoding: &'a str,
    pub data: &'a [u8],
}

/// A channel record.
pub(super) struct Channel<'a> {
    pub id: u16,
    pub schema: u16,
    pub topic: &'a str,
    pub encoding: &'a str,
    pub metadata: Vec<(&'a str, &'a str)>,
}

impl<'a> Cursor<'a> {
    fn whole_schema(mut self) -> Option<Schema<'a>> {
        let (id, name, encoding) = (self.u16()?, self.text()?, self.text()?);
        let length = usize::try_from(self.u32()?).ok()?;
        Some(Schema { id, name, encoding, data: self.take(length)? })
    }

    fn whole_channel(mut self) -> Option<Channel<'a>> {
        let (id, schema) = (self.u16()?, self.u16()?);
        Some(Channel { id, schema, topic: self.text()?, encoding: self.text()?, metadata: self.map()? })
    }

    fn whole_message(mut self) -> Option<(MessageHeader, &'a [u8])> {
        let (channel_id, sequence) = (self.u16()?, self.u32()?);
        let (log_time, publish_time) = (self.u64()?, self.u64()?);
        Some((MessageHeader { channel_id, sequence, log_time, publish_time }, self.0))
    }
}
