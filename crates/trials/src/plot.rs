//! Draws a chart of cost against error as SVG.
//!
//! # Practice
//! Both axes are logarithmic. The Pareto front and the budget are lines and the recommended method
//! is circled; methods differ in colour and in shape.

use crate::picture::{Chart, Mark};
use plotters::coord::CoordTranslate;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;

const SIZE: (u32, u32) = (960, 420);
/// Width of the legend, px.
const KEY_WIDTH: u32 = 210;
/// Colours that are distinguishable with any colour vision (Okabe and Ito 2008).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// Draws the chart. `methods` are all methods of the page's section, so that a method has the same
/// marker in each of its charts.
pub fn svg(chart: &Chart, methods: &[&str]) -> Result<String, Box<dyn std::error::Error>> {
    let at_least = |mark: &Mark| (mark.cost.max(1e-3), mark.error.max(1e-5));
    let span = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        0.6 * low..1.8 * high
    };
    let budget = chart.budget.as_ref();
    let mut costs = chart.marks.iter().map(|m| at_least(m).0).chain(budget.map(|b| b.0));
    let mut errors = chart.marks.iter().map(|m| at_least(m).1);
    let (x, y) = (span(&mut costs), span(&mut errors));
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let (plot, key) = root.split_horizontally(SIZE.0 - KEY_WIDTH);
        let mut axes = ChartBuilder::on(&plot)
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(70)
            .build_cartesian_2d(x.log_scale(), y.clone().log_scale())?;
        axes.configure_mesh()
            .x_desc(&chart.cost)
            .y_desc(&chart.error)
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
        let used = methods.iter().enumerate().filter(|(_, name)| chart.marks.iter().any(|m| m.method == **name));
        for (line, (at, name)) in used.enumerate() {
            for mark in chart.marks.iter().filter(|mark| mark.method == *name) {
                sign(axes.plotting_area(), at, at_least(mark))?;
                if chart.chosen.as_deref() == Some(*name) {
                    axes.plotting_area().draw(&Circle::new(at_least(mark), 10, BLACK.stroke_width(1)))?;
                }
            }
            let (x, y) = (14, 24 + 18 * line as i32);
            sign(&key, at, (x, y))?;
            let star = if chart.chosen.as_deref() == Some(*name) { " (recommended)" } else { "" };
            key.draw(&Text::new(format!("{name}{star}"), (x + 12, y - 6), ("sans-serif", 13)))?;
        }
        root.present()?;
    }
    Ok(svg)
}

/// Axis label with three significant digits.
fn tick(value: &f64) -> String {
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
