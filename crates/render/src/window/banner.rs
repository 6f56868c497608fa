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

#[cfg(test)]
mod tests {
    use super::super::plot::Trace;
    use super::super::{Panel, panel};
    use super::*;

    /// All texts that a window of this panel shows, and whether anything is filled with the banner's red.
    fn shown(panel: &Panel) -> (String, bool) {
        let mut force = Trace::over(8.0);
        force.push(0.0, 1.5);
        let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(900.0, 600.0));
        let input = egui::RawInput { screen_rect: Some(screen), ..Default::default() };
        let mut drawn = egui::Context::default().run_ui(input, |ui| {
            show(ui, &panel.warnings);
            egui::Panel::right("panel").exact_size(250.0).show(ui, |ui| panel::show(ui, panel, &force));
        });
        drawn.textures_delta.clear();
        let mut texts = String::new();
        let mut red = false;
        for clipped in &drawn.shapes {
            match &clipped.shape {
                egui::Shape::Text(text) => texts += &format!("{}|", text.galley.text()),
                egui::Shape::Rect(rect) => {
                    red |= rect.fill == Color32::from_rgb(190, 18, 24) && rect.rect.width() > 600.0
                }
                _ => (),
            }
        }
        (texts, red)
    }

    #[test]
    fn a_warning_is_a_wide_red_banner_and_goes_when_it_is_over() {
        let mut panel = Panel {
            phase: "Craniotomy".into(),
            tool: "burr 4 mm".into(),
            force_n: 1.25,
            force_limit_n: 3.3,
            values: vec![("haptic rate".into(), "1000 Hz".into())],
            ..Default::default()
        };
        let (texts, red) = shown(&panel);
        assert!(!red && !texts.contains("WARNING"));
        assert!(["Craniotomy", "1.25 N", "1000 Hz", "burr 4 mm"].iter().all(|t| texts.contains(t)), "{texts}");
        panel.warnings = vec!["The dura is 1 mm away".into(), "Force is clamped".into()];
        let (texts, red) = shown(&panel);
        assert!(
            red && texts.contains("WARNING   The dura is 1 mm away") && texts.contains("Force is clamped"),
            "{texts}"
        );
    }
}
