//! The pages of the start page, made from what is filled in.

use crate::desk::action::Action;
use crate::desk::browse::{Folder, Goal};
use crate::desk::form::Form;
use crate::error::SessionError;
use crate::settings::{Images, Recent, Source};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use trepan_geometry::Vec3;
use trepan_render::Image;
use trepan_report::printable::{capital, printable};
use trepan_stages::program::Program;
use trepan_window::{Amount, Choosable, Item, Page, Picture};

/// The first page.
pub(crate) fn start(program: Program, form: &Form, picture: Option<Arc<Image>>) -> Page<Action> {
    let begin = match form.lacks(program) {
        None => Item::main("Start the operation", "loads the case and begins", Action::Begin),
        Some(why) => Item::closed("Start the operation", why),
    };
    let check = match form.lacks(program) {
        None => Item::button("Check the case in pictures", "CT and MRI, labels, place of the opening", Action::Check),
        Some(why) => Item::closed("Check the case in pictures", why),
    };
    let chosen = Item::Text(format!("Case: {}", printable(&form.case.name)));
    let lacks = form.lacks(program).map(|why| Item::Note(why.into()));
    Page {
        title: "Trepan".into(),
        line: format!("{}: choose a case and start", what(program)),
        columns: vec![case(form, picture), session(program, form), more(program, form)],
        foot: [begin, check, chosen].into_iter().chain(lacks).collect(),
        ..Page::default()
    }
}

fn what(program: Program) -> &'static str {
    match program {
        Program::Craniotomy => "Drill a patient's skull",
        Program::Brain => "Probe a patient's brain",
        Program::Integrated => "Open a patient's skull and probe the brain",
    }
}

/// Largest height of the picture of a case, points.
const PICTURE: f32 = 190.0;

fn case(form: &Form, picture: Option<Arc<Image>>) -> Vec<Item<Action>> {
    let shown = |image| Picture {
        name: "picture of the case".into(),
        image,
        height: PICTURE,
        letters: Vec::new(),
        clicked: None,
        dragged: None,
        scrolled: None,
    };
    let mut items = vec![Item::Heading("Case".into())];
    items.extend(picture.map(shown).map(Item::Picture));
    items.extend([
        Item::Row(vec![
            Item::button("Built-in case", "a head that comes with the program", Action::BuiltIn),
            Item::button("Open CT...", Goal::Ct.line(), Action::Browse(Goal::Ct)),
            Item::button("Open MRI...", Goal::Mri.line(), Action::Browse(Goal::Mri)),
            Item::button("Open case folder...", Goal::Case.line(), Action::Browse(Goal::Case)),
        ]),
        Item::Note("Or drop files and folders on this window.".into()),
    ]);
    items.extend(images(form));
    items.extend(opening(&form.case));
    if !form.settings.recent.is_empty() {
        items.push(Item::Heading("Recent cases".into()));
        items.extend(form.settings.recent.iter().enumerate().map(|(at, recent)| self::recent(at, recent)));
    }
    items
}

/// Largest threshold of bone that the page offers, HU, numerical.
const MOST_HU: f32 = 1500.0;

/// The chosen case: its name, its images, and how they are imported.
pub(crate) fn images(form: &Form) -> Vec<Item<Action>> {
    let Source::Images(images) = &form.case.source else { return Vec::new() };
    let name = "a name that you know it by; not the patient's";
    let mut items = vec![Item::Field("Name".into(), form.case.name.clone(), name.into(), Action::Name)];
    let files = [
        (Goal::Ct, "CT", &images.ct),
        (Goal::Mri, "MRI", &images.mri),
        (Goal::Labels, "Brain labels", &images.labels),
        (Goal::Tumour, "Tumour labels", &images.tumour),
    ];
    for (goal, kind, path) in files {
        let closed = !matches!(goal, Goal::Ct | Goal::Mri) && images.mri.is_none();
        items.extend(match path {
            Some(path) => Some(Item::Row(vec![
                Item::Text(format!("{kind}: {}", described(path))),
                Item::button("x", "takes it away from this case; the file stays", Action::Remove(goal)),
            ])),
            None if closed => None,
            None if matches!(goal, Goal::Ct | Goal::Mri) => Some(Item::Text(format!("{kind}: none yet"))),
            None => Some(Item::Row(vec![Item::button(format!("{kind}..."), goal.line(), Action::Browse(goal))])),
        });
    }
    let option = |name: String, hint: &str| Choosable { name, hint: hint.into(), open: true };
    for (at, name) in ["CT series", "MRI series"].into_iter().enumerate().filter(|(at, _)| form.series[*at].len() > 1) {
        let usual = option("usual".into(), "the one with the most slices of this kind");
        let found = form.series[at].iter().enumerate().map(|(number, words)| option(number.to_string(), words));
        let chosen = images.series[at].map_or(0, |number| number + 1);
        let does = [Action::CtSeries, Action::MriSeries][at];
        items.push(Item::Choice(name.into(), [usual].into_iter().chain(found).collect(), chosen, does));
    }
    if images.ct.is_some() {
        let (value, range) = (images.isovalue_hu.map_or(0.0, f32::from), [0.0, MOST_HU]);
        let name = if value > 0.0 { "HU: threshold of bone" } else { "threshold of bone: from the histogram" };
        items.push(Item::Amount(Amount { name: name.into(), value, range, step: 25.0 }, Action::Isovalue));
    }
    if images.ct.is_some() && images.mri.is_some() {
        let options = vec![
            option("as scanned".into(), "both are in one space already"),
            option("register".into(), "moves the MRI to the CT by mutual information; takes a minute more"),
        ];
        items.push(Item::Choice("MRI to CT".into(), options, usize::from(images.register), Action::Register));
    }
    items
}

/// The chosen place of the opening and the drawn flap.
fn opening(case: &Recent) -> Vec<Item<Action>> {
    let mut items = Vec::new();
    if let Some([x, y, z]) = case.opening {
        items.push(Item::Row(vec![
            Item::Text(format!("Opening at {x:.0}, {y:.0}, {z:.0} mm (right, front, up)")),
            Item::button("Usual place", "forgets this place", Action::UsualOpening),
        ]));
    }
    if !case.flap_line.is_empty() {
        items.push(Item::Row(vec![
            Item::Text(format!("Flap along the line that you drew, {:.0} mm across", across_mm(&case.flap_line))),
            Item::button("Round flap", "forgets this line", Action::RoundFlap),
        ]));
    }
    items
}

/// Largest distance of two points of a line, mm.
pub(crate) fn across_mm(line: &[[f32; 3]]) -> f32 {
    let points = || line.iter().map(|point| Vec3::from(*point));
    points().flat_map(|a| points().map(move |b| a.distance(b))).fold(0.0, f32::max)
}

/// Describes a file or folder by its own name; folders above it may name a patient.
fn described(path: &Path) -> String {
    let name = printable(&path.file_name().unwrap_or_default().to_string_lossy());
    match std::fs::read_dir(path) {
        Ok(entries) => format!("{name}, a folder of {} entries", entries.count()),
        Err(_) => match path.metadata() {
            Ok(file) => format!("{name}, {:.1} MB", file.len() as f64 * 1e-6),
            Err(_) => format!("{name}: it is not there any more"),
        },
    }
}

fn recent(at: usize, recent: &Recent) -> Item<Action> {
    let kind = match &recent.source {
        Source::BuiltIn => "built-in case".into(),
        Source::Images(Images { ct, mri, .. }) => {
            let name = |path: &PathBuf| printable(&path.file_name().unwrap_or_default().to_string_lossy());
            [ct, mri].into_iter().flatten().map(name).collect::<Vec<_>>().join(", ")
        }
        Source::Folder(_) => "case folder".to_string(),
    };
    let hash = recent.hash.get(..8).unwrap_or("not built yet");
    Item::Row(vec![
        Item::named(printable(&recent.name), "chooses this case", Action::Recent(at)),
        Item::Note(format!("{kind}, {hash}")),
        Item::button("x", "takes it off this list; its files stay", Action::Forget(at)),
    ])
}

fn session(program: Program, form: &Form) -> Vec<Item<Action>> {
    let settings = &form.settings;
    let devices = form.devices(program).into_iter().map(|device| device.1).collect();
    let person = "for your learning curve; may stay empty";
    let mut items = vec![
        Item::Heading("Session".into()),
        Item::Field("Your name".into(), settings.person.clone(), person.into(), Action::Person),
        Item::Field(
            "Session".into(),
            form.session.clone(),
            "a name for its folder; may stay empty".into(),
            Action::Session,
        ),
        Item::Choice("Device".into(), devices, form.device(program), Action::Device),
        Item::Choice("First tool".into(), Form::tools(program), settings.tool, Action::Tool),
        Item::Choice("Quality".into(), Form::qualities(), form.quality(), Action::Quality),
    ];
    if program.has_bone() && form.case.flap_line.is_empty() {
        let name = if settings.flap_mm > 0.0 { "mm across: a flap" } else { "mm across: a burr hole, no flap" };
        items.push(Item::Note("Planned flap".into()));
        let amount = Amount { name: name.into(), value: settings.flap_mm, range: [0.0, 90.0], step: 2.0 };
        items.push(Item::Amount(amount, Action::Flap));
    }
    items
}

fn more(program: Program, form: &Form) -> Vec<Item<Action>> {
    let first = match program.has_bone() {
        true => Item::button("Guided first operation", "step by step, about two minutes", Action::Lesson(0)),
        false => Item::closed("Guided first operation", "it drills: use integrated or craniotomy"),
    };
    let language = form.languages.place(&form.settings.language);
    vec![
        Item::Heading("Learn".into()),
        first,
        Item::button("Lessons...", "steps, targets and pass marks", Action::Lessons),
        Item::Heading("Look back".into()),
        Item::button("Sessions...", "results, reports and replays of all sessions", Action::Sessions),
        Item::button("Replay a recording...", Goal::Recording.line(), Action::Browse(Goal::Recording)),
        Item::Heading("Window".into()),
        Item::Choice("Language".into(), form.languages.choosable(), language, Action::Language),
        Item::Look,
        Item::Note("F1 in a session lists all keys. Q ends it and writes its report.".into()),
        Item::Row(vec![Item::button("Quit", "closes the window", Action::Close)]),
    ]
}

/// The page on which a file or folder is chosen.
pub(crate) fn browse(goal: Goal, folder: &Folder, written: &str) -> Page<Action> {
    let path = &folder.path;
    let up = path.parent().map(|up| Item::button("Up", "the folder above", Action::Into(up.into())));
    let home = std::env::home_dir().map(|home| Item::button("Home", "your own folder", Action::Into(home)));
    let top = Item::button("Computer", "the top of all folders", Action::Into(PathBuf::from("/")));
    let places: Vec<Item<Action>> = up.into_iter().chain(home).chain([top]).collect();
    let written = Item::Field("Folder".into(), written.into(), "a path".into(), Action::Path);
    let entry = |name: &String, does: fn(PathBuf, Goal) -> Action| {
        Item::named(printable(name), String::new(), does(path.join(name), goal))
    };
    let folders = folder.folders.iter().map(|name| entry(name, |path, _| Action::Into(path))).collect::<Vec<_>>();
    let files = folder.files.iter().map(|name| entry(name, |path, goal| Action::Take(goal, path))).collect::<Vec<_>>();
    let count = folder.files.len();
    let mut foot = Vec::new();
    if goal.takes(path, count) {
        let hint = "reads the series in this folder";
        foot.push(Item::main("Use this folder", hint, Action::Take(goal, path.clone())));
    } else if goal != Goal::Recording {
        foot.push(Item::closed("Use this folder", goal.line()));
    }
    foot.push(Item::button("Cancel", "chooses nothing", Action::Home));
    foot.extend(folder.fault.clone().map(Item::Note));
    let of_folders = [Item::Row(places), written, Item::Heading("Folders".into())].into_iter().chain(folders);
    let none = files.is_empty().then(|| Item::Note(goal.none().into()));
    let of_files = [Item::Heading("Files".into())].into_iter().chain(none).chain(files);
    Page {
        title: goal.title().into(),
        line: goal.line().into(),
        columns: vec![of_folders.collect(), of_files.collect()],
        foot,
        escape: Some(Action::Home),
        steady: true,
    }
}

/// The page on which a dropped file or folder gets its purpose.
pub(crate) fn sort(path: &Path) -> Page<Action> {
    let take = |name: &str, hint: &str, goal| Item::main(name, hint, Action::Take(goal, path.into()));
    Page {
        title: "What did you drop here?".into(),
        line: described(path),
        columns: vec![vec![Item::Row(vec![
            take("The CT", "shows the skull", Goal::Ct),
            take("The MRI", "shows the brain", Goal::Mri),
        ])]],
        foot: vec![Item::button("Cancel", "takes nothing", Action::Home)],
        escape: Some(Action::Home),
        ..Page::default()
    }
}

/// The page while a session is loading, or over a draft of its scene.
pub(crate) fn loading(name: &str, (share, line): (f32, String)) -> Page<Action> {
    Page {
        title: format!("Loading: {}", printable(name)),
        line: String::new(),
        columns: vec![vec![
            Item::Progress(share, line),
            Item::button("Cancel", "back to the start page", Action::Cancel),
        ]],
        foot: Vec::new(),
        escape: Some(Action::Cancel),
        ..Page::default()
    }
}

/// The page after a session, while its report is written.
pub(crate) fn writing() -> Page<Action> {
    Page { title: "Writing the report".into(), line: "pictures, scores, drilled skull".into(), ..Page::default() }
}

/// Flags, and the controls of the window that do the same.
const CONTROLS: [(&str, &str); 14] = [
    ("--ct PATH", "\"Open CT...\""),
    ("--mri PATH", "\"Open MRI...\""),
    ("--tissue CLASS=PATH", "\"Tumour labels...\""),
    ("--tissue tumour", "\"Tumour labels\""),
    ("--labels PATH", "\"Brain labels...\""),
    ("--labels", "\"Brain labels\""),
    ("--isovalue-hu", "\"threshold of bone\""),
    ("--ct-series", "\"CT series\""),
    ("--mri-series", "\"MRI series\""),
    ("--register", "\"register\""),
    ("--opening", "the place of the opening"),
    ("--flap", "\"Planned flap\""),
    ("--ct", "\"Open CT...\""),
    ("--mri", "\"Open MRI...\""),
];

/// Names the window's controls instead of the flags in a message.
pub(crate) fn by_controls(text: &str) -> String {
    CONTROLS.iter().fold(text.to_string(), |text, (flag, control)| text.replace(flag, control))
}

/// The page of an error: what is wrong and what to do. Paths of the images are left out, since they
/// may name a patient.
pub(crate) fn fault(fault: &SessionError, source: &Source) -> Page<Action> {
    let images = match source {
        Source::Images(images) => [
            (images.ct.as_deref(), "the CT"),
            (images.mri.as_deref(), "the MRI"),
            (images.labels.as_deref(), "the labels of the brain"),
            (images.tumour.as_deref(), "the labels of the tumour"),
        ],
        _ => [(None, ""); 4],
    };
    let without = |text: String, (path, name): (Option<&Path>, &str)| match path {
        Some(path) => text.replace(&path.display().to_string(), name),
        None => text,
    };
    let text = by_controls(&printable(&images.into_iter().fold(fault.to_string(), without)));
    let (problem, remedy) = split(&text);
    let usual = match fault {
        SessionError::Internal(_) | SessionError::Picture(_) => {
            "Try again with quality draft; if it comes again, report it."
        }
        _ => "Go back, change it on the start page, and start again.",
    };
    let remedy = remedy.map_or_else(|| usual.to_string(), capital);
    Page {
        title: "This did not work".into(),
        line: String::new(),
        columns: vec![vec![Item::Alert(capital(problem)), Item::Heading("What to do".into()), Item::Text(remedy)]],
        foot: vec![
            Item::main("Back to the start page", "your choices are kept", Action::Home),
            Item::button("Quit", "closes the window", Action::Close),
        ],
        escape: Some(Action::Home),
        ..Page::default()
    }
}

/// The page that says that the desktop could not open a file.
pub(crate) fn unopened(path: &Path) -> Page<Action> {
    let problem = "No program of this desktop opens the file. Open it by hand:";
    Page {
        title: "The file was not opened".into(),
        columns: vec![vec![
            Item::Alert(problem.into()),
            Item::named(printable(&path.display().to_string()), "tries again", Action::Open(path.into())),
        ]],
        foot: vec![
            Item::main("Back to the start page", "your choices are kept", Action::Home),
            Item::button("All sessions", "", Action::Sessions),
        ],
        escape: Some(Action::Home),
        ..Page::default()
    }
}

/// Splits an error into its cause and its remedy.
fn split(text: &str) -> (&str, Option<&str>) {
    let at = text.rfind("; ").or_else(|| text.rfind(": give")).or_else(|| text.rfind(": name"));
    at.map_or((text, None), |at| (&text[..at], Some(text[at + 1..].trim())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_split_into_cause_and_remedy() {
        assert_eq!(
            split("cannot write x: full; give another folder"),
            ("cannot write x: full", Some("give another folder"))
        );
        assert_eq!(split("--flap 91 is out of range: give 0 to 90").1, Some("give 0 to 90"));
        assert_eq!(split("plain"), ("plain", None));
        let page = fault(&SessionError::Internal("a thread panicked".into()), &Source::BuiltIn);
        assert!(matches!(&page.columns[0][0], Item::Alert(text) if text == "A thread panicked"));
    }

    #[test]
    fn an_error_names_the_control_and_not_the_flag() {
        let text = "the MRI does not lie in the CT's space: give --register, --labels PATH or --isovalue-hu 700";
        let controls = by_controls(text);
        assert!(!controls.contains("--") && controls.contains("\"register\", \"Brain labels...\""), "{controls}");
    }

    #[test]
    fn no_path_of_an_image_is_shown() {
        let images = Source::Images(Images { ct: Some("/data/Doe^Jane/ct".into()), ..Images::default() });
        let mut form =
            Form { case: Recent { name: "case".into(), source: images, ..Recent::default() }, ..Form::default() };
        form.settings.recent = vec![form.case.clone()];
        let broken = SessionError::Case("/data/Doe^Jane/ct: no DICOM picture lies in it; give another".into());
        assert!(!format!("{:?}", fault(&broken, &form.case.source)).contains("Jane"));
        let page = start(Program::Integrated, &form, None);
        assert!(!format!("{page:?}").contains("Jane"));
        assert!(format!("{:?}", page.foot).contains("does: None"), "an MRI is missing");
    }
}
