//! The result page of a session, the list of all sessions and the list of lessons.

use crate::desk::action::Action;
use crate::sessions::{self, SessionRow};
use crate::settings::Recent;
use std::path::{Path, PathBuf};
use trepan_report::debrief::{Debrief, Row};
use trepan_report::kept::SessionFolder;
use trepan_report::printable::{count, printable};
use trepan_report::training::Lesson;
use trepan_window::{Item, Page};

/// The page of a session's result.
pub(crate) fn page(folder: &Path, kept: &[SessionFolder], lessons: &[Lesson]) -> Page<Action> {
    let Some(session) = SessionFolder::of(folder) else {
        return Page { title: "This session has no summary".into(), foot: vec![home()], ..Page::default() };
    };
    let lesson = lessons.iter().find(|lesson| lesson.name == session.lesson);
    let debrief = Debrief::of(&session.summary, lesson, &session.before(kept));
    let verdict = match debrief.passed {
        Some(passed) => Item::Verdict(passed, debrief.headline.clone()),
        None => Item::Text(debrief.headline.clone()),
    };
    let mut items: Vec<Item<Action>> = debrief.lesson.iter().cloned().map(Item::Heading).collect();
    items.extend([verdict, Item::Table(table(&debrief))]);
    if debrief.earlier > 0 {
        items.push(Item::Note(format!(
            "compared with {}: {}",
            count(debrief.earlier, "earlier session"),
            printable(&session.person)
        )));
    }
    let mut columns = vec![items];
    if !debrief.curves.is_empty() {
        let curve =
            |(name, values): &(String, Vec<f64>)| Item::Curve(format!("{name}, session by session"), values.clone());
        let heading = Item::Heading("Learning curve".into());
        columns.push([heading].into_iter().chain(debrief.curves.iter().map(curve)).collect());
    }
    Page {
        title: "Result".into(),
        line: format!("{}, {}, {}", when(&session.title), session.case, session.device),
        columns,
        foot: vec![
            home(),
            Item::button("Open the report", "in the browser, where it can be printed", Action::Report(folder.into())),
            Item::button("Replay", "shows the session again", Action::Replay(folder.into())),
            Item::button("All sessions", "", Action::Sessions),
            Item::named(
                printable(&folder.display().to_string()),
                "opens the folder of its files",
                Action::Open(folder.into()),
            ),
        ],
        escape: Some(Action::Home),
        ..Page::default()
    }
}

/// Date, time and name of a session, from the name of its folder.
fn when(title: &str) -> String {
    let title = printable(title);
    match title.split_once('T') {
        Some((date, rest)) if rest.len() >= 8 && rest.is_char_boundary(8) => {
            let (time, name) = rest.split_at(8);
            let name = name.strip_prefix('-').map_or(String::new(), |name| format!(", {name}"));
            format!("{date} {}{name}", time[..5].replace('-', ":"))
        }
        _ => title,
    }
}

fn table(debrief: &Debrief) -> Vec<Vec<String>> {
    let heading = ["measure", "value", "limit", "kept", "earlier mean"].map(String::from);
    let row = |row: &Row| {
        let kept = row.passed.map_or("", |passed| if passed { "yes" } else { "no" });
        vec![row.what.clone(), row.value.clone(), row.limit.clone(), kept.into(), row.earlier.clone()]
    };
    let rows: Vec<Vec<String>> = debrief.rows.iter().map(row).collect();
    // A column that says nothing is left out.
    let says: Vec<bool> = (0..heading.len()).map(|at| rows.iter().any(|row| !row[at].is_empty())).collect();
    let of = |row: Vec<String>| row.into_iter().zip(&says).filter(|(_, says)| **says).map(|(cell, _)| cell).collect();
    [heading.into()].into_iter().chain(rows).map(of).collect()
}

fn home() -> Item<Action> {
    Item::main("Back to the start page", "your choices are kept", Action::Home)
}

/// All sessions, and what is done with them on their page.
pub(crate) struct Sessions {
    rows: Vec<SessionRow>,
    /// Words that a session must have to be shown.
    pub only: String,
    /// The session that another one is compared with.
    pub first: Option<PathBuf>,
}

impl Sessions {
    pub fn of(kept: &[SessionFolder], lessons: &[Lesson], recent: &[Recent]) -> Self {
        Self { rows: sessions::rows(kept, lessons, recent), only: String::new(), first: None }
    }

    /// Chooses a session to compare; returns both once there are two.
    pub fn compares(&mut self, folder: PathBuf) -> Option<[PathBuf; 2]> {
        match self.first.take() {
            Some(first) if first != folder => Some([first, folder]),
            Some(_) => None,
            None => {
                self.first = Some(folder);
                None
            }
        }
    }

    /// The page of them.
    pub fn page(&self) -> Page<Action> {
        let words = self.only.to_lowercase();
        let has_words = |text: &str| words.split_whitespace().all(|word| text.to_lowercase().contains(word));
        let shown = self.rows.iter().map(|session| (session, summary(session)));
        let rows: Vec<_> =
            shown.filter(|(_, summary)| has_words(&summary.join(", "))).map(|row| self.row(row)).collect();
        let (all, count_of) = (self.rows.len(), count(rows.len(), "session"));
        let none = rows.is_empty().then(|| match all {
            0 => Item::Text("No session was kept yet.".into()),
            _ => Item::Text("No session has all of these words.".into()),
        });
        let empty = "a name, a case, a lesson, a date, passed";
        let only = Item::Field("Only with".into(), self.only.clone(), empty.into(), Action::Only);
        let only = (all > 0).then_some(only);
        Page {
            title: "Sessions".into(),
            line: format!("{count_of}, the newest first; none is ever overwritten"),
            columns: vec![only.into_iter().chain(rows).chain(none).collect()],
            foot: vec![home()],
            escape: Some(Action::Home),
            ..Page::default()
        }
    }

    fn row(&self, (session, summary): (&SessionRow, Vec<String>)) -> Item<Action> {
        let folder = session.folder.clone();
        let compare = Action::Compare(folder.clone());
        let compare = match &self.first {
            Some(first) if *first == folder => Item::main("Compare", "chosen: choose another one, too", compare),
            Some(_) => Item::button("Compare", "with the chosen one, in the browser", compare),
            None => Item::button("Compare", "then choose another one", compare),
        };
        Item::Row(vec![
            Item::button(summary[0].clone(), "its result", Action::Result(folder.clone())),
            Item::button("Report", "in the browser", Action::Report(folder.clone())),
            Item::button("Replay", "shows it again", Action::Replay(folder)),
            compare,
            Item::Note(summary[1..].join(", ")),
        ])
    }
}

/// Describes a session in short parts; date, time and name first.
fn summary(session: &SessionRow) -> Vec<String> {
    let title = when(&session.folder.file_name().unwrap_or_default().to_string_lossy());
    let passed = session.passed.map(|passed| String::from(if passed { "passed" } else { "not passed" }));
    let dice = session.dice.map(|dice| format!("Dice {dice:.2}"));
    let plunge = session.plunge_mm.map(|mm| format!("plunge {mm:.1} mm"));
    let known = [&session.person, &session.program, &session.case, &session.lesson].map(|text| printable(text));
    let all = [title].into_iter().chain(known).chain([passed, dice, plunge].into_iter().flatten());
    all.filter(|text| !text.is_empty()).collect()
}

fn tried(times: usize) -> String {
    format!("{times} {}", if times == 1 { "try" } else { "tries" })
}

/// The page of all lessons; `closed` is why none can begin.
pub(crate) fn lessons(lessons: &[Lesson], kept: &[SessionFolder], person: &str, closed: Option<&str>) -> Page<Action> {
    let lesson = |(at, lesson): (usize, &Lesson)| {
        let mine = |kept: &&SessionFolder| {
            kept.lesson == lesson.name && kept.person.trim().eq_ignore_ascii_case(person.trim())
        };
        let tries = kept.iter().filter(mine);
        let passed = tries.clone().any(|kept| Debrief::of(&kept.summary, Some(lesson), &[]).passed == Some(true));
        let state = match (passed, tries.count()) {
            (true, tries) => format!("passed, {}", tried(tries)),
            (false, 0) => "not tried yet".into(),
            (false, tries) => format!("not passed yet, {}", tried(tries)),
        };
        let begin = match closed {
            None if passed => Item::button("Begin", "once more", Action::Lesson(at)),
            None => Item::main("Begin", lesson.about.clone(), Action::Lesson(at)),
            Some(why) => Item::closed("Begin", why),
        };
        [
            Item::Heading(lesson.title.clone()),
            Item::Text(lesson.about.clone()),
            Item::Row(vec![begin, Item::Note(state)]),
        ]
    };
    Page {
        title: "Lessons".into(),
        line: "Steps while you operate, pass marks at the end; with the case and the device of the start page".into(),
        columns: vec![lessons.iter().enumerate().flat_map(lesson).collect()],
        foot: vec![Item::button("Back to the start page", "your choices are kept", Action::Home)],
        escape: Some(Action::Home),
        ..Page::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(page: &Page<Action>) -> String {
        format!("{:?}", page.columns)
    }

    #[test]
    fn sessions_are_found_by_words_and_compared_by_two_presses() {
        let row = |name: &str, person: &str, passed| SessionRow {
            folder: PathBuf::from(name),
            person: person.into(),
            passed: Some(passed),
            ..SessionRow::default()
        };
        let rows = vec![row("2026-03-06T10-20-30", "Ada", true), row("2026-03-07T10-20-30", "Grace", false)];
        let mut all = Sessions { rows, only: String::new(), first: None };
        assert!(texts(&all.page()).contains("Ada") && texts(&all.page()).contains("Grace"));
        all.only = "03-07 grace".into();
        assert!(!texts(&all.page()).contains("Ada") && texts(&all.page()).contains("Grace"));
        all.only = "nobody".into();
        assert!(texts(&all.page()).contains("No session has all of these words"));
        let [one, two] = ["a", "b"].map(PathBuf::from);
        assert_eq!((all.compares(one.clone()), all.compares(one.clone())), (None, None), "a second press lets go");
        assert_eq!((all.compares(one.clone()), all.compares(two.clone())), (None, Some([one, two])));
        assert_eq!(all.first, None);
    }
}
