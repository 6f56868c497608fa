//! Texts of the window's panel, live and in a replay: phase, tool, forces, warnings.

use trepan_geometry::{Buttons, Tool, ToolKind};
use trepan_report::printable::capital;
use trepan_report::uncertainty::Band;
use trepan_runtime::View;
use trepan_stages::notice::{Notice, Warning};
use trepan_stages::program::{Phase, Program, called};
use trepan_stages::second_hand::{SecondHand, SecondView};
use trepan_window::{Choice, Panel, Sound};

/// Time for which a notice is shown, ms.
pub(super) const NEWS_MS: f64 = 4000.0;

/// Warnings of harm to the patient, which sound the alarm, the most urgent first.
const DANGERS: [Warning; 6] = [
    Warning::BrainTouched,
    Warning::BrainPressed,
    Warning::BreakThrough,
    Warning::BreachSoon,
    Warning::BrainNear,
    Warning::ForbiddenNear,
];

/// Warnings of the operation without harm, after those.
const CARE: [Warning; 4] = [Warning::BoneThin, Warning::DrillStalled, Warning::CutterJams, Warning::RestsOnBone];

/// What the force on an arm's tool is called.
pub(crate) const IN_ARM: &str = "tool in the arm";

/// Returns the panel's contents that are common to all sessions.
pub(crate) fn panel(case: &str, program: Program, view: &View) -> Panel {
    let value = |name: &str, value: String| (name.to_string(), value);
    let sample = &view.sample;
    let [_, late, held] = view.counts;
    let on_tissue = Some(sample.tool.kind).filter(|kind| {
        matches!(kind, ToolKind::Aspirator | ToolKind::Bipolar | ToolKind::Scalpel | ToolKind::Scissors)
    });
    let brain_mm = match view.brain_distance_mm {
        mm if mm.is_finite() => format!("{mm:.1} mm"),
        _ => "no brain here".into(),
    };
    let removed = program.has_bone().then(|| value("bone removed", format!("{:.0} mm³", view.removed_mm3)));
    let task = [value("tool to brain", brain_mm)].into_iter().chain(removed).collect();
    let values = [
        value("force at the hand", format!("{:.2} N", view.force.length())),
        value("scale", view.force_scale.text()),
        value("depth in bone", format!("{:.2} mm", view.depth_mm[0])),
        value("depth in tissue", format!("{:.2} mm", view.depth_mm[1])),
        value("late / held ticks", format!("{late} / {held} ticks")),
        value("time", format!("{:.1} s", view.time_ms * 1e-3)),
    ];
    let band = (sample.phase() == Phase::Brain && view.depth_mm[1] > 0.0).then(|| {
        let [way_mm, depth_mm] = [-view.brain_distance_mm, view.depth_mm[1]];
        let Band { low, high, .. } = Band::of_tissue_force(view.force.length(), way_mm, depth_mm);
        value("force by the spread of stiffness", format!("{low:.2} to {high:.2} N"))
    });
    // Only the force of bone is scaled.
    let bone_scale = if sample.phase() == Phase::Brain { 1.0 } else { view.force_scale.0 };
    let of = |second: &SecondView| if second.tool == SecondHand::tool() { "second hand" } else { IN_ARM };
    let second = view.second.filter(|second| second.force.is_finite());
    let second = second.map(|second| value(of(&second), format!("{:.2} N", second.force.length())));
    Panel {
        case: case.into(),
        phase: ["Craniotomy", "Brain"][sample.phase() as usize].into(),
        tool: called(&sample.tool),
        drilling: sample.drilling || on_tissue.is_some() && sample.state.buttons.has(Buttons::PEDAL),
        on_tissue,
        sound: Sound {
            spindle: view.spindle,
            load: view.force.length() / view.force_limit_n.max(1e-3),
            alarm: active(view.warnings).any(|warning| DANGERS.contains(&warning)),
        },
        force_n: view.task_n,
        force_limit_n: view.force_limit_n / bone_scale,
        choices: vec![tray(program, view)],
        values: values.into_iter().chain(band).chain(second).collect(),
        task,
        no_bone: !program.has_bone(),
        no_drill: (!sample.tool.kind.cuts() && on_tissue.is_none())
            .then(|| format!("the {} does not drill: take a tool for bone with its number key", called(&sample.tool))),
        warnings: urgent(view.warnings).map(|warning| warning.text().into()).collect(),
        technical: technical(view.warnings).map(|warning| warning.text().into()).collect(),
        news: news(view),
        ..Panel::default()
    }
}

/// Returns a notice of the pause, and the newest notice while it is recent.
fn news(view: &View) -> Vec<String> {
    let pause =
        view.sample.state.buttons.has(Buttons::PAUSE).then(|| "PAUSED by the teacher: no force, no drill".into());
    let lately = view.news.filter(|notice| view.time_ms - notice.time_ms < NEWS_MS).map(in_words);
    pause.into_iter().chain(lately).collect()
}

/// Returns the choice of tools, with the present one selected.
fn tray(program: Program, view: &View) -> Choice {
    let closed =
        |tool: &Tool| Phase::of(tool) == Phase::Brain && view.sample.phase() != Phase::Brain && !view.bone_open;
    let held = |tool: &Tool| view.second.is_some_and(|second| second.tool == *tool && *tool != SecondHand::tool());
    let in_arm = |tool: &Tool| held(tool).then(|| Notice::IN_ARM.to_string());
    let why_not = |tool: &Tool| closed(tool).then(|| Notice::NOT_OPEN.into()).or_else(|| in_arm(tool));
    let options = program.tray().iter().map(|tool| (called(tool), why_not(tool))).collect();
    Choice { name: "Tool".into(), options, chosen: view.sample.slot, tools: program.tray().to_vec() }
}

/// Returns the active warnings.
fn active(bits: u32) -> impl Iterator<Item = Warning> {
    Warning::ALL.into_iter().filter(move |warning| bits & (1 << *warning as u32) != 0)
}

/// Returns the active warnings of the operation, the most urgent first.
fn urgent(bits: u32) -> impl Iterator<Item = Warning> {
    DANGERS.into_iter().chain(CARE).filter(move |warning| active(bits).any(|other| other == *warning))
}

/// Returns the active warnings of device and machine.
fn technical(bits: u32) -> impl Iterator<Item = Warning> {
    active(bits).filter(|warning| !DANGERS.contains(warning) && !CARE.contains(warning))
}

fn in_words(notice: Notice) -> String {
    capital(notice.words().1)
}

/// Returns a hint on what to do next.
pub(crate) fn hint(tool: &Tool, by_hand: bool) -> &'static str {
    match (Phase::of(tool), by_hand) {
        (_, false) => "the operation runs by itself",
        (Phase::Craniotomy, true) => {
            "point at the skull, hold the left button to drill there; let go to draw back; U undoes the last stroke"
        }
        (Phase::Brain, true) if tool.kind == ToolKind::Aspirator => {
            "point at the brain and hold the left button to take tissue away there; it does not come back"
        }
        (Phase::Brain, true) if tool.kind == ToolKind::Bipolar => {
            "point at tissue that bleeds and hold the left button to coagulate it; let go to draw back"
        }
        (Phase::Brain, true) if tool.kind == ToolKind::Scalpel => {
            "hold the left button and draw the scalpel over the dura; another tool holds the leaves back"
        }
        (Phase::Brain, true) if tool.kind == ToolKind::Scissors => {
            "point at the brain and press the left button: the scissors go in by 2 mm and close; Space closes them too"
        }
        (Phase::Brain, true) => "point at the brain and hold the left button to press it; let go to draw back",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Pose, ToolState, Vec3};
    use trepan_stages::force_scale::ForceScale;
    use trepan_stages::haptic_tick::ToolSample;
    use trepan_stages::notice::What;

    fn view(warnings: u32) -> View {
        let tool = Program::Integrated.tray()[1];
        let sample = ToolSample {
            tick: 1,
            state: ToolState::at(Pose::IDENTITY),
            tool,
            slot: 1,
            drilling: true,
            second: None,
            idle: false,
        };
        View { warnings, time_ms: 5000.0, spindle: 0.5, force: Vec3::X, ..View::at(sample, 2.0) }
    }

    #[test]
    fn only_warnings_of_harm_sound_the_alarm() {
        let bit = |warning| 1 << Warning::ALL.iter().position(|w| *w == warning).unwrap();
        let panel = |bits| panel("composite", Program::Integrated, &view(bits));
        assert!(panel(bit(Warning::BrainTouched)).sound.alarm);
        let late = panel(bit(Warning::TissueLate));
        assert!(!late.sound.alarm && late.warnings.is_empty() && late.technical == [Warning::TissueLate.text()]);
        let many = panel(bit(Warning::BoneThin) | bit(Warning::BrainTouched) | bit(Warning::BreachSoon));
        let order = [Warning::BrainTouched, Warning::BreachSoon, Warning::BoneThin].map(Warning::text);
        assert!(many.warnings == order && many.technical.is_empty(), "the most urgent first");
        assert_eq!((late.sound.spindle, late.sound.load), (0.5, 0.5));
        assert_eq!((late.choices[0].chosen, late.choices[0].options[1].0.as_str()), (1, "burr 4 mm"));
    }

    #[test]
    fn the_force_is_that_of_the_task_and_so_is_its_limit() {
        let mut view = View { task_n: 5.0, force_scale: ForceScale(0.2), ..view(0) };
        let shown = |view: &View| {
            let panel = panel("c", Program::Integrated, view);
            let hand = panel.values.iter().any(|(name, text)| name == "force at the hand" && text == "1.00 N");
            (panel.force_n, panel.force_limit_n, hand)
        };
        assert_eq!(shown(&view), (5.0, 10.0, true));
        view.sample.tool = Program::Brain.tray()[0];
        assert_eq!(shown(&view), (5.0, 2.0, true), "tissue is not scaled");
    }

    #[test]
    fn a_press_shows_the_band_of_its_force() {
        let mut view = View { depth_mm: [0.0, 1.0], brain_distance_mm: -4.0, ..view(0) };
        let shown =
            |view: &View| panel("c", Program::Integrated, view).values.iter().any(|(_, text)| text.contains(" to "));
        assert!(!shown(&view), "a burr");
        view.sample.tool = Program::Brain.tray()[0];
        assert!(shown(&view));
        view.depth_mm[1] = 0.0;
        assert!(!shown(&view));
    }

    #[test]
    fn tools_for_the_brain_wait_until_the_bone_is_open() {
        let closed = |bone_open: bool| {
            let panel = panel("c", Program::Integrated, &View { bone_open, ..view(0) });
            panel.choices[0].options.iter().filter(|(_, why_not)| why_not.is_some()).count()
        };
        assert_eq!((closed(false), closed(true)), (6, 0), "those for the brain and the dura");
    }

    #[test]
    fn notices_expire() {
        let mut view = view(0);
        view.news = Some(Notice { tick: 1, time_ms: 4000.0, what: What::NotOpen });
        assert_eq!(panel("c", Program::Brain, &view).news.len(), 1);
        view.time_ms = 9000.0;
        assert_eq!(panel("c", Program::Brain, &view).news.len(), 0);
        view.sample.state.buttons = Buttons::PAUSE;
        assert!(panel("c", Program::Brain, &view).news[0].contains("PAUSED"), "in a replay too");
    }
}
