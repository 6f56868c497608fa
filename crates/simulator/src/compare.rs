//! Compares two recorded sessions on one page: scores, events, forces over time.
//!
//! # Practice
//! Scores are computed from the recorded ticks as in a session, so neither case nor replay is
//! needed: a minute of recording takes a second. The files are called "first" and "second", because
//! their names may contain a patient's name.
//!
//! # When not to use it
//! To check whether two builds give the same forces: replay one recording; its summary compares the
//! forces bit by bit.

use crate::case::identity::Identity;
use crate::error::SessionError;
use crate::report::chart::{Curve, over_time};
use crate::report::output::whole;
use crate::report::page::{STYLE, escaped};
use crate::stages::score::ScoreKeeper;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use trepan_link::Recording;
use trepan_link::wire::TickRecord;

/// Reads two recordings and writes `compare.html` to a folder.
pub fn compare(files: [&Path; 2], out: &Path) -> Result<PathBuf, SessionError> {
    let [first, second] = files;
    let sessions = [Recording::open(first)?, Recording::open(second)?];
    let page = page(&sessions).map_err(SessionError::Internal)?;
    fs::create_dir_all(out).map_err(|fault| SessionError::Output { path: out.into(), fault })?;
    let path = out.join("compare.html");
    whole(&path, page.as_bytes()).map(|()| path)
}

/// Names of the two sessions.
const NAMES: [&str; 2] = ["first", "second"];
/// Style of a page with two columns.
const WIDE: &str = ".two{display:grid;grid-template-columns:1fr 1fr;gap:1em}body{max-width:1200px}";

fn page(sessions: &[Recording; 2]) -> Result<String, String> {
    let title = "Trepan: two sessions";
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}{WIDE}</style></head><body><h1>{title}</h1>"
    );
    page += "<p>Scores are physical sums, not clinical ones.</p>";
    remarks(&mut page, sessions);
    scores(&mut page, sessions);
    events(&mut page, sessions);
    curves(&mut page, sessions)?;
    page += "</body></html>\n";
    Ok(page)
}

/// Adds remarks on differences that limit the comparison.
fn remarks(page: &mut String, sessions: &[Recording; 2]) {
    let [first, second] = sessions.each_ref().map(|session| &session.header);
    let mut remark = |text: &str| _ = write!(page, "<p class=\"w\">{}</p>", escaped(text));
    if first.app != second.app {
        remark(&format!("Different programs: {} and {}.", first.app, second.app));
    }
    let [of_first, of_second] = [first, second].map(Identity::of);
    match of_first.is(&of_second) {
        Some(true) if of_first.case != of_second.case => {
            remark("One patient, but two cases: the voxels, tetrahedra, labels or version differ.");
        }
        Some(true) => {}
        Some(false) => remark("Different patients: scores are of different anatomies."),
        None => remark("Whether both are of one patient is unknown: an older version recorded at least one of them."),
    }
    for (key, value) in &first.config {
        let other = second.config.get(key).map_or("nothing", String::as_str);
        if other != value {
            remark(&format!("{key} was {value} in the first session, {other} in the second."));
        }
    }
    for (name, session) in NAMES.into_iter().zip(sessions) {
        if let Some(losses) = session.losses() {
            remark(&format!("The {name} recording is incomplete: {losses}."));
        }
    }
}

/// Computes the scores from a session's ticks.
fn score_keeper(session: &Recording) -> ScoreKeeper {
    let mut scores = ScoreKeeper::default();
    session.ticks.iter().for_each(|tick| scores.add(tick));
    scores
}

fn scores(page: &mut String, sessions: &[Recording; 2]) {
    *page += "<h2>Scores</h2><table><tr><th>score</th><th>first</th><th>second</th><th>second - first</th></tr>";
    let [first, second] = sessions.each_ref().map(rows);
    for ((name, first), (_, second)) in first.iter().zip(&second) {
        let cell = |value: Option<f64>| value.map_or_else(|| "-".into(), |value| format!("{value:.3}"));
        let difference = first.zip(*second).map(|(a, b)| b - a);
        let cells = [*first, *second, difference].map(|value| format!("<td class=\"n\">{}</td>", cell(value))).concat();
        _ = write!(page, "<tr><td>{}</td>{cells}</tr>", escaped(name));
    }
    *page += "</table>";
}

/// Lists every score by name; `None` if it is undefined.
fn rows(session: &Recording) -> Vec<(String, Option<f64>)> {
    let scores = serde_json::to_value(score_keeper(session)).unwrap_or_default();
    let length = ("length_s".to_string(), session.ticks.last().map(|tick| tick.time_ms * 1e-3));
    let warnings = session.events.iter().filter(|event| event.kind == "warning").count();
    let of_scores = scores.as_object().into_iter().flatten().map(|(name, value)| (name.clone(), value.as_f64()));
    [length, ("warnings".into(), Some(warnings as f64))].into_iter().chain(of_scores).collect()
}

fn events(page: &mut String, sessions: &[Recording; 2]) {
    *page += "<h2>Events</h2><div class=\"two\">";
    for (name, session) in NAMES.into_iter().zip(sessions) {
        _ = write!(page, "<div><h3>{name}</h3><ul>");
        for event in session.events.iter().filter(|event| !["cleared", "score"].contains(&event.kind.as_str())) {
            let class = if event.kind == "warning" { " class=\"w\"" } else { "" };
            _ = write!(page, "<li{class}>{:.2} s: {}</li>", event.time_ms * 1e-3, escaped(&event.text));
        }
        *page += "</ul></div>";
    }
    *page += "</div>";
}

fn curves(page: &mut String, sessions: &[Recording; 2]) -> Result<(), String> {
    let both = |value: &dyn Fn(&TickRecord) -> f32| {
        NAMES
            .iter()
            .zip(sessions)
            .map(|(name, session)| Curve {
                name,
                points: session.ticks.iter().map(|tick| (tick.time_ms * 1e-3, f64::from(value(tick)))).collect(),
            })
            .collect::<Vec<_>>()
    };
    let charts = [
        ("Force on the hand", "force, N", both(&|tick| tick.wrench.force.length())),
        ("Depth in bone", "depth, mm", both(&|tick| tick.depth_mm)),
        (
            "Distance to the brain at rest (cut at 20 mm)",
            "distance, mm",
            both(&|tick| tick.brain_distance_mm.clamp(-10.0, 20.0)),
        ),
        ("Depth in tissue", "depth, mm", both(&|tick| tick.tissue_depth_mm)),
    ];
    *page += "<h2>Curves</h2>";
    for (caption, unit, curves) in charts {
        let together = over_time(unit, &curves, None)?;
        _ = write!(page, "<figure>{together}<figcaption>{caption}, both</figcaption></figure><div class=\"two\">");
        for curve in curves {
            let name = curve.name;
            let alone = over_time(unit, &[curve], None)?;
            _ = write!(page, "<figure>{alone}<figcaption>{caption}, {name}</figcaption></figure>");
        }
        *page += "</div>";
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Pose, Vec3, Wrench};
    use trepan_link::wire::{EventRecord, SessionHeader};

    fn session(newtons: f32, spacing: &str) -> Recording {
        let tick = |n: u32| TickRecord {
            tick: n.into(),
            time_ms: f64::from(n),
            wrench: Wrench { force: Vec3::X * newtons, torque: Vec3::ZERO },
            proxy: Pose::from_translation(Vec3::X * n as f32 * 0.01),
            ..TickRecord::default()
        };
        let event = |kind: &str, text: &str| EventRecord { kind: kind.into(), text: text.into(), ..Default::default() };
        let config = [("spacing_mm".to_string(), spacing.to_string())].into();
        Recording {
            header: SessionHeader { app: "integrated".into(), config, ..Default::default() },
            ticks: (0..2000).map(tick).collect(),
            events: vec![event("warning", "burr <near>"), event("score", "{}"), event("phase", "brain begins")],
            ..Recording::default()
        }
    }

    #[test]
    fn scores_are_those_of_the_ticks() {
        let session = session(1.5, "1");
        let rows = rows(&session);
        let value = |name: &str| rows.iter().find(|(n, _)| n == name).unwrap().1;
        assert_eq!((value("peak_force_n"), value("warnings"), value("length_s")), (Some(1.5), Some(1.0), Some(1.999)));
        assert!((value("path_mm").unwrap() - 19.8).abs() < 0.3, "{:?}", value("path_mm"));
    }

    #[test]
    fn the_page_lists_differences_and_shows_both() {
        let page = page(&[session(1.0, "1"), session(2.5, "0.5")]).unwrap();
        assert!(page.contains("spacing_mm was 1 in the first session, 0.5 in the second"));
        assert!(page.contains("<td class=\"n\">1.000</td><td class=\"n\">2.500</td><td class=\"n\">1.500</td>"));
        assert!(page.contains("burr &lt;near&gt;") && !page.contains("{}") && page.matches("<svg").count() == 12);
        assert!(!page.contains("src=") && !page.contains("href="), "it needs nothing else");
    }

    #[test]
    fn an_invalid_file_is_an_error_and_writes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let (file, out) = (folder.path().join("a.mcap"), folder.path().join("out"));
        fs::write(&file, "no recording").unwrap();
        assert!(compare([&file, &file], &out).is_err() && !out.exists());
    }
}
