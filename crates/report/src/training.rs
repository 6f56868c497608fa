//! Lessons as data: steps with targets for the session, pass marks for its result.
//!
//! # Practice
//! A lesson is a JSON file: those of the program lie in `lessons/`, the user's own in the folder
//! `lessons` beside the settings. Targets of steps are read from the running session, pass marks
//! from its summary. The limits are a teacher's choice; none is validated against clinical skill.

use etcetera::{BaseStrategy, choose_base_strategy};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use trepan_runtime::View;
use trepan_stages::program::Program;

/// A lesson.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lesson {
    /// Short name, as in summaries.
    pub name: String,
    /// Title.
    pub title: String,
    /// What is learnt, in a sentence.
    pub about: String,
    /// Names of the programs that it is for.
    #[serde(default = "bone_programs")]
    pub programs: Vec<String>,
    /// Diameter of the planned flap, mm; 0 for a burr hole.
    #[serde(default)]
    pub flap_mm: f32,
    /// Radius of a tumour that is made below the opening, mm; none without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tumour_mm: Option<f32>,
    /// The tool at the start, by its place in the tray.
    #[serde(default)]
    pub slot: usize,
    /// What to do, in order.
    pub steps: Vec<Step>,
    /// What the result must keep.
    pub marks: Vec<Mark>,
}

/// One step of a lesson.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// What to do.
    pub text: String,
    /// What is measured to end the step.
    pub until: Measure,
    /// The step ends at this value or more.
    pub least: Option<f64>,
    /// The step ends at this value or less.
    pub most: Option<f64>,
}

/// What is measured in a running session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Depth in bone, mm.
    BoneDepthMm,
    /// Depth in tissue, mm.
    TissueDepthMm,
    /// Distance from the tool to the brain, mm.
    BrainMm,
    /// Bone removed, mm³.
    RemovedMm3,
    /// The planned flap: 0 attached to the skull, 1 cut free, 2 lifted.
    Flap,
    /// Longest time so far that the tool rested on tissue, s.
    HoldS,
    /// Force on the hand, N.
    ForceN,
    /// Tissue taken by the aspirator, ml.
    TakenMl,
    /// Blood that comes, ml/min.
    BleedsMlPerMin,
    /// Length of all incisions of the dura, mm.
    IncisedMm,
    /// Place of the tool in the tray.
    Slot,
    /// Nothing: the last step.
    Never,
}

/// A pass mark.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// What is measured.
    pub text: String,
    /// Where it stands in the summary: keys with points between them.
    pub path: String,
    /// Its unit; empty for a count.
    #[serde(default)]
    pub unit: String,
    /// Smallest value that passes.
    pub least: Option<f64>,
    /// Largest value that passes.
    pub most: Option<f64>,
}

/// Programs of a lesson that names none: those with bone.
fn bone_programs() -> Vec<String> {
    [Program::Craniotomy, Program::Integrated].map(|program| program.name().into()).into()
}

/// Lessons of the programs.
const OWN: [&str; 9] = [
    include_str!("../lessons/1-first-operation.json"),
    include_str!("../lessons/2-straight-through.json"),
    include_str!("../lessons/3-flap.json"),
    include_str!("../lessons/4-press.json"),
    include_str!("../lessons/5-retract.json"),
    include_str!("../lessons/6-resect.json"),
    include_str!("../lessons/7-bleeding.json"),
    include_str!("../lessons/8-dura.json"),
    include_str!("../lessons/9-arm.json"),
];

impl Lesson {
    /// Folder of the user's own lessons: `lessons` in `TREPAN_CONFIG`, else in the configuration
    /// folder.
    pub fn folder() -> Option<PathBuf> {
        let named = std::env::var_os("TREPAN_CONFIG").filter(|folder| !folder.is_empty()).map(PathBuf::from);
        let of_user = || Some(choose_base_strategy().ok()?.config_dir().join("trepan"));
        named.or_else(of_user).map(|folder| folder.join("lessons"))
    }

    /// Lists the lessons of the program and those in a folder; files that are none are logged.
    pub fn all(folder: Option<&Path>) -> Vec<Self> {
        let own = OWN.iter().filter_map(|text| serde_json::from_str(text).ok());
        let mut files: Vec<_> = folder
            .and_then(|folder| fs::read_dir(folder).ok())
            .into_iter()
            .flatten()
            .flatten()
            .map(|e| e.path())
            .collect();
        files.sort();
        let read = |file: &PathBuf| {
            let read = fs::read(file).map_err(|fault| fault.to_string());
            let lesson = read.and_then(|json| serde_json::from_slice(&json).map_err(|fault| fault.to_string()));
            lesson.inspect_err(|fault| tracing::warn!("lesson {}: {fault}", file.display())).ok()
        };
        own.chain(files.iter().filter_map(read)).collect()
    }
}

impl Lesson {
    /// Lists the lessons of a program: own ones and those in a folder.
    pub fn of(program: Program, folder: Option<&Path>) -> Vec<Self> {
        let mut all = Self::all(folder);
        all.retain(|lesson| lesson.programs.iter().any(|name| name == program.name()));
        all
    }
}

impl Step {
    /// Whether a running session has reached the target.
    fn is_reached(&self, view: &View, [taken_ml, ml_per_min, incised_mm]: [f64; 3]) -> bool {
        let value = match self.until {
            Measure::BoneDepthMm => view.depth_mm[0].into(),
            Measure::TissueDepthMm => view.depth_mm[1].into(),
            Measure::BrainMm => view.brain_distance_mm.into(),
            Measure::RemovedMm3 => view.removed_mm3,
            Measure::Flap => f64::from(view.flap as u8),
            Measure::HoldS => view.hold_s,
            Measure::ForceN => view.force.length().into(),
            Measure::TakenMl => taken_ml,
            Measure::BleedsMlPerMin => ml_per_min,
            Measure::IncisedMm => incised_mm,
            Measure::Slot => view.sample.slot as f64,
            Measure::Never => return false,
        };
        within(value, self.least, self.most)
    }
}

impl Mark {
    /// The value in a summary; `None` where it has none.
    pub fn value(&self, summary: &Value) -> Option<f64> {
        self.path.split('.').fold(summary, |value, key| &value[key]).as_f64()
    }

    /// Whether a value passes; a missing one does not.
    pub fn passes(&self, value: Option<f64>) -> bool {
        value.is_some_and(|value| within(value, self.least, self.most))
    }

    /// The limit in words: "at most 1 mm".
    pub fn limit(&self) -> String {
        let bound =
            |word: &str, value: Option<f64>| value.map(|value| format!("{word} {value} {}", self.unit).trim().into());
        let bounds: Vec<String> =
            [bound("at least", self.least), bound("at most", self.most)].into_iter().flatten().collect();
        bounds.join(", ")
    }
}

fn within(value: f64, least: Option<f64>, most: Option<f64>) -> bool {
    least.is_none_or(|least| value >= least) && most.is_none_or(|most| value <= most)
}

/// A lesson while its session runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Guide {
    lesson: Lesson,
    at: usize,
}

impl Guide {
    /// Begins with the first step.
    pub fn new(lesson: Lesson) -> Self {
        Self { lesson, at: 0 }
    }

    /// Goes on to the next step once the present one is reached; returns the text of the present
    /// one. `wound`: tissue taken by the aspirator, ml, blood that comes, ml/min, and how long the
    /// dura is incised, mm.
    pub fn follow(&mut self, view: &View, wound: [f64; 3]) -> String {
        let count = self.lesson.steps.len();
        if self.lesson.steps.get(self.at).is_some_and(|step| step.is_reached(view, wound)) && self.at + 1 < count {
            self.at += 1;
        }
        let text = self.lesson.steps.get(self.at).map_or("", |step| &step.text);
        format!("Step {} of {count}: {text}", self.at + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Pose, ToolState};
    use trepan_stages::flap::FlapPlace;
    use trepan_stages::haptic_tick::ToolSample;

    #[test]
    fn every_lesson_of_the_program_can_be_read_and_ends() {
        let lessons = Lesson::all(None);
        assert_eq!(lessons.len(), OWN.len());
        for lesson in &lessons {
            assert_eq!(lesson.steps.last().map(|step| step.until), Some(Measure::Never), "{}", lesson.name);
            assert!(
                lesson.slot < 4 && !lesson.marks.is_empty() && lesson.marks.iter().all(|mark| !mark.limit().is_empty())
            );
        }
    }

    #[test]
    fn a_program_has_its_own_lessons_only() {
        let names = |program| Lesson::of(program, None).into_iter().map(|lesson| lesson.name).collect::<Vec<_>>();
        assert_eq!(names(Program::Brain), ["press", "retract", "resect", "bleeding", "arm"]);
        assert_eq!(names(Program::Craniotomy), ["first-operation", "through", "flap"]);
        assert_eq!(names(Program::Integrated), [names(Program::Craniotomy), vec!["dura".into()]].concat());
        for lesson in Lesson::all(None) {
            let programs = [Program::Craniotomy, Program::Brain, Program::Integrated];
            let of = programs.into_iter().filter(|program| lesson.programs.iter().any(|name| name == program.name()));
            assert!(of.clone().count() == lesson.programs.len() && of.clone().count() > 0, "{}", lesson.name);
            assert!(of.into_iter().all(|program| lesson.slot < program.tray().len()), "{}", lesson.name);
        }
    }

    #[test]
    fn the_flap_is_lifted_once_it_is_free() {
        let state = ToolState::at(Pose::IDENTITY);
        let tool = Program::Craniotomy.tray()[3];
        let sample = ToolSample { tick: 0, state, tool, slot: 3, drilling: false, second: None, idle: false };
        let mut guide = Guide::new(Lesson::all(None).remove(2));
        let mut view = View { removed_mm3: 5000.0, ..View::at(sample, 1.0) };
        let mut text = |view: &View| (0..9).map(|_| guide.follow(view, [0.0; 3])).last().unwrap_or_default();
        assert!(text(&view).starts_with("Step 3"), "half a lap is no flap");
        view.flap = FlapPlace::Free;
        assert!(text(&view).contains("Lift the flap"));
        view.flap = FlapPlace::Away;
        assert!(text(&view).starts_with("Step 5"));
    }

    #[test]
    fn steps_go_on_when_their_target_is_reached() {
        let state = ToolState::at(Pose::IDENTITY);
        let sample = ToolSample {
            tick: 0,
            state,
            tool: Program::Integrated.tray()[0],
            slot: 0,
            drilling: false,
            second: None,
            idle: false,
        };
        let mut view = View::at(sample, 1.0);
        let mut guide = Guide::new(Lesson::all(None).remove(0));
        assert!(guide.follow(&view, [0.0, 0.0, 0.0]).starts_with("Step 1 of 6"));
        view.depth_mm[0] = 0.1;
        assert!(guide.follow(&view, [0.0, 0.0, 0.0]).starts_with("Step 2"));
        assert!(guide.follow(&view, [0.0, 0.0, 0.0]).starts_with("Step 2"), "nothing is removed yet");
        view.removed_mm3 = 50.0;
        assert!(guide.follow(&view, [0.0, 0.0, 0.0]).starts_with("Step 3"));
    }

    #[test]
    fn the_lesson_of_the_dura_goes_on_with_its_incision() {
        let lesson = Lesson::all(None).into_iter().find(|lesson| lesson.name == "dura").unwrap();
        let scalpel = lesson.steps.iter().position(|step| step.until == Measure::IncisedMm).unwrap();
        let (state, tool) = (ToolState::at(Pose::IDENTITY), Program::Integrated.tray()[8]);
        let sample = ToolSample { tick: 0, state, tool, slot: 8, drilling: false, second: None, idle: false };
        let mut guide = Guide { lesson, at: scalpel };
        let view = View::at(sample, 1.0);
        assert!(guide.follow(&view, [0.0, 0.0, 11.9]).contains("draw a line across"));
        assert!(guide.follow(&view, [0.0, 0.0, 12.0]).contains("Take the probe"));
    }

    #[test]
    fn a_resection_goes_on_with_what_was_taken() {
        let state = ToolState::at(Pose::IDENTITY);
        let sample = ToolSample {
            tick: 0,
            state,
            tool: Program::Brain.tray()[2],
            slot: 2,
            drilling: false,
            second: None,
            idle: false,
        };
        let (view, lesson) = (View::at(sample, 1.0), Lesson::all(None).remove(5));
        assert_eq!(lesson.tumour_mm, Some(7.5));
        let mut guide = Guide::new(lesson);
        assert!(guide.follow(&view, [0.0, 0.0, 0.0]).starts_with("Step 1 of 5"));
        assert!(guide.follow(&view, [0.1, 0.0, 0.0]).starts_with("Step 2"));
        assert!(guide.follow(&view, [0.1, 0.0, 0.0]).starts_with("Step 2"));
        assert!(guide.follow(&view, [0.9, 0.0, 0.0]).starts_with("Step 3"));
    }

    #[test]
    fn a_mark_is_read_by_its_path_and_a_missing_value_does_not_pass() {
        let mark =
            Mark { text: "t".into(), path: "plan.dice".into(), unit: "mm".into(), least: Some(0.5), most: Some(2.0) };
        let value = mark.value(&serde_json::json!({ "plan": { "dice": 0.7 } }));
        assert!(mark.passes(value) && !mark.passes(Some(3.0)) && !mark.passes(mark.value(&Value::Null)));
        assert_eq!(mark.limit(), "at least 0.5 mm, at most 2 mm");
    }
}
