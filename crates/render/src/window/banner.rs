//! Warnings that cannot be missed: large white letters on red across the whole window, with the word itself, so that colour is not
//! needed to see them.

use eframe::egui::{self, Color32, RichText};

/// Shows the warnings as long as there are any.
pub(crate) fn show(ui: &mut egui::Ui, warnings: &[String]) {
    if warnings.is_empty() {
        return;
    }
    let red = egui::Frame::new().fill(Color32::from_rgb(190, 18, 24)).inner_margin(10.0);
    egui::Panel::top("warnings").frame(red).show(ui, |ui| {
        for warning in warnings {
            ui.label(RichText::new(format!("WARNING   {warning}")).size(24.0).strong().color(Color32::WHITE));
        }
    });
}
