//! The results of a study, as rows of its tables.

use super::runs::Run;
use crate::statistics::{Classified, Comparison, PowerLaw, Reliability};
use anyhow::Result;
use serde::Serialize;

/// A comparison, and whether it is a finding: a row of `comparisons.csv`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Finding {
    /// Measure, or item of the questions.
    pub measure: String,
    /// Task; empty for questions.
    pub task: String,
    /// Group, or letter of a condition.
    pub first: String,
    /// The one that it is compared with.
    pub second: String,
    /// Whether they are conditions of the same participants.
    pub paired: bool,
    /// The numbers.
    pub comparison: Comparison,
    /// p, adjusted over all comparisons of the study (Holm).
    pub p_holm: f64,
    /// Whether the adjusted p is below the level and the interval of g leaves 0 out.
    pub found: bool,
}

/// Something of a measure in a task, of a group or of all of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Of<T> {
    /// Measure.
    pub measure: String,
    /// Task.
    pub task: String,
    /// Group; empty for all.
    pub group: String,
    /// What.
    pub is: T,
}

/// A mean over participants at an attempt, in a row of `learning.csv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Attempt {
    /// Attempt, from 1.
    pub attempt: usize,
    /// Mean over participants.
    pub mean: f64,
    /// Its standard error.
    pub standard_error: f64,
}

/// How participants learn, in a row of `laws.csv`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Law {
    /// Power law of the means.
    pub law: PowerLaw,
    /// 95 % interval of its rate over samples of participants.
    pub rate: [f64; 2],
}

/// An unusual session, listed and not left out: a row of `outliers.csv`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Outlier {
    /// Session's ID.
    pub session: String,
    /// Participant.
    pub participant: String,
    /// Task.
    pub task: String,
    /// Measure.
    pub measure: String,
    /// Value.
    pub value: f64,
    /// Modified z-score within the group and task.
    pub modified_z: f64,
}

/// All results.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Results {
    /// Comparisons.
    pub findings: Vec<Finding>,
    /// Means by attempt; those of a measure and task follow each other, by group.
    pub attempts: Vec<Of<Attempt>>,
    /// Learning.
    pub laws: Vec<Of<Law>>,
    /// Reliability.
    pub reliability: Vec<Of<Reliability>>,
    /// How well the measures tell the groups apart.
    pub classified: Option<Classified>,
    /// Group of each classified participant.
    pub groups: Vec<usize>,
    /// Outliers.
    pub outliers: Vec<Outlier>,
    /// The sessions.
    pub runs: Vec<Run>,
    /// Whether any participant was made by a program.
    pub simulated: bool,
}

/// Rows as CSV below a line of names, also where there are none.
pub(super) fn csv<T: Serialize>(names: &str, rows: &[T]) -> Result<Vec<u8>> {
    let mut writer = csv::WriterBuilder::new().has_headers(false).from_writer(Vec::new());
    writer.write_record(names.split(' '))?;
    rows.iter().try_for_each(|row| writer.serialize(row))?;
    Ok(writer.into_inner()?)
}

/// Sessions as CSV, with a column for each measure.
pub(super) fn sessions(runs: &[Run], measures: &[&str]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let names = ["session", "participant", "task", "condition", "attempt", "complete", "simulated"];
    writer.write_record(names.iter().chain(measures))?;
    for run in runs {
        let Run { session, participant, task, condition, attempt, complete, simulated, .. } = run;
        let condition = condition.clone().unwrap_or_default();
        let mut row = vec![session.clone(), participant.clone(), task.clone(), condition];
        row.extend([attempt.to_string(), complete.to_string(), simulated.to_string()]);
        row.extend(measures.iter().map(|name| run.scores.get(*name).map_or_else(String::new, f64::to_string)));
        writer.write_record(row)?;
    }
    Ok(writer.into_inner()?)
}
