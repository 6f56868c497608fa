//! The warning line: large black letters on vermilion across the picture.
//! The most urgent warning stands alone. The word itself is shown too, so that colour is not
//! needed. Information such as a pause is on sky blue below; notices on device and machine stand
//! small at the picture's lower edge.
//!
//! # Practice
//! They overlap the picture's upper edge: making room would change the picture's size and recast it
//! each time.

use crate::Panel;
use crate::palette::{PALE as GREY, SKY, VERMILION};
use crate::words::tr;
use eframe::egui::{self, Color32, Rect, RichText};

/// Shows the most urgent warning, the news and an answer to the user over an area of the window.
pub(crate) fn show(ui: &egui::Ui, over: Rect, panel: &Panel, answer: Option<&str>) {
    let area = egui::Area::new(egui::Id::unique("banner"))
        .fixed_pos(over.min)
        .interactable(false)
        .fade_in(false)
        .order(egui::Order::Middle);
    area.show(ui.ctx(), |ui| {
        ui.set_width(over.width());
        ui.spacing_mut().item_spacing.y = 0.0;
        strip(ui, "WARNING", 24.0, VERMILION, &panel.warnings[..panel.warnings.len().min(1)]);
        strip(ui, "", 18.0, SKY, &panel.news);
        strip(ui, "", 16.0, GREY, answer.map(String::from).as_slice());
    });
    let notes = panel.technical.iter().map(|note| tr(note)).collect::<Vec<_>>().join("; ");
    if !notes.is_empty() {
        let (at, font) = (over.left_bottom() + egui::vec2(8.0, -6.0), egui::FontId::proportional(13.0));
        let galley = ui.painter().layout(notes, font, GREY, over.width() - 16.0);
        let area = Rect::from_min_size(at - egui::vec2(0.0, galley.size().y), galley.size());
        ui.painter().rect_filled(area.expand(4.0), 3.0, Color32::from_black_alpha(190));
        ui.painter().galley(area.min, galley, GREY);
    }
}

fn strip(ui: &mut egui::Ui, word: &str, size: f32, colour: Color32, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    let text = |line: &String| if word.is_empty() { tr(line) } else { format!("{}   {}", tr(word), tr(line)) };
    egui::Frame::new().fill(colour).inner_margin(10.0).show(ui, |ui| {
        ui.set_width(ui.available_width());
        for line in lines {
            ui.label(RichText::new(text(line)).size(size).strong().color(Color32::BLACK));
        }
    });
}
