//! Losses of a recording: damaged parts of the file and missing ticks.
//!
//! # Theory
//! Three sources show the number of ticks: chunks carry checksums, which locate damage; the index
//! at the end counts the messages of each topic; and ticks are numbered without gaps.

use super::scan::{Cursor, index};
use super::{Reading, Recording};

/// Damage of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Damage {
    /// The byte at which reading ended.
    /// `None` if every chunk is valid but the file's checksum fails; then its header may have been
    /// changed.
    pub at_byte: Option<u64>,
    /// Length of the file, bytes.
    pub of_bytes: u64,
    /// Haptic ticks in the file's index; `None` without a valid index.
    pub indexed_ticks: Option<u64>,
}

impl Damage {
    /// Damage of a file that was read up to its regular `end` (`Ok`) or to invalid data (`Err`).
    pub(super) fn of(bytes: &[u8], end: Result<usize, usize>, ticks: u64) -> Option<Self> {
        let indexed_ticks = indexed_ticks(bytes);
        let at_byte = match end {
            Err(at) => Some(at as u64),
            Ok(at) if checksum_holds(bytes, at) && indexed_ticks.is_none_or(|indexed| indexed == ticks) => return None,
            Ok(_) => None,
        };
        Some(Self { at_byte, of_bytes: bytes.len() as u64, indexed_ticks })
    }
}

/// Whether the checksum at the regular end is valid or absent.
fn checksum_holds(bytes: &[u8], end: usize) -> bool {
    let mut rest = Cursor(bytes.get(end..).unwrap_or_default());
    let stated = rest.record().and_then(|record| Cursor(record.body).u32());
    stated.is_some_and(|crc| crc == 0 || bytes.get(..end).is_some_and(|before| crc32fast::hash(before) == crc))
}

/// Haptic ticks in the index.
fn indexed_ticks(bytes: &[u8]) -> Option<u64> {
    let mut reading = Reading::default();
    let mut counts = Vec::new();
    for record in index(bytes)? {
        match record.opcode {
            mcap::records::op::STATISTICS => counts = Cursor(record.body).message_counts()?,
            opcode => reading.record(opcode, record.body)?,
        }
    }
    let is_tick = |channel: &u16| reading.channels.get(channel).is_some_and(|topic| topic.is_tick());
    Some(counts.iter().filter(|count| is_tick(&count.channel)).map(|count| count.messages).sum())
}

/// A gap in a sequence of numbers: the first missing number, and the total count of missing ones.
struct Gap {
    from: u64,
    to: u64,
    missing: u64,
}

impl Gap {
    fn of(first: u64, numbers: impl Iterator<Item = u64>) -> Option<Self> {
        let (mut next, mut found) = (first, None::<Self>);
        for number in numbers {
            let missing = number.saturating_sub(next);
            if missing > 0 {
                let gap = found.get_or_insert(Self { from: next, to: number - 1, missing: 0 });
                gap.missing = gap.missing.saturating_add(missing);
            }
            next = number.saturating_add(1);
        }
        found
    }
}

impl Recording {
    /// Ticks of the session according to the file: the larger of those read and missing, and those
    /// in its index.
    pub fn promised_ticks(&self) -> u64 {
        let missing = self.missing_ticks().map_or(0, |gap| gap.missing);
        let indexed = self.damage.and_then(|damage| damage.indexed_ticks).unwrap_or(0);
        (self.ticks.len() as u64).saturating_add(missing).max(indexed)
    }

    /// Description of the losses; `None` if there are none.
    pub fn losses(&self) -> Option<String> {
        let missing = |what: &str, gap: Option<Gap>| {
            let Gap { from, to, missing } = gap?;
            Some(format!("{what} {from} to {to} are missing ({missing} in all)"))
        };
        let losses = [
            self.damage.map(|damage| self.damaged(damage)),
            self.repaired.as_ref().map(|lost| format!("it was repaired; before, {lost}")),
            missing("ticks", self.missing_ticks()),
            missing("the second hand's ticks", between(self.second.iter().map(|second| second.tick))),
            missing("collision steps", between(self.collisions.iter().map(|step| step.seq))),
        ];
        let losses: Vec<String> = losses.into_iter().flatten().collect();
        (!losses.is_empty()).then(|| losses.join("; "))
    }

    /// Sessions count their ticks from 1, some recorded paths from 0.
    fn missing_ticks(&self) -> Option<Gap> {
        let first = self.ticks.first()?.tick.min(1);
        Gap::of(first, self.ticks.iter().map(|tick| tick.tick))
    }

    fn damaged(&self, Damage { at_byte, of_bytes, indexed_ticks }: Damage) -> String {
        let place = at_byte.map_or_else(
            || "its checksum does not hold, though every chunk is sound: its header may have been changed".into(),
            |at| format!("it is cut or damaged at byte {at} of {of_bytes}"),
        );
        let count = match (self.ticks.len() as u64, indexed_ticks) {
            (read, Some(all)) if all > read => format!("{read} of {all} ticks can be read, {} are lost", all - read),
            (read, Some(_)) => format!("all of its {read} ticks can be read"),
            (read, None) => format!("{read} ticks can be read, how many are lost is not known"),
        };
        format!("{place}; {count}")
    }
}

/// Numbers missing between the first and the last.
fn between(numbers: impl Iterator<Item = u64> + Clone) -> Option<Gap> {
    Gap::of(numbers.clone().next()?, numbers)
}
