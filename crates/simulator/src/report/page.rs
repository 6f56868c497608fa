//! `report.html`: a self-contained page on a session with pictures, curves from the recording,
//! scores and the machine.

use crate::models::{ModelSummary, TissueSummary};
use crate::report::chart::{Curve, histogram, over_time};
use crate::report::summary::Summary;
use crate::run::Outcome;
use base64::Engine;
use std::fmt::Write;
use trepan_budget::Tissue;
use trepan_link::Recording;
use trepan_link::wire::{SecondRecord, TickRecord};

/// A picture for the report.
#[derive(Clone, Debug)]
pub struct Shot {
    /// Caption of the picture.
    pub caption: String,
    /// PNG bytes.
    pub png: Vec<u8>,
}

/// CSS of every page.
pub const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:960px;margin:2em auto;padding:0 1em;color:#222}\
h1,h2{line-height:1.2}table{border-collapse:collapse}td,th{padding:.2em .8em;border-bottom:1px solid #ccc;text-align:left}\
td.n{text-align:right;font-variant-numeric:tabular-nums}figure{margin:1em 0}img,svg{max-width:100%;height:auto}\
figcaption{color:#555}.w{border-left:.4em solid #d55e00;padding-left:.6em}";

/// Returns the page as HTML.
pub fn html(summary: &Summary, outcome: &Outcome, recording: &Recording, shots: &[Shot]) -> Result<String, String> {
    let mut page = String::new();
    let title = format!("Trepan {}: {}", escaped(&summary.app), escaped(&summary.case));
    let head = "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">";
    page += &format!("{head}<title>{title}</title><style>{STYLE}</style></head><body><h1>{title}</h1>");
    page += &format!(
        "<p>Device {}, {} ticks at {:.1} Hz. Tissue and drilling constants are uncalibrated; scores are physical sums, not clinical ones.</p>",
        escaped(&summary.device),
        summary.ticks,
        summary.rate_hz
    );
    models(&mut page, summary);
    add_events(&mut page, outcome, recording);
    pictures(&mut page, shots);
    curves(&mut page, outcome, recording)?;
    numbers(&mut page, summary)?;
    page += "</body></html>\n";
    Ok(page)
}

/// Adds the models that ran, and why they were chosen.
fn models(page: &mut String, summary: &Summary) {
    let ModelSummary { quality, bone, tissue, picture, .. } = &summary.models;
    let TissueSummary { solver, tets, halvings, still_mm, .. } = *tissue;
    let rays = if picture.sparse { "sparse rays" } else { "every ray" };
    let parts = [
        ("Bone", format!("{} on {} mm voxels", bone.method, bone.spacing_mm), &bone.why),
        ("Tissue", Tissue { solver, tets, halvings, still_mm }.to_string(), &tissue.why),
        ("Picture", format!("{rays}, detail {}", picture.detail), &picture.why),
    ];
    *page += &format!("<h2>Models</h2><p>Quality: {quality}.</p><ul>");
    for (name, what, why) in parts {
        *page += &format!("<li>{name}: {} ({})</li>", escaped(&what), escaped(why));
    }
    *page += "</ul>";
}

/// Adds all notices in the order of time; the teacher's requests are read from the recording.
fn add_events(page: &mut String, outcome: &Outcome, recording: &Recording) {
    let notices = outcome.written.notices.iter().map(|notice| (notice.time_ms, notice.words()));
    let notices = notices.filter(|(_, (kind, _))| *kind != "cleared").map(|(time_ms, (kind, text))| Line {
        time_ms,
        warns: kind == "warning",
        text: if kind == "warning" { text } else { format!("{kind}: {text}") },
    });
    let requests = recording.events.iter().filter(|event| event.kind == TEACHER);
    let requests =
        requests.map(|event| Line { time_ms: event.time_ms, warns: false, text: format!("{TEACHER}: {}", event.text) });
    let mut all: Vec<Line> = notices.chain(requests).collect();
    all.sort_by(|a, b| a.time_ms.total_cmp(&b.time_ms));
    *page += "<h2>What happened</h2><ul>";
    for Line { time_ms, text, warns } in all {
        let class = if warns { " class=\"w\"" } else { "" };
        *page += &format!("<li{class}>{:.2} s: {}</li>", time_ms * 1e-3, escaped(&text));
    }
    *page += "</ul>";
}

/// Kind of the events of a teacher's requests.
const TEACHER: &str = "teacher";

struct Line {
    time_ms: f64,
    text: String,
    warns: bool,
}

fn pictures(page: &mut String, shots: &[Shot]) {
    *page += "<h2>Pictures</h2>";
    if shots.is_empty() {
        *page += "<p>No picture was drawn; the remarks below say why.</p>";
    }
    for shot in shots {
        let png = base64::engine::general_purpose::STANDARD.encode(&shot.png);
        let caption = escaped(&shot.caption);
        *page += &format!(
            "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{png}\"><figcaption>{caption}</figcaption></figure>"
        );
    }
}

fn curves(page: &mut String, outcome: &Outcome, recording: &Recording) -> Result<(), String> {
    let of = |name, value: &dyn Fn(&TickRecord) -> f32| Curve {
        name,
        points: recording.ticks.iter().map(|t| (t.time_ms * 1e-3, f64::from(value(t)))).collect(),
    };
    let near = |t: &TickRecord| t.brain_distance_mm.clamp(-10.0, 20.0);
    let moved = Curve {
        name: "largest displacement",
        points: recording.solver.iter().map(|s| (s.time_ms * 1e-3, f64::from(s.max_displacement_mm))).collect(),
    };
    let forces = match recording.second.is_empty() {
        true => vec![of("force", &|t| t.wrench.force.length())],
        false => vec![of("first hand", &|t| t.wrench.force.length()), second(recording)],
    };
    let charts = [
        ("Force on the hand", over_time("force, N", &forces, Some((outcome.force_limit_n.into(), "device limit")))?),
        (
            "Depth of the tool",
            over_time("depth, mm", &[of("in bone", &|t| t.depth_mm), of("in tissue", &|t| t.tissue_depth_mm)], None)?,
        ),
        (
            "Distance to the brain at rest (cut at 20 mm)",
            over_time("distance, mm", &[of("tool to brain", &near)], None)?,
        ),
        ("Brain", over_time("displacement, mm", &[moved], None)?),
        (
            "Tick compute time (dashed: the 1 ms of the thesis)",
            histogram("compute time of a tick, µs", &outcome.ticks.times.bins(), 1000.0)?,
        ),
    ];
    *page += "<h2>Curves</h2>";
    for (caption, svg) in charts {
        *page += &format!("<figure>{svg}<figcaption>{caption}</figcaption></figure>");
    }
    Ok(())
}

fn second(recording: &Recording) -> Curve {
    let point = |t: &SecondRecord| (t.time_ms * 1e-3, f64::from(t.wrench.force.length()));
    Curve { name: "second hand", points: recording.second.iter().map(point).collect() }
}

/// Paths of the timings in a summary; scores and the rest have their own tables.
const TIMINGS: [&str; 11] = [
    "asked_hz",
    "rate_hz",
    "late_ticks",
    "held_ticks",
    "tick_us",
    "solver.dt_ms",
    "solver.step_us",
    "solver.collision_us",
    "solver.real_time_factor",
    "frames",
    "fps",
];
/// Paths of the scores in a summary.
const SCORES: [&str; 5] = ["scores", "bone_removed_mm3", "plan", "cut_off", "force_n"];

/// Adds every number of the summary by its path: scores, timings, the rest.
fn numbers(page: &mut String, summary: &Summary) -> Result<(), String> {
    let value = serde_json::to_value(summary).map_err(|fault| format!("summary: {fault}"))?;
    let mut all = Vec::new();
    rows("", &value, &mut all);
    let under = |row: &Row, paths: &[&str]| {
        paths
            .iter()
            .any(|path| row.path.strip_prefix(path).is_some_and(|rest| rest.is_empty() || rest.starts_with('.')))
    };
    let (scores, all): (Vec<_>, Vec<_>) = all.into_iter().partition(|row| under(row, &SCORES));
    let (timings, all): (Vec<_>, Vec<_>) = all.into_iter().partition(|row| under(row, &TIMINGS));
    for (title, rows) in [("Scores", scores), ("Timings", timings), ("Numbers", all)] {
        *page += &format!("<h2>{title}</h2>");
        table(page, &rows);
    }
    Ok(())
}

/// A value of a JSON file and its path.
pub struct Row {
    path: String,
    value: String,
}

/// Adds a table of values with their units.
pub fn table(page: &mut String, rows: &[Row]) {
    *page += "<table><tr><th>what</th><th>value</th><th>unit</th></tr>";
    for Row { path, value } in rows {
        let [path, value] = [path, value].map(|text| escaped(text));
        _ = write!(page, "<tr><td>{path}</td><td class=\"n\">{value}</td><td>{}</td></tr>", unit(&path));
    }
    *page += "</table>";
}

/// Endings of names and their units; a longer ending comes before its own endings.
const UNITS: [(&str, &str); 14] = [
    ("_mm3", "mm³"),
    ("_n_s", "N s"),
    ("_n_ms_per_mm", "N ms/mm"),
    ("_mm", "mm"),
    ("_ms", "ms"),
    ("_us", "µs"),
    ("_kpa", "kPa"),
    ("_hz", "Hz"),
    ("_ticks", "ticks"),
    ("_percent", "%"),
    ("_s", "s"),
    ("_n", "N"),
    ("fps", "1/s"),
    ("guard", "ticks"),
];

/// Returns the unit of a path, from the last part that has one.
fn unit(path: &str) -> &'static str {
    let of = |name: &str| UNITS.iter().find(|(end, _)| name.ends_with(end)).map(|(_, unit)| *unit);
    path.rsplit('.').find_map(of).unwrap_or_default()
}

/// Adds a JSON value as rows of a table.
pub fn rows(path: &str, value: &serde_json::Value, into: &mut Vec<Row>) {
    use serde_json::Value;
    let under = |key: &str| if path.is_empty() { key.to_string() } else { format!("{path}.{key}") };
    let text = match value {
        Value::Object(map) => return map.iter().for_each(|(key, value)| rows(&under(key), value, into)),
        Value::Array(list) if list.iter().any(|item| !item.is_string()) => return,
        Value::Array(list) => return list.iter().for_each(|item| rows(path, item, into)),
        Value::Number(n) if n.is_f64() => format!("{:.4}", n.as_f64().unwrap_or_default()),
        other => other.as_str().map_or_else(|| other.to_string(), String::from),
    };
    into.push(Row { path: path.into(), value: text });
}

/// Escapes a text for HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::notice::{Notice, Warning, What};
    use trepan_link::wire::EventRecord;

    #[test]
    fn events_are_in_order_and_complete() {
        let notice = |time_ms, what| Notice { tick: 0, time_ms, what };
        let mut outcome = Outcome::default();
        outcome.written.notices = vec![
            notice(10.0, What::Phase(crate::Phase::Craniotomy)),
            notice(4000.0, What::Warning(Warning::BrainNear, true, 1.0)),
            notice(4500.0, What::Warning(Warning::BrainNear, false, 1.0)),
            notice(3000.0, What::Through),
        ];
        let event = EventRecord { time_ms: 3500.0, kind: "teacher".into(), text: "begins: rest".into(), tick: 0 };
        let score = EventRecord { time_ms: 3600.0, kind: "score".into(), text: "{}".into(), tick: 0 };
        let mut page = String::new();
        add_events(&mut page, &outcome, &Recording { events: vec![event, score], ..Recording::default() });
        let lines: Vec<_> = page.split("<li").skip(1).map(|line| line.split('<').next().unwrap()).collect();
        assert_eq!(lines.len(), 4, "{page}");
        assert!(lines[0].contains("0.01 s: phase") && lines[1].contains("3.00 s: through: the burr came through"));
        assert!(lines[2].contains("3.50 s: teacher: begins") && lines[3].contains("class=\"w\">4.00 s: brain-near"));
    }

    #[test]
    fn a_path_names_its_unit() {
        let units = ["scores.tissue_impulse_n_s", "tick_us.p50", "scores.bone_removed_mm3", "force_n.max_step"];
        assert_eq!(units.map(unit), ["N s", "µs", "mm³", "N"]);
        assert_eq!(["scores.idle_s", "scores.tool_changes", "late_ticks"].map(unit), ["s", "", "ticks"]);
        assert_eq!(["fps", "guard.slewed", "second.guard.slewed"].map(unit), ["1/s", "ticks", "ticks"]);
        let mut page = String::new();
        table(&mut page, &[Row { path: "scores.path_mm".into(), value: "1.5".into() }]);
        assert!(page.contains("<td>scores.path_mm</td><td class=\"n\">1.5</td><td>mm</td>"), "{page}");
    }
}
