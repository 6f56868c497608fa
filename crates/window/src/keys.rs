//! The table of keys and buttons, and the help page.

use crate::Action;
use crate::palette::SKY;
use crate::words::tr;
use eframe::egui::{self, Key, RichText};

/// A command of the user to the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Command {
    NextTool,
    Undo,
    Redo,
    Withdraw,
    FocusTool,
    Front,
    Back,
    Left,
    Right,
    Top,
    Light,
    FullScreen,
    Reset,
    Microscope,
    Bone,
    Brain,
    Slices,
    Apart,
    Hints,
    Section,
    Stereo,
    Picture,
    Film,
    LargeType,
    #[cfg(feature = "sound")]
    Mute,
    Help,
    Close,
    Quit,
}

/// Key, command, label.
pub(crate) const KEYS: &[(Key, Command, &str)] = &[
    (Key::N, Command::NextTool, "Next tool"),
    (Key::U, Command::Undo, "Undo the last stroke"),
    (Key::Y, Command::Redo, "Redo the stroke"),
    (Key::X, Command::Withdraw, "Draw the tool back"),
    (Key::R, Command::Reset, "Reset the view"),
    (Key::D, Command::FocusTool, "Centre the tool"),
    (Key::F2, Command::Front, "Front"),
    (Key::F3, Command::Back, "Back"),
    (Key::F4, Command::Left, "Left"),
    (Key::F5, Command::Right, "Right"),
    (Key::F6, Command::Top, "Top"),
    (Key::M, Command::Microscope, "Microscope"),
    (Key::B, Command::Bone, "Skull"),
    (Key::T, Command::Brain, "Brain"),
    (Key::S, Command::Slices, "Slices"),
    (Key::W, Command::Apart, "Slices in their own window"),
    (Key::O, Command::Hints, "Colours and arrows"),
    (Key::C, Command::Section, "Section"),
    (Key::E, Command::Stereo, "Stereo"),
    (Key::P, Command::Picture, "Save a picture of the window"),
    (Key::V, Command::Film, "Save every picture of the window"),
    (Key::L, Command::LargeType, "Large type"),
    (Key::I, Command::Light, "Light or dark"),
    (Key::F11, Command::FullScreen, "Full screen"),
    #[cfg(feature = "sound")]
    (Key::Z, Command::Mute, "No sound"),
    (Key::F1, Command::Help, "Keys"),
    (Key::Questionmark, Command::Help, "Keys"),
    (Key::Escape, Command::Close, "Close what is open, or draw the tool back"),
    (Key::Q, Command::Quit, "End"),
];

/// Mouse actions, and keys that are not in [`KEYS`].
const REST: [(&str, &str); 11] = [
    ("pointer", "The tool flies over what is under it"),
    ("left button", "Lowers the tool and pushes; dragged, slides; with Shift tilts the shaft"),
    ("wheel", "Zooms to the pointer; with Shift pushes the tool in or pulls it out, finely"),
    ("slices", "A click sets the point through which they pass, the wheel turns pages; nothing is cut"),
    ("right drag", "Orbits the view"),
    ("middle drag", "Pans the view; so does Shift + right drag"),
    ("arrows, Page Up and Down", "Move the tool by half a millimetre"),
    ("+ and -, 1 to 9, 0", "Zoom; take a tool"),
    ("Space, held", "Drills"),
    ("Space", "In a replay: runs or stands still"),
    ("[ and ]", "In a replay: to the event before and after"),
];

/// Largest width of the page of keys, points.
const WIDEST: f32 = 640.0;

/// The commands whose keys were pressed.
pub(crate) fn pressed(input: &egui::InputState) -> impl Iterator<Item = Command> {
    KEYS.iter().filter(|(key, ..)| input.key_pressed(*key)).map(|(_, command, _)| *command)
}

/// Name of a command.
pub(crate) fn name(command: Command) -> &'static str {
    KEYS.iter().find(|(_, c, _)| *c == command).map_or("", |(.., words)| words)
}

/// Button label of a command with its key.
pub(crate) fn label(command: Command) -> String {
    let found = KEYS.iter().find(|(_, c, _)| *c == command);
    found.map_or_else(String::new, |(key, _, words)| format!("{} ({})", tr(words), tr(key.symbol_or_name())))
}

/// The key of a session's own action.
pub(crate) fn of_action(action: &Action) -> Option<Key> {
    action.key.and_then(|key| Key::from_name(key.to_uppercase().to_string().as_str()))
}

/// The help page over the picture.
pub(crate) fn help(context: &egui::Context, actions: &[Action]) {
    let (centre, screen) = (egui::Align2::CENTER_CENTER, context.content_rect());
    let page = egui::Window::new(tr("Keys and mouse")).collapsible(false).resizable(false).anchor(centre, [0.0, 0.0]);
    let width = (screen.width() - 60.0).min(WIDEST);
    page.max_width(width).show(context, |ui| {
        egui::ScrollArea::vertical().min_scrolled_height(screen.height() - 90.0).show(ui, |ui| {
            egui::Grid::new("keys").num_columns(2).striped(true).min_col_width(0.3 * width).show(ui, |ui| {
                let mut row = |key: &str, words: &str| {
                    let column = |ui: &mut egui::Ui, share: f32, text: RichText| {
                        ui.scope(|ui| (ui.set_max_width(share * width), ui.add(egui::Label::new(text).wrap())));
                    };
                    column(ui, 0.3, RichText::new(tr(key)).color(SKY));
                    column(ui, 0.62, RichText::new(tr(words)));
                    ui.end_row();
                };
                REST.iter().for_each(|(key, words)| row(key, words));
                KEYS.iter().for_each(|(key, _, words)| row(key.symbol_or_name(), words));
                for action in actions {
                    action.key.iter().for_each(|key| row(&key.to_string(), &action.name));
                }
            });
        });
    });
}

/// The question whether the session shall end; returns the answer once there is one.
pub(crate) fn end(context: &egui::Context) -> Option<bool> {
    let middle = egui::Align2::CENTER_CENTER;
    let page =
        egui::Window::new(tr("End the operation?")).collapsible(false).resizable(false).anchor(middle, [0.0, 0.0]);
    let mut answer = context.input(|input| input.key_pressed(Key::Enter)).then_some(true);
    page.show(context, |ui| {
        ui.label(RichText::new(tr("The report is written and shown; it cannot go on after that.")).size(15.0));
        ui.horizontal(|ui| {
            let end = RichText::new(tr("End and write the report (Enter)")).strong().color(egui::Color32::BLACK);
            let end = ui.add(egui::Button::new(end).fill(SKY).min_size(egui::vec2(120.0, 34.0)));
            let on = egui::Button::new(tr("Go on operating (Esc)")).min_size(egui::vec2(120.0, 34.0));
            answer = answer.or(ui.add(on).clicked().then_some(false)).or(end.clicked().then_some(true));
        });
    });
    answer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_has_two_meanings() {
        for (at, (key, ..)) in KEYS.iter().enumerate() {
            assert!(KEYS[at + 1..].iter().all(|(other, ..)| other != key), "{key:?}");
            assert!(![Key::Space, Key::OpenBracket, Key::CloseBracket, Key::Plus, Key::Minus].contains(key));
        }
        assert_eq!(label(Command::Undo), "Undo the last stroke (U)");
        let of = |key| of_action(&Action { key, ..Action::default() });
        assert_eq!((of(Some('g')), of(Some('¶')), of(None)), (Some(Key::G), None, None));
    }
}
