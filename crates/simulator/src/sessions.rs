//! The sessions that were kept as a table: for the console, the window and a spreadsheet.
//!
//! # Practice
//! [`rows`] reads each session's own `summary.json`; whether a lesson is passed is found anew from
//! its marks. Replays and watched sessions are left out: they are nobody's work.

use crate::error::SessionError;
use crate::options::SessionFilter;
use crate::settings::{Recent, Settings, sessions};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use trepan_report::csv;
use trepan_report::debrief::Debrief;
use trepan_report::kept::SessionFolder;
use trepan_report::printable::{columns, count, printable};
use trepan_report::training::Lesson;
use trepan_report::whole::whole;

/// One session in the table.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SessionRow {
    /// The session's folder.
    pub folder: PathBuf,
    /// When it began, UTC as in RFC 3339; empty if unknown.
    pub date: String,
    /// Who operated; empty if unknown.
    pub person: String,
    /// The program.
    pub program: String,
    /// What the user calls the case, else its name.
    pub case: String,
    /// Title of the lesson; empty without one.
    pub lesson: String,
    /// Name of the session; empty without one.
    pub name: String,
    /// Whether the lesson is passed; `None` without a lesson that is known.
    pub passed: Option<bool>,
    /// Agreement with the plan (Dice); `None` without bone.
    pub dice: Option<f64>,
    /// Deepest plunge past the dura, mm.
    pub plunge_mm: Option<f64>,
    /// Length of the session, s; `None` in older sessions.
    pub length_s: Option<f64>,
}

/// Makes the rows of the table, in the order given. `recent` has the users' names of cases.
pub(crate) fn rows(kept: &[SessionFolder], lessons: &[Lesson], recent: &[Recent]) -> Vec<SessionRow> {
    kept.iter().filter(|kept| !kept.is_copy()).map(|kept| row(kept, lessons, recent)).collect()
}

fn row(kept: &SessionFolder, lessons: &[Lesson], recent: &[Recent]) -> SessionRow {
    let number = |path: &str| at(&kept.summary, path).as_f64();
    let lesson = lessons.iter().find(|lesson| lesson.name == kept.lesson);
    let hash = at(&kept.summary, "hashes.case").as_str().filter(|hash| !hash.is_empty());
    let named = recent.iter().find(|case| hash == Some(&case.hash) && !case.name.is_empty());
    SessionRow {
        folder: kept.folder.clone(),
        date: kept.date(),
        person: kept.person.trim().into(),
        program: kept.program.clone(),
        case: named.map_or_else(|| kept.case.clone(), |case| case.name.clone()),
        lesson: lesson.map_or_else(|| kept.lesson.clone(), |lesson| lesson.title.clone()),
        name: kept.summary["name"].as_str().unwrap_or_default().into(),
        passed: lesson.and_then(|lesson| Debrief::of(&kept.summary, Some(lesson), &[]).passed),
        dice: number("plan.dice"),
        plunge_mm: number("scores.plunge_mm"),
        length_s: number("length_s"),
    }
}

fn at<'a>(summary: &'a Value, path: &str) -> &'a Value {
    path.split('.').fold(summary, |value, key| &value[key])
}

/// Headings of the printed table.
const HEADINGS: [&str; 9] =
    ["date (UTC)", "person", "program", "case", "lesson", "name", "passed", "Dice", "plunge, mm"];

impl SessionRow {
    /// Cells of the printed table, in the order of its headings.
    pub fn cells(&self) -> [String; 9] {
        let number = |value: Option<f64>, digits: usize| value.map_or("-".into(), |value| format!("{value:.digits$}"));
        let text = |text: &str| if text.is_empty() { "-".into() } else { printable(text) };
        let passed = self.passed.map_or("-", |passed| if passed { "yes" } else { "no" });
        let date = self.date.get(..16).map_or("-".into(), |date| date.replace('T', " "));
        let [person, program, case] = [&self.person, &self.program, &self.case].map(|cell| text(cell));
        let [lesson, name] = [&self.lesson, &self.name].map(|cell| text(cell));
        let (dice, plunge) = (number(self.dice, 2), number(self.plunge_mm, 1));
        [date, person, program, case, lesson, name, passed.into(), dice, plunge]
    }
}

/// A table for the console.
fn table(rows: &[SessionRow]) -> String {
    columns([HEADINGS.map(String::from)].into_iter().chain(rows.iter().map(SessionRow::cells)))
}

impl SessionFilter {
    fn folders(&self) -> Vec<PathBuf> {
        let usual = || vec![sessions(), PathBuf::from("trepan-out")];
        if self.folders.is_empty() { usual() } else { self.folders.clone() }
    }

    fn takes(&self, kept: &SessionFolder, row: &SessionRow) -> bool {
        let low = |text: &str| text.trim().to_lowercase();
        let is = |wanted: &Option<String>, names: &[&str]| {
            wanted.as_ref().is_none_or(|wanted| names.iter().any(|name| low(name) == low(wanted)))
        };
        let of_case = |wanted: &String| [&row.case, &kept.case].iter().any(|name| low(name).contains(&low(wanted)));
        is(&self.person, &[&row.person])
            && is(&self.lesson, &[&kept.lesson, &row.lesson])
            && self.case.as_ref().is_none_or(of_case)
    }

    /// The sessions that are wanted, the newest first.
    fn find(&self) -> Vec<(SessionFolder, SessionRow)> {
        let (lessons, recent) = (Lesson::all(Lesson::folder().as_deref()), Settings::read().recent);
        let all = SessionFolder::all(&self.folders());
        let rows = rows(&all, &lessons, &recent);
        let all = all.into_iter().filter(|kept| !kept.is_copy());
        all.zip(rows).filter(|(kept, row)| self.takes(kept, row)).collect()
    }
}

/// Prints the sessions as a table.
pub(crate) fn list(wanted: &SessionFilter) -> Result<ExitCode, SessionError> {
    let rows: Vec<SessionRow> = wanted.find().into_iter().map(|(_, row)| row).collect();
    if !rows.is_empty() {
        print!("{}", table(&rows));
    }
    println!("{}", in_folders(rows.len(), wanted));
    Ok(ExitCode::SUCCESS)
}

fn in_folders(number: usize, wanted: &SessionFilter) -> String {
    let folders: Vec<String> = wanted.folders().iter().map(|folder| folder.display().to_string()).collect();
    printable(&format!("{} in {}", count(number, "session"), folders.join(", ")))
}

/// Writes one row per session to a CSV file, with every number of its scores.
pub(crate) fn export(wanted: &SessionFilter, file: &Path) -> Result<ExitCode, SessionError> {
    if file.exists() {
        return Err(SessionError::Usage(format!("{} exists already: name a file that does not", file.display())));
    }
    let found = wanted.find();
    if found.is_empty() {
        return Err(SessionError::Usage(format!("{}: nothing to write", in_folders(0, wanted))));
    }
    whole(file, text(&found).as_bytes())?;
    println!("{}", printable(&format!("{}: {}", file.display(), count(found.len(), "session"))));
    Ok(ExitCode::SUCCESS)
}

/// Parts of a summary whose numbers are exported.
const PARTS: [&str; 4] = ["scores", "plan", "cut_off", "force_n"];

fn text(found: &[(SessionFolder, SessionRow)]) -> String {
    let numbers: Vec<BTreeMap<String, String>> = found.iter().map(|(kept, _)| numbers(&kept.summary)).collect();
    let keys: BTreeSet<&String> = numbers.iter().flat_map(BTreeMap::keys).collect();
    let about = ["date_utc", "person", "program", "version", "case", "case_hash", "lesson", "name", "device", "passed"];
    let head = about.into_iter().chain(["length_s", "warnings"]).chain(keys.iter().map(|key| key.as_str()));
    let mut csv = csv::line(head.chain(["folder"]));
    for ((kept, row), numbers) in found.iter().zip(&numbers) {
        let of_summary = |path: &str| at(&kept.summary, path).as_str().unwrap_or_default().to_string();
        let passed = row.passed.map_or(String::new(), |passed| u8::from(passed).to_string());
        let warnings = kept.summary["warnings"].as_array().map_or(String::new(), |all| all.len().to_string());
        let about = [
            row.date.clone(),
            row.person.clone(),
            row.program.clone(),
            of_summary("version"),
            kept.case.clone(),
            of_summary("hashes.case"),
            kept.lesson.clone(),
            row.name.clone(),
            kept.device.clone(),
            passed,
            row.length_s.map_or(String::new(), |s| s.to_string()),
            warnings,
        ];
        let numbers = keys.iter().map(|key| numbers.get(*key).cloned().unwrap_or_default());
        csv += &csv::line(about.into_iter().chain(numbers).chain([row.folder.display().to_string()]));
    }
    csv
}

/// Every number of a session's scores by its path.
fn numbers(summary: &Value) -> BTreeMap<String, String> {
    let of_part = |part: &'static str| {
        let values = summary[part].as_object().into_iter().flatten();
        values
            .filter(|(_, value)| value.is_number())
            .map(move |(key, value)| (format!("{part}.{key}"), value.to_string()))
    };
    PARTS.into_iter().flat_map(of_part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn kept(person: &str, device: &str, dice: f64) -> SessionFolder {
        let summary = json!({
            "app": "integrated", "case": "case-1a2b", "person": person, "lesson": "through", "device": device,
            "date": "2026-03-04T05:06:07Z", "version": "0.3.0", "length_s": 61.5, "hashes": { "case": "1a2b" },
            "plan": { "dice": dice }, "scores": { "plunge_mm": 1.25, "new_key_n": 2 }, "warnings": [{}, {}],
        });
        SessionFolder::with(Path::new("kept/integrated/one"), summary)
    }

    #[test]
    fn a_row_has_the_result_of_its_own_summary_and_the_users_name_of_the_case() {
        let lessons = Lesson::all(None);
        let recent = [Recent { name: "Training head".into(), hash: "1a2b".into(), ..Recent::default() }];
        let all = [kept("Ada", "mouse", 0.875), kept("Ada", "replay", 0.9)];
        let rows = rows(&all, &lessons, &recent);
        assert_eq!(rows.len(), 1, "a replay is nobody's work");
        assert!(rows[0].passed.is_some() && rows[0].length_s == Some(61.5));
        let table = table(&rows);
        let cells = ["2026-03-04 05:06", "Ada", "integrated", "Training head", "0.88", "1.2"];
        assert!(cells.iter().all(|cell| table.contains(cell)), "{table}");
        let columns = table.lines().map(|line| line.find("integrated").or(line.find("program")));
        assert_eq!(columns.collect::<BTreeSet<_>>().len(), 1, "columns are aligned:\n{table}");
    }

    #[test]
    fn sessions_are_chosen_by_person_lesson_and_case() {
        let (kept, lessons) = (kept("Ada", "mouse", 0.5), Lesson::all(None));
        let row = row(&kept, &lessons, &[]);
        let takes = |person: Option<&str>, lesson: Option<&str>, case: Option<&str>| {
            let [person, lesson, case] = [person, lesson, case].map(|text| text.map(String::from));
            SessionFilter { person, lesson, case, ..SessionFilter::default() }.takes(&kept, &row)
        };
        assert!(takes(None, None, None) && takes(Some(" ada"), Some("through"), Some("1A2B")));
        assert!(takes(None, Some(&row.lesson), None), "by title");
        assert!(
            !takes(Some("Bob"), None, None) && !takes(None, Some("flap"), None) && !takes(None, None, Some("head"))
        );
    }

    #[test]
    fn an_export_has_a_column_for_each_number_of_any_session() {
        let (lessons, mut other) = (Lesson::all(None), kept("B, C", "mouse", 0.5));
        other.summary["scores"] = json!({ "old_key_mm": 3.5, "none": null });
        let found: Vec<_> = [kept("Ada", "mouse", 0.5), other].map(|k| (k.clone(), row(&k, &lessons, &[]))).into();
        let csv = text(&found);
        let lines: Vec<&str> = csv.lines().collect();
        let heads: Vec<&str> = lines[0].split(',').collect();
        let cell = |line: usize, head: &str| {
            let at = heads.iter().position(|known| *known == head).unwrap();
            lines[line].replace("\"B, C\"", "B").split(',').nth(at).unwrap().to_string()
        };
        assert_eq!((lines.len(), cell(1, "scores.new_key_n"), cell(2, "scores.new_key_n")), (3, "2".into(), "".into()));
        assert_eq!((cell(2, "scores.old_key_mm"), cell(1, "plan.dice")), ("3.5".into(), "0.5".into()));
        assert_eq!((cell(1, "warnings"), cell(1, "version")), ("2".into(), "0.3.0".into()));
    }
}
