//! Reads a recording chunk by chunk, so that memory does not grow with its length.

use super::chunk::MAX_CHUNK_BYTES;
use super::scan::Cursor;
use super::{Reading, Recording};
use crate::LinkError;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

/// Length of a record's opcode and length.
const HEAD_BYTES: usize = 9;

/// How much of a file was read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Streamed {
    /// Haptic ticks that were read.
    pub ticks: u64,
    /// Numbers missing between ticks that were read.
    pub missing: u64,
    /// The byte at which the file is cut or damaged, if it is; what follows was not read.
    pub cut_at: Option<u64>,
}

impl Streamed {
    /// Describes what is missing; `None` for a whole file.
    pub fn losses(&self) -> Option<String> {
        let cut = self.cut_at.map(|at| format!("it is cut or damaged at byte {at}; {} ticks can be read", self.ticks));
        let gaps = (self.missing > 0).then(|| format!("{} ticks are missing between them", self.missing));
        let losses: Vec<String> = cut.into_iter().chain(gaps).collect();
        (!losses.is_empty()).then(|| losses.join("; "))
    }
}

/// Calls `each` with the header and the records of every whole chunk, in the order of the file, up
/// to the first damage.
pub fn stream<E: From<LinkError>>(
    path: &Path,
    mut each: impl FnMut(&Recording) -> Result<(), E>,
) -> Result<Streamed, E> {
    let failed = |source| LinkError::Read { path: path.to_owned(), source };
    let kind = std::fs::metadata(path).map_err(failed)?;
    if !kind.is_file() {
        return Err(failed(std::io::Error::other("it is not a regular file")).into());
    }
    let mut file = BufReader::new(File::open(path).map_err(failed)?);
    let mut magic = Vec::new();
    file.by_ref().take(mcap::MAGIC.len() as u64).read_to_end(&mut magic).map_err(failed)?;
    if magic != mcap::MAGIC {
        return Err(LinkError::NotARecording { path: path.to_owned() }.into());
    }
    let mut reading = Reading { budget: u64::MAX, ..Reading::default() };
    let (mut streamed, mut next, mut record) = (Streamed::default(), None::<u64>, Vec::new());
    loop {
        let at = file.stream_position().map_err(failed)?;
        let end = read_record(&mut file, &mut record).map_err(failed)?;
        if end == Some(false) {
            continue;
        }
        let read = end.and_then(|_| reading.whole_record(&record));
        if read != Some(true) {
            streamed.cut_at = read.is_none().then_some(at);
            break;
        }
        if reading.recording.is_empty() {
            continue;
        }
        reading.recording.header = reading.header(path)?;
        for tick in reading.recording.ticks.iter().map(|tick| tick.tick) {
            streamed.missing += tick.saturating_sub(next.unwrap_or(tick));
            next = Some(tick.saturating_add(1));
        }
        streamed.ticks += reading.recording.ticks.len() as u64;
        each(&reading.recording)?;
        reading.recording.rewind([0; 5]);
    }
    match reading.foreign.filter(|_| streamed.ticks == 0) {
        Some(found) => Err(LinkError::Compression { path: path.to_owned(), found }.into()),
        None => reading.header.map(|_| streamed).ok_or_else(|| LinkError::NoHeader { path: path.to_owned() }.into()),
    }
}

/// Reads the next record. Returns `true` if it is in `record`, `false` if it was too long and
/// passed over, `None` if the file ends before its end.
fn read_record(file: &mut BufReader<File>, record: &mut Vec<u8>) -> std::io::Result<Option<bool>> {
    record.clear();
    file.by_ref().take(HEAD_BYTES as u64).read_to_end(record)?;
    let Some(length) = record.get(1..HEAD_BYTES).and_then(|length| Some(u64::from_le_bytes(length.try_into().ok()?)))
    else {
        return Ok(None);
    };
    // A chunk is not longer than what it holds, but for bytes that do not compress.
    if length > 2 * MAX_CHUNK_BYTES {
        let is_chunk = record[0] == mcap::records::op::CHUNK;
        let passes = !is_chunk && i64::try_from(length).is_ok_and(|length| file.seek_relative(length).is_ok());
        return Ok(passes.then_some(false));
    }
    let read = file.by_ref().take(length).read_to_end(record)?;
    Ok((read as u64 == length).then_some(true))
}

impl Reading {
    /// Processes a record with its head; `false` at the regular end, `None` for an invalid one.
    fn whole_record(&mut self, bytes: &[u8]) -> Option<bool> {
        use mcap::records::op;
        let record = Cursor(bytes).record()?;
        match record.opcode {
            op::DATA_END => return Some(false),
            op::CHUNK => {
                if self.chunk(&record).is_none() {
                    self.foreign = super::chunk::foreign_compression(&record).map(str::to_owned);
                    return None;
                }
            }
            opcode => self.record(opcode, record.body)?,
        }
        Some(true)
    }
}

impl Recording {
    fn is_empty(&self) -> bool {
        self.mark() == [0; 5]
    }
}
