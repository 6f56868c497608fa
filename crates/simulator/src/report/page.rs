//! `report.html`: a session on one page that needs nothing else: pictures, curves from the recording, scores, the machine.

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
    /// What it shows.
    pub caption: String,
    /// PNG bytes.
    pub png: Vec<u8>,
}

/// Style of every page.
pub const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:960px;margin:2em auto;padding:0 1em;color:#222}\
h1,h2{line-height:1.2}table{border-collapse:collapse}td,th{padding:.2em .8em;border-bottom:1px solid #ccc;text-align:left}\
td.n{text-align:right;font-variant-numeric:tabular-nums}figure{margin:1em 0}img,svg{max-width:100%;height:auto}\
figcaption{color:#555}.w{border-left:.4em solid #d55e00;padding-left:.6em}";

/// The page.
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
    warnings(&mut page, summary);
    pictures(&mut page, shots);
    curves(&mut page, outcome, recording)?;
    numbers(&mut page, summary)?;
    page += "</body></html>\n";
    Ok(page)
}

/// What ran, and why.
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

fn warnings(page: &mut String, summary: &Summary) {
    *page += "<h2>What happened</h2><ul>";
    for phase in &summary.phases {
        *page += &format!("<li>{:.2} s: phase {}</li>", phase.from_s, escaped(&phase.name));
    }
    for raised in &summary.warnings {
        *page += &format!("<li class=\"w\">{:.2} s: {}</li>", raised.time_s, escaped(&raised.text));
    }
    *page += "</ul>";
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

/// Every number of the summary, as a table of paths.
fn numbers(page: &mut String, summary: &Summary) -> Result<(), String> {
    *page += "<h2>Numbers</h2><table><tr><th>what</th><th>value</th></tr>";
    let value = serde_json::to_value(summary).map_err(|fault| format!("summary: {fault}"))?;
    rows(page, "", &value);
    *page += "</table>";
    Ok(())
}

/// A value as rows of a table, by their paths.
pub fn rows(page: &mut String, path: &str, value: &serde_json::Value) {
    use serde_json::Value;
    let under = |key: &str| if path.is_empty() { key.to_string() } else { format!("{path}.{key}") };
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| rows(page, &under(key), value)),
        Value::Array(list) if list.iter().any(|item| !item.is_string()) => {}
        Value::Array(list) => {
            for item in list {
                rows(page, path, item);
            }
        }
        Value::Number(n) if n.is_f64() => {
            let number = n.as_f64().unwrap_or_default();
            _ = write!(page, "<tr><td>{}</td><td class=\"n\">{number:.4}</td></tr>", escaped(path));
        }
        other => {
            let text = other.as_str().map_or_else(|| other.to_string(), String::from);
            _ = write!(page, "<tr><td>{}</td><td class=\"n\">{}</td></tr>", escaped(path), escaped(&text));
        }
    }
}

/// Text as HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
