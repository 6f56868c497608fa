//! Tests recordings: complete, cut at any byte, damaged, and on a full disk.
#![expect(clippy::unwrap_used, reason = "a test may stop where it fails")]

use prost::Message;
use std::io::{Cursor, Seek, SeekFrom, Write};
use std::path::Path;
use trepan_geometry::{Pose, Quat, Twist, Vec3, Wrench};
use trepan_link::wire::{CollisionRecord, EventRecord, SecondRecord, SessionHeader, SolverRecord, TickRecord};
use trepan_link::{LinkError, Recorder, Recording, Repaired, repair, stream};

fn header() -> SessionHeader {
    SessionHeader {
        app: "integrated".into(),
        version: "0.1.0".into(),
        case: "built-in".into(),
        seed: 7,
        hashes: [("ct".to_owned(), "00ff".to_owned())].into(),
        config: [("rigid".to_owned(), "thesis".to_owned()), ("solver".to_owned(), "tled \"ü\"".to_owned())].into(),
    }
}

/// Random numbers of every bit pattern, from a counter (splitmix64).
struct Noise(u64);

impl Noise {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn float(&mut self) -> f32 {
        f32::from_bits(self.bits() as u32)
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.float(), self.float(), self.float())
    }

    fn pose(&mut self) -> Pose {
        Pose {
            translation: self.vector(),
            rotation: Quat::from_xyzw(self.float(), self.float(), self.float(), self.float()),
            ..Pose::IDENTITY
        }
    }
}

fn tick(number: u64) -> TickRecord {
    let mut noise = Noise(number);
    TickRecord {
        tick: number,
        time_ms: number as f64 + 1e-7,
        device: noise.pose(),
        twist: Twist { linear: noise.vector(), angular: noise.vector() },
        buttons: noise.bits() as u32,
        proxy: noise.pose(),
        wrench: Wrench { force: noise.vector(), torque: noise.vector() },
        tissue_force: noise.vector(),
        contact_normal: noise.vector(),
        depth_mm: f32::NAN,
        tissue_depth_mm: -0.0,
        removed_mm3: f32::MIN_POSITIVE / 2.0,
        spindle_rpm: noise.float(),
        brain_distance_mm: f32::NEG_INFINITY,
        patch_seq: noise.bits(),
        compute_us: noise.float(),
        flags: TickRecord::LATE | TickRecord::DRILLING,
        phase: noise.bits() as u8,
        tool: noise.bits() as u8,
    }
}

/// All bits of a tick, as words.
fn bits(t: &TickRecord) -> Vec<u64> {
    let pose = |p: &Pose| [p.translation.to_array().to_vec(), p.rotation.to_array().to_vec()].concat();
    let floats = [
        pose(&t.device),
        pose(&t.proxy),
        [t.twist.linear, t.twist.angular, t.wrench.force, t.wrench.torque, t.tissue_force, t.contact_normal]
            .map(|v| v.to_array())
            .concat(),
        vec![t.depth_mm, t.tissue_depth_mm, t.removed_mm3, t.spindle_rpm, t.brain_distance_mm, t.compute_us],
    ]
    .concat();
    let whole =
        [t.tick, t.time_ms.to_bits(), t.patch_seq, t.buttons.into(), t.flags.into(), t.phase.into(), t.tool.into()];
    floats.iter().map(|f| u64::from(f.to_bits())).chain(whole).collect()
}

fn second(number: u64) -> SecondRecord {
    let TickRecord { tick, time_ms, device, twist, buttons, proxy, wrench, depth_mm, .. } = tick(number);
    SecondRecord { tick, time_ms, device, twist, buttons, proxy, wrench, depth_mm, tissue_depth_mm: 0.5, flags: 3 }
}

fn record<W: Write + Seek>(recorder: &mut Recorder<W>, ticks: u64) -> Result<(), LinkError> {
    for number in 0..ticks {
        recorder.tick(&tick(number))?;
        recorder.second(&second(number))?;
        recorder.collision(&CollisionRecord { seq: number, tick: number, points: 3, ..Default::default() })?;
        if number % 7 == 0 {
            recorder.solver(&SolverRecord { step: number, time_ms: 0.1, inverted: 2, ..Default::default() })?;
        }
        if number % 50 == 0 {
            let kind = if number == 0 { "phase" } else { "warning" };
            recorder.event(&EventRecord {
                tick: number,
                time_ms: number as f64,
                kind: kind.into(),
                text: "dura ahead: ½ mm".into(),
            })?;
        }
    }
    Ok(())
}

fn file(ticks: u64) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let mut recorder = Recorder::create(&path, &header()).unwrap();
    record(&mut recorder, ticks).unwrap();
    recorder.finish().unwrap();
    std::fs::read(path).unwrap()
}

fn open(bytes: &[u8]) -> Result<Recording, LinkError> {
    Recording::of_bytes(bytes, Path::new("session.mcap"))
}

#[test]
fn every_record_comes_back_bit_for_bit() {
    let recording = open(&file(1000)).unwrap();
    assert_eq!((&recording.header, recording.losses()), (&header(), None));
    assert_eq!(recording.ticks.len(), 1000);
    for (number, read) in recording.ticks.iter().enumerate() {
        assert_eq!(bits(read), bits(&tick(number as u64)));
    }
    assert_eq!(recording.second.len(), 1000);
    for (number, read) in recording.second.iter().enumerate() {
        assert_eq!(format!("{read:?}"), format!("{:?}", second(number as u64)));
    }
    assert_eq!((recording.collisions.len(), recording.solver.len(), recording.events.len()), (1000, 143, 20));
    assert_eq!(recording.solver[1], SolverRecord { step: 7, time_ms: 0.1, inverted: 2, ..Default::default() });
    assert_eq!((recording.events[1].kind.as_str(), recording.events[1].text.as_str()), ("warning", "dura ahead: ½ mm"));
}

#[test]
fn the_same_session_makes_the_same_bytes() {
    assert_eq!(file(300), file(300));
}

#[test]
fn a_cut_at_any_byte_leaves_all_complete_chunks() {
    let whole = file(900);
    let mut last = 0;
    let mut steps = std::collections::BTreeSet::new();
    // The index contains no records: few cuts in it are tested.
    for length in (0..whole.len()).filter(|l| l % 331 == 0 || *l < 600 || l + 600 > whole.len()) {
        match open(&whole[..length]) {
            Ok(recording) => {
                let count = recording.ticks.len();
                assert!(count >= last, "cut at {length}: {count} ticks after {last}");
                assert!(recording.ticks.iter().enumerate().all(|(n, t)| bits(t) == bits(&tick(n as u64))));
                assert!(recording.losses().is_some() || count == 900);
                last = count;
                steps.insert(count);
            }
            Err(LinkError::NotARecording { .. }) => assert!(length < 8, "{length}"),
            Err(LinkError::NoHeader { .. }) => assert!(length < 1000 && last == 0, "{length}"),
            Err(other) => panic!("cut at {length}: {other}"),
        }
    }
    assert_eq!(last, 900);
    let longest_loss = steps.iter().zip(steps.iter().skip(1)).map(|(a, b)| b - a).max().unwrap();
    assert!(longest_loss <= 201, "{longest_loss} ticks lost at once: {steps:?}");
}

#[test]
fn a_stream_reads_the_chunks_of_a_whole_and_of_a_cut_file() {
    let (folder, bytes) = (tempfile::tempdir().unwrap(), file(900));
    let path = folder.path().join("session.mcap");
    for length in (0..bytes.len()).step_by(bytes.len() / 40).chain([bytes.len()]) {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let (mut ticks, mut largest) = (Vec::new(), 0);
        let streamed = stream(&path, |part| {
            assert_eq!(part.header, header());
            largest = largest.max(part.ticks.len());
            ticks.extend(part.ticks.iter().map(bits));
            Ok::<_, LinkError>(())
        });
        match (streamed, open(&bytes[..length])) {
            (Ok(streamed), Ok(recording)) => {
                assert_eq!(ticks, recording.ticks.iter().map(bits).collect::<Vec<_>>(), "cut at {length}");
                assert_eq!((streamed.ticks, streamed.missing), (ticks.len() as u64, 0));
                assert!(largest < 300, "{largest} ticks at once");
                assert!(streamed.losses().is_some() == streamed.cut_at.is_some());
                assert!(length < bytes.len() || streamed.losses().is_none());
            }
            (Err(one), Err(other)) => {
                assert_eq!(one.to_string().split(':').nth(1), other.to_string().split(':').nth(1))
            }
            (streamed, opened) => panic!("cut at {length}: {streamed:?}, {:?}", opened.map(|all| all.ticks.len())),
        }
    }
}

#[test]
fn scores_are_numbers_with_names_in_the_file_and_a_replay_ignores_them() {
    let path = Path::new("session.mcap");
    let mut file = Cursor::new(Vec::new());
    let mut recorder = Recorder::to(&mut file, path, &header()).unwrap();
    recorder.tick(&tick(0)).unwrap();
    let scores = |at: f64| [("path_mm".to_string(), 1.5 * at), ("smoothness".to_string(), f64::NAN)];
    recorder.scores(0, 0.0, &scores(0.0)).unwrap();
    recorder.scores(1000, 1000.0, &scores(2.0)).unwrap();
    recorder.finish().unwrap();
    let recording = open(file.get_ref()).unwrap();
    assert_eq!((recording.ticks.len(), recording.events.len(), recording.losses()), (1, 0, None));
    let messages: Vec<_> = mcap::MessageStream::new(file.get_ref()).unwrap().map(Result::unwrap).collect();
    let found: Vec<_> = messages.iter().filter(|message| message.channel.topic == "/score").collect();
    let schema = found[1].channel.schema.as_ref().unwrap();
    assert_eq!((found.len(), schema.name.as_str()), (2, "trepan.Score"));
    let set = prost_types::FileDescriptorSet::decode(&*schema.data).unwrap();
    let names: Vec<_> = set.file[0].message_type[0].field.iter().map(|field| field.name().to_string()).collect();
    assert_eq!(names, ["tick", "time_ms", "path_mm", "smoothness"]);
    // 1: varint 1000; 2, 3, 4: doubles.
    let mut expected = vec![8, 0xe8, 7];
    for (key, value) in [(17, 1000.0), (25, 3.0), (33, f64::NAN)] {
        expected.push(key);
        expected.extend(f64::to_le_bytes(value));
    }
    assert_eq!(&*found[1].data, &expected);
}

#[test]
fn a_recorder_that_dies_unfinished_leaves_what_was_flushed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("killed.mcap");
    let mut recorder = Recorder::create(&path, &header()).unwrap();
    record(&mut recorder, 250).unwrap();
    recorder.flush().unwrap();
    std::mem::forget(recorder);
    let recording = Recording::open(&path).unwrap();
    assert_eq!((recording.ticks.len(), recording.damage.is_some()), (250, true));
}

#[test]
fn a_repaired_file_is_whole_and_holds_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (cut, repaired) = (folder.path().join("cut.mcap"), folder.path().join("repaired.mcap"));
    let whole = file(450);
    for length in [whole.len(), whole.len() * 3 / 4, whole.len() / 2] {
        std::fs::write(&cut, &whole[..length]).unwrap();
        let before = Recording::open(&cut).unwrap();
        let report = repair(&cut, &repaired).unwrap();
        let after = Recording::open(&repaired).unwrap();
        assert_eq!((report.was_whole, after.losses().is_none()), (length == whole.len(), length == whole.len()));
        assert!(report.messages as usize >= after.ticks.len() + after.collisions.len());
        assert_eq!(after.header, before.header);
        assert_eq!(after.ticks.iter().map(bits).collect::<Vec<_>>(), before.ticks.iter().map(bits).collect::<Vec<_>>());
        assert_eq!(
            (&after.collisions, &after.solver, &after.events),
            (&before.collisions, &before.solver, &before.events)
        );
        let index = mcap::Summary::read(&std::fs::read(&repaired).unwrap()).unwrap().unwrap();
        assert_eq!(index.stats.unwrap().message_count, report.messages);
        assert_eq!(repair(&repaired, &cut).unwrap(), Repaired { was_whole: true, ..report });
    }
    assert!(repair(&repaired, &repaired).unwrap_err().to_string().contains("another name"));
    std::fs::remove_file(&repaired).unwrap();
    std::fs::write(&cut, &whole[..offset_of(6, &whole) + 20]).unwrap();
    let none = repair(&cut, &repaired).unwrap_err().to_string();
    assert!(none.contains("no tick") && none.contains("nothing was written") && !repaired.exists(), "{none}");
}

/// A recording written again with another compression, as other programs do it.
fn recompressed(bytes: &[u8], compression: Option<mcap::Compression>) -> Vec<u8> {
    use mcap::records::Record;
    let options = mcap::WriteOptions::new().compression(compression).chunk_size(Some(64 << 10));
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    for record in mcap::read::ChunkFlattener::new(bytes).unwrap() {
        match record.unwrap() {
            Record::Schema { header, data } => {
                writer.add_schema_with_id(header.id, &header.name, &header.encoding, &data).unwrap();
            }
            Record::Channel(c) => {
                writer.add_channel_with_id(c.id, c.schema_id, &c.topic, &c.message_encoding, &c.metadata).unwrap();
            }
            Record::Message { header, data } => writer.write_to_known_channel(&header, &data).unwrap(),
            Record::Metadata(metadata) => writer.write_metadata(&metadata).unwrap(),
            Record::DataEnd(_) => break,
            _ => {}
        }
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn recordings_of_every_compression_are_read_and_repaired_alike() {
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (folder.path().join("damaged.mcap"), folder.path().join("repaired.mcap"));
    for compression in [None, Some(mcap::Compression::Lz4), Some(mcap::Compression::Zstd)] {
        let other = recompressed(&file(1000), compression);
        let read = open(&other).unwrap();
        assert_eq!((read.damage, read.ticks.len(), read.indexed), (None, 1000, true), "{compression:?}");
        assert!(read.ticks.iter().enumerate().all(|(n, t)| bits(t) == bits(&tick(n as u64))));
        let mut bytes = other.clone();
        damage_chunk(&mut bytes, 1);
        std::fs::write(&from, &bytes).unwrap();
        assert!(!repair(&from, &to).unwrap().was_whole);
        let (before, after) = (open(&bytes).unwrap().ticks.len(), Recording::open(&to).unwrap().ticks.len());
        assert!(after > before && after < 1000, "{compression:?}: {before} ticks before the damage, {after} saved");
    }
}

#[test]
fn an_unknown_compression_is_named() {
    let other = recompressed(&file(450), Some(mcap::Compression::Zstd));
    let name = b"\x04\0\0\0zstd";
    let places: Vec<usize> = (0..other.len() - 8).filter(|&at| other[at..at + 8] == *name).collect();
    let mut bytes = other.clone();
    places.iter().for_each(|at| bytes[at + 4..at + 8].copy_from_slice(b"brot"));
    let fault = open(&bytes).unwrap_err();
    assert!(matches!(&fault, LinkError::Compression { found, .. } if found == "brot"), "{fault}");
    assert!(fault.to_string().contains("mcap compress"), "{fault}");
    // One name alone is damage: the rest can be saved.
    let mut damaged = other;
    damaged[places[0] + 4] = b'x';
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (folder.path().join("damaged.mcap"), folder.path().join("repaired.mcap"));
    std::fs::write(&from, &damaged).unwrap();
    assert!(open(&damaged).unwrap().damage.is_some());
    repair(&from, &to).unwrap();
    assert!(Recording::open(&to).unwrap().ticks.len() > 100);
}

#[test]
fn damaged_files_never_panic_and_give_no_wrong_ticks() {
    let whole = file(450);
    let folder = tempfile::tempdir().unwrap();
    let (damaged, repaired) = (folder.path().join("damaged.mcap"), folder.path().join("repaired.mcap"));
    let mut noise = Noise(1);
    for _ in 0..1500 {
        let mut bytes = whole.clone();
        for _ in 0..=noise.bits() % 4 {
            let at = (noise.bits() % bytes.len() as u64) as usize;
            match noise.bits() % 4 {
                0 => bytes[at] = noise.bits() as u8,
                1 => bytes[at] ^= 1 << (noise.bits() % 8),
                2 => bytes.truncate(at.max(1)),
                _ => {
                    let end = (at + 8).min(bytes.len());
                    bytes[at..end].fill(0xff);
                }
            }
        }
        if noise.bits().is_multiple_of(16) {
            std::fs::write(&damaged, &bytes).unwrap();
            if repair(&damaged, &repaired).is_ok() {
                let (before, after) = (open(&bytes).unwrap(), Recording::open(&repaired).unwrap());
                assert!(after.damage.is_none() && after.ticks.len() >= before.ticks.len());
                assert!(after.ticks.iter().all(|t| bits(t) == bits(&tick(t.tick))));
            }
        }
        if let Ok(recording) = open(&bytes) {
            assert!(recording.ticks.len() <= 450);
            // A checksum covers every tick: ticks that are read equal those recorded.
            assert!(recording.losses().is_some() || recording.ticks.len() == 450);
            assert!(recording.ticks.iter().enumerate().all(|(n, t)| bits(t) == bits(&tick(n as u64))));
        }
    }
}

/// Overwrites 16 bytes in the middle of a chunk; returns the chunk's start.
fn damage_chunk(file: &mut [u8], number: usize) -> usize {
    let mut at = 8;
    for chunk in 0.. {
        at += offset_of(6, &file[at - 8..]) - 8;
        let length = u64::from_le_bytes(file[at + 1..at + 9].try_into().unwrap()) as usize;
        if chunk == number {
            file[at + length / 2..at + length / 2 + 16].fill(0xa5);
            return at;
        }
        at += 9 + length;
    }
    unreachable!()
}

#[test]
fn a_damaged_file_says_where_and_how_many_ticks_are_lost() {
    let whole = file(1000);
    assert_eq!((open(&whole).unwrap().losses(), open(&whole).unwrap().promised_ticks()), (None, 1000));

    let mut damaged = whole.clone();
    let at = damage_chunk(&mut damaged, 3);
    let recording = open(&damaged).unwrap();
    let (read, losses) = (recording.ticks.len(), recording.losses().unwrap());
    assert!(read > 100 && read < 900, "{read}");
    assert_eq!(recording.promised_ticks(), 1000, "the index knows");
    let words = [format!("byte {at} of {}", damaged.len()), format!("{read} of 1000 ticks")];
    assert!(words.iter().all(|word| losses.contains(word)), "{losses}");

    let cut = open(&whole[..whole.len() * 3 / 4]).unwrap();
    assert!(cut.losses().unwrap().contains("is not known") && cut.promised_ticks() == cut.ticks.len() as u64);

    // A changed digit in the header is still valid JSON, and every chunk is valid.
    let mut changed = whole.clone();
    let seed = whole.windows(8).position(|bytes| bytes == b"\"seed\":7").unwrap();
    changed[seed + 7] = b'8';
    let recording = open(&changed).unwrap();
    assert_eq!((recording.header.seed, recording.ticks.len()), (8, 1000));
    assert!(recording.losses().unwrap().contains("its header may have been changed"));
}

#[test]
fn ticks_that_a_full_ring_lost_are_missed_by_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gaps.mcap");
    let mut recorder = Recorder::create(&path, &header()).unwrap();
    for number in (1..=100).chain(111..=200).chain(206..=300) {
        recorder.tick(&tick(number)).unwrap();
    }
    recorder.finish().unwrap();
    let recording = Recording::open(&path).unwrap();
    assert_eq!((recording.damage, recording.promised_ticks()), (None, 300));
    assert_eq!(recording.losses().unwrap(), "ticks 101 to 110 are missing (15 in all)");
}

#[test]
fn a_repair_keeps_the_chunks_behind_a_damaged_one() {
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (folder.path().join("damaged.mcap"), folder.path().join("repaired.mcap"));
    let whole = file(1000);
    let length_field = |file: &mut [u8]| {
        let at = damage_chunk(file, 2);
        file[at + 1..at + 9].copy_from_slice(&u64::MAX.to_le_bytes());
    };
    let topics = |file: &mut [u8]| {
        damage_chunk(file, 0);
    };
    let in_chunk = |file: &mut [u8]| {
        damage_chunk(file, 2);
    };
    for (what, damage) in [("chunk", &in_chunk as &dyn Fn(&mut [u8])), ("length", &length_field), ("topics", &topics)] {
        let mut bytes = whole.clone();
        damage(&mut bytes);
        std::fs::write(&from, &bytes).unwrap();
        assert!(!repair(&from, &to).unwrap().was_whole);
        let (before, after) = (open(&bytes).unwrap(), Recording::open(&to).unwrap());
        let lost = 1000 - after.ticks.len();
        assert!(lost <= 201 && (lost == 0) == (what == "topics"), "{what}: {lost} ticks lost");
        assert!(after.ticks.len() > before.ticks.len() && after.damage.is_none(), "{what}");
        assert!(after.ticks.iter().all(|t| bits(t) == bits(&tick(t.tick))));
        assert_eq!(after.promised_ticks(), 1000, "{what}: gaps are missed");
        let losses = after.losses().unwrap();
        assert!(losses.contains("it was repaired; before, it is cut or damaged at byte"), "{losses}");
        let bytes = std::fs::read(&to).unwrap();
        let index = mcap::Summary::read(&bytes).unwrap().unwrap();
        let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).count() as u64;
        assert_eq!(index.stats.unwrap().message_count, messages);
    }
    let mut headless = whole.clone();
    let at = offset_of(12, &whole);
    headless[at + 9..at + 40].fill(0xff);
    std::fs::write(&from, headless).unwrap();
    std::fs::remove_file(&to).unwrap();
    assert!(matches!(repair(&from, &to), Err(LinkError::NoHeader { .. })) && !to.exists(), "nothing is left");
}

#[test]
fn older_recordings_are_whole() {
    let paths = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/paths");
    let files = std::fs::read_dir(paths).unwrap().flatten().map(|entry| entry.path());
    let files: Vec<_> = files.filter(|path| path.extension().is_some_and(|e| e == "mcap")).collect();
    assert!(files.len() >= 7);
    for file in files {
        let recording = Recording::open(&file).unwrap();
        assert!(recording.losses().is_none() && recording.ticks.len() >= 2500, "{}", file.display());
    }
}

/// Position of the record with this opcode.
fn offset_of(opcode: u8, file: &[u8]) -> usize {
    let mut at = 8;
    while file[at] != opcode {
        at += 9 + u64::from_le_bytes(file[at + 1..at + 9].try_into().unwrap()) as usize;
    }
    at
}

#[test]
fn claims_of_huge_sizes_are_refused() {
    const CHUNK: u8 = 6;
    let whole = file(450);
    let first = offset_of(CHUNK, &whole);
    let claims = |field: usize, value: u64| {
        let mut bytes = whole.clone();
        bytes[first + field..first + field + 8].copy_from_slice(&value.to_le_bytes());
        let recording = open(&bytes).unwrap();
        assert!(recording.damage.is_some() && recording.ticks.is_empty(), "field at {field} = {value}");
    };
    for value in [u64::MAX, 1 << 60, 1 << 40, 17 << 20] {
        claims(1, value); // length of the record
        claims(9 + 16, value); // unpacked size
    }
}

#[test]
fn errors_name_the_file_and_the_remedy() {
    let missing = Recording::open(Path::new("nowhere/session.mcap")).unwrap_err().to_string();
    assert!(missing.contains("nowhere/session.mcap") && missing.contains("check the name"), "{missing}");
    let folder = Recorder::create(Path::new("nowhere/session.mcap"), &header()).err().unwrap().to_string();
    assert!(folder.contains("nowhere/session.mcap") && folder.contains("folder"), "{folder}");
    let other = open(b"not a recording at all").unwrap_err().to_string();
    assert!(other.contains("session.mcap") && other.contains("--record"), "{other}");
}

/// A disk with limited room, bytes.
struct SmallDisk {
    stream: Cursor<Vec<u8>>,
    room: usize,
}

impl Write for SmallDisk {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let count = bytes.len().min(self.room.saturating_sub(self.stream.position() as usize));
        if count == 0 && !bytes.is_empty() {
            return Err(std::io::Error::from(std::io::ErrorKind::StorageFull));
        }
        self.stream.write(&bytes[..count])
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Seek for SmallDisk {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.stream.seek(to)
    }
}

#[test]
fn a_full_disk_is_an_error_each_time_and_never_a_panic() {
    let whole = file(600).len();
    for room in (0..whole).step_by(1717) {
        let disk = SmallDisk { stream: Cursor::new(Vec::new()), room };
        let Ok(mut recorder) = Recorder::to(disk, Path::new("full.mcap"), &header()) else { continue };
        let written = record(&mut recorder, 600);
        if written.is_err() {
            assert!(recorder.flush().is_err() && recorder.tick(&tick(0)).is_err());
        }
        let error = written.and_then(|()| recorder.finish()).unwrap_err().to_string();
        assert!(error.contains("full.mcap") && error.contains("free some disk space"), "{error}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn the_systems_own_full_disk_is_an_error() {
    let full = Path::new("/dev/full");
    let error = Recorder::create(full, &header()).and_then(|mut r| record(&mut r, 600)).unwrap_err().to_string();
    assert!(error.contains("/dev/full") && error.contains("No space left"), "{error}");
}

#[test]
fn times_that_are_no_numbers_are_recorded_as_they_are() {
    let mut recorder = Recorder::to(Cursor::new(Vec::new()), Path::new("odd.mcap"), &header()).unwrap();
    for time_ms in [f64::NAN, f64::INFINITY, -5.0, 1e300, 3.0] {
        recorder.tick(&TickRecord { time_ms, ..TickRecord::default() }).unwrap();
    }
    recorder.finish().unwrap();
}

#[test]
fn older_recordings_give_the_tissue_force_without_bone_contact() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/paths");
    for (name, soft) in [("brain-light", true), ("skull-touch", false)] {
        let recording = Recording::open(&folder.join(format!("{name}.mcap"))).unwrap();
        assert!(recording.ticks.len() > 2000 && recording.losses().is_none());
        assert!(recording.ticks.iter().all(|tick| !tick.has(TickRecord::TISSUE) && tick.tissue_force == Vec3::ZERO));
        let peak = recording.ticks.iter().map(|tick| tick.tissue_n()).fold(0.0, f32::max);
        assert_eq!(peak > 0.0, soft, "{name}: {peak} N");
    }
    let tick = TickRecord { tissue_depth_mm: 1.0, wrench: Wrench { force: Vec3::X, torque: Vec3::ZERO }, ..tick(3) };
    let old = |depth_mm| TickRecord { depth_mm, flags: 0, ..tick };
    assert_eq!((old(0.0).tissue_n(), old(0.1).tissue_n()), (1.0, 0.0));
    let new = TickRecord { tissue_force: 0.25 * Vec3::Y, flags: TickRecord::TISSUE, ..old(0.1) };
    assert_eq!((new.tissue_n(), new.tissue_normal()), (0.25, Vec3::Y));
}
