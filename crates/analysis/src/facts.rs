//! Facts and scores of a session from `summary.json` and `scores.csv`, without names of people.
//!
//! # Practice
//! The tables hold no free text that may name a person: `--person` is taken if it looks like a
//! participant's code (N07), `--name` if it is one letter (a blinded condition), and paths in
//! texts are cut out. The case goes by its hash.

use crate::files::shown;
use anyhow::{Context, Result};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// What `summary.json` says of a session.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Facts {
    /// Device's name.
    pub device: Option<String>,
    /// Who operated, as given.
    person: Option<String>,
    /// Lesson's name.
    pub lesson: Option<String>,
    /// Session's name, as given.
    name: Option<String>,
    /// When it began, UTC.
    pub date: Option<String>,
    /// The second hand; its `device` is read.
    pub second: serde_json::Value,
    /// Whether a program made the participant.
    pub simulated: bool,
}

impl Facts {
    /// The participant's code; `None` for none, or for what may be a name.
    pub fn participant(&self) -> Option<&str> {
        self.person.as_deref().filter(|person| is_code(person))
    }

    /// The blinded condition.
    pub fn condition(&self) -> Option<&str> {
        self.name.as_deref().filter(|name| matches!(name.as_bytes(), [b'A'..=b'Z']))
    }

    /// Whether the person was left out, since it may be a name.
    pub fn hides_a_person(&self) -> bool {
        self.participant().is_none() && self.person.as_ref().is_some_and(|person| !person.trim().is_empty())
    }
}

/// Whether a text is a participant's code: one to four letters, then one to six digits.
pub(crate) fn is_code(text: &str) -> bool {
    let digits = text.trim_start_matches(|c: char| c.is_ascii_alphabetic());
    (1..=4).contains(&(text.len() - digits.len()))
        && (1..=6).contains(&digits.len())
        && digits.bytes().all(|byte| byte.is_ascii_digit())
}

/// A number that a session left.
pub(crate) struct Score {
    pub name: String,
    pub value: f64,
    pub unit: &'static str,
}

/// Files of results beside a recording; none where the folder holds several recordings.
pub(crate) fn results_of(recording: &Path) -> [Option<PathBuf>; 2] {
    let folder = recording.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let others = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let alone = others.filter(|path| path.extension().is_some_and(|extension| extension == "mcap")).count() == 1;
    ["summary.json", "scores.csv"].map(|name| Some(folder.join(name)).filter(|path| alone && path.is_file()))
}

/// Reads `summary.json`.
pub(crate) fn facts(path: &Path) -> Result<Facts> {
    let remedy = || format!("{} is no summary of a session; fetch it again, or remove it", shown(path));
    serde_json::from_slice(&fs::read(path).with_context(remedy)?).with_context(remedy)
}

/// Reads the numbers of `scores.csv`; those of later parts of a name win.
pub(crate) fn scores(path: &Path) -> Result<Vec<Score>> {
    let remedy = || format!("{} is no table of scores; fetch it again, or remove it", shown(path));
    let mut found = BTreeMap::new();
    for record in csv::Reader::from_path(path).with_context(remedy)?.records() {
        let record = record.with_context(remedy)?;
        // What says who, when and where has no dot in its name, but for the hashes.
        let (Some(name), Some(Ok(value))) = (record.get(0), record.get(1).map(str::parse::<f64>)) else { continue };
        if name.contains('.') && !name.starts_with("hashes.") {
            let name = name.strip_prefix("scores.").unwrap_or(name);
            found.insert(name.to_owned(), value);
        }
    }
    Ok(found.into_iter().map(|(name, value)| Score { unit: unit(&name), name, value }).collect())
}

/// Endings of scores' names and their units, in pairs; the longer ones first.
const UNITS: &str = "ml_per_min ml/min, seconds s, share 1, count 1, mm3 mm3, mm2 mm2, m_s m/s, n_s N s, deg degrees, \
                     mm mm, ms ms, us us, hz Hz, ml ml, n N, s s, j J";

/// The unit that ends a score's name; empty for none.
pub(crate) fn unit(name: &str) -> &'static str {
    let last = name.rsplit('.').next().unwrap_or(name);
    let ends = |ending: &str| last.strip_suffix(ending).is_some_and(|rest| rest.is_empty() || rest.ends_with('_'));
    let pairs = UNITS.split(", ").filter_map(|pair| pair.split_once(' '));
    { pairs }.find(|(ending, _)| ends(ending)).map_or("", |(_, unit)| unit)
}

/// A text without paths of files: each word with a path is replaced from where the path begins.
pub(crate) fn without_paths(text: &str) -> String {
    if !text.contains(['/', '\\']) {
        return text.to_owned();
    }
    // A path may hold blanks: what follows its first separator in the same clause goes too.
    let begin = |word: &str| word.rfind(['"', '\'', '(', '=', ':']).map_or(0, |at| at + 1);
    let mut out = Vec::new();
    for clause in text.split_inclusive([';', '\n']) {
        let Some(at) = clause.find(['/', '\\']) else {
            out.push(clause.to_owned());
            continue;
        };
        // A unit such as mm/s or 1/min is no path.
        let word_at = clause[..at].rfind(char::is_whitespace).map_or(0, |blank| blank + 1);
        let word = clause[word_at..].split_whitespace().next().unwrap_or_default();
        let is_unit =
            word.len() <= 8 && word.matches(['/', '\\']).count() == 1 && !word.starts_with(['/', '\\', '~', '.']);
        if is_unit {
            let end = word_at + word.len();
            out.push(format!("{}{}", &clause[..end], without_paths(&clause[end..])));
        } else {
            out.push(format!("{}(path)", &clause[..word_at + begin(&clause[word_at..at])]));
        }
    }
    out.concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_told_from_names() {
        let codes = ["N07", "EXP001", "p1"].map(is_code);
        let names = ["Ada", "Müller", "N", "07", "N07 Ada", "Ada Lovelace1815", "ABCDE1", ""].map(is_code);
        assert_eq!((codes, names), ([true; 3], [false; 8]));
    }

    #[test]
    fn paths_go_and_units_stay() {
        let cases = [
            ("the feed was 3 mm/s at 9000 1/min", "the feed was 3 mm/s at 9000 1/min"),
            ("cannot read /home/ada/Head of Ada.nii; give another", "cannot read (path) give another"),
            ("replay:/data/Ada/a.mcap", "replay:(path)"),
            (r"C:\Users\Ada\ct.nii is gone", "C:(path)"),
            ("script:retract", "script:retract"),
        ];
        for (text, left) in cases {
            assert_eq!(without_paths(text), left);
        }
    }
}
