//! Plots the last seconds of a value.

use crate::palette::{NIGHT, VERMILION};
use eframe::egui::{self, Color32};
use egui_plot::{HLine, Line, Plot, PlotPoint, PlotPoints};
use std::collections::VecDeque;

/// Most samples kept: more than the seconds shown at 30 pictures a second.
const MOST_SAMPLES: usize = 1024;

/// A value over the last seconds.
#[derive(Clone, Debug)]
pub(crate) struct Trace {
    seconds_shown: f64,
    samples: VecDeque<PlotPoint>,
}

/// Style of a trace.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TraceStyle<'a> {
    /// Name of the plot.
    pub name: &'a str,
    /// Height, points.
    pub height: f32,
    /// A marked value that is always in range.
    pub mark: f64,
    /// Of the line.
    pub colour: Color32,
}

impl Trace {
    pub fn over(seconds_shown: f64) -> Self {
        Self { seconds_shown, samples: VecDeque::with_capacity(MOST_SAMPLES) }
    }

    /// Adds a value at a time, s. A time before the last one, or far after it, clears the trace.
    pub fn push(&mut self, seconds: f64, value: f64) {
        if self.samples.back().is_some_and(|last| seconds < last.x) {
            self.samples.clear();
        }
        while self.samples.len() == MOST_SAMPLES
            || self.samples.front().is_some_and(|s| s.x < seconds - self.seconds_shown)
        {
            self.samples.pop_front();
        }
        self.samples.push_back(PlotPoint::new(seconds, value));
    }

    /// Largest visible value.
    pub fn most(&self) -> f64 {
        self.samples.iter().map(|s| s.y).fold(0.0, f64::max)
    }

    /// Draws the line from 0 to a little over the largest value and the mark.
    pub fn show(&mut self, ui: &mut egui::Ui, style: TraceStyle<'_>) {
        let top = (1.1 * style.mark.max(self.most())).max(1e-6);
        let now = self.samples.back().map_or(0.0, |s| s.x);
        let points = PlotPoints::Borrowed(self.samples.make_contiguous());
        ui.style_mut().visuals.extreme_bg_color = NIGHT;
        let still = |plot: Plot<'static>| {
            plot.allow_zoom(false)
                .allow_drag(false)
                .allow_scroll(false)
                .allow_boxed_zoom(false)
                .show_axes([false, true])
        };
        let plot = still(Plot::new(style.name).height(style.height)).y_axis_min_width(32.0).show_x(false);
        plot.show(ui, |plot| {
            plot.set_plot_bounds_x(now - self.seconds_shown..=now);
            plot.set_plot_bounds_y(0.0..=top);
            plot.hline(HLine::new("limit", style.mark).color(VERMILION).style(egui_plot::LineStyle::dashed_loose()));
            plot.line(Line::new(style.name, points).color(style.colour).width(1.5));
        });
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
        trace.push(3.0, 2.0);
        assert_eq!((trace.samples.len(), trace.most()), (1, 2.0), "time went back");
    }
}
