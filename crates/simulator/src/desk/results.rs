//! The result page of a session, and the list of all sessions.

use crate::desk::action::Action;
use crate::desk::kept::Kept;
use crate::printable::printable;
use std::path::Path;
use trepan_render::window::{Item, Page};

/// The page of a session's result.
pub(crate) fn page(folder: &Path, kept: &[Kept]) -> Page<Action> {
    let Some(session) = Kept::of(folder) else {
        return Page { title: "This session has no summary".into(), foot: vec![home()], ..Page::default() };
    };
    let _ = kept;
    let number = |path: &[&str], unit: &str| session.number(path).map_or("-".into(), |n| format!("{n:.1} {unit}"));
    let row = |name: &str, value: String| vec![name.to_string(), value];
    let table = vec![
        row("measure", "value".into()),
        row("bone removed", number(&["bone_removed_mm3"], "mm³")),
        row("bone removed outside the plan", number(&["plan", "outside_plan_mm3"], "mm³")),
        row("touches of the brain with a tool for bone", number(&["scores", "burr_touches_of_brain"], "")),
        row("deepest plunge past the dura", number(&["scores", "plunge_mm"], "mm")),
        row("largest force on the hand", number(&["force_n", "max"], "N")),
        row("time of drilling", number(&["scores", "drilling_s"], "s")),
    ];
    Page {
        title: "Result".into(),
        line: format!("{}, case {}, device {}", printable(&session.title), session.case, session.device),
        columns: vec![vec![Item::Heading("Measures".into()), Item::Table(table)]],
        foot: vec![
            Item::main("Back to the start page", "", Action::Home),
            Item::button("Open the report", "in the browser, where it can be printed", Action::Report(folder.into())),
            Item::button("Replay", "shows the session again", Action::Replay(folder.into())),
            Item::button("All sessions", "", Action::Sessions),
        ],
        escape: Some(Action::Home),
    }
}

fn home() -> Item<Action> {
    Item::main("Back to the start page", "", Action::Home)
}

/// The page of all sessions.
pub(crate) fn list(kept: &[Kept]) -> Page<Action> {
    let row = |session: &Kept| {
        let (title, folder) = (printable(&session.title), session.folder.clone());
        let who = if session.person.is_empty() { String::new() } else { format!(", {}", printable(&session.person)) };
        Item::Row(vec![
            Item::button(title, "its result", Action::Result(folder.clone())),
            Item::Note(format!("{}, {}, {}{who}", session.program, session.case, session.device)),
            Item::button("Report", "in the browser", Action::Report(folder.clone())),
            Item::button("Replay", "shows it again", Action::Replay(folder)),
        ])
    };
    let rows: Vec<_> = kept.iter().map(row).collect();
    let none = rows.is_empty().then(|| Item::Text("No session was kept yet.".into()));
    Page {
        title: "Sessions".into(),
        line: format!("{} sessions, the newest first; none is ever overwritten", kept.len()),
        columns: vec![rows.into_iter().chain(none).collect()],
        foot: vec![home()],
        escape: Some(Action::Home),
    }
}
