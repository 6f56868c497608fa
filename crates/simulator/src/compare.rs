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

use crate::config::SessionConfig;
use crate::error::SessionError;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use trepan_link::Recording;
use trepan_link::wire::{EventRecord, TickRecord};
use trepan_patient::identity::Identity;
use trepan_report::chart::{Chart, Curve, over_time};
use trepan_report::page::{Event, render};
use trepan_report::whole::whole;
use trepan_stages::score::ScoreKeeper;

/// Reads two recordings and writes `compare.html` to a folder.
pub(crate) fn compare(files: [&Path; 2], out: &Path) -> Result<PathBuf, SessionError> {
    let [first, second] = files;
    let page = page(&[Recording::open(first)?, Recording::open(second)?])?;
    fs::create_dir_all(out).map_err(SessionError::output(out))?;
    let path = out.join("compare.html");
    whole(&path, page.as_bytes())?;
    Ok(path)
}

/// Names of the two sessions.
const NAMES: [&str; 2] = ["first", "second"];

fn page(sessions: &[Recording; 2]) -> Result<String, SessionError> {
    let context = json!({
        "title": "Trepan: two sessions",
        "remarks": remarks(sessions),
        "scores": scores(sessions),
        "sessions": ([0, 1].map(|at| json!({ "name": NAMES[at], "events": events(&sessions[at]) }))),
        "curves": curves(sessions)?,
    });
    Ok(render("compare.html", &context)?)
}

/// Remarks on differences that limit the comparison.
fn remarks(sessions: &[Recording; 2]) -> Vec<String> {
    let [first, second] = sessions.each_ref().map(|session| &session.header);
    let mut remarks = Vec::new();
    if first.app != second.app {
        remarks.push(format!("Different programs: {} and {}.", first.app, second.app));
    }
    let [of_first, of_second] = [first, second].map(Identity::of);
    let patients = match of_first.is(&of_second) {
        Some(true) if of_first.case == of_second.case => None,
        Some(true) => Some("One patient, but two cases: the voxels, tetrahedra, labels or version differ."),
        Some(false) => Some("Different patients: scores are of different anatomies."),
        None => Some("Whether both are of one patient is unknown: an older version recorded at least one of them."),
    };
    remarks.extend(patients.map(String::from));
    let configs = [first, second].map(SessionConfig::of);
    for (name, config) in NAMES.into_iter().zip(&configs) {
        let fault = config.as_ref().err();
        remarks.extend(fault.map(|fault| format!("The {name} recording: {fault}. Its newtons are the hand's.")));
    }
    let [of_first, of_second] = configs.map(|config| config.unwrap_or_default().entries());
    let keys: BTreeSet<&String> = of_first.keys().chain(of_second.keys()).collect();
    for key in keys {
        let [value, other] = [&of_first, &of_second].map(|of| of.get(key).map_or("nothing", String::as_str));
        if other != value {
            remarks.push(format!("{key} was {value} in the first session, {other} in the second."));
        }
    }
    let losses = NAMES.into_iter().zip(sessions).filter_map(|(name, session)| Some((name, session.losses()?)));
    remarks.extend(losses.map(|(name, losses)| format!("The {name} recording is incomplete: {losses}.")));
    remarks
}

/// Computes the scores from a session's ticks.
fn score_keeper(session: &Recording) -> ScoreKeeper {
    let force_scale = SessionConfig::of(&session.header).unwrap_or_default().device.force_scale();
    let mut scores = ScoreKeeper::at(force_scale);
    session.ticks.iter().for_each(|tick| scores.add(tick));
    scores
}

/// Lists each score of both sessions, with the difference.
fn scores(sessions: &[Recording; 2]) -> Vec<Value> {
    let [first, second] = sessions.each_ref().map(rows);
    let row = |((name, first), (_, second)): ((String, Option<f64>), (String, Option<f64>))| json!({ "name": name, "values": [first, second, first.zip(second).map(|(a, b)| b - a)] });
    first.into_iter().zip(second).map(row).collect()
}

/// Lists every score by name; `None` if it is undefined.
fn rows(session: &Recording) -> Vec<(String, Option<f64>)> {
    let scores = serde_json::to_value(score_keeper(session)).unwrap_or_default();
    let length = ("length_s".to_string(), session.ticks.last().map(|tick| tick.time_ms * 1e-3));
    let warnings = session.events.iter().filter(|event| event.kind == "warning").count();
    let of_scores = scores.as_object().into_iter().flatten().map(|(name, value)| (name.clone(), value.as_f64()));
    [length, ("warnings".into(), Some(warnings as f64))].into_iter().chain(of_scores).collect()
}

fn events(session: &Recording) -> Vec<Event> {
    let shown = session.events.iter().filter(|event| !["cleared", "score"].contains(&event.kind.as_str()));
    let event = |event: &EventRecord| Event {
        seconds: event.time_ms * 1e-3,
        text: event.text.clone(),
        warns: event.kind == "warning",
    };
    shown.map(event).collect()
}

/// Draws each quantity of both sessions in one chart, then each alone.
fn curves(sessions: &[Recording; 2]) -> Result<[Value; 4], SessionError> {
    let pair = |caption: &str, unit: &str, value: fn(&TickRecord) -> f32| {
        let curve = |at: usize| Curve::over_time(NAMES[at], &sessions[at].ticks, |tick| (tick.time_ms, value(tick)));
        let both = [curve(0), curve(1)];
        let chart = |name: &str, curves: &[Curve]| {
            Ok::<_, SessionError>(Chart::new(format!("{caption}, {name}"), over_time(unit, curves, None)?))
        };
        let alone = [chart(NAMES[0], &both[..1])?, chart(NAMES[1], &both[1..])?];
        Ok::<_, SessionError>(json!({ "together": [chart("both", &both)?], "alone": alone }))
    };
    let distance = "Distance to the brain at rest (cut at 20 mm)";
    Ok([
        pair("Force on the hand", "force, N", |tick| tick.wrench.force.length())?,
        pair("Depth in bone", "depth, mm", |tick| tick.depth_mm)?,
        pair(distance, "distance, mm", |tick| tick.brain_distance_mm.clamp(-10.0, 20.0))?,
        pair("Depth in tissue", "depth, mm", |tick| tick.tissue_depth_mm)?,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Pose, Vec3, Wrench};
    use trepan_link::wire::SessionHeader;

    fn session(newtons: f32, spacing: &str) -> Recording {
        let tick = |n: u32| TickRecord {
            tick: n.into(),
            time_ms: f64::from(n),
            wrench: Wrench { force: Vec3::X * newtons, torque: Vec3::ZERO },
            proxy: Pose::from_translation(Vec3::X * n as f32 * 0.01),
            ..TickRecord::default()
        };
        let event = |kind: &str, text: &str| EventRecord { kind: kind.into(), text: text.into(), ..Default::default() };
        let config = [("sizes.spacing_mm".to_string(), spacing.to_string())].into();
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
        assert_eq!(
            (value("hand_peak_force_n"), value("warnings"), value("length_s")),
            (Some(1.5), Some(1.0), Some(1.999))
        );
        assert!((value("path_mm").unwrap() - 19.8).abs() < 0.3, "{:?}", value("path_mm"));
    }

    #[test]
    fn the_page_lists_differences_and_shows_both() {
        let page = page(&[session(1.0, "1"), session(2.5, "0.5")]).unwrap();
        assert!(page.contains("sizes.spacing_mm was 1 in the first session, 0.5 in the second"));
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
