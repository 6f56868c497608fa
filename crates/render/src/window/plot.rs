//! The last seconds of a value as a line.

use eframe::egui::{self, Color32, Pos2, Stroke};
use std::collections::VecDeque;

/// Samples kept at most; at 30 pictures a second more than the seconds shown.
const MOST_SAMPLES: usize = 1024;

/// A value over the last seconds.
#[derive(Clone, Debug)]
pub(crate) struct Trace {
    seconds_shown: f64,
    samples: VecDeque<[f64; 2]>,
}

impl Trace {
    pub fn over(seconds_shown: f64) -> Self {
        Self { seconds_shown, samples: VecDeque::with_capacity(MOST_SAMPLES) }
    }

    pub fn push(&mut self, seconds: f64, value: f64) {
        while self.samples.len() == MOST_SAMPLES
            || self.samples.front().is_some_and(|s| s[0] < seconds - self.seconds_shown)
        {
            self.samples.pop_front();
        }
        self.samples.push_back([seconds, value]);
    }

    /// Largest value in sight.
    pub fn most(&self) -> f64 {
        self.samples.iter().map(|s| s[1]).fold(0.0, f64::max)
    }

    /// Draws the line up to `top`, with a mark at `limit`.
    pub fn show(&self, ui: &mut egui::Ui, height: f32, limit: f64, colour: Color32) {
        let (_, area) = ui.allocate_space(egui::vec2(ui.available_width(), height));
        let painter = ui.painter_at(area);
        painter.rect_filled(area, 2.0, Color32::from_gray(16));
        let top = (1.1 * limit.max(self.most())).max(1e-6);
        let now = self.samples.back().map_or(0.0, |s| s[0]);
        let place = |[seconds, value]: [f64; 2]| {
            let x = 1.0 - ((now - seconds) / self.seconds_shown) as f32;
            Pos2::new(area.left() + x * area.width(), area.bottom() - (value / top) as f32 * area.height())
        };
        let mark = place([now, limit]).y;
        painter.hline(area.x_range(), mark, Stroke::new(1.0, Color32::from_rgb(150, 60, 50)));
        painter.line(self.samples.iter().map(|&s| place(s)).collect(), Stroke::new(1.5, colour));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_samples_leave_and_the_number_is_bounded() {
        let mut trace = Trace::over(5.0);
        for i in 0..10_000 {
            trace.push(f64::from(i) * 0.001, f64::from(i % 7));
        }
        assert!(trace.samples.len() <= MOST_SAMPLES);
        assert_eq!(trace.most(), 6.0);
        trace.push(100.0, 1.0);
        assert_eq!((trace.samples.len(), trace.most()), (1, 1.0));
    }
}
