//! A study's files: `study.html`, one page without links to elsewhere, and CSV tables.

use super::protocol::Protocol;
use super::results::{Attempt, Finding, Law, Results, csv, sessions};
use crate::files::whole;
use anyhow::Result;
use minijinja::value::Serde;
use minijinja::{Environment, Value, context};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

/// Colours that colour-blind people tell apart (Okabe and Ito), as on the report's pages.
const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

/// Columns of `comparisons.csv` and `reliability.csv`, those of their rows in order.
const COMPARISONS: &str =
    "measure task first second paired n_first n_second mean_first mean_second g g_low g_high p p_holm found";
const RELIABILITY: &str =
    "measure task participants attempts icc_2_1 icc_2_1_low icc_2_1_high icc_3_1 icc_3_1_low icc_3_1_high";

/// Writes the page and its tables. `missing` lists what the study lacks; `names` lifts the blinding:
/// the name behind each letter.
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
    let of_chart = |a: &Attempt, b: &Attempt| a.measure == b.measure && a.task == b.task;
    let charts = results.attempts.chunk_by(of_chart).map(|rows| {
        let caption = format!("{}, {}", rows[0].measure, rows[0].task);
        BTreeMap::from([("svg", chart(rows, &results.laws)), ("caption", caption)])
    });
    let taken = |of: usize, taken_for: usize| {
        let taken = results.classified.iter().flat_map(|classified| &classified.taken_for);
        results.groups.iter().zip(taken).filter(|(group, taken)| **group == of && **taken == taken_for).count()
    };
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
        forest => forest(&results.findings),
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
    let digits = 3 - value.abs().max(1e-3).log10().floor() as i32;
    format!("{value:.*}", digits.clamp(0, 4) as usize)
}

/// A text for SVG.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Effects with their intervals.
fn forest(findings: &[Finding]) -> String {
    let ends = findings.iter().flat_map(|of| [of.comparison.g_low, of.comparison.g_high]);
    // Wider ones are cut: beyond 8 standard deviations nothing needs a scale.
    let span = ends.filter(|end| end.is_finite()).fold(1.0, |span: f64, end| span.max(end.abs())).min(8.0);
    let x = |g: f64| 570.0 + 260.0 * (g / span).clamp(-1.0, 1.0);
    let height = 24 * findings.len() + 40;
    let mut svg = format!("<svg viewBox=\"0 0 860 {height}\" font-size=\"13\" role=\"img\">");
    _ = write!(svg, "<path d=\"M570 0V{}\" stroke=\"#999\"/>", height - 30);
    for (at, of) in findings.iter().enumerate() {
        let (y, colour) = (24.0 * at as f64 + 14.0, if of.found { COLOURS[0] } else { "#777" });
        let [low, high, middle] = [of.comparison.g_low, of.comparison.g_high, of.comparison.g].map(x);
        let place = if of.task.is_empty() { String::new() } else { format!(" ({})", of.task) };
        let name = escaped(&format!("{}{place}: {} − {}", of.measure, of.first, of.second));
        _ = write!(
            svg,
            "<text x=\"0\" y=\"{}\">{name}</text><path d=\"M{low:.1} {y}H{high:.1}\" stroke=\"{colour}\" stroke-width=\"2\"/>\
             <circle cx=\"{middle:.1}\" cy=\"{y}\" r=\"5\" fill=\"{colour}\"/>",
            y + 4.0
        );
    }
    for g in [-span, 0.0, span] {
        _ = write!(svg, "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>", x(g), height - 8, number(g));
    }
    svg + "</svg>"
}

/// Means of the groups by attempt, with their standard errors and laws.
fn chart(rows: &[Attempt], laws: &[Law]) -> String {
    let error = |of: &Attempt| if of.standard_error.is_finite() { of.standard_error } else { 0.0 };
    let low = rows.iter().fold(f64::MAX, |low, of| low.min(of.mean - error(of)));
    let high = rows.iter().fold(f64::MIN, |high, of| high.max(of.mean + error(of)));
    let last = rows.iter().map(|of| of.attempt).max().unwrap_or(0).max(2) as f64;
    let x = |attempt: f64| 80.0 + 560.0 * (attempt - 1.0) / (last - 1.0);
    let y = |value: f64| 220.0 - 200.0 * (value - low) / (high - low).max(1e-12);
    let mut svg = "<svg viewBox=\"0 0 860 260\" font-size=\"13\" role=\"img\">".to_owned();
    svg += "<path d=\"M70 20V225H640\" stroke=\"#999\" fill=\"none\"/>";
    svg += "<text x=\"360\" y=\"254\" text-anchor=\"middle\">attempt</text>";
    for value in [low, high] {
        _ = write!(svg, "<text x=\"64\" y=\"{:.0}\" text-anchor=\"end\">{}</text>", y(value) + 4.0, number(value));
    }
    for attempt in [1.0, last] {
        _ = write!(svg, "<text x=\"{:.0}\" y=\"240\" text-anchor=\"middle\">{attempt}</text>", x(attempt));
    }
    for (at, rows) in rows.chunk_by(|a, b| a.group == b.group).enumerate() {
        let colour = COLOURS[at % COLOURS.len()];
        for of in rows {
            let (cx, cy) = (x(of.attempt as f64), y(of.mean));
            let (from, to) = (y(of.mean - error(of)), y(of.mean + error(of)));
            _ = write!(svg, "<path d=\"M{cx:.1} {from:.1}V{to:.1}\" stroke=\"{colour}\"/>");
            _ = write!(svg, "<circle cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"4\" fill=\"{colour}\"/>");
        }
        let is_of =
            |law: &&Law| law.group == rows[0].group && law.measure == rows[0].measure && law.task == rows[0].task;
        if let Some(Law { law, .. }) = laws.iter().find(is_of) {
            let line = (0..=60).map(|step| 1.0 + (last - 1.0) * f64::from(step) / 60.0);
            let line: Vec<String> = line.map(|at| format!("{:.1},{:.1}", x(at), y(law.at(at)))).collect();
            _ = write!(svg, "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\"/>", line.join(" "));
        }
        _ = write!(svg, "<text x=\"660\" y=\"{}\" fill=\"{colour}\">{}</text>", 40 + 20 * at, escaped(&rows[0].group));
    }
    svg + "</svg>"
}
