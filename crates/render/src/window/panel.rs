//! The side panel: phase, force, values and buttons.

use super::Panel;
use super::plot::Trace;
use eframe::egui::{self, Color32, RichText};

/// What was clicked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Clicks {
    pub pedal: bool,
    pub next_tool: bool,
    pub undo: bool,
    pub reset: bool,
    pub quit: bool,
}

/// The seconds of force in the plot.
pub(crate) const SECONDS_SHOWN: f64 = 8.0;

const BLUE: Color32 = Color32::from_rgb(86, 180, 233);
const ORANGE: Color32 = Color32::from_rgb(230, 159, 0);

/// Shows the panel and says what was clicked. Blue and orange can be told apart by colour-blind eyes.
pub(crate) fn show(ui: &mut egui::Ui, panel: &Panel, force: &Trace) -> Clicks {
    ui.add_space(8.0);
    ui.label(RichText::new(&panel.phase).size(22.0).strong());
    ui.label(RichText::new(&panel.hint).size(14.0).color(Color32::from_gray(200)));
    ui.separator();
    ui.label(RichText::new(format!("Force  {:.2} N", panel.force_n)).size(18.0).color(Color32::WHITE));
    force.show(ui, 90.0, panel.force_limit_n.into(), BLUE);
    ui.label(
        RichText::new(format!(
            "last {SECONDS_SHOWN:.0} s, most {:.2} N, limit {:.1} N",
            force.most(),
            panel.force_limit_n
        ))
        .small(),
    );
    ui.separator();
    egui::Grid::new("values").num_columns(2).striped(true).show(ui, |ui| {
        for (name, value) in &panel.values {
            ui.label(name);
            ui.label(RichText::new(value).monospace());
            ui.end_row();
        }
    });
    ui.separator();
    let clicks = buttons(ui, panel);
    ui.add_space(8.0);
    ui.label(RichText::new(KEYS).small());
    clicks
}

const KEYS: &str = "left drag: move the tool, with Shift tilt it\nwheel: push it in or pull it out\nright drag: turn the view, Ctrl + wheel: zoom\n\
                    Space: drill, N: next tool, U: undo, R: reset the view, Q: quit";

fn buttons(ui: &mut egui::Ui, panel: &Panel) -> Clicks {
    let wide = egui::vec2(ui.available_width(), 32.0);
    let name = if panel.drilling {
        RichText::new("Drilling (Space)").strong().color(Color32::BLACK)
    } else {
        RichText::new("Hold to drill (Space)")
    };
    let mut pedal = egui::Button::new(name).min_size(wide);
    if panel.drilling {
        pedal = pedal.fill(ORANGE);
    }
    let mut button = |text: &str| ui.add(egui::Button::new(text).min_size(egui::vec2(wide.x, 26.0))).clicked();
    let next_tool = button(&format!("Next tool (N): {}", panel.tool));
    let (undo, reset, quit) = (button("Undo the last stroke (U)"), button("Reset the view (R)"), button("Quit (Q)"));
    Clicks { pedal: ui.add(pedal).is_pointer_button_down_on(), next_tool, undo, reset, quit }
}
