//! Draws a trace: a recorded quantity over time, one line for each run, as SVG.
//!
//! # Practice
//! Both axes are linear. The height shows what the first line needs and three times as much to
//! either side, so that a run that bursts leaves the picture and the sound one stays visible.

use plotters::prelude::*;
use serde::{Deserialize, Serialize};

const SIZE: (u32, u32) = (620, 300);
/// Line colours: the first run, the second.
const COLOURS: [RGBColor; 2] = [RGBColor(0, 114, 178), RGBColor(213, 94, 0)];
/// Bins of a kept line; each keeps its lowest and its highest point.
const BINS: usize = 120;
/// How many heights of the first line fit above it, and below.
const ROOM: f64 = 3.0;

/// A line of a trace.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// What was run.
    pub name: String,
    /// Points; only finite ones.
    pub points: Vec<(f64, f64)>,
}

impl Run {
    /// Keeps the finite points, thinned to the lowest and the highest of 120 bins.
    pub fn new(name: impl Into<String>, points: &[(f64, f64)]) -> Self {
        let finite: Vec<(f64, f64)> = points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
        let bin = finite.len().div_ceil(BINS).max(2);
        let ends = |points: &[(f64, f64)]| {
            let by = |pick: fn(f64, f64) -> bool| {
                (0..points.len()).reduce(|a, b| if pick(points[b].1, points[a].1) { b } else { a }).unwrap_or(0)
            };
            let (low, high) = (by(|a, b| a < b), by(|a, b| a > b));
            let mut kept = vec![points[low.min(high)], points[low.max(high)]];
            kept.dedup();
            kept
        };
        Self { name: name.into(), points: finite.chunks(bin).flat_map(ends).collect() }
    }
}

/// Recorded quantity over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// Title.
    pub title: String,
    /// Names of the axes, with units.
    pub axes: [String; 2],
    /// At most two lines, the sound one first.
    pub runs: Vec<Run>,
}

impl Trace {
    /// The trace as SVG; an error if no run has a point.
    pub fn svg(&self) -> Result<String, Box<dyn std::error::Error>> {
        let span = |points: &mut dyn Iterator<Item = f64>| {
            points.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
        };
        let all = || self.runs.iter().flat_map(|run| &run.points);
        let Some(first) = self.runs.iter().find(|run| !run.points.is_empty()) else { return Err("no points".into()) };
        let (left, right) = span(&mut all().map(|p| p.0));
        let (own, every) = (span(&mut first.points.iter().map(|p| p.1)), span(&mut all().map(|p| p.1)));
        let room = ROOM * (own.1 - own.0).max(1e-3 * own.1.abs()).max(1e-9);
        let (low, high) = (every.0.max(own.0 - room), every.1.min(own.1 + room));
        let pad = (0.05 * (high - low)).max(1e-9);
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
            root.fill(&WHITE)?;
            let mut axes = ChartBuilder::on(&root)
                .caption(&self.title, ("sans-serif", 14))
                .margin(8)
                .x_label_area_size(36)
                .y_label_area_size(64)
                .build_cartesian_2d(left..right.max(left + 1e-9), low - pad..high + pad)?;
            axes.configure_mesh()
                .x_desc(&self.axes[0])
                .y_desc(&self.axes[1])
                .x_labels(7)
                .y_labels(6)
                .light_line_style(WHITE)
                .draw()?;
            for (run, colour) in self.runs.iter().zip(COLOURS.iter().cycle()) {
                let within = run.points.iter().map(|&(x, y)| (x, y.clamp(low - pad, high + pad)));
                axes.draw_series(LineSeries::new(within, colour))?
                    .label(&run.name)
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
            }
            axes.configure_series_labels()
                .position(SeriesLabelPosition::UpperLeft)
                .background_style(WHITE.mix(0.8))
                .draw()?;
            root.present()?;
        }
        Ok(svg)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_line_keeps_its_peaks_and_a_bursting_one_stays_in_the_picture() {
        let points: Vec<(f64, f64)> = (0..10_000).map(|n| (f64::from(n), if n == 4321 { 7.0 } else { 0.0 })).collect();
        let run = Run::new("works", &points);
        assert!(run.points.len() <= 2 * BINS && run.points.contains(&(4321.0, 7.0)));
        let burst = Run::new("bursts", &[(0.0, 0.0), (1.0, 1e30), (2.0, f64::NAN)]);
        assert_eq!(burst.points.len(), 2);
        let axes = ["time, ms", "force, N"].map(String::from);
        let trace = Trace { title: "a wall".into(), axes, runs: vec![run, burst] };
        let svg = trace.svg().unwrap();
        for text in ["a wall", "time, ms", "force, N", "works", "bursts"] {
            assert!(svg.contains(text), "{text} is missing");
        }
        assert!(Trace { runs: vec![], ..trace }.svg().is_err());
    }
}
