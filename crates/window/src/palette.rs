//! Colours that are legible and distinguishable with any colour vision.
//!
//! # Sources
//! Okabe and Ito 2008, "Color universal design". Contrast: WCAG 2.1, at least 4.5 for text.

use eframe::egui::{Color32, Ui};

pub(crate) const SKY: Color32 = Color32::from_rgb(86, 180, 233);
pub(crate) const ORANGE: Color32 = Color32::from_rgb(230, 159, 0);
pub(crate) const GREEN: Color32 = Color32::from_rgb(0, 158, 115);
pub(crate) const VERMILION: Color32 = Color32::from_rgb(213, 94, 0);
/// Background of the plots.
pub(crate) const NIGHT: Color32 = Color32::from_gray(16);
/// Secondary text.
pub(crate) const PALE: Color32 = Color32::from_gray(205);

/// Share of a colour's light that stays on a light background.
const DARKER: f32 = 0.5;

/// Colour of text on the present background.
pub(crate) fn ink(ui: &Ui) -> Color32 {
    if ui.visuals().dark_mode { Color32::from_gray(225) } else { Color32::from_gray(30) }
}

/// Colour of secondary text on the present background.
pub(crate) fn pale(ui: &Ui) -> Color32 {
    if ui.visuals().dark_mode { PALE } else { Color32::from_gray(70) }
}

/// A colour as it is legible on the present background.
pub(crate) fn legible(ui: &Ui, colour: Color32) -> Color32 {
    if ui.visuals().dark_mode { colour } else { darker(colour) }
}

fn darker(colour: Color32) -> Color32 {
    let [red, green, blue, _] = colour.to_array().map(|c| (DARKER * f32::from(c)) as u8);
    Color32::from_rgb(red, green, blue)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contrast of two colours, from 1 to 21.
    fn contrast(a: Color32, b: Color32) -> f32 {
        let linear = |c: u8| {
            let s = f32::from(c) / 255.0;
            if s <= 0.04045 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) }
        };
        let luminance = |c: Color32| 0.2126 * linear(c.r()) + 0.7152 * linear(c.g()) + 0.0722 * linear(c.b());
        let (a, b) = (luminance(a) + 0.05, luminance(b) + 0.05);
        a.max(b) / a.min(b)
    }

    #[test]
    fn text_colours_have_enough_contrast() {
        assert!((contrast(Color32::BLACK, Color32::WHITE) - 21.0).abs() < 0.01);
        for on_dark in [SKY, ORANGE, GREEN, VERMILION, PALE] {
            assert!(contrast(on_dark, NIGHT) > 4.5, "{on_dark:?}");
        }
        for on_light in [SKY, ORANGE, GREEN, VERMILION] {
            assert!(contrast(darker(on_light), Color32::from_gray(248)) > 4.5, "{on_light:?}");
        }
        assert!(contrast(Color32::BLACK, VERMILION) > 4.5 && contrast(Color32::BLACK, ORANGE) > 4.5);
    }
}
