//! Every page of the three programs at every size: no control is out of reach. With
//! `TREPAN_GALLERY` as the name of a folder the pages, and those of a session, are kept there as
//! pictures, in the language `TREPAN_GALLERY_LANGUAGE`; with `TREPAN_GALLERY_PROGRAM` those of one
//! program in one size.

use super::*;
use crate::desk::action::Action;
use crate::desk::browse::Goal;
use crate::desk::job::USUAL_S;
use crate::settings::{Images, Recent, Source};
use crate::show::notice_text;
use crate::show::notice_text::IN_ARM;
use crate::show::window::{ARM, NOT_IN_HAND, SWITCHES, TEACH};
use crate::{Inputs, TissueSource};
use clap::Parser;
use egui_kittest::Harness;
use egui_kittest::kittest::{By, NodeT, Queryable};
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;
use trepan_geometry::Tool;
use trepan_gpu::GpuError;
use trepan_render::Image;
use trepan_report::training::Lesson;
use trepan_runtime::lesson::TEACHER_REQUESTS;
use trepan_stages::notice::{Hindrance, NoArm, Notice, Warning, What};
use trepan_stages::program::Phase;
use trepan_window::{Host, Pages, missing, speak, tr};

/// Sizes of the window, pixels, and its scale.
const SIZES: [([f32; 2], f32); 4] =
    [([1024.0, 700.0], 1.0), ([1280.0, 800.0], 1.0), ([1920.0, 1080.0], 1.0), ([1280.0, 800.0], 2.0)];

/// A program in a window that a test looks at.
pub(crate) struct Gallery {
    window: Harness<'static, Pages<App>>,
    program: Program,
    home: PathBuf,
    /// What is cut off.
    cut: Vec<String>,
}

impl Gallery {
    fn open(program: Program, home: &Path) -> Self {
        for (name, folder) in [("TREPAN_CONFIG", "config"), ("TREPAN_SESSIONS", "sessions")] {
            #[expect(unsafe_code, reason = "the folders of a program that runs in this process")]
            // SAFETY: no other test of this process runs a program in a window.
            unsafe {
                std::env::set_var(name, home.join(folder));
            }
        }
        let case = trepan_fixtures::case_head();
        let tissues = TissueSource::regions_of_aseg(case.aseg);
        let (ct, mri, labels) = (Some(case.ct), Some(case.mri), Some(case.labels));
        let built_in = Inputs { name: Some(case.name), ct, mri, labels, tissues, ..Inputs::default() };
        let language = std::env::var("TREPAN_GALLERY_LANGUAGE").unwrap_or("en".into());
        let options = Options::try_parse_from(["x", "--quality", "draft", "--language", &language]).unwrap();
        let (stage, offers) = window::stage();
        let desk = App::new(program, options, built_in, (stage, Err(GpuError::NoAdapter)), Stop::default());
        let pages = Pages::undisplayed(offers, desk);
        let mut harness = Harness::builder().with_size([1280.0, 800.0]);
        if std::env::var_os("TREPAN_GALLERY").is_some() {
            harness = harness.wgpu();
        }
        let window = harness.build_ui_state(|ui, pages: &mut Pages<App>| pages.draw(ui), pages);
        Self { window, program, home: home.into(), cut: Vec::new() }
    }

    /// Does what a control does.
    fn act(&mut self, action: Action) {
        self.window.state().with_host(|desk| desk.act(action));
        self.window.run_steps(2);
    }

    /// Presses the button of a command with its key.
    fn press(&mut self, name: &str, key: &str) {
        self.window.get_by_label(&format!("{} ({key})", tr(name))).click_accesskit();
        self.window.run_steps(3);
    }

    fn shows(&self, text: &str) -> bool {
        self.window.query_all_by_label_contains(text).next().is_some()
    }

    /// Waits until a text is shown, in the language of the window.
    fn waits_for(&mut self, text: &str) {
        for _ in 0..3000 {
            self.window.step();
            if self.shows(&tr(text)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        panic!("{text} does not come");
    }

    /// Looks at the page in every size.
    fn look(&mut self, name: &str) {
        let sizes = if only().is_some() { &SIZES[1..2] } else { &SIZES };
        for &([width, height], scale) in sizes {
            self.window.set_pixels_per_point(scale);
            self.window.step();
            self.window.set_size([width / scale, height / scale].into());
            self.window.run_steps(4);
            let shown = format!("{}-{name}-{width}x{height}-{scale}", self.program.name());
            self.reaches_all(&shown, [width / scale, height / scale]);
            self.keep(&shown);
        }
        self.window.set_pixels_per_point(1.0);
        self.window.step();
        self.window.set_size([1280.0, 800.0].into());
        self.window.run_steps(3);
    }

    /// Notes what is cut off beside the window.
    fn reaches_all(&mut self, shown: &str, [width, _]: [f32; 2]) {
        let all = self.window.query_all(By::new().predicate(|node| node.raw_bounds().is_some()));
        let cut = all.filter(|node| node.rect().left() < -1.0 || node.rect().right() > width + 1.0);
        let cut: Vec<_> =
            cut.map(|node| format!("{shown}: {:?} at {:?}", node.accesskit_node().label(), node.rect())).collect();
        self.cut.extend(cut);
    }

    /// Keeps a picture if pictures are wanted.
    fn keep(&mut self, name: &str) {
        let Some(folder) = std::env::var_os("TREPAN_GALLERY").map(PathBuf::from) else { return };
        let drawn = self.window.render().unwrap();
        let (width, height) = (drawn.width(), drawn.height());
        fs::create_dir_all(&folder).unwrap();
        let image = Image { width, height, rgba: drawn.into_raw() };
        image.write_png(&folder.join(format!("{name}.png"))).unwrap();
    }

    /// Puts sessions of one person into the folder of sessions.
    fn keeps_sessions(&self) -> PathBuf {
        let mut last = PathBuf::new();
        for day in 1..=7 {
            last = self.home.join(format!("sessions/{}/2026-03-0{day}T10-20-30", self.program.name()));
            fs::create_dir_all(&last).unwrap();
            let lesson = (day % 2 == 1).then_some("first-operation");
            let summary = json!({
                "app": self.program.name(), "case": "case-head", "device": "mouse", "person": "Ada", "lesson": lesson,
                "bone_removed_mm3": 60.0 + 10.0 * f64::from(day),
                "plan": { "outside_plan_mm3": 20.0 / f64::from(day), "dice": 0.5 + 0.05 * f64::from(day) },
                "scores": { "plunge_mm": 3.0 - 0.4 * f64::from(day), "burr_touches_of_brain": 7 - day,
                            "times_through": 1, "drilling_s": 200.0 / f64::from(day), "path_mm": 900.0 },
            });
            fs::write(last.join("summary.json"), summary.to_string()).unwrap();
        }
        last
    }

    /// Walks through all pages around a session.
    fn walk(&mut self, look: &mut dyn FnMut(&mut Self, &str)) {
        look(self, "start");
        let images = |ct: Option<&str>| Source::Images(Images { ct: ct.map(PathBuf::from), ..Images::default() });
        let case = |name: &str, source| Recent { name: name.into(), source, ..Recent::default() };
        self.window.state().with_host(|desk| {
            let form = &mut desk.form;
            form.settings.recent =
                vec![case("frontal tumour", images(Some("/ct"))), case("case-head", Source::BuiltIn)];
            form.settings.person = "Ada".into();
            form.case = Recent { opening: Some([30.0, 40.0, 20.0]), ..case("frontal tumour", images(Some("/ct"))) };
        });
        self.window.run_steps(2);
        look(self, "start-chosen");
        self.act(Action::Browse(Goal::Ct));
        fs::create_dir_all(self.home.join("images/series")).unwrap();
        self.act(Action::Into(self.home.join("images")));
        look(self, "browse");
        self.window.state().with_host(|desk| desk.dropped(vec!["/images".into()]));
        look(self, "dropped");
        self.act(Action::Sessions);
        look(self, "no-sessions");
        let last = self.keeps_sessions();
        self.act(Action::Sessions);
        look(self, "sessions");
        self.act(Action::Compare(last.clone()));
        look(self, "sessions-to-compare");
        self.act(Action::Result(last.clone()));
        look(self, "result");
        self.act(Action::Result(last.with_file_name("2026-03-06T10-20-30")));
        look(self, "result-without-lesson");
        self.act(Action::Lessons);
        look(self, "lessons");
        self.act(Action::Home);
        // Its CT is not there.
        self.act(Action::Begin);
        while self.window.state().with_host(|desk| desk.last.is_none()) {
            std::thread::sleep(Duration::from_millis(20));
            self.window.step();
        }
        look(self, "fault");
        self.act(Action::Home);
        self.act(Action::BuiltIn);
    }

    /// Looks at a session from its loading to its result.
    fn operates(&mut self) {
        self.act(Action::Home);
        self.act(Action::Begin);
        self.look("loading");
        self.waits_for("Engineering");
        self.window.run_steps(10);
        self.look("session");
        self.press("Keys", "F1");
        self.look("help");
        self.press("Keys", "F1");
        for (name, words, key) in [("microscope", "Microscope", "M"), ("section", "Section", "C")] {
            self.press(words, key);
            if name == "section" {
                self.window.get_by_label(&tr("axial")).click_accesskit();
            }
            self.look(name);
            self.press(words, key);
        }
        self.press("Large type", "L");
        self.look("large");
        self.press("Large type", "L");
        self.press("Light or dark", "I");
        self.look("light");
        self.press("Light or dark", "I");
        self.window.get_by_label(&tr("End the operation")).click_accesskit();
        self.window.run_steps(3);
        self.look("end");
        self.window.get_by_label(&tr("End and write the report (Enter)")).click_accesskit();
        self.waits_for("Back to the start page");
        self.look("result-of-session");
    }
}

/// The one program whose pages are wanted; `None` for all.
fn only() -> Option<String> {
    std::env::var("TREPAN_GALLERY_PROGRAM").ok()
}

#[test]
fn every_page_can_be_used_at_every_size() {
    let wanted = |program: &Program| only().is_none_or(|only| only == program.name());
    for program in [Program::Craniotomy, Program::Brain, Program::Integrated].into_iter().filter(wanted) {
        let home = tempfile::tempdir().unwrap();
        let mut gallery = Gallery::open(program, home.path());
        gallery.walk(&mut |gallery, name| gallery.look(name));
        gallery.act(Action::Check);
        gallery.look("loading-check");
        gallery.waits_for("Slices");
        gallery.look("check");
        if std::env::var_os("TREPAN_GALLERY").is_some() {
            gallery.operates();
        }
        assert!(gallery.cut.is_empty(), "{:#?}", gallery.cut);
    }
}

/// Every text of a panel that a session sends.
fn panel_texts() -> Vec<String> {
    let warnings = Warning::ALL.map(|warning| warning.text().to_string());
    let hindrances = Hindrance::ALL.into_iter().flat_map(|why| [What::NotUndone(why), What::NotRedone(why)]);
    let tools = Program::Integrated.tray().iter().map(|tool| What::Taken(*tool));
    let force = [[true, false], [false, false], [true, true], [false, true]];
    let whats = [
        What::Phase(Phase::Craniotomy),
        What::Phase(Phase::Brain),
        What::Through,
        What::Undone(1.0),
        What::Redone(1.0),
        What::NotChanged,
        What::HeldByArm,
        What::ArmGone,
        What::FlapWaits(Hindrance::Touches),
        What::NoFlap,
        What::NotOpen,
        What::FlapFree(1.0),
        What::FlapHangs,
        What::PieceHangs,
        What::FlapLifted(1.0),
        What::FlapReturned,
    ];
    let arms = [Tool::spatula(), Tool::probe(2.0)].map(What::ArmHolds).into_iter().chain(NoArm::ALL.map(What::NoArm));
    let whats = whats.into_iter().chain(hindrances).chain(tools).chain(arms);
    let whats = whats.chain(force.map(|[waits, second]| What::Force { waits, second }));
    let notices = whats.map(|what| Notice { tick: 0, time_ms: 0.0, what }.words().1);
    let tray = Program::Integrated.tray().iter();
    let hints = tray.flat_map(|tool| [true, false].map(|hand| notice_text::hint(tool, hand).into()));
    let lessons = Lesson::all(None).into_iter().flat_map(|lesson| {
        let steps = lesson.steps.into_iter().map(|step| step.text);
        steps.chain(lesson.marks.into_iter().map(|mark| mark.text)).chain([lesson.title, lesson.about])
    });
    let loading = USUAL_S.into_iter().map(|(stage, _)| stage.to_string());
    let requests = TEACHER_REQUESTS.into_iter().map(|(_, text)| text.to_string());
    let switches = SWITCHES.into_iter().map(|(text, ..)| text.to_string());
    let others = [TEACH, NOT_IN_HAND, ARM, IN_ARM, Notice::NO_FLAP, Notice::NOT_OPEN].map(String::from);
    let texts = warnings.into_iter().chain(notices).chain(hints).chain(lessons).chain(loading);
    texts.chain(requests).chain(switches).chain(others).collect()
}

#[test]
fn every_text_has_a_german_line() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/languages/de.json");
    let german = language::read(&fs::read_to_string(file).unwrap()).unwrap();
    let mut lacks = std::collections::BTreeSet::new();
    for program in [Program::Craniotomy, Program::Brain, Program::Integrated] {
        let home = tempfile::tempdir().unwrap();
        let mut gallery = Gallery::open(program, home.path());
        speak(Some(german.clone()));
        gallery.window.run_steps(2);
        gallery.walk(&mut |gallery, _| {
            // A text that stays English although it has a line did not pass through the language.
            let all = gallery.window.query_all(By::new().predicate(|node| node.label().is_some()));
            let labels = all.filter_map(|node| node.accesskit_node().label());
            let english = labels.filter(|label| german.texts.get(label).is_some_and(|line| line != label));
            lacks.extend(english.filter(|label| !german.texts.values().any(|line| line == label)));
        });
        if program == Program::Integrated {
            gallery.act(Action::Check);
            gallery.waits_for("Slices");
            gallery.window.run_steps(2);
        }
        panel_texts().iter().for_each(|text| _ = tr(text));
        lacks.extend(missing());
    }
    // Names that the test gave, and names of devices and languages.
    let given = ["Ada", "case-head", "frontal tumour", "series", "Trepan", "English", "Deutsch", "ct"];
    let names = given.into_iter().chain(["openhaptics", "force-dimension", "haply", "spacemouse"]).collect::<Vec<_>>();
    lacks.retain(|text| !names.contains(&text.as_str()));
    assert!(lacks.is_empty(), "no German line for {lacks:#?}");
}
