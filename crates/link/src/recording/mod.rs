//! Reads a session file, complete, cut or damaged at any byte, bit for bit.
//!
//! # Practice
//! The file is parsed record by record from its start; the index at its end is not needed. A chunk
//! is accepted if it is complete, its checksum is valid and every message in it decodes. Reading
//! stops before the first one that is not, and [`Recording::damage`] reports it.
//! [`Recording::losses`] also reports ticks missing between those read. Everything is kept in
//! memory, about 250 B a tick: 15 MB a minute at 1 kHz. Memory stays in proportion to the file's
//! size whatever its contents.

mod chunk;
mod losses;
mod repair;
mod scan;
mod scene;
mod stream;

pub use losses::Damage;
pub use repair::{Repaired, repair};
pub use scene::{NODE_STEP_MM, SceneChange, SceneRecord, SceneWriter, read_scene};
pub use stream::{Streamed, stream};

use crate::LinkError;
use crate::recorder::{FORMAT, FORMAT_KEY, HEADER_KEY, HEADER_NAME, LOSSES_KEY, REPAIR_NAME};
use crate::wire::{CollisionRecord, EventRecord, SecondRecord, SessionHeader, SolverRecord, StateRecord, TickRecord};
use scan::{Cursor, Topic};
use std::collections::HashMap;
use std::path::Path;

/// A session read from a file.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Description of the session.
    pub header: SessionHeader,
    /// Haptic ticks in the order in which they were recorded.
    pub ticks: Vec<TickRecord>,
    /// Ticks of the second hand, if any.
    pub second: Vec<SecondRecord>,
    /// Collision steps.
    pub collisions: Vec<CollisionRecord>,
    /// Solver steps.
    pub solver: Vec<SolverRecord>,
    /// Events.
    pub events: Vec<EventRecord>,
    /// What the session began with, if it joined another; `None` for one that began at rest.
    pub state: Option<StateRecord>,
    /// Damage of the file; the records are those before it. `None` for a complete file.
    pub damage: Option<Damage>,
    /// Losses before the file was repaired; `None` if it never was.
    pub repaired: Option<String>,
    /// Whether the file ends with a valid index, which other programs require.
    pub indexed: bool,
    /// Compression of its last chunk; empty for none.
    pub compression: String,
}

impl Recording {
    /// Reads a file.
    pub fn open(path: &Path) -> Result<Self, LinkError> {
        Self::of_bytes(&bytes_of(path)?, path)
    }

    /// Reads a recording in memory; `path` is only used in error messages.
    pub fn of_bytes(bytes: &[u8], path: &Path) -> Result<Self, LinkError> {
        let Some(body) = bytes.strip_prefix(mcap::MAGIC) else {
            return Err(LinkError::NotARecording { path: path.to_owned() });
        };
        let mut reading = Reading { budget: chunk::budget(bytes.len()), ..Reading::default() };
        let end = reading.walk(body);
        let header = reading.header(path);
        if let Some(found) =
            reading.foreign.filter(|_| reading.recording.ticks.is_empty() && repair::next_chunk(body).is_none())
        {
            return Err(LinkError::Compression { path: path.to_owned(), found });
        }
        let header = header?;
        let damage = Damage::of(bytes, end, reading.recording.ticks.len() as u64);
        Ok(Self { header, damage, indexed: scan::index(bytes).is_some(), ..reading.recording })
    }

    /// Number of records of each kind, for a rewind.
    fn mark(&self) -> [usize; 5] {
        [self.ticks.len(), self.collisions.len(), self.solver.len(), self.events.len(), self.second.len()]
    }

    fn rewind(&mut self, mark: [usize; 5]) {
        self.ticks.truncate(mark[0]);
        self.collisions.truncate(mark[1]);
        self.solver.truncate(mark[2]);
        self.events.truncate(mark[3]);
        self.second.truncate(mark[4]);
    }
}

/// The bytes of a regular file. A pipe or a device has no end, and opening it could block.
fn bytes_of(path: &Path) -> Result<Vec<u8>, LinkError> {
    let kind = std::fs::metadata(path).map(|kind| kind.is_file());
    let bytes = match kind {
        Ok(false) => Err(std::io::Error::other("it is not a regular file")),
        Ok(true) => std::fs::read(path),
        Err(fault) => Err(fault),
    };
    bytes.map_err(|source| LinkError::Read { path: path.to_owned(), source })
}

/// A partly read file.
#[derive(Default)]
struct Reading {
    header: Option<(u32, SessionHeader)>,
    recording: Recording,
    schemas: HashMap<u16, Topic>,
    channels: HashMap<u16, Topic>,
    /// Remaining limit of unpacked bytes.
    budget: u64,
    /// Compression of a chunk that is not read.
    foreign: Option<String>,
}

impl Reading {
    /// Takes a header that this version reads; an error if there is none.
    fn header(&self, path: &Path) -> Result<SessionHeader, LinkError> {
        match &self.header {
            None => Err(LinkError::NoHeader { path: path.to_owned() }),
            Some((format, _)) if *format > FORMAT => {
                Err(LinkError::TooNew { path: path.to_owned(), found: *format, known: FORMAT })
            }
            Some((_, header)) => Ok(header.clone()),
        }
    }

    /// Reads records up to the regular end; `Err` if the bytes end or are invalid before it. Both
    /// contain the byte position.
    fn walk(&mut self, body: &[u8]) -> Result<usize, usize> {
        use mcap::records::op;
        let mut rest = Cursor(body);
        loop {
            let at = mcap::MAGIC.len() + body.len() - rest.0.len();
            let record = rest.record().ok_or(at)?;
            match record.opcode {
                op::CHUNK => {
                    let mark = self.recording.mark();
                    if self.chunk(&record).is_none() {
                        self.foreign = chunk::foreign_compression(&record).map(str::to_owned);
                        self.recording.rewind(mark);
                        return Err(at);
                    }
                }
                op::DATA_END => return Ok(at),
                _ => self.record(record.opcode, record.body).ok_or(at)?,
            }
        }
    }

    fn chunk(&mut self, record: &scan::Record<'_>) -> Option<()> {
        let mut budget = self.budget;
        chunk::unpack(record, &mut budget, |opcode, body| self.record(opcode, body))?;
        self.budget = budget;
        self.recording.compression = Cursor(record.body).compression().unwrap_or_default().into();
        Some(())
    }

    /// Processes a record other than a chunk; unused kinds are skipped.
    fn record(&mut self, opcode: u8, body: &[u8]) -> Option<()> {
        use mcap::records::op;
        match opcode {
            op::METADATA => self.metadata(Cursor(body)),
            op::SCHEMA => {
                let (id, topic) = Cursor(body).schema()?;
                self.schemas.insert(id, topic);
                Some(())
            }
            op::CHANNEL => {
                let (id, schema) = Cursor(body).channel()?;
                self.channels.insert(id, self.schemas.get(&schema).copied().unwrap_or_default());
                Some(())
            }
            op::MESSAGE => {
                let (channel, message) = Cursor(body).message()?;
                let topic = *self.channels.get(&channel)?;
                topic.read_into(message, &mut self.recording)
            }
            _ => Some(()),
        }
    }

    fn metadata(&mut self, body: Cursor<'_>) -> Option<()> {
        let (name, entries) = body.metadata()?;
        let value = |key| entries.iter().find(|(k, _)| *k == key).map(|(_, v)| *v);
        if name == REPAIR_NAME {
            self.recording.repaired = value(LOSSES_KEY).map(str::to_owned);
        }
        if name == HEADER_NAME {
            self.header = Some((value(FORMAT_KEY)?.parse().ok()?, serde_json::from_str(value(HEADER_KEY)?).ok()?));
        }
        Some(())
    }
}
