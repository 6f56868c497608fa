//! Answers on screen to every key and command: what it did, or why it does nothing here.

use crate::keys::{Command, KEYS, of_action};
use crate::look::Look;
use crate::{Panel, Playback};
use eframe::egui::{self, Key};

/// Time for which an answer stands, s.
const STANDS_S: f64 = 4.0;
/// Keys that move tool or view by themselves, belong to the focused widget, or only modify others.
const QUIET: [Key; 22] = [
    Key::ArrowUp,
    Key::ArrowDown,
    Key::ArrowLeft,
    Key::ArrowRight,
    Key::PageUp,
    Key::PageDown,
    Key::Plus,
    Key::Minus,
    Key::Equals,
    Key::Tab,
    Key::Enter,
    Key::Home,
    Key::End,
    Key::ShiftLeft,
    Key::ShiftRight,
    Key::ControlLeft,
    Key::ControlRight,
    Key::AltLeft,
    Key::AltRight,
    Key::SuperLeft,
    Key::SuperRight,
    Key::CapsLock,
];

/// Slots of a choice that have number keys, in their order.
pub(crate) const NUMBERS: [Key; 10] =
    [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9, Key::Num0];

/// The newest answer and the time until which it stands, s.
#[derive(Clone, Debug, Default)]
pub(crate) struct Answers {
    text: String,
    until_s: f64,
}

impl Answers {
    /// Gives an answer at a time, s.
    pub fn give(&mut self, text: String, now_s: f64) {
        (self.text, self.until_s) = (text, now_s + STANDS_S);
    }

    /// The answer that stands at a time, s.
    pub fn standing(&self, now_s: f64) -> Option<&str> {
        (now_s < self.until_s && !self.text.is_empty()).then_some(&*self.text)
    }
}

/// Why a command does nothing in the present state; `None` where it works.
pub(crate) fn refusal(command: Command, panel: &Panel, look: &Look) -> Option<String> {
    let led = || (!panel.by_hand).then(|| NOBODY.to_string());
    match command {
        Command::NextTool | Command::Withdraw => led(),
        Command::Undo => led().or_else(|| panel.no_undo.clone()),
        Command::Redo => led().or_else(|| panel.no_redo.clone()),
        Command::Apart if !look.slices.shown => Some("the slices are switched off".into()),
        Command::Bone if panel.no_bone => Some("there is no bone here".into()),
        Command::Microscope if !look.has_microscope() => Some("this view has no microscope".into()),
        _ => None,
    }
}

const NOBODY: &str = "the tool is not in this window's hand: another device, a script or a recording moves it";

/// What a command did, once it is applied.
pub(crate) fn done(command: Command, name: &str, look: &Look, large: bool) -> String {
    let on = |on| format!("{name}: {}", if on { "on" } else { "off" });
    match command {
        Command::Bone => on(look.bone),
        Command::Brain => on(look.brain),
        Command::Slices => on(look.slices.shown),
        Command::Apart => on(look.apart),
        Command::Hints => on(look.hints),
        Command::Section => on(look.section.is_some()),
        Command::Stereo => on(look.stereo.is_some()),
        Command::LargeType => on(large),
        Command::Quit => "the session goes on until you say so".into(),
        _ => name.to_string(),
    }
}

/// Why the other keys pressed in this picture do nothing.
pub(crate) fn unused_key(input: &egui::InputState, panel: &Panel) -> Option<String> {
    let replays = panel.timeline.is_some();
    let of = |key: Key| {
        let is_known = KEYS.iter().any(|(known, ..)| *known == key) || QUIET.contains(&key);
        let action = panel.actions.iter().find(|action| of_action(action) == Some(key));
        match (key, action) {
            _ if is_known => None,
            (_, Some(action)) => action.why_not.as_ref().map(|why| format!("{}: {why}", action.name)),
            (Key::Space, _) if replays => None,
            (Key::Space, _) if !panel.by_hand => Some(NOBODY.into()),
            (Key::Space, _) => panel.no_drill.clone(),
            (Key::OpenBracket | Key::CloseBracket, _) => (!replays).then(|| "events are in a replay only".into()),
            _ => number(key, panel).unwrap_or_else(|| {
                Some(format!("this key has no use here: {}; F1 shows all keys", key.symbol_or_name()))
            }),
        }
    };
    Key::ALL.iter().filter(|key| input.key_pressed(**key)).find_map(|key| of(*key))
}

/// Why a number key takes no tool; `None` where the key is no number.
fn number(key: Key, panel: &Panel) -> Option<Option<String>> {
    let slot = NUMBERS.iter().position(|number| *number == key)?;
    let choice = panel.choices.first().filter(|choice| !choice.tools.is_empty());
    Some(match choice.and_then(|choice| choice.options.get(slot).map(|option| (choice, option))) {
        _ if !panel.by_hand => Some(NOBODY.into()),
        None => Some(format!("there is no tool number {}", slot + 1)),
        Some((choice, (name, _))) if choice.chosen == slot => Some(format!("it is in the hand: {name}")),
        Some((_, (name, Some(why)))) => Some(format!("{name}: {why}")),
        Some(_) => None,
    })
}

/// What a command of the time bar did.
pub(crate) fn played(playback: Playback) -> String {
    match playback {
        Playback::Run(true) => "the replay runs".into(),
        Playback::Run(false) => "the replay stands still".into(),
        Playback::Speed(speed) => format!("speed {speed}x"),
        Playback::Seek(at_s) => format!("at {at_s:.1} s"),
    }
}
