//! Unpacks a chunk, verifies its checksum, and returns its records.

use super::scan::{Cursor, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// Largest unpacked chunk that is read; the recorder's have 256 KiB plus one record.
pub(super) const MAX_CHUNK_BYTES: u64 = 16 << 20;

/// Limit of the unpacked size of all chunks in a file of `length` bytes.
///
/// Recordings shrink about threefold under LZ4 and fourfold under zstd, whose formats allow more.
pub(super) fn budget(length: usize) -> u64 {
    (length as u64).saturating_mul(32).max(MAX_CHUNK_BYTES)
}

/// Compressions that are read; MCAP defines no others.
const COMPRESSIONS: [&str; 3] = ["", "lz4", "zstd"];

/// The compression that a chunk names, if it is none that is read.
pub(super) fn foreign_compression<'a>(chunk: &Record<'a>) -> Option<&'a str> {
    Cursor(chunk.body).compression().filter(|name| !COMPRESSIONS.contains(name))
}

/// Whether a record may be a chunk that is read, by its header.
pub(super) fn is_likely(record: &Record<'_>) -> bool {
    record.opcode == mcap::records::op::CHUNK
        && Cursor(record.body).chunk_size().is_some_and(|size| size <= MAX_CHUNK_BYTES)
        && Cursor(record.body).packed().is_some_and(|(name, whole)| whole && COMPRESSIONS.contains(&name))
}

/// Calls `each` with opcode and body of the records in a chunk. Returns `None` on any error; `each`
/// may have been called by then.
pub(super) fn unpack(
    chunk: &Record<'_>,
    budget: &mut u64,
    mut each: impl FnMut(u8, &[u8]) -> Option<()>,
) -> Option<()> {
    let size = Cursor(chunk.body).chunk_size()?;
    if size > MAX_CHUNK_BYTES {
        return None;
    }
    *budget = budget.checked_sub(size)?;

    let mut reader = LinearReader::new_with_options(
        LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(MAX_CHUNK_BYTES as usize),
    );
    let mut packed = chunk.whole;
    while let Some(event) = reader.next_event() {
        match event.ok()? {
            LinearReadEvent::ReadRequest(wanted) => {
                let count = wanted.min(packed.len());
                let (now, later) = packed.split_at(count);
                reader.insert(count).copy_from_slice(now);
                reader.notify_read(count);
                packed = later;
            }
            LinearReadEvent::Record { data, opcode } => each(opcode, data)?,
        }
    }
    Some(())
}
