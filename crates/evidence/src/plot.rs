//! Draws a chart of cost against error as SVG.
//!
//! # Practice
//! Both axes are logarithmic and named with their units. The Pareto front, the cost limit and the
//! tolerance are lines, the recommended method is circled, and each method is named beside one of
//! its marks.

use crate::picture::{Chart, Mark};
use plotters::coord::CoordTranslate;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;

const SIZE: (u32, u32) = (960, 460);
/// Margin inside the axes that a label may not enter, px.
const EDGE: i32 = 4;
/// Height of a label, px.
const LINE: i32 = 14;
/// Mean width of a label's letter, px.
const LETTER: f64 = 6.4;
/// Distance of a label from its mark, px.
const BESIDE: i32 = 9;
/// Colours that are distinguishable with any colour vision (Okabe and Ito 2008).
pub(crate) const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];
/// Quantities whose names do not follow from the metric's.
const QUANTITIES: [(&str, &str); 6] = [
    ("cpu_s_per_s", "CPU load, cores"),
    ("cost_cores", "CPU load, cores"),
    ("error_over_tolerance", "worst error / tolerance"),
    ("change_over_tolerance", "worst change / tolerance"),
    ("hand_change_over_tolerance", "change of force / tolerance"),
    ("regret_percent", "time over the best voxel size, %"),
];
/// Units as a metric's name ends in them, and as they are written.
const UNITS: [(&str, &str); 9] = [
    ("ns", "ns"),
    ("us", "µs"),
    ("ms", "ms"),
    ("s", "s"),
    ("mm", "mm"),
    ("n", "N"),
    ("percent", "%"),
    ("voxel", "voxels"),
    ("deg", "degrees"),
];
/// Parts of a metric's name that are written out.
const WORDS: [(&str, &str); 5] =
    [("p50", "median"), ("p95", "95th percentile"), ("p99", "99th percentile"), ("rms", "RMS"), ("max", "largest")];

/// Draws the chart. `methods` are all methods of the page's section, so that a method has the same
/// marker in each of its charts.
pub fn svg(chart: &Chart, methods: &[&str]) -> Result<String, Box<dyn std::error::Error>> {
    let at_least = |mark: &Mark| (mark.cost.max(1e-3), mark.error.max(1e-5));
    let span = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        0.6 * low..1.8 * high
    };
    let (budget, tolerance) = (chart.budget.as_ref(), tolerance(&chart.error));
    let mut costs = chart.marks.iter().map(|m| at_least(m).0).chain(budget.map(|b| b.0));
    let mut errors = chart.marks.iter().map(|m| at_least(m).1).chain(tolerance);
    let (x, y) = (span(&mut costs), span(&mut errors));
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let mut axes = ChartBuilder::on(&root)
            .caption(&chart.title, ("sans-serif", 15))
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(70)
            .build_cartesian_2d(x.clone().log_scale(), y.clone().log_scale())?;
        axes.configure_mesh()
            .x_desc(quantity(&chart.cost))
            .y_desc(quantity(&chart.error))
            .x_label_formatter(&tick)
            .y_label_formatter(&tick)
            .light_line_style(WHITE)
            .draw()?;
        let best = chart.front().into_iter().map(|(cost, error)| (cost.max(1e-3), error.max(1e-5)));
        axes.draw_series(LineSeries::new(best, BLACK.mix(0.4)))?;
        if let Some((cost, name)) = budget {
            axes.draw_series(LineSeries::new([(*cost, y.start), (*cost, y.end)], RED.mix(0.6)))?;
            axes.draw_series([Text::new(name.clone(), (*cost, y.end), ("sans-serif", 12))])?;
        }
        if let Some(error) = tolerance {
            axes.draw_series(LineSeries::new([(x.start, error), (x.end, error)], RED.mix(0.6)))?;
            axes.draw_series([Text::new("tolerance", (x.start, error), ("sans-serif", 12))])?;
        }
        let area = axes.plotting_area();
        let pixel = |mark: &Mark| area.map_coordinate(&at_least(mark));
        let mut labels = Labels::new(area.get_pixel_range(), chart.marks.iter().map(pixel).collect());
        for (at, name) in methods.iter().enumerate() {
            let own: Vec<&Mark> = chart.marks.iter().filter(|mark| mark.method == *name).collect();
            if own.is_empty() {
                continue;
            }
            for mark in &own {
                sign(area, at, at_least(mark))?;
                if chart.chosen.as_deref() == Some(*name) {
                    area.draw(&Circle::new(at_least(mark), 10, BLACK.stroke_width(1)))?;
                }
            }
            let label = labels.place(name, own.into_iter().map(pixel));
            root.draw(&PathElement::new([label.mark, label.near_end()], BLACK.mix(0.25)))?;
            root.draw(&Text::new(name.to_string(), label.corner, ("sans-serif", 12)))?;
        }
        root.present()?;
    }
    Ok(svg)
}

/// Error at which a tolerance is reached, where the metric is measured in tolerances.
fn tolerance(metric: &str) -> Option<f64> {
    metric.ends_with("_over_tolerance").then_some(1.0)
}

/// Quantity of a metric with its unit, for an axis.
fn quantity(metric: &str) -> String {
    if let Some((_, quantity)) = QUANTITIES.iter().find(|(name, _)| *name == metric) {
        return (*quantity).into();
    }
    let (name, unit) = match metric.rsplit_once('_') {
        Some((name, end)) => match UNITS.iter().find(|(unit, _)| *unit == end) {
            Some((_, unit)) => (name, Some(*unit)),
            None => (metric, None),
        },
        None => (metric, None),
    };
    let written = |word: &&str| WORDS.iter().find(|(short, _)| short == word).map(|(_, long)| *long);
    let plain: Vec<&str> = name.split('_').filter(|word| written(word).is_none()).collect();
    let plain = plain.join(" ").replace(" over ", " / ");
    let parts = [plain.as_str()].into_iter().chain(name.split('_').filter_map(|word| written(&word))).chain(unit);
    parts.collect::<Vec<_>>().join(", ")
}

/// Places labels beside marks where they cover least, px.
struct Labels {
    /// Corners of the area inside the axes.
    area: [(i32, i32); 2],
    marks: Vec<(i32, i32)>,
    placed: Vec<Label>,
}

/// A label's upper left corner and lower right corner, and the mark that it names, px.
#[derive(Clone, Copy)]
struct Label {
    corner: (i32, i32),
    end: (i32, i32),
    mark: (i32, i32),
}

impl Labels {
    fn new((x, y): (std::ops::Range<i32>, std::ops::Range<i32>), marks: Vec<(i32, i32)>) -> Self {
        Self { area: [(x.start + EDGE, y.start + EDGE), (x.end - EDGE, y.end - EDGE)], marks, placed: Vec::new() }
    }

    /// Puts a name beside one of its marks.
    fn place(&mut self, name: &str, marks: impl Iterator<Item = (i32, i32)>) -> Label {
        let width = (LETTER * name.chars().count() as f64) as i32;
        let beside = |mark: (i32, i32)| {
            (0..16).flat_map(move |shift| {
                let dy = LINE * if shift % 2 == 0 { shift / 2 } else { -(shift + 1) / 2 } - LINE / 2;
                [mark.0 + BESIDE, mark.0 - BESIDE - width].map(|x| {
                    let corner = (x, mark.1 + dy);
                    (shift, Label { corner, end: (x + width, corner.1 + LINE), mark })
                })
            })
        };
        let best = marks.flat_map(beside).min_by_key(|(shift, label)| self.covered(label) + shift);
        let label = best.map_or(Label { corner: (0, 0), end: (0, 0), mark: (0, 0) }, |(_, label)| label);
        self.placed.push(label);
        label
    }

    /// What a label would cover: other labels count most, then the axes, then marks.
    fn covered(&self, label: &Label) -> i32 {
        let [low, high] = self.area;
        let outside = label.corner.0 < low.0 || label.corner.1 < low.1 || label.end.0 > high.0 || label.end.1 > high.1;
        let meets = |a: &Label| {
            a.corner.0 < label.end.0 && label.corner.0 < a.end.0 && a.corner.1 < label.end.1 && label.corner.1 < a.end.1
        };
        let disc = |&(x, y): &(i32, i32)| Label { corner: (x - 5, y - 5), end: (x + 5, y + 5), mark: (x, y) };
        let labels = self.placed.iter().filter(|placed| meets(placed)).count() as i32;
        let marks = self.marks.iter().filter(|mark| meets(&disc(mark))).count() as i32;
        1000 * labels + 1000 * i32::from(outside) + 4 * marks
    }
}

impl Label {
    /// The end of the label's middle line that lies nearer to its mark.
    fn near_end(&self) -> (i32, i32) {
        let x = if self.corner.0 > self.mark.0 { self.corner.0 } else { self.end.0 };
        (x, (self.corner.1 + self.end.1) / 2)
    }
}

/// Axis label with three significant digits.
pub(crate) fn tick(value: &f64) -> String {
    let digits = (2.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 7.0);
    let text = format!("{value:.*}", digits as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// Marker of a method: seven colours as discs, then as triangles, then as crosses.
fn sign<B: DrawingBackend, C: CoordTranslate>(
    area: &DrawingArea<B, C>,
    at: usize,
    place: C::From,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let colour = COLOURS[at % COLOURS.len()];
    match at / COLOURS.len() {
        0 => area.draw(&Circle::new(place, 5, colour.filled())),
        1 => area.draw(&TriangleMarker::new(place, 7, colour.filled())),
        _ => area.draw(&Cross::new(place, 5, colour.stroke_width(2))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_named_in_words_with_units() {
        let expected = [
            ("tick_p50_us", "tick, median, µs"),
            ("depth_error_p95_voxel", "depth error, 95th percentile, voxels"),
            ("force_error_rms_n", "force error, RMS, N"),
            ("cpu_s_per_s", "CPU load, cores"),
            ("cost_over_cheapest", "cost / cheapest"),
            ("ticks", "ticks"),
        ];
        expected.into_iter().for_each(|(metric, name)| assert_eq!(quantity(metric), name));
    }

    #[test]
    fn labels_of_crowded_marks_do_not_overlap() {
        let marks: Vec<(i32, i32)> = (0..12).map(|n| (300 + 3 * n, 200 + 2 * n)).collect();
        let mut labels = Labels::new((70..950, 10..410), marks.clone());
        for (n, mark) in marks.into_iter().enumerate() {
            let label = labels.place(&format!("method number {n}"), [mark].into_iter());
            labels.placed.pop();
            assert!(labels.covered(&label) < 1000, "label {n} covers another or leaves the axes");
            labels.placed.push(label);
        }
    }

    #[test]
    fn a_chart_has_its_title_axes_lines_and_every_method_by_name() {
        let mark = |method: &str, cost, error| Mark { method: method.into(), cost, error };
        let chart = Chart {
            title: "the operation".into(),
            cost: "cpu_s_per_s".into(),
            error: "error_over_tolerance".into(),
            marks: vec![mark("draft", 0.2, 12.0), mark("auto", 0.8, 0.7)],
            budget: Some((1.0, "one core".into())),
            chosen: Some("auto".into()),
        };
        let svg = svg(&chart, &["draft", "auto"]).unwrap();
        for text in
            ["the operation", "CPU load, cores", "worst error / tolerance", "one core", "tolerance", "draft", "auto"]
        {
            assert!(svg.contains(text), "{text} is missing");
        }
    }
}
