//! The side panel: the task first, then tools and view; engineering is folded away.

use crate::answers::refusal;
use crate::guide::{FEEDS, Guide};
use crate::input::ViewAndTool;
use crate::keys::{Command, label};
use crate::look::Look;
use crate::palette::{GREEN, ORANGE, SKY};
use crate::plot::{Trace, TraceStyle};
use crate::words::{sentence, tr};
use crate::{Choice, Panel, tool_icon};
use eframe::egui::{self, Color32, RichText};
use trepan_geometry::ToolKind;

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

/// Colour to which the window is cleared: the panels'.
pub(crate) fn background(visuals: &egui::Visuals) -> [f32; 4] {
    visuals.panel_fill.to_normalized_gamma_f32()
}

/// Margins of a panel over the cleared window. A software driver takes 17 ms to fill one.
pub(crate) fn frame(ui: &egui::Ui) -> egui::Frame {
    egui::Frame::side_top_panel(ui.style()).fill(Color32::TRANSPARENT)
}

/// Shows the panel, the task first; returns the clicks. `filming` is whether screenshots are being
/// recorded.
pub(crate) fn show(
    ui: &mut egui::Ui,
    panel: &Panel,
    traces: &mut Traces,
    look: &mut Look,
    hand: &mut ViewAndTool,
    filming: bool,
) -> Clicks {
    let mut clicks = Clicks::default();
    let end = egui::Panel::bottom("end").resizable(false).frame(frame(ui));
    end.show(ui, |ui| {
        ui.add_space(4.0);
        let name = if panel.timeline.is_some() { "Close the replay" } else { "End the operation" };
        let end =
            egui::Button::new(RichText::new(tr(name)).strong()).wrap().min_size(egui::vec2(ui.available_width(), 32.0));
        if ui.add(end).on_hover_text(tr("Q; the report is written and shown")).clicked() {
            clicks.commands.push(Command::Quit);
        }
        ui.add_space(4.0);
    });
    // All of it scrolls: nothing is cut off on a small screen.
    egui::ScrollArea::vertical().auto_shrink([false, true]).show(ui, |ui| {
        ui.add_space(8.0);
        ui.label(RichText::new(tr(&panel.phase)).size(22.0).strong());
        ui.label(RichText::new(format!("{} {}", tr("case"), panel.case)).weak());
        ui.label(RichText::new(sentence(&tr(&panel.hint))).size(15.0).strong());
        ui.separator();
        if panel.force_limit_n > 0.0 {
            force(ui, panel, traces);
        }
        grid(ui, "task", &panel.task, 16.0);
        ui.separator();
        pedal(ui, panel, &mut clicks);
        for (at, choice) in panel.choices.iter().enumerate() {
            clicks.chosen = options(ui, choice).map(|option| [at, option]).or(clicks.chosen);
        }
        buttons(ui, panel, look, &mut clicks);
        if panel.by_hand {
            by_mouse(ui, &mut hand.guide, panel.no_bone);
        }
        ui.separator();
        look.show(ui, &mut hand.camera, panel.no_bone);
        ui.separator();
        if filming {
            ui.label(RichText::new(tr("every picture of the window is saved")).strong().color(ORANGE));
        }
        ui.horizontal_wrapped(|ui| window_buttons(ui, &mut clicks));
        let engineering = egui::CollapsingHeader::new(tr("Engineering")).default_open(false);
        engineering.show(ui, |ui| {
            rate(ui, panel, traces);
            grid(ui, "values", &panel.values, 13.0);
        });
    });
    clicks
}

fn window_buttons(ui: &mut egui::Ui, clicks: &mut Clicks) {
    for (command, why) in [
        (Command::Picture, "into the session's folder"),
        (Command::Film, "into the session's folder, until it is pressed again"),
        (Command::LargeType, "larger letters and controls"),
        (Command::Light, "bright rooms, or dark ones"),
        (Command::FullScreen, "without the frame of the window"),
        (Command::Help, "all keys and what the mouse does"),
    ] {
        if ui.button(label(command)).on_hover_text(tr(why)).clicked() {
            clicks.commands.push(command);
        }
    }
}

fn heading(ui: &mut egui::Ui, text: String) {
    ui.label(RichText::new(text).size(18.0).strong());
}

fn force(ui: &mut egui::Ui, panel: &Panel, traces: &mut Traces) {
    heading(ui, tr(&format!("Force  {:.2} N", panel.force_n)));
    traces.force.show(ui, TraceStyle { name: "force", height: 90.0, mark: panel.force_limit_n.into(), colour: SKY });
    let most = traces.force.most();
    let note = format!("last {SECONDS_SHOWN:.0} s, most {most:.2} N, limit {:.1} N", panel.force_limit_n);
    ui.label(RichText::new(tr(&note)).size(12.0)).on_hover_text(tr("what your hand would feel on a device with force"));
}

fn rate(ui: &mut egui::Ui, panel: &Panel, traces: &mut Traces) {
    if panel.rate_hz > 0.0 {
        heading(ui, tr(&format!("Rate  {:.0} Hz", panel.rate_hz)));
        traces
            .rate
            .show(ui, TraceStyle { name: "rate", height: 50.0, mark: panel.wanted_rate_hz.into(), colour: GREEN });
    }
}

fn grid(ui: &mut egui::Ui, id: &str, values: &[(String, String)], size: f32) {
    for (name, value) in values {
        ui.push_id((id, name), |ui| {
            ui.horizontal_wrapped(|ui| {
                ui.label(RichText::new(tr(name)).size(size));
                ui.label(RichText::new(tr(value)).size(size).monospace().strong());
            });
        });
    }
}

fn wide(ui: &egui::Ui, text: RichText, height: f32) -> egui::Button<'static> {
    egui::Button::new(text).wrap().min_size(egui::vec2(ui.available_width(), height))
}

/// The button that is held down to drill.
fn pedal(ui: &mut egui::Ui, panel: &Panel, clicks: &mut Clicks) {
    if !panel.by_hand || panel.no_bone && panel.on_tissue.is_none() {
        return;
    }
    let name = match (panel.on_tissue, panel.drilling) {
        (None, false) => "Hold to drill (Space)",
        (None, true) => "Drilling (Space)",
        (Some(ToolKind::Bipolar), false) => "Hold to coagulate (Space)",
        (Some(ToolKind::Bipolar), true) => "Coagulating (Space)",
        (Some(ToolKind::Scalpel), false) => "Hold to incise (Space)",
        (Some(ToolKind::Scalpel), true) => "Incising (Space)",
        (Some(ToolKind::Scissors), false) => "Press to cut (Space)",
        (Some(ToolKind::Scissors), true) => "Closed (Space)",
        (Some(_), false) => "Hold to aspirate (Space)",
        (Some(_), true) => "Aspirating (Space)",
    };
    let name = RichText::new(tr(name)).strong();
    let pedal = match panel.drilling {
        true => wide(ui, name.color(Color32::BLACK), 32.0).fill(ORANGE),
        false => wide(ui, name, 32.0),
    };
    // A widget that only senses clicks counts as released after 0.8 s.
    let held = ui.add_enabled(panel.no_drill.is_none(), pedal.sense(egui::Sense::drag()));
    clicks.pedal = held.is_pointer_button_down_on();
    if let Some(why) = &panel.no_drill {
        held.on_disabled_hover_text(tr(why));
    }
}

/// The commands to hand and view, and the session's own actions.
fn buttons(ui: &mut egui::Ui, panel: &Panel, look: &Look, clicks: &mut Clicks) {
    for (at, action) in panel.actions.iter().enumerate() {
        let key = action.key.map_or_else(String::new, |key| format!(" ({})", key.to_uppercase()));
        let name = RichText::new(format!("{}{key}", tr(&action.name)));
        let button = match action.on {
            true => wide(ui, name.color(Color32::BLACK), 26.0).fill(SKY),
            false => wide(ui, name, 26.0),
        };
        let mut button = ui.add_enabled(action.why_not.is_none(), button);
        if let Some(why) = &action.why_not {
            button = button.on_disabled_hover_text(tr(why));
        }
        if button.clicked() {
            clicks.actions |= 1 << at;
        }
    }
    let of_hand = [Command::Undo, Command::Redo, Command::Withdraw, Command::NextTool];
    let of_view = [Command::Reset, Command::FocusTool];
    ui.horizontal_wrapped(|ui| {
        for command in of_hand.into_iter().filter(|_| panel.by_hand).chain(of_view) {
            let why_not = refusal(command, panel, look);
            let mut button = ui.add_enabled(why_not.is_none(), egui::Button::new(label(command)));
            if let Some(why) = why_not {
                button = button.on_disabled_hover_text(tr(&why));
            }
            if button.clicked() {
                clicks.commands.push(command);
            }
        }
    });
}

/// What the left button does.
fn by_mouse(ui: &mut egui::Ui, guide: &mut Guide, no_bone: bool) {
    if !no_bone {
        ui.checkbox(&mut guide.drills, tr("The left button drills"))
            .on_hover_text(tr("Held down on the skull, the left button lowers the tool, runs it and pushes it in"));
    }
    let feed =
        egui::Slider::new(&mut guide.feed_mm_s, FEEDS).logarithmic(true).fixed_decimals(1).text(tr("feed, mm/s"));
    ui.add(feed).on_hover_text(tr("How fast the held button pushes the tool along its shaft"));
}

/// The options of a choice; returns the one clicked.
fn options(ui: &mut egui::Ui, choice: &Choice) -> Option<usize> {
    let mut clicked = None;
    if choice.tools.len() == choice.options.len() && !choice.tools.is_empty() {
        for (at, (tool, (name, why_not))) in choice.tools.iter().zip(&choice.options).enumerate() {
            let chosen = at == choice.chosen;
            let why_not = why_not.as_deref().filter(|_| !chosen);
            if tool_icon::show(ui, tool, (at + 1) % 10, name, (why_not, chosen)) && !chosen {
                clicked = Some(at);
            }
        }
        return clicked;
    }
    ui.horizontal_wrapped(|ui| {
        ui.label(format!("{}:", tr(&choice.name)));
        for (at, (name, why_not)) in choice.options.iter().enumerate() {
            let option = egui::Button::selectable(at == choice.chosen, tr(name));
            let shown = ui.add_enabled(why_not.is_none() || at == choice.chosen, option);
            if shown.clicked() && at != choice.chosen {
                clicked = Some(at);
            }
            if let Some(why) = why_not {
                shown.on_disabled_hover_text(tr(why));
            }
        }
    });
    clicked
}
