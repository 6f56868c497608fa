//! Draws lines of a quantity over frames, or over another quantity, as SVG.
//!
//! # Practice
//! Every line has its own colour and stands in the legend. The page's plot of cost against error is
//! [`plot`](crate::plot).

use crate::picture::Series;
use crate::plot::{COLOURS, tick};
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::ops::Range;

const SIZE: (u32, u32) = (960, 300);
/// Room for the legend right of the lines, as a share of their width.
const LEGEND: f64 = 0.24;
/// Heights of the first line that fit above and below it where a chart is around it.
const ROOM: f64 = 3.0;
/// Width of the legend's sample of a line, px.
const SAMPLE: i32 = 16;

type Fault = Box<dyn std::error::Error>;
type Root<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

/// Draws the lines; an error says that no line has two finite points.
pub fn svg(series: &Series) -> Result<String, Fault> {
    let is_drawn = |y: f64| y.is_finite() && (!series.logarithmic || y > 0.0);
    let all = || series.lines.iter().flat_map(|(_, points)| points).filter(|(x, y)| x.is_finite() && is_drawn(*y));
    let span = |values: &mut dyn Iterator<Item = f64>| {
        values.fold(f64::INFINITY..f64::NEG_INFINITY, |range, v| range.start.min(v)..range.end.max(v))
    };
    let x = span(&mut all().map(|point| point.0));
    let wide = x.start..x.end + LEGEND * (x.end - x.start);
    let limit = series.limit.as_ref().map(|(value, _)| *value).filter(|value| is_drawn(*value));
    let mut y = span(&mut all().map(|point| point.1).chain(limit));
    if let (true, Some((_, first))) = (series.around_first, series.lines.first()) {
        let own = span(&mut first.iter().map(|point| point.1).filter(|y| is_drawn(*y)));
        let room = ROOM * (own.end - own.start).max(1e-3 * own.end.abs()).max(1e-9);
        y = y.start.max(own.start - room)..y.end.min(own.end + room);
    }
    if x.start >= x.end {
        return Err(format!("{}: no line has two finite points", series.title).into());
    }
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        if series.logarithmic {
            let y = 0.8 * y.start..1.4 * y.end;
            draw(series, &root, &wide, (&y, y.clone().log_scale()), limit)?;
        } else {
            let room = 0.06 * (y.end - y.start).max(1e-6);
            let y = y.start - room..y.end + room;
            draw(series, &root, &wide, (&y, y.clone()), limit)?;
        }
        root.present()?;
    }
    Ok(svg)
}

fn draw<Y>(
    series: &Series,
    root: &Root<'_>,
    x: &Range<f64>,
    (ends, y): (&Range<f64>, Y),
    limit: Option<f64>,
) -> Result<(), Fault>
where
    Y: AsRangedCoord<Value = f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let mut axes = ChartBuilder::on(root)
        .caption(&series.title, ("sans-serif", 15))
        .margin(8)
        .x_label_area_size(34)
        .y_label_area_size(62)
        .build_cartesian_2d::<Range<f64>, Y>(x.clone(), y)?;
    let _: &RangedCoordf64 = axes.as_coord_spec().x_spec();
    axes.configure_mesh()
        .x_desc(&series.x)
        .y_desc(&series.y)
        .x_label_formatter(&tick)
        .y_label_formatter(&signed)
        .light_line_style(WHITE)
        .draw()?;
    for (at, (name, points)) in series.lines.iter().enumerate() {
        let colour = COLOURS[at % COLOURS.len()];
        let seen = points.iter().copied().filter(|(_, y)| y.is_finite() && (!series.logarithmic || *y > 0.0));
        let within = seen.map(|(x, y)| (x, y.clamp(ends.start, ends.end)));
        axes.draw_series(LineSeries::new(within, colour))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + SAMPLE, y)], colour.stroke_width(3)));
    }
    if let (Some(value), Some((_, name))) = (limit, &series.limit) {
        axes.draw_series(LineSeries::new([(x.start, value), (x.end, value)], RED.mix(0.6)))?;
        axes.draw_series([Text::new(name.clone(), (x.start, value), ("sans-serif", 12))])?;
    }
    axes.configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.7))
        .label_font(("sans-serif", 12))
        .draw()?;
    Ok(())
}

/// Axis label of a value of either sign.
fn signed(value: &f64) -> String {
    if *value < -1e-9 { format!("-{}", tick(&-value)) } else { tick(&value.max(0.0)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_has_title_axes_limit_and_every_line() {
        let line =
            |name: &str, by: f64| (name.to_string(), (0..9).map(|n| (f64::from(n), by * f64::from(n))).collect());
        let series = Series {
            title: "depth by frame".into(),
            x: "frame".into(),
            y: "depth, mm".into(),
            lines: vec![line("thesis", 1.0), line("ours", -0.5)],
            limit: Some((2.0, "limit".into())),
            ..Series::default()
        };
        for series in [series.clone(), Series { logarithmic: true, ..series.clone() }] {
            let svg = svg(&series).unwrap();
            for text in ["depth by frame", "frame", "depth, mm", "thesis", "ours", "limit", "<polyline"] {
                assert!(svg.contains(text), "{text} is missing");
            }
        }
        let burst = ("bursts".to_string(), vec![(0.0, 0.0), (8.0, 1e30)]);
        let around_first = Series { lines: vec![line("works", 1.0), burst], around_first: true, ..series.clone() };
        assert!(svg(&around_first).unwrap().contains("30"), "the axis ends near the first line");
        assert!(svg(&Series { lines: vec![], ..series }).is_err());
    }
}
