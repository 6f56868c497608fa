//! The timeline bar of a replay: run, speed, events and position.

use crate::palette::{ORANGE, PALE, SKY, VERMILION};
use crate::words::tr;
use crate::{Playback, Timeline};
use eframe::egui::{self, Key, RichText};

/// Selectable speeds; 1 is real time.
const SPEEDS: [f32; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
/// Distance within which an event counts as the current one, s.
const HERE_S: f64 = 0.05;

/// Shows the bar; returns the user's command.
pub(crate) fn show(ui: &mut egui::Ui, timeline: &Timeline) -> Option<Playback> {
    let mut asked = keys(ui, timeline);
    egui::Panel::bottom("timeline").show(ui, |ui| {
        ui.add_space(4.0);
        ui.horizontal_wrapped(|ui| asked = buttons(ui, timeline).or(asked));
        asked = asked.or(bar(ui, timeline));
        ui.add_space(6.0);
    });
    asked
}

fn keys(ui: &egui::Ui, timeline: &Timeline) -> Option<Playback> {
    let pressed = |key| ui.input(|i| i.key_pressed(key));
    if pressed(Key::Space) {
        Some(Playback::Run(!timeline.running))
    } else if pressed(Key::OpenBracket) {
        timeline.before().map(Playback::Seek)
    } else if pressed(Key::CloseBracket) {
        timeline.after().map(Playback::Seek)
    } else {
        None
    }
}

impl Timeline {
    /// Time of the event before the current one, s.
    fn before(&self) -> Option<f64> {
        self.marks.iter().rev().map(|mark| mark.at_s).find(|at| *at < self.at_s - HERE_S)
    }

    /// Time of the next event, s.
    fn after(&self) -> Option<f64> {
        self.marks.iter().map(|mark| mark.at_s).find(|at| *at > self.at_s + HERE_S)
    }
}

fn buttons(ui: &mut egui::Ui, timeline: &Timeline) -> Option<Playback> {
    let mut asked = None;
    let name = if timeline.running { "Pause (Space)" } else { "Run (Space)" };
    if ui.add(egui::Button::new(tr(name)).min_size(egui::vec2(110.0, 26.0))).clicked() {
        asked = Some(Playback::Run(!timeline.running));
    }
    for (name, time) in [("Event before ([)", timeline.before()), ("Event after (])", timeline.after())] {
        if ui.add_enabled(time.is_some(), egui::Button::new(tr(name))).clicked() {
            asked = time.map(Playback::Seek);
        }
    }
    for speed in SPEEDS {
        if ui.selectable_label(timeline.speed == speed, format!("{speed}x")).clicked() {
            asked = Some(Playback::Speed(speed));
        }
    }
    let time = format!("{:.1} / {:.1} s", timeline.at_s, timeline.length_s);
    ui.label(RichText::new(time).monospace());
    if timeline.ready_s < timeline.length_s {
        let share = 100.0 * timeline.ready_s / timeline.length_s.max(1e-9);
        ui.label(RichText::new(tr(&format!("{share:.0} % made"))).color(ORANGE));
    }
    let last = timeline.marks.iter().rev().find(|mark| mark.at_s <= timeline.at_s + HERE_S);
    if let Some(mark) = last {
        let text = RichText::new(tr(&mark.text)).color(if mark.warning { ORANGE } else { PALE });
        // A longer row would widen the bar too.
        ui.add(egui::Label::new(text).truncate());
    }
    asked
}

/// The slider with a mark for each event. It shows no number: rounding to decimals would move the
/// time.
fn bar(ui: &mut egui::Ui, timeline: &Timeline) -> Option<Playback> {
    let mut at_s = timeline.at_s;
    ui.spacing_mut().slider_width = (ui.available_width() - 80.0).max(60.0);
    let slider = egui::Slider::new(&mut at_s, 0.0..=timeline.length_s.max(1e-3)).show_value(false).text(tr("time, s"));
    let response = ui.add(slider);
    let rail =
        egui::Rect::from_min_size(response.rect.min, egui::vec2(ui.spacing().slider_width, response.rect.height()));
    // The knob's centre stays its own radius from either end.
    let rail = rail.shrink2(egui::vec2(0.5 * rail.height(), 0.0));
    let x = |seconds: f64| rail.left() + rail.width() * (seconds / timeline.length_s.max(1e-9)).clamp(0.0, 1.0) as f32;
    for mark in timeline.marks.iter() {
        let colour = if mark.warning { VERMILION } else { SKY };
        let reach = if mark.warning { rail.y_range() } else { egui::Rangef::new(rail.center().y, rail.bottom()) };
        ui.painter().vline(x(mark.at_s), reach, egui::Stroke::new(2.0, colour));
    }
    let pointed = ui.input(|i| i.pointer.hover_pos()).filter(|pos| rail.expand(3.0).contains(*pos));
    let near = pointed.and_then(|pos| timeline.marks.iter().find(|mark| (x(mark.at_s) - pos.x).abs() < 3.0));
    if let Some(mark) = near {
        response.clone().on_hover_text_at_pointer(format!("{:.2} s   {}", mark.at_s, tr(&mark.text)));
    }
    response.changed().then_some(Playback::Seek(at_s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mark;

    #[test]
    fn events_are_found_before_and_after() {
        let mark = |at_s| Mark { at_s, ..Mark::default() };
        let marks = [mark(1.0), mark(2.0), mark(5.0)].into();
        let mut timeline = Timeline { at_s: 2.0, length_s: 9.0, ready_s: 9.0, running: false, speed: 1.0, marks };
        assert_eq!((timeline.before(), timeline.after()), (Some(1.0), Some(5.0)));
        timeline.at_s = 0.5;
        assert_eq!((timeline.before(), timeline.after()), (None, Some(1.0)));
        timeline.at_s = 8.0;
        assert_eq!((timeline.before(), timeline.after()), (Some(5.0), None));
    }
}
