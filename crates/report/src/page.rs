//! `report.html`: a self-contained page on a session with pictures, curves from the recording,
//! scores and the machine.

use crate::ReportError;
use crate::chart::{Chart, Curve, histogram, over_time, traces};
use crate::constants;
use crate::debrief::Debrief;
use crate::models::{ModelSummary, TissueSummary};
use crate::summary::{Raised, Summary};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::value::Serde;
use minijinja::{Environment, UndefinedBehavior};
use serde::Serialize;
use serde_json::json;
use trepan_budget::Tissue;
use trepan_link::Recording;
use trepan_link::wire::TickRecord;
use trepan_models::ingredients::KEYS;
use trepan_runtime::Outcome;
use trepan_stages::force_scale::ForceScale;

/// A picture for the report.
#[derive(Clone, Debug)]
pub struct Shot {
    /// Caption of the picture.
    pub caption: String,
    /// PNG bytes.
    pub png: Vec<u8>,
}

/// Templates of all pages and of their parts.
const TEMPLATES: [(&str, &str); 7] = [
    ("page.html", include_str!("../templates/page.html")),
    ("events.html", include_str!("../templates/events.html")),
    ("charts.html", include_str!("../templates/charts.html")),
    ("tables.html", include_str!("../templates/tables.html")),
    ("report.html", include_str!("../templates/report.html")),
    ("device.html", include_str!("../templates/device.html")),
    ("compare.html", include_str!("../templates/compare.html")),
];

/// Renders a template; texts of the context are escaped for HTML.
pub fn render(template: &str, context: &impl Serialize) -> Result<String, ReportError> {
    let mut all = Environment::new();
    all.set_undefined_behavior(UndefinedBehavior::Strict);
    let added = TEMPLATES.into_iter().try_for_each(|(name, text)| all.add_template(name, text));
    let page = added.and_then(|()| all.get_template(template)?.render(Serde(context)));
    page.map_err(|fault| ReportError::Internal(format!("{template}: {fault:#}")))
}

/// Returns the page as HTML.
pub fn html(
    summary: &Summary,
    outcome: &Outcome,
    recording: &Recording,
    (debrief, shots): (&Debrief, &[Shot]),
) -> Result<String, ReportError> {
    let shot = |Shot { caption, png }: &Shot| json!({ "caption": caption, "png": STANDARD.encode(png) });
    let context = json!({
        "title": format!("Trepan {}: {}", summary.app, summary.case),
        "summary": summary,
        "when": when(summary),
        "debrief": debrief,
        "limits": debrief.rows.iter().any(|row| row.passed.is_some()),
        "faults": faults(&summary.warnings),
        "learning": learning(debrief)?,
        "parts": parts(&summary.models),
        "ingredients": KEYS.iter().map(|key| format!("{} {}", key.name, key.value(&summary.models.ingredients))).collect::<Vec<_>>(),
        "bands": summary.bands.sentences(),
        "calibration": constants::sentence(),
        "constants": constants::all(),
        "events": events(outcome, recording),
        "shots": shots.iter().map(shot).collect::<Vec<_>>(),
        "charts": charts(outcome, recording)?,
        "tables": tables(summary)?,
    });
    render("report.html", &context)
}

/// Date and length of a session in words: "2026-03-04 05:06 UTC, 8 min 35 s".
fn when(summary: &Summary) -> String {
    let seconds = summary.length_s;
    let length = match seconds {
        s if s < 60.0 => format!("{s:.1} s"),
        s => format!("{} min {} s", s.round() as u64 / 60, s.round() as u64 % 60),
    };
    let date = summary.date.get(..16).map(|date| format!("{} UTC, ", date.replace('T', " ")));
    format!("{}{length}", date.unwrap_or_default())
}

/// Times of a fault that are listed.
const TIMES: usize = 6;

/// Lists the warnings by their kind in the order of their first time: text, number, times.
fn faults(warnings: &[Raised]) -> Vec<serde_json::Value> {
    let mut kinds: Vec<Vec<&Raised>> = Vec::new();
    for raised in warnings {
        match kinds.iter_mut().find(|kind| kind[0].name == raised.name) {
            Some(kind) => kind.push(raised),
            None => kinds.push(vec![raised]),
        }
    }
    let fault = |kind: &Vec<&Raised>| {
        let times: Vec<String> = kind.iter().take(TIMES).map(|raised| format!("{:.1}", raised.time_s)).collect();
        let more = kind.len().saturating_sub(TIMES);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        json!({ "text": kind[0].text, "count": kind.len(), "times": format!("{} s{more}", times.join(", ")) })
    };
    kinds.iter().map(fault).collect()
}

/// Draws the learning curves: each measure over the number of the session.
fn learning(debrief: &Debrief) -> Result<Vec<Chart>, ReportError> {
    let chart = |(name, values): &(String, Vec<f64>)| {
        let points = values.iter().enumerate().map(|(at, value)| (at as f64 + 1.0, *value)).collect();
        let svg = traces(["session", name], &[Curve { name: "sessions", points }])?;
        Ok(Chart::new(format!("{name}: sessions of the same lesson and case; the last is this one"), svg))
    };
    debrief.curves.iter().map(chart).collect()
}

/// Describes the models that ran, and why they were chosen.
fn parts(ModelSummary { bone, tissue, picture, .. }: &ModelSummary) -> [serde_json::Value; 3] {
    let TissueSummary { solver, tets, halvings, .. } = *tissue;
    let rays = if picture.sparse { "sparse rays" } else { "every ray" };
    let part = |name: &str, what: String, why: &str| json!({ "name": name, "what": what, "why": why });
    [
        part("Bone", format!("{} on {} mm voxels", bone.method, bone.spacing_mm), &bone.why),
        part("Tissue", Tissue { solver, tets, halvings }.to_string(), &tissue.why),
        part("Picture", format!("{rays}, detail {}", picture.detail), &picture.why),
    ]
}

/// An event of a session, as its page lists it.
#[derive(Debug, Serialize)]
pub struct Event {
    /// Session time, s.
    pub seconds: f64,
    /// Description.
    pub text: String,
    /// Whether it is a warning.
    pub warns: bool,
}

/// Lists all notices in the order of time; the teacher's requests are read from the recording.
fn events(outcome: &Outcome, recording: &Recording) -> Vec<Event> {
    let notices = outcome.written.notices.iter().map(|notice| (notice.time_ms, notice.words()));
    let notices = notices.filter(|(_, (kind, _))| *kind != "cleared").map(|(time_ms, (kind, text))| Event {
        seconds: time_ms * 1e-3,
        warns: kind == "warning",
        text: if kind == "warning" { text } else { format!("{kind}: {text}") },
    });
    let requests = recording.events.iter().filter(|event| event.kind == TEACHER).map(|event| Event {
        seconds: event.time_ms * 1e-3,
        warns: false,
        text: format!("{TEACHER}: {}", event.text),
    });
    let mut all: Vec<Event> = notices.chain(requests).collect();
    all.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    all
}

/// Kind of the events of a teacher's requests.
const TEACHER: &str = "teacher";

fn charts(outcome: &Outcome, recording: &Recording) -> Result<[Chart; 6], ReportError> {
    let Recording { ticks, second, solver, .. } = recording;
    let of = |name, value: fn(&TickRecord) -> f32| Curve::over_time(name, ticks, |t| (t.time_ms, value(t)));
    let moved = Curve::over_time("largest displacement", solver, |s| (s.time_ms, s.max_displacement_mm));
    let mut forces = vec![of("force", |t| t.wrench.force.length())];
    if !second.is_empty() {
        forces[0].name = "first hand";
        forces.push(Curve::over_time("second hand", second, |t| (t.time_ms, t.wrench.force.length())));
    }
    let limit = Some((outcome.force_limit_n.into(), "device limit"));
    let depths = [of("in bone", |t| t.depth_mm), of("in tissue", |t| t.tissue_depth_mm)];
    let near = of("tool to brain", |t| t.brain_distance_mm.clamp(-10.0, 20.0));
    let times = outcome.ticks.times.bins();
    let scale = ForceScale(if outcome.force_scale > 0.0 { outcome.force_scale } else { 1.0 });
    let task = Curve::over_time("force of the task", ticks, |t| (t.time_ms, scale.task_n(t)));
    Ok([
        Chart::new("Force on the hand", over_time("force, N", &forces, limit)?),
        Chart::new(format!("Force of the task: {}", scale.text()), over_time("force of the task, N", &[task], None)?),
        Chart::new("Depth of the tool", over_time("depth, mm", &depths, None)?),
        Chart::new("Distance to the brain at rest (cut at 20 mm)", over_time("distance, mm", &[near], None)?),
        Chart::new("Brain", over_time("displacement, mm", &[moved], None)?),
        Chart::new(
            "Tick compute time (dashed: the 1 ms of the thesis)",
            histogram("compute time of a tick, µs", &times, 1000.0)?,
        ),
    ])
}

/// Paths of the timings in a summary; scores and the rest have their own tables.
const TIMINGS: &str = "asked_hz rate_hz late_ticks held_ticks tick_us solver.dt_ms solver.step_us solver.collision_us \
                       solver.real_time_factor frames fps moving";
/// Paths of the scores in a summary.
const SCORES: &str = "scores bone_removed_mm3 resection brain_cut_mm2 bleeding dura tool_use plan cut_off \
                      hand_force_n hand_force_scale";

/// A table of a page.
#[derive(Serialize)]
pub struct Table {
    /// Heading.
    pub title: &'static str,
    /// Its rows.
    pub rows: Vec<Row>,
}

/// A value of a JSON file, its path and its unit.
#[derive(Serialize)]
pub struct Row {
    path: String,
    value: String,
    unit: &'static str,
}

/// Lists every number of the summary by its path: scores, timings, the rest.
fn tables(summary: &Summary) -> Result<[Table; 3], ReportError> {
    let under = |row: &Row, paths: &str| {
        let is_under = |rest: &str| rest.is_empty() || rest.starts_with('.');
        paths.split(' ').any(|path| row.path.strip_prefix(path).is_some_and(is_under))
    };
    let all = rows("summary", summary)?;
    let (scores, all): (Vec<_>, Vec<_>) = all.into_iter().partition(|row| under(row, SCORES));
    let (timings, all): (Vec<_>, Vec<_>) = all.into_iter().partition(|row| under(row, TIMINGS));
    Ok([("Scores", scores), ("Timings", timings), ("Numbers", all)].map(|(title, rows)| Table { title, rows }))
}

/// Lists the values of a JSON file; `name` names it in an error.
pub fn rows(name: &str, file: &impl Serialize) -> Result<Vec<Row>, ReportError> {
    let value = serde_json::to_value(file).map_err(|fault| ReportError::Internal(format!("{name}: {fault}")))?;
    let mut rows = Vec::new();
    add_rows("", &value, &mut rows);
    Ok(rows)
}

/// Endings of names and their units; a longer ending comes before its own endings.
const UNITS: [(&str, &str); 17] = [
    ("_mm3", "mm³"),
    ("_mm2", "mm²"),
    ("_ml_per_min", "ml/min"),
    ("_ml", "ml"),
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
fn add_rows(path: &str, value: &serde_json::Value, into: &mut Vec<Row>) {
    use serde_json::Value;
    let under = |key: &str| if path.is_empty() { key.to_string() } else { format!("{path}.{key}") };
    let value = match value {
        Value::Object(map) => return map.iter().for_each(|(key, value)| add_rows(&under(key), value, into)),
        Value::Array(list) if list.iter().any(|item| !item.is_string()) => return,
        Value::Array(list) => return list.iter().for_each(|item| add_rows(path, item, into)),
        Value::Number(n) if n.is_f64() => format!("{:.4}", n.as_f64().unwrap_or_default()),
        other => other.as_str().map_or_else(|| other.to_string(), String::from),
    };
    into.push(Row { path: path.into(), value, unit: unit(path) });
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_link::wire::EventRecord;
    use trepan_stages::notice::{Notice, Warning, What};

    #[test]
    fn events_are_in_order_and_complete() {
        let notice = |time_ms, what| Notice { tick: 0, time_ms, what };
        let mut outcome = Outcome::default();
        outcome.written.notices = vec![
            notice(10.0, What::Phase(trepan_stages::Phase::Craniotomy)),
            notice(4000.0, What::Warning(Warning::BrainNear, true, 1.0)),
            notice(4500.0, What::Warning(Warning::BrainNear, false, 1.0)),
            notice(3000.0, What::Through),
        ];
        let event = EventRecord { time_ms: 3500.0, kind: "teacher".into(), text: "begins: rest".into(), tick: 0 };
        let score = EventRecord { time_ms: 3600.0, kind: "score".into(), text: "{}".into(), tick: 0 };
        let events = events(&outcome, &Recording { events: vec![event, score], ..Recording::default() });
        let page = render("events.html", &json!({ "events": events })).unwrap();
        let lines: Vec<_> = page.split("<li").skip(1).map(|line| line.split('<').next().unwrap()).collect();
        assert_eq!(lines.len(), 4, "{page}");
        assert!(lines[0].contains("0.01 s: phase") && lines[1].contains("3.00 s: through: the burr came through"));
        assert!(lines[2].contains("3.50 s: teacher: begins") && lines[3].contains("class=\"w\">4.00 s: brain-near"));
    }

    #[test]
    fn a_fault_is_one_row_however_often_it_came() {
        let raised = |name: &str, time_s: f64| Raised { time_s, name: name.into(), text: format!("{name}: so") };
        let mut warnings: Vec<Raised> = (0..9).map(|n| raised("brain-pressed", f64::from(n))).collect();
        warnings.insert(1, raised("bone-thin", 0.26));
        let faults = faults(&warnings);
        assert_eq!((faults.len(), &faults[1]["times"]), (2, &json!("0.3 s")));
        assert_eq!(faults[0]["times"], json!("0.0, 1.0, 2.0, 3.0, 4.0, 5.0 s and 3 more"));
        let summary = |length_s| Summary { length_s, date: "2026-03-04T05:06:07Z".into(), ..Summary::default() };
        assert_eq!(when(&summary(515.0)), "2026-03-04 05:06 UTC, 8 min 35 s");
        assert_eq!(when(&Summary { date: String::new(), ..summary(7.25) }), "7.2 s");
    }

    #[test]
    fn a_report_begins_with_the_result_and_folds_the_models() {
        let (summary, outcome) = (Summary::default(), Outcome::default());
        let row = |passed: Option<bool>| crate::debrief::Row {
            what: "plunge".into(),
            value: "0.4".into(),
            limit: passed.map_or(String::new(), |_| "at most 1 mm".into()),
            passed,
            earlier: String::new(),
        };
        let page = |passed| {
            let debrief =
                Debrief { headline: "The skull is open.".into(), rows: vec![row(passed)], ..Debrief::default() };
            html(&summary, &outcome, &Recording::default(), (&debrief, &[])).unwrap()
        };
        let (free, marked) = (page(None), page(Some(true)));
        assert!(
            !free.contains("<th>limit</th>") && marked.contains("<th>limit</th>") && marked.contains("<td>yes</td>")
        );
        let place = |text: &str| free.find(text).unwrap_or_else(|| panic!("{text} in {free}"));
        assert!(place("The skull is open.") < place("Warnings") && place("Warnings") < place("<details>"));
        assert!(
            place("<details>") < place("Models")
                && free.matches("<details>").count() == free.matches("</details>").count()
        );
    }

    #[test]
    fn a_path_names_its_unit() {
        let units = [
            "scores.tissue_impulse_n_s",
            "tick_us.p50",
            "scores.bone_removed_mm3",
            "hand_force_n.max_step",
            "bleeding.bled_ml",
            "bleeding.rate_ml_per_min",
            "dura.cut_out_mm2",
        ];
        assert_eq!(units.map(unit), ["N s", "µs", "mm³", "N", "ml", "ml/min", "mm²"]);
        assert_eq!(["hand_force_scale", "scores.peak_bone_force_n"].map(unit), ["", "N"]);
        assert_eq!(["scores.idle_s", "scores.tool_changes", "late_ticks"].map(unit), ["s", "", "ticks"]);
        assert_eq!(["fps", "guard.slewed", "second.guard.slewed"].map(unit), ["1/s", "ticks", "ticks"]);
        let rows = rows("scores", &json!({ "scores": { "path_mm": 1.5 } })).unwrap();
        let page = render("tables.html", &json!({ "tables": [Table { title: "Scores", rows }] })).unwrap();
        assert!(page.contains("<td>scores.path_mm</td><td class=\"n\">1.5000</td><td>mm</td>"), "{page}");
    }
}
