//! What a session came to, in the order in which one asks: the result, the plan, earlier sessions.
//!
//! # Practice
//! It is made of summaries only, so the report, the result page and a later look at an old session
//! show the same. Earlier sessions are those of the same person on the same case with the same
//! lesson, or the same program without one.

use crate::kept::SessionFolder;
use crate::training::{Lesson, Mark};
use serde::Serialize;
use serde_json::Value;

/// The debriefing of a session.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Debrief {
    /// The result in a sentence.
    pub headline: String,
    /// Whether the lesson is passed; `None` without a lesson.
    pub passed: Option<bool>,
    /// Title of the lesson.
    pub lesson: Option<String>,
    /// What was measured.
    pub rows: Vec<Row>,
    /// How many earlier sessions it is compared with.
    pub earlier: usize,
    /// Who operated.
    pub person: Option<String>,
    /// Learning curves: name with unit, and the value in each session, the oldest first.
    pub curves: Vec<(String, Vec<f64>)>,
}

/// One measure of a session.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// What is measured, with its unit.
    pub what: String,
    /// Its value.
    pub value: String,
    /// The limit, in words; empty without one.
    pub limit: String,
    /// Whether it is kept; `None` without a limit.
    pub passed: Option<bool>,
    /// Mean of the earlier sessions; empty without one.
    pub earlier: String,
}

/// Measures of every session: what, place in the summary, unit.
const MEASURES: [(&str, &str, &str); 9] = [
    ("bone removed", "bone_removed_mm3", "mm³"),
    ("bone removed outside the plan", "plan.outside_plan_mm3", "mm³"),
    ("agreement with the plan (Dice)", "plan.dice", ""),
    ("touches of the brain with a tool for bone", "scores.burr_touches_of_brain", ""),
    ("deepest plunge past the dura", "scores.plunge_mm", "mm"),
    ("largest force on the brain", "scores.peak_tissue_force_n", "N"),
    ("time of drilling", "scores.drilling_s", "s"),
    ("path of the tip", "scores.path_mm", "mm"),
    ("blood lost", "bleeding.bled_ml", "ml"),
];
/// Measures of a learning curve, by their place in [`MEASURES`].
const CURVES: [usize; 3] = [2, 4, 6];

impl Debrief {
    /// Makes the debriefing of a session from its summary and earlier ones, the newest first.
    pub fn of(summary: &Value, lesson: Option<&Lesson>, earlier: &[SessionFolder]) -> Self {
        let usual = MEASURES.map(|(text, path, unit)| {
            let (text, path, unit) = (text.into(), path.into(), unit.into());
            Mark { text, path, unit, least: None, most: None }
        });
        let marks: Vec<&Mark> = lesson.iter().flat_map(|lesson| &lesson.marks).collect();
        let is_marked = |mark: &Mark| marks.iter().any(|known| known.path == mark.path);
        let rows = marks.iter().copied().chain(usual.iter().filter(|mark| !is_marked(mark)));
        let rows: Vec<Row> = rows
            .filter(|m| !m.limit().is_empty() || m.value(summary).is_some())
            .map(|m| row(m, summary, earlier))
            .collect();
        let passed = lesson.map(|_| rows.iter().all(|row| row.passed != Some(false)));
        let curves = CURVES.map(|at| {
            let mark = &usual[at];
            let all = earlier.iter().rev().map(|kept| &kept.summary).chain([summary]);
            (named(mark), all.filter_map(|summary| mark.value(summary)).collect::<Vec<_>>())
        });
        Self {
            headline: headline(summary, &rows, passed),
            passed,
            lesson: lesson.map(|lesson| lesson.title.clone()),
            rows,
            earlier: earlier.len(),
            person: summary["person"].as_str().map(String::from),
            curves: curves.into_iter().filter(|(_, values)| values.len() > 1).collect(),
        }
    }
}

fn named(mark: &Mark) -> String {
    if mark.unit.is_empty() { mark.text.clone() } else { format!("{}, {}", mark.text, mark.unit) }
}

fn row(mark: &Mark, summary: &Value, earlier: &[SessionFolder]) -> Row {
    let value = mark.value(summary);
    let before: Vec<f64> = earlier.iter().filter_map(|kept| mark.value(&kept.summary)).collect();
    let mean = (!before.is_empty()).then(|| before.iter().sum::<f64>() / before.len() as f64);
    let limit = mark.limit();
    Row {
        what: named(mark),
        value: value.map_or("not measured".into(), written),
        passed: (!limit.is_empty()).then(|| mark.passes(value)),
        limit,
        earlier: mean.map_or_else(String::new, written),
    }
}

/// Writes a number with the digits that a reader needs.
fn written(value: f64) -> String {
    match value.abs() {
        size if size >= 100.0 => format!("{value:.0}"),
        _ if value.fract() == 0.0 => format!("{value:.0}"),
        size if size >= 10.0 => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    }
}

fn headline(summary: &Value, rows: &[Row], passed: Option<bool>) -> String {
    let missed = rows.iter().filter(|row| row.passed == Some(false)).count();
    let marks = rows.iter().filter(|row| row.passed.is_some()).count();
    let touches = summary["scores"]["burr_touches_of_brain"].as_u64().unwrap_or(0);
    let through = summary["scores"]["times_through"].as_u64().unwrap_or(0);
    let brain = match touches {
        0 => "the brain was not touched by a tool for bone".into(),
        1 => "the drill touched the brain once".into(),
        n => format!("the drill touched the brain {n} times"),
    };
    let skull = if through > 0 { "The skull is open" } else { "The skull is not open" };
    match passed {
        Some(true) => format!("Passed: all {marks} pass marks are kept."),
        Some(false) => format!("Not passed: {missed} of {marks} pass marks are missed."),
        None => format!("{skull}; {brain}."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn summary(plunge_mm: f64, touches: u64) -> Value {
        json!({ "app": "integrated", "person": "Ada", "bone_removed_mm3": 80.0,
                "plan": { "outside_plan_mm3": 3.5, "dice": 0.9 },
                "scores": { "plunge_mm": plunge_mm, "burr_touches_of_brain": touches, "times_through": 1 } })
    }

    #[test]
    fn a_lesson_is_passed_by_its_marks_and_compared_with_earlier_sessions() {
        let lesson = Lesson::all(None).remove(0);
        let kept = |plunge_mm| SessionFolder { summary: summary(plunge_mm, 1), ..SessionFolder::default() };
        let debrief = Debrief::of(&summary(0.4, 0), Some(&lesson), &[kept(2.0), kept(3.0)]);
        assert_eq!((debrief.passed, debrief.earlier), (Some(true), 2));
        let plunge = debrief.rows.iter().find(|row| row.what.contains("plunge")).unwrap();
        assert_eq!((plunge.value.as_str(), plunge.earlier.as_str(), plunge.passed), ("0.40", "2.50", Some(true)));
        assert_eq!(debrief.curves[1], ("deepest plunge past the dura, mm".into(), vec![3.0, 2.0, 0.4]), "oldest first");
        let failed = Debrief::of(&summary(2.0, 3), Some(&lesson), &[]);
        assert_eq!((failed.passed, failed.curves.len()), (Some(false), 0));
        assert!(failed.headline.contains("2 of 4"), "{}", failed.headline);
    }

    #[test]
    fn without_a_lesson_the_headline_says_what_happened() {
        let debrief = Debrief::of(&summary(0.0, 0), None, &[]);
        assert!(debrief.passed.is_none() && debrief.headline.starts_with("The skull is open; the brain was not"));
        assert!(debrief.rows.iter().all(|row| row.passed.is_none() && row.limit.is_empty()));
    }
}
