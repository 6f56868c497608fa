//! What skull and brain looked like during a session, in a file beside its recording.
//!
//! # Theory
//! A recording holds what the loops were given; the scene follows from it by running them again,
//! which takes about as long as the session with a brain. So a session also keeps what changed on
//! the picture: thirty times a second the voxels and cut nodes with their values before and after,
//! less often the brain's nodes. Any time is then reached by adding or taking back changes.
//!
//! # Practice
//! An MCAP file with one channel of messages in a layout of this module ([`SceneRecord`]), packed
//! with zstd; it names the recording's session in its header. It is not needed for a replay bit for
//! bit, and may be deleted. A cut file gives the records before the cut.

use super::chunk;
use super::scan::Cursor;
use crate::LinkError;
use crate::recorder::{metadata, write_error};
use crate::wire::SessionHeader;
use mcap::records::{MessageHeader, op};
use mcap::{Compression, WriteOptions};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// A node's displacement from rest is stored in steps of this length, mm.
pub const NODE_STEP_MM: f32 = 1.0 / 256.0;
/// Largest number of changes in a message; a record with more is split.
const MOST_CHANGES: usize = 400_000;
/// A chunk is closed when it spans this much session time, ms.
const CHUNK_MS: f64 = 1000.0;
/// Stands between tetrahedra and splits, which older programs do not read.
const NO_TET: u32 = u32::MAX;
/// Name of the layout of messages.
const LAYOUT: &str = "trepan.scene.1";

/// A voxel whose density changed, or a cut node whose depth did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneChange {
    /// Index of the voxel or node.
    pub at: [u16; 3],
    /// Density, HU, or the cut's value before.
    pub before: i16,
    /// The same after.
    pub after: i16,
}

/// What changed on the picture since the record before.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneRecord {
    /// Number of the haptic tick.
    pub tick: u64,
    /// Session time, ms.
    pub time_ms: f64,
    /// Active warnings, bits.
    pub warnings: u32,
    /// Whether the bone is open.
    pub open: bool,
    /// Bone removed so far, mm³.
    pub removed_mm3: f64,
    /// Speed of the spindle over its free speed.
    pub spindle: f32,
    /// Voxels of the skull.
    pub voxels: Vec<SceneChange>,
    /// Nodes of the cut.
    pub cuts: Vec<SceneChange>,
    /// Displacement of each node of the brain from rest, [`NODE_STEP_MM`]; in some records.
    pub nodes: Option<Vec<[i16; 3]>>,
    /// Tetrahedra of the brain that were resected.
    pub gone: Vec<u32>,
    /// Splits of its nodes: 4 · tetrahedron + corner, node before, node after.
    pub splits: Vec<[u32; 3]>,
}

/// Writes the scene of a session.
pub struct SceneWriter {
    path: PathBuf,
    mcap: mcap::Writer<BufWriter<File>>,
    channel: u16,
    bytes: Vec<u8>,
    chunk_ms: f64,
}

impl SceneWriter {
    /// Creates or truncates the file; the header is that of the recording.
    pub fn create(path: &Path, header: &SessionHeader) -> Result<Self, LinkError> {
        let file = File::create(path).map_err(|source| LinkError::Create { path: path.to_owned(), source })?;
        let options = WriteOptions::new().compression(Some(Compression::Zstd)).disable_seeking(true);
        let made = options.chunk_size(Some(4 << 20)).create(BufWriter::new(file)).and_then(|mut mcap| {
            mcap.write_metadata(&metadata(header))?;
            let channel = mcap.add_channel(0, "/scene", LAYOUT, &BTreeMap::new())?;
            Ok((mcap, channel))
        });
        let (mcap, channel) = made.map_err(|error| write_error(path, &error))?;
        Ok(Self { path: path.to_owned(), mcap, channel, bytes: Vec::new(), chunk_ms: 0.0 })
    }

    /// Writes a record.
    pub fn write(&mut self, record: &SceneRecord) -> Result<(), LinkError> {
        let (mut voxels, mut cuts) = (&record.voxels[..], &record.cuts[..]);
        loop {
            let [(some, more_voxels), (others, more_cuts)] =
                [voxels, cuts].map(|all| all.split_at(all.len().min(MOST_CHANGES)));
            let is_last = more_voxels.is_empty() && more_cuts.is_empty();
            self.bytes.clear();
            encode(record, [some, others], is_last, &mut self.bytes);
            let time_ns = (record.time_ms.max(0.0) * 1e6) as u64;
            let header =
                MessageHeader { channel_id: self.channel, sequence: 0, log_time: time_ns, publish_time: time_ns };
            let written = self.mcap.write_to_known_channel(&header, &self.bytes);
            written.map_err(|error| write_error(&self.path, &error))?;
            if is_last {
                break;
            }
            (voxels, cuts) = (more_voxels, more_cuts);
        }
        if record.time_ms - self.chunk_ms >= CHUNK_MS {
            self.chunk_ms = record.time_ms;
            self.mcap.flush().map_err(|error| write_error(&self.path, &error))?;
        }
        Ok(())
    }

    /// Writes the index and closes the file.
    pub fn finish(mut self) -> Result<(), LinkError> {
        self.mcap.finish().map(|_| ()).map_err(|error| write_error(&self.path, &error))
    }
}

/// Reads the scene beside a recording with this header; `None` for a file of another session.
pub fn read_scene(path: &Path, of: &SessionHeader) -> Result<Option<Vec<SceneRecord>>, LinkError> {
    let bytes = super::bytes_of(path)?;
    let Some(body) = bytes.strip_prefix(mcap::MAGIC) else {
        return Err(LinkError::NotARecording { path: path.to_owned() });
    };
    let (mut reading, mut records) = (super::Reading::default(), Vec::new());
    let (mut rest, mut budget) = (Cursor(body), chunk::budget(bytes.len()).saturating_mul(8));
    while let Some(record) = rest.record() {
        let read = match record.opcode {
            op::CHUNK => {
                let whole = records.len();
                let unpacked = chunk::unpack(&record, &mut budget, |opcode, body| {
                    if opcode == op::MESSAGE {
                        records.push(decode(Cursor(body).message()?.1)?);
                    }
                    Some(())
                });
                if unpacked.is_none() {
                    records.truncate(whole);
                }
                unpacked
            }
            op::METADATA => reading.record(op::METADATA, record.body),
            op::DATA_END => None,
            _ => Some(()),
        };
        if read.is_none() {
            break;
        }
    }
    Ok(reading.header.filter(|(_, header)| header == of).map(|_| records))
}

fn encode(record: &SceneRecord, changes: [&[SceneChange]; 2], with_brain: bool, out: &mut Vec<u8>) {
    let nodes = record.nodes.as_deref().filter(|_| with_brain);
    let (gone, splits) = if with_brain { (&record.gone[..], &record.splits[..]) } else { (&[][..], &[][..]) };
    out.extend(record.tick.to_le_bytes());
    out.extend(record.time_ms.to_le_bytes());
    out.extend(record.warnings.to_le_bytes());
    out.extend(u32::from(record.open).to_le_bytes());
    out.extend(record.removed_mm3.to_le_bytes());
    out.extend(record.spindle.to_le_bytes());
    for all in changes {
        out.extend((all.len() as u32).to_le_bytes());
        // One kind of number after the other: they differ little from neighbour to neighbour.
        (0..3).for_each(|axis| all.iter().for_each(|change| out.extend(change.at[axis].to_le_bytes())));
        all.iter().for_each(|change| out.extend(change.before.to_le_bytes()));
        all.iter().for_each(|change| out.extend(change.after.to_le_bytes()));
    }
    out.extend(nodes.map_or(u32::MAX, |nodes| nodes.len() as u32).to_le_bytes());
    let nodes = nodes.unwrap_or_default();
    (0..3).for_each(|axis| nodes.iter().for_each(|node| out.extend(node[axis].to_le_bytes())));
    gone.iter().for_each(|tet| out.extend(tet.to_le_bytes()));
    if !splits.is_empty() {
        out.extend(NO_TET.to_le_bytes());
        splits.iter().flatten().for_each(|number| out.extend(number.to_le_bytes()));
    }
}

fn decode(bytes: &[u8]) -> Option<SceneRecord> {
    let mut rest = Cursor(bytes);
    let (tick, time_ms) = (rest.u64()?, f64::from_bits(rest.u64()?));
    let (warnings, open) = (rest.u32()?, rest.u32()? != 0);
    let (removed_mm3, spindle) = (f64::from_bits(rest.u64()?), f32::from_bits(rest.u32()?));
    let (voxels, cuts) = (changes(&mut rest)?, changes(&mut rest)?);
    let count = rest.u32()?;
    let nodes = match count {
        u32::MAX => None,
        count => {
            let [x, y, z] = [numbers(&mut rest, count)?, numbers(&mut rest, count)?, numbers(&mut rest, count)?];
            Some(x.zip(y).zip(z).map(|((x, y), z)| [x, y, z].map(u16::cast_signed)).collect())
        }
    };
    // Records of files without resection end here.
    let (mut gone, mut splits) = (Vec::new(), Vec::new());
    while !rest.0.is_empty() {
        match rest.u32()? {
            NO_TET => break,
            tet => gone.push(tet),
        }
    }
    while !rest.0.is_empty() {
        splits.push([rest.u32()?, rest.u32()?, rest.u32()?]);
    }
    Some(SceneRecord { tick, time_ms, warnings, open, removed_mm3, spindle, voxels, cuts, nodes, gone, splits })
}

fn changes(rest: &mut Cursor<'_>) -> Option<Vec<SceneChange>> {
    let count = rest.u32()?;
    let [x, y, z] = [numbers(rest, count)?, numbers(rest, count)?, numbers(rest, count)?];
    let [before, after] = [numbers(rest, count)?, numbers(rest, count)?];
    let places = x.zip(y).zip(z).map(|((x, y), z)| [x, y, z]);
    let values = before.zip(after).map(|(before, after)| [before, after].map(u16::cast_signed));
    Some(places.zip(values).map(|(at, [before, after])| SceneChange { at, before, after }).collect())
}

fn numbers<'a>(rest: &mut Cursor<'a>, count: u32) -> Option<impl Iterator<Item = u16> + use<'a>> {
    let bytes = rest.take(usize::try_from(count).ok()?.checked_mul(2)?)?;
    Some(bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn records() -> Vec<SceneRecord> {
        let change = |n: usize| SceneChange { at: [n as u16, 7, (n / 3) as u16], before: -1000, after: n as i16 };
        let of = |n: usize| SceneRecord {
            tick: 33 * n as u64,
            time_ms: 33.0 * n as f64,
            warnings: n as u32,
            open: n > 20,
            removed_mm3: n as f64,
            spindle: 0.5,
            voxels: (0..n).map(change).collect(),
            cuts: (0..3 * n).map(change).collect(),
            nodes: n.is_multiple_of(3).then(|| vec![[n as i16, -3, 9]; 40]),
            gone: (0..n as u32 % 4).collect(),
            splits: (0..n as u32 % 3).map(|n| [n, 7, 40 + n]).collect(),
        };
        (0..200).map(of).collect()
    }

    #[test]
    fn a_scene_comes_back_whole_cut_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.scene");
        let header = SessionHeader { case: "case".into(), ..SessionHeader::default() };
        let mut writer = SceneWriter::create(&path, &header).unwrap();
        records().iter().for_each(|record| writer.write(record).unwrap());
        writer.finish().unwrap();
        assert_eq!(read_scene(&path, &header).unwrap().unwrap(), records());
        let other = SessionHeader { case: "another".into(), ..SessionHeader::default() };
        assert_eq!(read_scene(&path, &other).unwrap(), None, "it belongs to another session");
        let bytes = std::fs::read(&path).unwrap();
        for cut in (0..bytes.len()).step_by(97) {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            if let Ok(Some(read)) = read_scene(&path, &header) {
                assert!(read.len() <= 200 && read[..] == records()[..read.len()], "cut at {cut}");
            }
            let mut flipped = bytes.clone();
            flipped[cut] ^= 0x10;
            std::fs::write(&path, &flipped).unwrap();
            _ = read_scene(&path, &header);
        }
    }

    #[test]
    fn a_record_with_many_changes_is_split() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.scene");
        let header = SessionHeader::default();
        let voxels = vec![SceneChange { at: [1, 2, 3], before: 900, after: -1000 }; 2 * MOST_CHANGES + 5];
        let record = SceneRecord { voxels, nodes: Some(vec![[1; 3]]), gone: vec![9], ..SceneRecord::default() };
        let mut writer = SceneWriter::create(&path, &header).unwrap();
        writer.write(&record).unwrap();
        writer.finish().unwrap();
        let read = read_scene(&path, &header).unwrap().unwrap();
        assert_eq!(read.iter().map(|record| record.voxels.len()).sum::<usize>(), record.voxels.len());
        assert!(read.len() == 3 && read[2].nodes.is_some() && read[0].nodes.is_none());
        assert!(read[2].gone == [9] && read[0].gone.is_empty());
    }
}
