//! Warning banners: large black letters on vermilion across the picture.
//! The word itself is shown too, so that colour is not needed. Information such as a pause is on
//! sky blue below.
//!
//! # Practice
//! They overlap the picture's upper edge: making room would change the picture's size and recast it
//! each time.

use super::palette::{SKY, VERMILION};
use eframe::egui::{self, Color32, Rect, RichText};

/// Shows warnings and news over an area of the window while there are any.
pub(crate) fn show(ui: &egui::Ui, over: Rect, warnings: &[String], news: &[String]) {
    let area = egui::Area::new(egui::Id::unique("banner"))
        .fixed_pos(over.min)
        .interactable(false)
        .fade_in(false)
        .order(egui::Order::Middle);
    area.show(ui.ctx(), |ui| {
        ui.set_width(over.width());
        ui.spacing_mut().item_spacing.y = 0.0;
        strip(ui, "WARNING   ", 24.0, VERMILION, warnings);
        strip(ui, "", 18.0, SKY, news);
    });
}

fn strip(ui: &mut egui::Ui, word: &str, size: f32, colour: Color32, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    egui::Frame::new().fill(colour).inner_margin(10.0).show(ui, |ui| {
        ui.set_width(ui.available_width());
        for line in lines {
            ui.label(RichText::new(format!("{word}{line}")).size(size).strong().color(Color32::BLACK));
        }
    });
}
