//! Writes recordings as Parquet tables, a partition for each session.
//!
//! # Practice
//! `OUT/TABLE/session=ID/part.parquet` for `ticks`, `events`, `scores` and `cases`. A session's
//! files are written beside them and renamed when all four are whole, `cases` last: a session is
//! there if its file of `cases` is. Ticks go through a window of [`BATCH`] plus [`LAG`], so that
//! memory does not grow with a recording's length, nor with the number of recordings. The ID is a
//! hash of the recording's beginning, which has the session's seed, configuration and first
//! measured times: a copy under another name is the same session.

use crate::facts::{self, Facts, Score, without_paths};
use crate::files::{recordings, shown};
use crate::tables::{self, SOURCE_KEY, TABLES, VERSION, VERSION_KEY};
use anyhow::{Context, Result, bail};
use datafusion::arrow::array::{ArrayRef, BooleanArray, Float64Array, RecordBatch, StringArray, UInt64Array};
use datafusion::parquet::arrow::ArrowWriter;
use datafusion::parquet::file::metadata::KeyValue;
use datafusion::parquet::file::reader::{FileReader, SerializedFileReader};
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{self, File, TryLockError};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use trepan_link::wire::{EventRecord, SecondRecord, SessionHeader, TickRecord};
use trepan_link::{Recording, Streamed};

/// Ticks that are encoded at once; numerical, it bounds memory.
const BATCH: usize = 8192;
/// Ticks that are held back for a record of the second hand that comes later in the file;
/// numerical.
const LAG: usize = 4096;
/// Bytes of a recording's beginning that its ID is made of; numerical.
const HEAD_BYTES: u64 = 64 * 1024;
/// Key of program and version in a file's metadata.
const PROGRAM_KEY: &str = "trepan.program";
/// File of a partition.
const PART: &str = "part.parquet";

/// What an export did.
#[derive(Debug, Default)]
pub struct Exported {
    /// Sessions that were written.
    pub written: usize,
    /// Sessions that were there, from the same files.
    pub skipped: usize,
    /// Ticks that were written.
    pub ticks: u64,
    /// Session time that was written, s.
    pub seconds: f64,
    /// Number of sessions by program and version, of all in the folder that was read.
    pub versions: BTreeMap<String, usize>,
    /// Losses and choices that a reader of the tables should know, each with file and remedy.
    pub warnings: Vec<String>,
    /// Recordings that could not be exported, with reason and remedy.
    pub failed: Vec<String>,
    /// Sessions of the folder that was read.
    pub sessions: BTreeSet<String>,
}

/// A recording and the files of results beside it.
struct Source {
    path: PathBuf,
    id: String,
    bytes: u64,
    /// Length of the recording and hash of the others, which tell changed files from exported ones.
    stamp: String,
    results: [Option<PathBuf>; 2],
}

/// What became of one session.
#[derive(Default)]
struct Done {
    written: bool,
    ticks: u64,
    seconds: f64,
    program: String,
    warnings: Vec<String>,
}

/// Exports every recording in a folder and below, on all cores. A recording that fails is listed
/// and does not stop the others. An error where nothing can be read or `out` cannot be written.
pub fn export(runs: &Path, out: &Path) -> Result<Exported> {
    let paths = recordings(runs)?;
    let failed = || format!("cannot write into {}; choose a folder that you may write to", shown(out));
    fs::create_dir_all(out).with_context(failed)?;
    let was_ours = out.join(".lock").is_file();
    let lock = File::create(out.join(".lock")).with_context(failed)?;
    match lock.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => bail!("another export writes into {}; wait for its end", shown(out)),
        Err(TryLockError::Error(fault)) => return Err(fault).with_context(failed),
    }
    if was_ours {
        remove_unfinished(out)?;
    }
    let mut exported = Exported::default();
    let sources = distinct(paths, &mut exported);
    exported.sessions = sources.iter().map(|source| source.id.clone()).collect();
    let done: Vec<_> = sources.par_iter().map(|source| (source, session(source, out))).collect();
    for (source, done) in done {
        match done {
            Ok(Done { written, ticks, seconds, program, warnings }) => {
                exported.written += usize::from(written);
                exported.skipped += usize::from(!written);
                exported.ticks += ticks;
                exported.seconds += seconds;
                *exported.versions.entry(program).or_default() += 1;
                exported.warnings.extend(warnings.iter().map(|warning| format!("{}: {warning}", shown(&source.path))));
            }
            Err(fault) => exported.failed.push(format!("{}: {fault:#}", shown(&source.path))),
        }
    }
    Ok(exported)
}

/// Removes what a stopped export left: temporary folders, and partitions without their row of
/// `cases`.
fn remove_unfinished(out: &Path) -> Result<()> {
    let list = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let temporary =
        list(out).filter(|path| path.file_name().is_some_and(|n| n.to_string_lossy().starts_with(".part-")));
    let partitions = TABLES[..3].iter().flat_map(|table| list(&out.join(table)));
    // Folders of other names are somebody else's.
    let is_ours = |name: &str| {
        let id = name.strip_prefix("session=s").unwrap_or_default();
        id.len() == 16 && id.bytes().all(|byte| byte.is_ascii_hexdigit())
    };
    let unfinished = partitions.filter(|path| {
        let session = path.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
        is_ours(&session) && !out.join("cases").join(&*session).join(PART).exists()
    });
    for path in temporary.chain(unfinished).filter(|path| path.is_dir()) {
        fs::remove_dir_all(&path).with_context(|| format!("cannot remove {}; remove it yourself", shown(&path)))?;
    }
    Ok(())
}

fn source(path: &Path) -> Result<Source> {
    let failed = || "cannot read it; check the rights to read it".to_owned();
    let file = File::open(path).with_context(failed)?;
    let bytes = file.metadata().with_context(failed)?.len();
    let mut head = Vec::new();
    file.take(HEAD_BYTES).read_to_end(&mut head).with_context(failed)?;
    let mut id = "s".to_owned(); // Readers take digits alone for a number.
    Sha256::digest(&head).iter().take(8).for_each(|byte| _ = write!(id, "{byte:02x}"));
    let results = facts::results_of(path);
    let mut digest = Sha256::new();
    results
        .iter()
        .flatten()
        .filter_map(|path| fs::read(path).ok())
        .for_each(|file| digest.update(Sha256::digest(file)));
    let stamp = digest.finalize().iter().take(8).fold(format!("{bytes}:"), |text, byte| text + &format!("{byte:02x}"));
    Ok(Source { path: path.to_owned(), id, bytes, stamp, results })
}

/// One source for each session: of copies, the longest.
fn distinct(paths: Vec<PathBuf>, exported: &mut Exported) -> Vec<Source> {
    let mut found = BTreeMap::<String, Source>::new();
    for path in paths {
        let source = match source(&path) {
            Ok(source) => source,
            Err(fault) => {
                exported.failed.push(format!("{}: {fault:#}", shown(&path)));
                continue;
            }
        };
        let Some(other) = found.remove(&source.id) else {
            found.insert(source.id.clone(), source);
            continue;
        };
        let [kept, left] = if source.bytes > other.bytes { [source, other] } else { [other, source] };
        let [place, again] = [&kept, &left].map(|source| shown(&source.path));
        exported
            .warnings
            .push(format!("{again} is the session of {place}, and not longer: left out; remove one of them"));
        found.insert(kept.id.clone(), kept);
    }
    found.into_values().collect()
}

/// Exports one session; nothing of it is there if that fails.
fn session(source: &Source, out: &Path) -> Result<Done> {
    let partition = |table: &str| out.join(table).join(format!("session={}", source.id));
    if let Some(program) = exported_before(&partition("cases").join(PART), &source.stamp)? {
        return Ok(Done { program, ..Done::default() });
    }
    let failed = || format!("cannot write into {}; free some disk space", shown(out));
    let folder = tempfile::Builder::new().prefix(".part-").tempdir_in(out).with_context(failed)?;
    let mut warnings = Vec::new();
    let facts = source.results[0].as_deref().map(facts::facts).transpose()?.unwrap_or_default();
    let scores = source.results[1].as_deref().map(facts::scores).transpose()?;
    if scores.is_none() {
        warnings.push("no scores.csv beside it, so its table of scores is empty; fetch it, and export again".into());
    }
    if facts.hides_a_person() {
        warnings.push("its person may be a name and was left out; give codes such as --person N07".into());
    }
    let file = |table: &str| folder.path().join(format!("{table}.parquet"));
    let mut sink = Sink { writer: create(&file("ticks"), "ticks", &source.stamp)?, session: Session::default() };
    let streamed = trepan_link::stream(&source.path, |chunk| sink.add(chunk))?;
    let session = sink.finish()?;
    let late = session.of_second[0] - session.of_second[1];
    if let Some(losses) = streamed.losses() {
        let remedy = "what is whole was exported; fetch the file again for the rest";
        warnings.push(format!("{losses}; {remedy}"));
    }
    if late > 0 {
        warnings.push(format!("{late} records of the second hand came {LAG} ticks late and are null; tell the makers"));
    }
    let program = format!("{} {}", session.header.app, session.header.version);
    let write = |table, rows| write_one(&file(table), table, &source.stamp, &program, rows);
    write("events", events(&session.events)?)?;
    write("scores", score_rows(&scores.unwrap_or_default())?)?;
    write("cases", case_row(&session, &facts, &streamed)?)?;
    for table in TABLES {
        let place = partition(table);
        if table == TABLES[0] {
            // From here the old session is gone, if there was one: `cases` first, as it says what
            // is there.
            for table in ["cases", "ticks", "events", "scores"] {
                let old = partition(table);
                if old.exists() {
                    fs::remove_dir_all(&old).with_context(failed)?;
                }
            }
        }
        fs::create_dir_all(&place).with_context(failed)?;
        fs::rename(file(table), place.join(PART)).with_context(failed)?;
    }
    Ok(Done { written: true, ticks: session.ticks, seconds: session.seconds(), program, warnings })
}

/// Program and version if the session was exported from the same files by this version of the
/// tables.
fn exported_before(cases: &Path, stamp: &str) -> Result<Option<String>> {
    if !cases.exists() {
        return Ok(None);
    }
    let damaged = || format!("{} is damaged; remove its folder, and export again", shown(cases));
    let reader = SerializedFileReader::new(File::open(cases).with_context(damaged)?).with_context(damaged)?;
    let entries = reader.metadata().file_metadata().key_value_metadata();
    let value = |key: &str| entries.into_iter().flatten().find(|entry| entry.key == key)?.value.as_deref();
    if value(VERSION_KEY) != Some(VERSION) {
        let found = value(VERSION_KEY).unwrap_or("none");
        bail!("the folder has tables of version {found}, this program writes {VERSION}; export into a new folder");
    }
    if value(SOURCE_KEY) != Some(stamp) {
        return Ok(None);
    }
    Ok(value(PROGRAM_KEY).map(str::to_owned))
}

fn create(path: &Path, table: &str, stamp: &str) -> Result<ArrowWriter<File>> {
    let file = File::create(path).with_context(|| format!("cannot create {}", shown(path)))?;
    Ok(ArrowWriter::try_new(file, tables::schema(table), Some(tables::properties(table, stamp)))?)
}

fn write_one(path: &Path, table: &str, stamp: &str, program: &str, rows: RecordBatch) -> Result<()> {
    let mut writer = create(path, table, stamp)?;
    writer.append_key_value_metadata(KeyValue::new(PROGRAM_KEY.to_owned(), program.to_owned()));
    writer.write(&rows)?;
    writer.close()?;
    Ok(())
}

/// The ticks of a session on their way to a file, and what else the other tables need.
struct Sink {
    writer: ArrowWriter<File>,
    session: Session,
}

/// What was read of a session.
#[derive(Default)]
struct Session {
    waiting: Vec<TickRecord>,
    second: Vec<SecondRecord>,
    /// Records of the second hand, and those that found their tick.
    of_second: [u64; 2],
    header: SessionHeader,
    events: Vec<EventRecord>,
    ticks: u64,
    first_ms: Option<f64>,
    last_ms: f64,
}

impl Sink {
    fn add(&mut self, chunk: &Recording) -> Result<()> {
        let Session { waiting, second, of_second, header, events, .. } = &mut self.session;
        header.clone_from(&chunk.header);
        events.extend(chunk.events.iter().cloned());
        waiting.extend_from_slice(&chunk.ticks);
        second.extend_from_slice(&chunk.second);
        of_second[0] += chunk.second.len() as u64;
        while self.session.waiting.len() >= BATCH + LAG {
            self.write(BATCH)?;
        }
        Ok(())
    }

    /// Writes the first ticks that wait, each with the second hand's record of its number.
    fn write(&mut self, count: usize) -> Result<()> {
        let session = &mut self.session;
        let ticks = &session.waiting[..count];
        let (mut pairs, mut used) = (vec![None; count], 0);
        if let Some(last) = ticks.last() {
            used = session.second.partition_point(|second| second.tick <= last.tick);
            let mut second = session.second[..used].iter().peekable();
            for (tick, pair) in ticks.iter().zip(&mut pairs) {
                while second.next_if(|second| second.tick < tick.tick).is_some() {}
                *pair = second.next_if(|second| second.tick == tick.tick).copied();
            }
            session.first_ms = session.first_ms.or(ticks.first().map(|tick| tick.time_ms));
            session.last_ms = last.time_ms;
        }
        session.of_second[1] += pairs.iter().flatten().count() as u64;
        self.writer.write(&tables::tick_rows(ticks, &pairs)?)?;
        session.ticks += count as u64;
        session.waiting.drain(..count);
        session.second.drain(..used);
        Ok(())
    }

    /// Writes the rest.
    fn finish(mut self) -> Result<Session> {
        self.write(self.session.waiting.len())?;
        self.writer.close()?;
        Ok(self.session)
    }
}

impl Session {
    /// Session time from the first tick to the last, s.
    fn seconds(&self) -> f64 {
        1e-3 * (self.last_ms - self.first_ms.unwrap_or(self.last_ms))
    }
}

fn events(events: &[EventRecord]) -> Result<RecordBatch> {
    let values: Vec<ArrayRef> = vec![
        Arc::new(UInt64Array::from_iter_values(events.iter().map(|event| event.tick))),
        Arc::new(Float64Array::from_iter_values(events.iter().map(|event| event.time_ms))),
        Arc::new(StringArray::from_iter_values(events.iter().map(|event| &event.kind))),
        Arc::new(StringArray::from_iter_values(events.iter().map(|event| without_paths(&event.text)))),
    ];
    Ok(RecordBatch::try_new(tables::schema("events"), values)?)
}

fn score_rows(scores: &[Score]) -> Result<RecordBatch> {
    let values: Vec<ArrayRef> = vec![
        Arc::new(StringArray::from_iter_values(scores.iter().map(|score| without_paths(&score.name)))),
        Arc::new(Float64Array::from_iter_values(scores.iter().map(|score| score.value))),
        Arc::new(StringArray::from_iter_values(scores.iter().map(|score| score.unit))),
    ];
    Ok(RecordBatch::try_new(tables::schema("scores"), values)?)
}

fn case_row(session: &Session, facts: &Facts, streamed: &Streamed) -> Result<RecordBatch> {
    let header = &session.header;
    let config = |key: &str| header.config.get(key).cloned();
    let clean = |text: &Option<String>| text.as_deref().map(without_paths);
    let own = |text: Option<&str>| text.map(str::to_owned);
    let text = |value: Option<String>| Arc::new(StringArray::from(vec![value])) as ArrayRef;
    let whole = |value: u64| Arc::new(UInt64Array::from(vec![value])) as ArrayRef;
    let yes = |value: bool| Arc::new(BooleanArray::from(vec![value])) as ArrayRef;
    let second_device = facts.second["device"].as_str().map(without_paths);
    let losses = streamed.losses();
    let values = vec![
        text(Some(header.app.clone())),
        text(Some(header.version.clone())),
        text(header.hashes.get("case").cloned()),
        text(clean(&facts.device)),
        text(second_device),
        text(Some(clean(&facts.lesson).unwrap_or_else(|| header.app.clone()))),
        text(own(facts.participant())),
        text(own(facts.condition())),
        text(config("quality")),
        // With a condition it would say what that is.
        text(config("ingredients.rigid").filter(|_| facts.condition().is_none())),
        text(facts.date.clone()),
        whole(header.seed),
        Arc::new(Float64Array::from(vec![session.seconds()])),
        whole(session.ticks),
        whole(streamed.missing),
        yes(session.of_second[0] > 0),
        yes(losses.is_none()),
        yes(facts.simulated),
        text(losses),
    ];
    Ok(RecordBatch::try_new(tables::schema("cases"), values)?)
}
