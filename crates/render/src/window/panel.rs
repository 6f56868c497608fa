//! The side panel: phase, force, rate, values, choices and buttons.

use super::keys::{Command, label};
use super::look::Look;
use super::palette::{GREEN, ORANGE, PALE, SKY};
use super::plot::{Drawn, Trace};
use super::{Choice, Panel};
use crate::Camera;
use eframe::egui::{self, Color32, RichText};

/// The clicks in the panel.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Clicks {
    /// Whether the pedal is held down.
    pub pedal: bool,
    pub commands: Vec<Command>,
    /// Index of the choice and of its selected option.
    pub chosen: Option<[usize; 2]>,
    /// The session's actions, one bit each.
    pub actions: u32,
}

/// Time span of the plots, s.
pub(crate) const SECONDS_SHOWN: f64 = 8.0;

/// Force and rate over the last seconds.
pub(crate) struct Traces {
    pub force: Trace,
    pub rate: Trace,
}

impl Default for Traces {
    fn default() -> Self {
        Self { force: Trace::over(SECONDS_SHOWN), rate: Trace::over(SECONDS_SHOWN) }
    }
}

/// Shows the panel; returns the clicks. `filming` is whether screenshots are being recorded.
pub(crate) fn show(
    ui: &mut egui::Ui,
    panel: &Panel,
    traces: &mut Traces,
    look: &mut Look,
    camera: &mut Camera,
    filming: bool,
) -> Clicks {
    let mut clicks = Clicks::default();
    ui.add_space(8.0);
    ui.label(RichText::new(&panel.phase).size(22.0).strong());
    ui.label(RichText::new(format!("case {}", panel.case)).color(PALE));
    ui.label(RichText::new(&panel.hint).size(14.0).color(PALE));
    ui.separator();
    egui::ScrollArea::vertical().auto_shrink([false, true]).show(ui, |ui| {
        plots(ui, panel, traces);
        values(ui, panel);
        ui.separator();
        buttons(ui, panel, &mut clicks);
        for (at, choice) in panel.choices.iter().enumerate() {
            clicks.chosen = options(ui, choice).map(|option| [at, option]).or(clicks.chosen);
        }
        ui.separator();
        look.show(ui, camera);
        ui.separator();
        if filming {
            ui.label(RichText::new("every picture of the window is saved").strong().color(ORANGE));
        }
        ui.horizontal_wrapped(|ui| {
            for command in [Command::Picture, Command::Film, Command::LargeType, Command::Help, Command::Quit] {
                if ui.button(label(command)).clicked() {
                    clicks.commands.push(command);
                }
            }
        });
    });
    clicks
}

fn plots(ui: &mut egui::Ui, panel: &Panel, traces: &mut Traces) {
    let Traces { force, rate } = traces;
    let heading = |text: String| RichText::new(text).size(18.0).color(Color32::WHITE);
    ui.label(heading(format!("Force  {:.2} N", panel.force_n)));
    force.show(ui, Drawn { name: "force", height: 90.0, mark: panel.force_limit_n.into(), colour: SKY });
    let most = force.most();
    let note = format!("last {SECONDS_SHOWN:.0} s, most {most:.2} N, limit {:.1} N", panel.force_limit_n);
    ui.label(RichText::new(note).small());
    if panel.rate_hz > 0.0 {
        ui.label(heading(format!("Rate  {:.0} Hz", panel.rate_hz)));
        rate.show(ui, Drawn { name: "rate", height: 50.0, mark: panel.wanted_rate_hz.into(), colour: GREEN });
    }
    ui.separator();
}

fn values(ui: &mut egui::Ui, panel: &Panel) {
    egui::Grid::new("values").num_columns(2).striped(true).max_col_width(122.0).show(ui, |ui| {
        for (name, value) in &panel.values {
            ui.label(name);
            ui.label(RichText::new(value).monospace());
            ui.end_row();
        }
    });
}

fn buttons(ui: &mut egui::Ui, panel: &Panel, clicks: &mut Clicks) {
    let width = ui.available_width();
    let wide = |text: RichText, height: f32| egui::Button::new(text).min_size(egui::vec2(width, height));
    if panel.by_hand {
        let name = if panel.drilling { "Drilling (Space)" } else { "Hold to drill (Space)" };
        let mut pedal = wide(RichText::new(name).strong(), 32.0);
        if panel.drilling {
            pedal = wide(RichText::new(name).strong().color(Color32::BLACK), 32.0).fill(ORANGE);
        }
        // A widget that only senses clicks counts as released after 0.8 s.
        clicks.pedal = ui.add(pedal.sense(egui::Sense::drag())).is_pointer_button_down_on();
        let next = format!("{}: {}", label(Command::NextTool), panel.tool);
        for (command, name) in [(Command::NextTool, next), (Command::Undo, label(Command::Undo))] {
            if ui.add(wide(RichText::new(name), 26.0)).clicked() {
                clicks.commands.push(command);
            }
        }
    }
    if ui.add(wide(RichText::new(label(Command::Reset)), 26.0)).clicked() {
        clicks.commands.push(Command::Reset);
    }
    for (at, action) in panel.actions.iter().enumerate() {
        let key = action.key.map_or_else(String::new, |key| format!(" ({})", key.to_uppercase()));
        let name = RichText::new(format!("{}{key}", action.name));
        let button = if action.on { wide(name.color(Color32::BLACK), 26.0).fill(SKY) } else { wide(name, 26.0) };
        if ui.add(button).clicked() {
            clicks.actions |= 1 << at;
        }
    }
}

/// The options of a choice; returns the one clicked.
fn options(ui: &mut egui::Ui, choice: &Choice) -> Option<usize> {
    let mut clicked = None;
    ui.horizontal_wrapped(|ui| {
        ui.label(format!("{}:", choice.name));
        for (at, (name, open)) in choice.options.iter().enumerate() {
            let option = egui::Button::selectable(at == choice.chosen, name);
            if ui.add_enabled(*open || at == choice.chosen, option).clicked() && at != choice.chosen {
                clicked = Some(at);
            }
        }
    });
    clicked
}
