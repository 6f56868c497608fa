//! The result page of a session, the list of all sessions and the list of lessons.

use crate::desk::action::Action;
use crate::printable::{count, printable};
use crate::report::debrief::{Debrief, Row};
use crate::report::kept::Kept;
use crate::report::sessions::{self, SessionRow};
use crate::settings::Recent;
use crate::training::Lesson;
use std::path::Path;
use trepan_render::window::{Item, Page};

/// The page of a session's result.
pub(crate) fn page(folder: &Path, kept: &[Kept], lessons: &[Lesson]) -> Page<Action> {
    let Some(session) = Kept::of(folder) else {
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

/// The page of all sessions.
pub(crate) fn list(kept: &[Kept], lessons: &[Lesson], recent: &[Recent]) -> Page<Action> {
    let row = |session: &SessionRow| {
        let folder = session.folder.clone();
        let title = when(&folder.file_name().unwrap_or_default().to_string_lossy());
        let passed = session.passed.map(|passed| String::from(if passed { "passed" } else { "not passed" }));
        let dice = session.dice.map(|dice| format!("Dice {dice:.2}"));
        let plunge = session.plunge_mm.map(|mm| format!("plunge {mm:.1} mm"));
        let known = [&session.person, &session.program, &session.case, &session.lesson].map(|text| printable(text));
        let all = known.into_iter().chain([passed, dice, plunge].into_iter().flatten());
        let line: Vec<String> = all.filter(|text| !text.is_empty()).collect();
        Item::Row(vec![
            Item::button(title, "its result", Action::Result(folder.clone())),
            Item::button("Report", "in the browser", Action::Report(folder.clone())),
            Item::button("Replay", "shows it again", Action::Replay(folder)),
            Item::Note(line.join(", ")),
        ])
    };
    let kept = sessions::rows(kept, lessons, recent);
    let rows: Vec<_> = kept.iter().map(row).collect();
    let none = rows.is_empty().then(|| Item::Text("No session was kept yet.".into()));
    Page {
        title: "Sessions".into(),
        line: format!("{}, the newest first; none is ever overwritten", count(kept.len(), "session")),
        columns: vec![rows.into_iter().chain(none).collect()],
        foot: vec![home()],
        escape: Some(Action::Home),
        ..Page::default()
    }
}

fn tried(times: usize) -> String {
    format!("{times} {}", if times == 1 { "try" } else { "tries" })
}

/// The page of all lessons; `closed` is why none can begin.
pub(crate) fn lessons(lessons: &[Lesson], kept: &[Kept], person: &str, closed: Option<&str>) -> Page<Action> {
    let lesson = |(at, lesson): (usize, &Lesson)| {
        let mine = |kept: &&Kept| kept.lesson == lesson.name && kept.person.trim().eq_ignore_ascii_case(person.trim());
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
