//! What a study lacks: sessions, scores, answers.

use super::plan::plan;
use super::protocol::Protocol;
use super::runs::Run;
use crate::files::shown;
use anyhow::{Context, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// An answer of a participant in a condition (empty without conditions) to an item.
pub type Answers = BTreeMap<(String, String, String), f64>;

/// Reads `answers.csv`: participant, condition, item, value. Blank values are passed over; none
/// where there is no file. Also lists what is wrong in it.
pub fn answers(protocol: &Protocol, path: &Path) -> Result<(Answers, Vec<String>)> {
    let (mut found, mut wrong) = (Answers::new(), Vec::new());
    if !path.exists() {
        return Ok((found, wrong));
    }
    let remedy = || format!("{} is no table of answers; `plan --out` writes one to fill in", shown(path));
    for record in csv::Reader::from_path(path).with_context(remedy)?.records() {
        let record = record.with_context(remedy)?;
        let line = record.position().map_or(0, csv::Position::line);
        let cell = |at: usize| record.get(at).unwrap_or_default().trim().to_owned();
        let [code, condition, item, value] = [cell(0), cell(1), cell(2), cell(3)];
        if value.is_empty() {
            continue;
        }
        let question = protocol.questions.iter().find(|question| question.item == item);
        let Some([low, high]) = question.map(|question| question.scale.range()) else {
            wrong.push(format!("answers.csv, line {line}: {item:?} is no item of the protocol; correct it"));
            continue;
        };
        match value.parse::<f64>().ok().filter(|value| (low..=high).contains(value)) {
            Some(value) => _ = found.insert((code, condition, item), value),
            None => wrong.push(format!("answers.csv, line {line}: {value:?} is not {low} to {high}; correct it")),
        }
    }
    Ok((found, wrong))
}

/// Lists what is missing or too much in a study, each a line that says what and of whom.
pub fn missing(protocol: &Protocol, runs: &[Run], answers: &Answers) -> Vec<String> {
    let plan = plan(protocol);
    let mut lines = Vec::new();
    let planned: BTreeSet<&str> = plan.participants.iter().map(|participant| participant.code.as_str()).collect();
    let others: BTreeSet<&str> = runs.iter().map(|run| run.participant.as_str()).collect();
    lines.extend(others.difference(&planned).map(|code| format!("{code} has sessions and is not planned")));
    for participant in &plan.participants {
        let code = &participant.code;
        let letters: Vec<Option<&String>> =
            if plan.key.is_empty() { vec![None] } else { participant.order.iter().map(Some).collect() };
        for letter in letters {
            let place = letter.map_or_else(String::new, |letter| format!(" in condition {letter}"));
            for task in &protocol.tasks {
                let is_of =
                    |run: &&Run| run.participant == *code && run.task == task.name && run.condition.as_ref() == letter;
                let count = runs.iter().filter(is_of).count();
                if count != task.attempts {
                    lines.push(format!("{code}: {count} of {} attempts at {}{place}", task.attempts, task.name));
                }
            }
            let key = |item: &str| (code.clone(), letter.cloned().unwrap_or_default(), item.to_owned());
            let items = protocol.questions.iter().map(|question| question.item.as_str());
            let unanswered: Vec<&str> = items.filter(|item| !answers.contains_key(&key(item))).collect();
            if !unanswered.is_empty() {
                lines.push(format!("{code}: no answer{place} to {}", unanswered.join(", ")));
            }
        }
    }
    for run in runs {
        let scores = protocol.measures.iter().map(|measure| measure.score.as_str());
        let lacks: Vec<&str> = scores.filter(|score| !run.scores.contains_key(*score)).collect();
        if !lacks.is_empty() {
            let Run { participant, session, .. } = run;
            lines.push(format!("{participant}: session {session} has no score {}", lacks.join(", ")));
        }
        if !run.complete {
            lines.push(format!("{}: the recording of session {} is not whole", run.participant, run.session));
        }
    }
    lines
}
