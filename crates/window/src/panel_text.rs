//! The data that a session sends to its window.

use std::sync::Arc;
use trepan_geometry::{Tool, ToolKind, Twist, Vec3};

/// Contents of the panel beside the picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// The case, by a name that is safe to show.
    pub case: String,
    /// The phase of the operation.
    pub phase: String,
    /// The next step.
    pub hint: String,
    /// The current tool.
    pub tool: String,
    /// Whether mouse and keys move the tool; then pedal, next tool and undo are shown.
    pub by_hand: bool,
    /// Whether the tool that the pedal runs is running.
    pub drilling: bool,
    /// Kind of the tool for tissue that the pedal runs; `None` for a drill.
    pub on_tissue: Option<ToolKind>,
    /// The current sounds of drill and alarm.
    pub sound: Sound,
    /// Largest force since the last picture, N.
    pub force_n: f32,
    /// Where the force guard clamps, N; marked in the plot.
    pub force_limit_n: f32,
    /// Haptic rate, Hz; no plot where this is 0.
    pub rate_hz: f32,
    /// Target rate, Hz; marked in the plot.
    pub wanted_rate_hz: f32,
    /// Available choices: tools, sizes.
    pub choices: Vec<Choice>,
    /// Further actions.
    pub actions: Vec<Action>,
    /// Values of the task, with units: bone left, distance to the brain.
    pub task: Vec<(String, String)>,
    /// Why nothing can be undone now; `None` where it can.
    pub no_undo: Option<String>,
    /// Why nothing can be redone now; `None` where it can.
    pub no_redo: Option<String>,
    /// Whether there is no bone: nothing of drilling is shown.
    pub no_bone: bool,
    /// Why the present tool does not drill; `None` where it does.
    pub no_drill: Option<String>,
    /// Further values, in order, with units.
    pub values: Vec<(String, String)>,
    /// Active warnings, the most urgent first; it is shown in a vermilion banner.
    pub warnings: Vec<String>,
    /// Notices on device and machine, shown small.
    pub technical: Vec<String>,
    /// Information such as a pause, shown in a blue banner.
    pub news: Vec<String>,
    /// Position in time, for a session that can be replayed.
    pub timeline: Option<Timeline>,
    /// Limit of the distance from hand to tool; `None` for no limit.
    pub leash: Option<Leash>,
    /// Velocity of a 3-D mouse in the other hand, mm/ms and rad/ms: right, up, to the user.
    pub knob: Twist,
    /// Whether the window should close.
    pub finished: bool,
}

/// A choice between options.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// Name of the choice: `Tool`, `Burr`.
    pub name: String,
    /// The options, and why each cannot be chosen now; `None` where it can.
    pub options: Vec<(String, Option<String>)>,
    /// Index of the selected option.
    pub chosen: usize,
    /// The tools that the options stand for, shown with icons and number keys; else empty.
    pub tools: Vec<Tool>,
}

/// A session-specific button.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Action {
    /// Its label.
    pub name: String,
    /// A letter key for it that the window does not use: see [`crate`].
    pub key: Option<char>,
    /// Whether it is on, for a switch.
    pub on: bool,
    /// Why it does nothing now; `None` where it works.
    pub why_not: Option<String>,
}

/// The position in time of a replayable session.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeline {
    /// The time shown, s.
    pub at_s: f64,
    /// The whole length, s.
    pub length_s: f64,
    /// Time up to which it can be shown, s.
    pub ready_s: f64,
    /// Whether time advances.
    pub running: bool,
    /// Speed; 1 is real time.
    pub speed: f32,
    /// Events in chronological order.
    pub marks: Arc<[Mark]>,
}

/// An event.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mark {
    /// Time of the event, s.
    pub at_s: f64,
    /// Description.
    pub text: String,
    /// Whether it was a warning.
    pub warning: bool,
}

/// A command to a [`Timeline`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Playback {
    /// Runs or pauses.
    Run(bool),
    /// Sets the speed; 1 is real time.
    Speed(f32),
    /// Jumps to a time, s.
    Seek(f64),
}

/// The current sounds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sound {
    /// Spindle speed, 1 at its free speed, 0 at rest.
    pub spindle: f32,
    /// Force on the tool, 1 at the device's limit.
    pub load: f32,
    /// Whether the alarm is on.
    pub alarm: bool,
}

/// Limits the distance from the hand to the tool, since a hand without force feedback does not feel
/// walls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leash {
    /// Tip position that contact allows, world mm.
    pub tip: Vec3,
    /// Largest distance from there to the hand, mm.
    pub length_mm: f32,
}
