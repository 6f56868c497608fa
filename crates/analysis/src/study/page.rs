//! A study's files: `study.html`, one page without links to elsewhere, and CSV tables.

use super::protocol::Protocol;
use super::results::{Attempt, Law, Of, Results, csv, sessions};
use crate::files::whole;
use anyhow::Result;
use minijinja::value::Serde;
use minijinja::{Environment, Value, context};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Colours that colour-blind people tell apart (Okabe and Ito), as on the report's pages.
const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

/// Columns of `comparisons.csv` and `reliability.csv`, those of their rows in order.
const COMPARISONS: &str =
    "measure task first second paired n_first n_second mean_first mean_second g g_low g_high p p_holm found";
const RELIABILITY: &str =
    "measure task group participants attempts icc_2_1 icc_2_1_low icc_2_1_high icc_3_1 icc_3_1_low icc_3_1_high";

/// Writes the page and its tables. `missing` lists what the study lacks; `names` lifts the
/// blinding: the name behind each letter.
pub fn write(
    protocol: &Protocol,
    results: &Results,
    missing: &[String],
    names: &BTreeMap<String, String>,
    folder: &Path,
) -> Result<()> {
    let measures: Vec<&str> = protocol.measures.iter().map(|measure| measure.score.as_str()).collect();
    let tables = [
        ("comparisons.csv", csv(COMPARISONS, &results.findings)?),
        ("learning.csv", csv("measure task group attempt mean standard_error", &results.attempts)?),
        ("laws.csv", csv("measure task group floor gain rate r_squared rate_low rate_high", &results.laws)?),
        ("reliability.csv", csv(RELIABILITY, &results.reliability)?),
        ("outliers.csv", csv("session participant task measure value modified_z", &results.outliers)?),
        ("sessions.csv", sessions(&results.runs, &measures)?),
        ("study.html", html(protocol, results, missing, names)?.into_bytes()),
    ];
    tables.iter().try_for_each(|(name, bytes)| whole(&folder.join(name), bytes))
}

fn html(
    protocol: &Protocol,
    results: &Results,
    missing: &[String],
    names: &BTreeMap<String, String>,
) -> Result<String> {
    let mut pages = Environment::new();
    pages.add_filter("number", number);
    pages.add_template("study.html", include_str!("../../templates/study.html"))?;
    let of_chart = |a: &Of<Attempt>, b: &Of<Attempt>| a.measure == b.measure && a.task == b.task;
    let charts = results.attempts.chunk_by(of_chart).map(|rows| chart(rows, &results.laws));
    let taken = |of: usize, taken_for: usize| {
        let taken = results.classified.iter().flat_map(|classified| &classified.taken_for);
        results.groups.iter().zip(taken).filter(|(group, taken)| **group == of && **taken == taken_for).count()
    };
    let ends = results.findings.iter().flat_map(|of| [of.comparison.g_low, of.comparison.g_high]);
    let all = 0..protocol.groups.len();
    let page = pages.get_template("study.html")?.render(context! {
        protocol => Value::from(Serde(protocol)),
        simulated => results.simulated,
        found => results.findings.iter().filter(|finding| finding.found).count(),
        participants => results.runs.iter().map(|run| &run.participant).collect::<BTreeSet<_>>().len(),
        sessions => results.runs.len(),
        missing => Value::from(Serde(missing)),
        names => Value::from(Serde(names)),
        findings => Value::from(Serde(&results.findings)),
        span => ends.filter(|end| end.is_finite()).fold(1.0, |span: f64, end| span.max(end.abs())),
        charts => charts.collect::<Vec<_>>(),
        laws => Value::from(Serde(&results.laws)),
        reliability => Value::from(Serde(&results.reliability)),
        classified => Value::from(Serde(&results.classified)),
        groups => protocol.groups.iter().map(|group| group.name.clone()).collect::<Vec<_>>(),
        taken => all.clone().map(|of| all.clone().map(|for_| taken(of, for_)).collect::<Vec<_>>()).collect::<Vec<_>>(),
        outliers => Value::from(Serde(&results.outliers)),
    })?;
    Ok(page)
}

/// A number of four digits.
fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    if value == 0.0 {
        return "0".into();
    }
    let digits = 3 - value.abs().max(1e-3).log10().floor() as i32;
    format!("{value:.*}", digits.clamp(0, 4) as usize)
}

/// Means of the groups by attempt with their standard errors and laws, in the picture's pixels.
fn chart(rows: &[Of<Attempt>], laws: &[Of<Law>]) -> Value {
    let error = |is: &Attempt| if is.standard_error.is_finite() { is.standard_error } else { 0.0 };
    let low = rows.iter().fold(f64::MAX, |low, Of { is, .. }| low.min(is.mean - error(is)));
    let high = rows.iter().fold(f64::MIN, |high, Of { is, .. }| high.max(is.mean + error(is)));
    let last = rows.iter().map(|of| of.is.attempt).max().unwrap_or(0).max(2) as f64;
    let x = |attempt: f64| 80.0 + 560.0 * (attempt - 1.0) / (last - 1.0);
    let y = |value: f64| 220.0 - 200.0 * (value - low) / (high - low).max(1e-12);
    let groups = rows.chunk_by(|a, b| a.group == b.group).zip(COLOURS.iter().cycle()).map(|(rows, colour)| {
        let point = |Of { is, .. }: &Of<Attempt>| {
            [x(is.attempt as f64), y(is.mean), y(is.mean - error(is)), y(is.mean + error(is))]
        };
        let Of { measure, task, group, .. } = &rows[0];
        let is_of = |law: &&Of<Law>| law.group == *group && law.measure == *measure && law.task == *task;
        let line = laws.iter().find(is_of).map(|of| {
            let attempts = (0..=60).map(|step| 1.0 + (last - 1.0) * f64::from(step) / 60.0);
            attempts.map(|at| format!("{:.1},{:.1} ", x(at), y(of.is.law.at(at)))).collect::<String>()
        });
        context! { group, colour => *colour, line, points => rows.iter().map(point).collect::<Vec<_>>() }
    });
    let caption = format!("{}, {}", rows[0].measure, rows[0].task);
    context! { caption, low, high, last, groups => groups.collect::<Vec<_>>() }
}
