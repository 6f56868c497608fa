//! The runs of a study, from the tables: who did which task in which condition, and the scores.

use super::protocol::Protocol;
use crate::files::shown;
use crate::query::Database;
use crate::statistics::{mean, strokes};
use anyhow::{Context, Result};
use datafusion::arrow::array::{AsArray, RecordBatch};
use datafusion::arrow::compute::cast;
use datafusion::arrow::datatypes::{DataType, Float64Type};
use datafusion::parquet::arrow::ProjectionMask;
use datafusion::parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

/// One session of a participant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Run {
    /// Code of the participant.
    pub participant: String,
    /// Number of the participant's group.
    pub group: usize,
    /// Task.
    pub task: String,
    /// Letter of the blinded condition.
    pub condition: Option<String>,
    /// Attempt at the task in the condition, from 1, by the time at which it began.
    pub attempt: usize,
    /// The protocol's measures, those that the session has.
    pub scores: BTreeMap<String, f64>,
    /// Whether the recording is whole.
    pub complete: bool,
    /// Whether a program made the participant.
    pub simulated: bool,
    /// Session's ID in the tables.
    pub session: String,
}

/// Reads the runs from a folder of tables, and lists sessions that are no part of the study. Runs
/// are sorted by participant, task, condition and time.
pub fn runs(protocol: &Protocol, tables: &Path) -> Result<(Vec<Run>, Vec<String>)> {
    let database = Database::open(tables)?;
    let cases = database.rows(
        "select session, participant, task, condition, complete, simulated from cases \
         order by participant, task, condition, began_utc, session",
    )?;
    let (mut runs, mut others) = (Vec::<Run>::new(), Vec::new());
    for batch in &cases {
        let columns: Vec<Vec<Option<String>>> = (0..6).map(|at| texts(batch, at)).collect::<Result<_>>()?;
        let rows = (0..batch.num_rows()).map(|row| std::array::from_fn(|at| columns[at][row].clone()));
        for [session, participant, task, condition, complete, simulated] in rows {
            let (session, task) = (session.unwrap_or_default(), task.unwrap_or_default());
            let code = participant.unwrap_or_default();
            let Some(group) = protocol.group_of(&code).filter(|_| !code.is_empty()) else {
                others.push(format!("session {session}: participant {code:?} is not in the plan; is --person right?"));
                continue;
            };
            if !protocol.tasks.iter().any(|known| known.name == task) {
                others.push(format!("session {session} of {code}: task {task:?} is not in the protocol"));
                continue;
            }
            let same = |run: &&Run| run.participant == code && run.task == task && run.condition == condition;
            let attempt = runs.last().filter(same).map_or(1, |run| run.attempt + 1);
            let is = |text: Option<String>| text.as_deref() == Some("true");
            let (complete, simulated) = (is(complete), is(simulated));
            let scores = BTreeMap::new();
            runs.push(Run { participant: code, group, task, condition, attempt, scores, complete, simulated, session });
        }
    }
    add_scores(protocol, &database, &mut runs)?;
    if protocol.measures.iter().any(|measure| measure.score.starts_with("strokes.")) {
        add_strokes(tables, &mut runs)?;
    }
    Ok((runs, others))
}

fn add_scores(protocol: &Protocol, database: &Database, runs: &mut [Run]) -> Result<()> {
    let names: Vec<String> = protocol.measures.iter().map(|m| format!("'{}'", m.score.replace('\'', "''"))).collect();
    let sql = format!("select session, name, value from scores where name in ({})", names.join(", "));
    let mut found = BTreeMap::<String, BTreeMap<String, f64>>::new();
    for batch in database.rows(&sql)? {
        let (sessions, names) = (texts(&batch, 0)?, texts(&batch, 1)?);
        let values = batch.column(2).as_primitive::<Float64Type>();
        for ((session, name), value) in sessions.into_iter().zip(names).zip(values.values()) {
            found.entry(session.unwrap_or_default()).or_default().insert(name.unwrap_or_default(), *value);
        }
    }
    for run in runs {
        run.scores = found.remove(&run.session).unwrap_or_default();
    }
    Ok(())
}

/// A column as texts.
fn texts(batch: &RecordBatch, column: usize) -> Result<Vec<Option<String>>> {
    let column = cast(batch.column(column), &DataType::Utf8)?;
    Ok(column.as_string::<i32>().iter().map(|text| text.map(str::to_owned)).collect())
}

/// Adds what the motion says: strokes a minute, their mean way and mean fastest speed.
fn add_strokes(tables: &Path, runs: &mut [Run]) -> Result<()> {
    runs.par_iter_mut().try_for_each(|run| {
        let path = tables.join("ticks").join(format!("session={}", run.session)).join("part.parquet");
        let (time_ms, tip) = motion(&path).with_context(|| format!("cannot read {}; export again", shown(&path)))?;
        let found = strokes(&time_ms, &tip);
        let minutes = (time_ms.last().unwrap_or(&0.0) - time_ms.first().unwrap_or(&0.0)) / 60e3;
        if found.is_empty() || minutes <= 0.0 {
            return Ok(());
        }
        let mean_of = |value: fn(&crate::statistics::Stroke) -> f64| mean(&found.iter().map(value).collect::<Vec<_>>());
        run.scores.insert("strokes.per_min".into(), found.len() as f64 / minutes);
        run.scores.insert("strokes.path_mm".into(), mean_of(|stroke| stroke.path_mm));
        run.scores.insert("strokes.peak_mm_s".into(), mean_of(|stroke| stroke.peak_mm_s));
        Ok(())
    })
}

/// Times and tip of a session's ticks.
fn motion(path: &Path) -> Result<(Vec<f64>, Vec<[f32; 3]>)> {
    let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(path)?)?;
    let names = ["time_ms", "proxy_x_mm", "proxy_y_mm", "proxy_z_mm"];
    let mask = ProjectionMask::columns(reader.parquet_schema(), names);
    let (mut time_ms, mut tip) = (Vec::new(), Vec::new());
    for batch in reader.with_projection(mask).build()? {
        let batch = batch?;
        time_ms.extend_from_slice(batch.column(0).as_primitive::<Float64Type>().values());
        let axes: [_; 3] = std::array::from_fn(|axis| {
            batch.column(axis + 1).as_primitive::<datafusion::arrow::datatypes::Float32Type>().values().clone()
        });
        tip.extend((0..batch.num_rows()).map(|row| std::array::from_fn(|axis| axes[axis][row])));
    }
    Ok((time_ms, tip))
}
