//! What a session says to its window: all of it plain data.

use std::sync::Arc;
use trepan_geometry::Vec3;

/// What the window shows beside the picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// The case, by a name that may be read by anybody.
    pub case: String,
    /// The phase of the operation.
    pub phase: String,
    /// What to do next.
    pub hint: String,
    /// The tool in hand.
    pub tool: String,
    /// Whether mouse and keys hold the tool: then there are a pedal, a next tool and an undo.
    pub by_hand: bool,
    /// Whether the drill runs.
    pub drilling: bool,
    /// What the drill and the alarm sound like now.
    pub sound: Sound,
    /// Largest force since the last picture, N.
    pub force_n: f32,
    /// Where the force guard clamps, N; marked in the plot.
    pub force_limit_n: f32,
    /// Haptic ticks a second, Hz; no plot where this is 0.
    pub rate_hz: f32,
    /// What it should be, Hz; marked in the plot.
    pub wanted_rate_hz: f32,
    /// What can be chosen: tools, sizes.
    pub choices: Vec<Choice>,
    /// What else can be asked for.
    pub actions: Vec<Action>,
    /// Named values, in order.
    pub values: Vec<(String, String)>,
    /// What must not be missed; shown in a vermilion banner as long as it is here.
    pub warnings: Vec<String>,
    /// What is to be known, such as a pause; shown in a blue banner.
    pub news: Vec<String>,
    /// Where in time the session is, if it can go back and forth.
    pub timeline: Option<Timeline>,
    /// What keeps the hand near the tool; `None` lets it go anywhere.
    pub leash: Option<Leash>,
    /// Whether the window shall close.
    pub finished: bool,
}

/// One of several that is chosen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// What is chosen: `Tool`, `Burr`.
    pub name: String,
    /// The options, and whether each can be had now.
    pub options: Vec<(String, bool)>,
    /// Which one it is.
    pub chosen: usize,
}

/// A button of the session's own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Action {
    /// What it does.
    pub name: String,
    /// A letter that does the same; none that the window has taken: see [`crate::window`].
    pub key: Option<char>,
    /// Whether it is on, where it is a switch.
    pub on: bool,
}

/// Where in time a session is that can go back and forth.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeline {
    /// The time shown, s.
    pub at_s: f64,
    /// The whole length, s.
    pub length_s: f64,
    /// How far it can be shown by now, s.
    pub ready_s: f64,
    /// Whether time goes on by itself.
    pub running: bool,
    /// How fast, 1 as it was.
    pub speed: f32,
    /// What happened when, in order.
    pub marks: Arc<[Mark]>,
}

/// Something that happened.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mark {
    /// When, s.
    pub at_s: f64,
    /// What.
    pub text: String,
    /// Whether it was a warning.
    pub warning: bool,
}

/// What the user does to a [`Timeline`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Playback {
    /// Lets time go on, or stand still.
    Run(bool),
    /// Goes at another speed, 1 as it was.
    Speed(f32),
    /// Goes to a time, s.
    Seek(f64),
}

/// What is to be heard.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sound {
    /// Speed of the spindle, 1 at its free speed, 0 at rest.
    pub spindle: f32,
    /// Force on the tool, 1 at the device's limit.
    pub load: f32,
    /// Whether the alarm sounds.
    pub alarm: bool,
}

/// A hand without force feedback would not notice a wall: it is kept this close to where the tool
/// is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leash {
    /// Where contact lets the tool's tip be, world mm.
    pub tip: Vec3,
    /// Longest way from there to the hand, mm.
    pub length_mm: f32,
}
