//! Notices of a running session: changes of phase and tool, warnings raised and cleared.
//!
//! # Practice
//! A notice is plain data, made in a tick without allocation. Its text is made where it is shown.

use crate::program::{Phase, called};
use trepan_bone::{MAX_STROKE_BRICKS, MAX_STROKES};
use trepan_geometry::Tool;

/// A warning, active while its cause is present; the number is that of its bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Warning {
    /// Less than 1 mm of bone is left ahead of the burr.
    BoneThin,
    /// At most 0.3 mm of bone is left ahead of the burr.
    BreakThrough,
    /// The burr is close to the brain.
    BrainNear,
    /// The cutting part is past the brain's rest surface, where the dura lies. A craniotome's foot
    /// does not count.
    BrainTouched,
    /// The desired force is over the device's limit.
    ForceLimit,
    /// The last collision result is stale; its force fades.
    TissueLate,
    /// The device gave no fresh or no finite pose.
    DeviceStale,
    /// The device's motors are warm; the force is less than desired.
    MotorsWarm,
    /// The drill has stalled under its load.
    DrillStalled,
    /// At the present feed rate the burr comes through within 300 ms.
    BreachSoon,
    /// A tool presses hard on the brain.
    BrainPressed,
    /// A tool is close to a structure that must not be touched.
    ForbiddenNear,
    /// The simulated brain is slower than real time, so that it feels softer or stiffer than it is.
    TissueSlow,
    /// A craniotome is led on with more force than its cut gives way to.
    CutterJams,
    /// A tool for the brain presses on bone.
    RestsOnBone,
}

/// Texts of a warning.
struct Texts {
    /// Name for files.
    name: &'static str,
    /// Text shown to the trainee.
    text: &'static str,
    /// Unit of its value.
    unit: &'static str,
}

impl Warning {
    /// All warnings, in the order of their bits.
    pub const ALL: [Self; 15] = [
        Self::BoneThin,
        Self::BreakThrough,
        Self::BrainNear,
        Self::BrainTouched,
        Self::ForceLimit,
        Self::TissueLate,
        Self::DeviceStale,
        Self::MotorsWarm,
        Self::DrillStalled,
        Self::BreachSoon,
        Self::BrainPressed,
        Self::ForbiddenNear,
        Self::TissueSlow,
        Self::CutterJams,
        Self::RestsOnBone,
    ];

    fn texts(self) -> Texts {
        let (name, text, unit) = match self {
            Self::BoneThin => ("bone-thin", "less than a millimetre of bone is left: press lightly", "mm left"),
            Self::BreakThrough => ("break-through", "the bone is about to give way: hold back", "mm left"),
            Self::BrainNear => ("brain-near", "the drill is about to reach the brain: stop pushing", "mm away"),
            Self::BrainTouched => ("brain-touched", "the drill touches the brain: draw it back", "mm deep"),
            Self::ForceLimit => ("force-limit", "the force is at the device's limit", "N wanted"),
            Self::TissueLate => {
                ("tissue-late", "the collision result of the tissue is late, its force fades", "ms old")
            }
            Self::DeviceStale => ("device-stale", "the device gave no fresh position, the last one is used", "ms old"),
            Self::MotorsWarm => {
                ("motors-warm", "the device's motors are warm, its force is reduced: press less", "N wanted")
            }
            Self::DrillStalled => ("drill-stalled", "the drill has stalled: press less", "N wanted"),
            Self::BreachSoon => ("breach-soon", "at this feed the drill is through in a moment: slow down", "ms left"),
            Self::BrainPressed => ("brain-pressed", "the brain is pressed hard: press less", "N"),
            Self::ForbiddenNear => {
                ("forbidden-near", "a structure that must not be touched is close: keep away", "mm away")
            }
            Self::TissueSlow => (
                "tissue-slow",
                "the brain moves more slowly than in real time and feels wrong: close programs, or take a lower quality",
                "of real time",
            ),
            Self::CutterJams => (
                "cutter-jams",
                "the craniotome is caught in its cut: lead it back a little, upright, then on more slowly",
                "N wanted",
            ),
            Self::RestsOnBone => (
                "rests-on-bone",
                "the tool rests on bone, not on the brain: draw it back, and widen the hole if it is too narrow",
                "N",
            ),
        };
        Texts { name, text, unit }
    }

    /// Returns the name for files.
    pub fn name(self) -> &'static str {
        self.texts().name
    }

    /// Returns the text shown to the trainee.
    pub fn text(self) -> &'static str {
        self.texts().text
    }
}

/// Kind of a notice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum What {
    /// A phase began.
    Phase(Phase),
    /// A warning was raised (`true`) or cleared, with its distance, force, time or age (mm, N, ms).
    Warning(Warning, bool, f32),
    /// The burr came through the bone.
    Through,
    /// The last stroke of the burr was undone; the volume of restored bone, mm³.
    Undone(f32),
    /// Undoing a stroke was requested and refused.
    NotUndone(Hindrance),
    /// The stroke undone last was redone; the volume of bone removed again, mm³.
    Redone(f32),
    /// Redoing a stroke was requested and refused.
    NotRedone(Hindrance),
    /// A tool was requested while the present one touches something.
    NotChanged,
    /// A tool was requested that an arm holds.
    HeldByArm,
    /// An arm holds a tool from now on.
    ArmHolds(Tool),
    /// The arm was taken away, and its tool with it.
    ArmGone,
    /// An arm was requested and has nothing to hold.
    NoArm(NoArm),
    /// Moving the flap was requested and is not possible now.
    FlapWaits(Hindrance),
    /// Moving a flap was requested where there is no bone.
    NoFlap,
    /// A tool was taken.
    Taken(Tool),
    /// A tool for the brain was requested before the bone was open.
    NotOpen,
    /// The planned flap is cut free; its volume, mm³.
    FlapFree(f32),
    /// Lifting the flap was requested while it is still attached to the skull.
    FlapHangs,
    /// Lifting was requested where no flap is planned, and the bone below the tool is not free.
    PieceHangs,
    /// The flap was lifted; its volume, mm³.
    FlapLifted(f32),
    /// The flap was put back.
    FlapReturned,
    /// The force was switched off after a fault of the device, or is back.
    Force {
        /// Whether the force is off and waits for an action of the user.
        waits: bool,
        /// Whether it is the second hand's force.
        second: bool,
    },
}

/// Reason why an arm does not hold the tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoArm {
    /// It holds blunt tools only.
    Tool,
    /// The second hand has a device, and so a tool.
    SecondHand,
}

impl NoArm {
    /// All reasons.
    pub const ALL: [Self; 2] = [Self::Tool, Self::SecondHand];

    fn text(self) -> &'static str {
        match self {
            Self::Tool => "an arm holds a spatula or a probe: take one of these first",
            Self::SecondHand => "no arm holds the tool: the second hand has a tool already",
        }
    }
}

/// Reason why a stroke is not undone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hindrance {
    /// The tool lies in bone that would be restored.
    Tool,
    /// The second hand's tool, or an arm's, lies where bone would be restored.
    SecondTool,
    /// The pedal is down.
    Pedal,
    /// The present tool is a tool for the brain.
    BrainTool,
    /// The flap is being lifted or put back.
    FlapMoves,
    /// The flap is lifted and was in its place during the stroke.
    FlapAway,
    /// The flap is in its place and was lifted during the stroke.
    FlapThere,
    /// No stroke is left to undo.
    NoStroke,
    /// No stroke was undone since the last one.
    NothingUndone,
    /// The tool touches something.
    Touches,
    /// A stroke is being undone or redone.
    UndoRuns,
    /// Earlier strokes are no longer stored.
    Forgotten,
}

impl Hindrance {
    /// All reasons.
    pub const ALL: [Self; 12] = [
        Self::Tool,
        Self::SecondTool,
        Self::Pedal,
        Self::BrainTool,
        Self::FlapMoves,
        Self::FlapAway,
        Self::FlapThere,
        Self::NoStroke,
        Self::NothingUndone,
        Self::Touches,
        Self::UndoRuns,
        Self::Forgotten,
    ];

    /// Returns the text shown to the trainee.
    fn text(self) -> String {
        let text = match self {
            Self::Tool => "the tool lies in the bone that would be restored: it is undone once the tool is out",
            Self::SecondTool => "the other tool is in the way: draw it out first, or take the arm away",
            Self::Pedal => "the pedal is down: let it go first",
            Self::BrainTool => "a tool for the brain is in the hand: take one for bone first",
            Self::FlapMoves => "the flap is moving: wait until it rests",
            Self::FlapAway => "the flap was in its place at that stroke: put it back first",
            Self::FlapThere => "the flap was away at that stroke: lift it first",
            Self::NoStroke => "there is no stroke left",
            Self::UndoRuns => "a stroke is being undone: wait a moment",
            Self::NothingUndone => "no stroke was undone since the last one",
            Self::Touches => "the tool touches something: draw it back first",
            Self::Forgotten => {
                let room = format!("{MAX_STROKES} strokes, or {MAX_STROKE_BRICKS} blocks of bone that they changed");
                return format!("earlier strokes are no longer stored: there is room for {room}");
            }
        };
        text.into()
    }
}

/// An event of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Notice {
    /// Tick number.
    pub tick: u64,
    /// Session time, ms.
    pub time_ms: f64,
    /// Kind of the notice.
    pub what: What,
}

impl Notice {
    /// Why no flap moves.
    pub const NO_FLAP: &'static str = "no bone is drilled here, so none can be lifted";
    /// Why a tool that an arm holds is not taken.
    pub const IN_ARM: &'static str = "the arm holds that tool: take the arm away first";
    /// Why no tool for the brain is taken.
    pub const NOT_OPEN: &'static str = "the bone is not open: drill through it or lift the flap first";

    /// Returns kind and text, as recorded.
    pub fn words(&self) -> (&'static str, String) {
        match self.what {
            What::Phase(phase) => ("phase", format!("{} begins", phase.name())),
            What::Taken(tool) => ("tool", format!("in the hand: {}", called(&tool))),
            What::Warning(warning, true, value) => {
                let Texts { name, text, unit } = warning.texts();
                // Avoids -0.00.
                let value = (100.0 * value).round() / 100.0 + 0.0;
                let value = match warning {
                    Warning::BreachSoon => format!(" (through in {:.1} s)", 1e-3 * value),
                    // A touch has no depth yet.
                    Warning::BrainTouched if value < 0.05 => String::new(),
                    Warning::BrainTouched => format!(" ({value:.1} {unit})"),
                    _ => format!(" ({value:.2} {unit})"),
                };
                ("warning", format!("{name}: {text}{value}"))
            }
            What::Warning(warning, false, _) => ("cleared", warning.name().to_string()),
            What::Through => ("through", "the burr came through the bone".into()),
            What::Undone(mm3) => ("undo", format!("the last stroke is undone: {mm3:.1} mm3 of bone are back")),
            What::NotUndone(why) => ("refused", format!("no stroke is undone: {}", why.text())),
            What::Redone(mm3) => ("redo", format!("the stroke is redone: {mm3:.1} mm3 of bone are gone again")),
            What::NotRedone(why) => ("refused", format!("no stroke is redone: {}", why.text())),
            What::NotChanged => ("refused", format!("the tool stays in the hand: {}", Hindrance::Touches.text())),
            What::HeldByArm => ("refused", Self::IN_ARM.into()),
            What::ArmHolds(tool) => ("arm", format!("an arm holds the {}: draw the hand back", called(&tool))),
            What::ArmGone => ("arm", "the arm is taken away".into()),
            What::NoArm(why) => ("refused", why.text().into()),
            What::FlapWaits(why) => ("refused", format!("the flap stays: {}", why.text())),
            What::NoFlap => ("refused", Self::NO_FLAP.into()),
            What::NotOpen => ("refused", Self::NOT_OPEN.into()),
            What::FlapFree(mm3) => ("flap", format!("the flap is free: {mm3:.0} mm3 of bone")),
            What::FlapHangs => ("refused", "the flap is still attached to the skull: cut it free first".into()),
            What::PieceHangs => {
                ("refused", "no free piece of bone below the tool: cut one free, and point at it".into())
            }
            What::FlapLifted(mm3) => ("flap", format!("the flap is lifted: {mm3:.0} mm3 of bone")),
            What::FlapReturned => ("flap", "the flap is back in its place".into()),
            What::Force { waits, second } => {
                let hand = if second { "the second hand's device" } else { "the device" };
                let act = "until a button is pressed anew, or the tool touches nothing for a moment";
                let text =
                    if waits { format!("was gone: no force and no drill {act}") } else { "has its force again".into() };
                ("device", format!("{hand} {text}"))
            }
        }
    }
}

/// The active warnings, with hysteresis, so that noise at a threshold does not repeat them.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    standing: u32,
    quiet_since_ms: [f64; Warning::ALL.len()],
}

/// Time that a cause must be absent before its warning is cleared, ms. A hand that hovers at a
/// threshold crosses it again sooner. A numerical parameter.
const CLEAR_MS: f64 = 500.0;

impl Watch {
    /// Updates a warning with the presence of its cause at `time_ms`; returns a change.
    pub fn update(&mut self, warning: Warning, present: bool, value: f32, time_ms: f64) -> Option<What> {
        let at = warning as usize;
        let bit = 1 << at;
        let stands = self.standing & bit != 0;
        if present {
            self.quiet_since_ms[at] = time_ms;
            self.standing |= bit;
            (!stands).then_some(What::Warning(warning, true, value))
        } else if stands && time_ms - self.quiet_since_ms[at] >= CLEAR_MS {
            self.standing &= !bit;
            Some(What::Warning(warning, false, value))
        } else {
            None
        }
    }

    /// Returns the bits of the active warnings, as in [`Warning::ALL`].
    pub fn standing(&self) -> u32 {
        self.standing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_is_raised_once_and_cleared_after_quiet() {
        let mut watch = Watch::default();
        let mut changes = Vec::new();
        for ms in 0..1200 {
            let present = ms < 50 || (ms < 550 && ms % 100 == 0);
            changes.extend(watch.update(Warning::BrainNear, present, 1.5, f64::from(ms)).map(|what| (ms, what)));
        }
        assert_eq!(changes.len(), 2);
        assert_eq!(changes[0], (0, What::Warning(Warning::BrainNear, true, 1.5)));
        assert!(matches!(changes[1], (1000, What::Warning(Warning::BrainNear, false, _))), "{changes:?}");
        assert_eq!(watch.standing(), 0);
    }

    #[test]
    fn a_warning_gives_its_value_as_one_would_say_it() {
        let words =
            |value| Notice { tick: 0, time_ms: 0.0, what: What::Warning(Warning::BrainTouched, true, value) }.words().1;
        assert!(words(-0.001).ends_with("draw it back"), "a touch without a depth: {}", words(-0.001));
        assert!(words(0.16).ends_with("(0.2 mm deep)"), "{}", words(0.16));
        let what = What::Warning(Warning::BreachSoon, true, 209.27);
        let soon = Notice { tick: 0, time_ms: 0.0, what }.words().1;
        assert!(soon.ends_with("slow down (through in 0.2 s)"), "{soon}");
    }
}
