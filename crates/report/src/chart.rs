//! Charts of a report, as SVG.

use crate::ReportError;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;
use serde::Serialize;

/// A chart of a page.
#[derive(Clone, Debug, Serialize)]
pub struct Chart {
    caption: String,
    svg: String,
}

impl Chart {
    /// Makes a chart with its caption.
    pub fn new(caption: impl Into<String>, svg: String) -> Self {
        Self { caption: caption.into(), svg }
    }
}

/// One line of a chart.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Name in the legend.
    pub name: &'static str,
    /// (x, y) in the chart's units.
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    /// Makes a curve of records over session time; `of` returns the time, ms, and the value of one.
    pub fn over_time<T>(name: &'static str, records: &[T], of: impl Fn(&T) -> (f64, f32)) -> Self {
        let point = |(time_ms, value): (f64, f32)| (time_ms * 1e-3, f64::from(value));
        Self { name, points: records.iter().map(of).map(point).collect() }
    }
}

/// Blue, orange, green, which readers with any colour vision can distinguish (Okabe and Ito 2008).
const COLOURS: [RGBColor; 3] = [RGBColor(0, 114, 178), RGBColor(213, 94, 0), RGBColor(0, 158, 115)];
/// Largest number of points drawn of a curve.
const POINTS: usize = 1200;
/// Size of a chart, pixels.
const SIZE: (u32, u32) = (900, 260);

type Fault = DrawingAreaErrorKind<std::io::Error>;
type Plane<'a, 'b, X, Y> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<<X as AsRangedCoord>::CoordDescType, <Y as AsRangedCoord>::CoordDescType>,
>;

/// Draws labelled axes, what `draw` adds to them, and a legend if wanted. `what` names the chart in
/// an error.
fn plot<X, Y>(
    what: &str,
    axes: [&str; 2],
    (x, y): (X, Y),
    legend: bool,
    draw: impl FnOnce(&mut Plane<'_, '_, X, Y>) -> Result<(), Fault>,
) -> Result<String, ReportError>
where
    X: AsRangedCoord<Value = f64, CoordDescType: ValueFormatter<f64>>,
    Y: AsRangedCoord<Value = f64, CoordDescType: ValueFormatter<f64>>,
{
    let mut svg = String::new();
    let drawn = (|| {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let mut builder = ChartBuilder::on(&root);
        let mut chart = builder.margin(8).x_label_area_size(34).y_label_area_size(60).build_cartesian_2d(x, y)?;
        chart.configure_mesh().x_desc(axes[0]).y_desc(axes[1]).light_line_style(WHITE).draw()?;
        draw(&mut chart)?;
        if legend {
            chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
        }
        root.present()
    })();
    drawn.map_err(|fault: Fault| ReportError::Internal(format!("{what}: {fault}")))?;
    Ok(svg)
}

/// Draws curves over session time, s. `limit` is a dashed line with its label.
pub fn over_time(unit: &str, curves: &[Curve], limit: Option<(f64, &str)>) -> Result<String, ReportError> {
    let curves: Vec<Curve> = curves.iter().map(thinned).collect();
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let end = points().map(|p| p.0).fold(1e-3, f64::max);
    let low = points().map(|p| p.1).fold(0.0, f64::min);
    let high = points().map(|p| p.1).chain(limit.map(|l| l.0)).fold(low + 1e-6, f64::max);
    let range = low..high + 0.06 * (high - low);
    plot(&format!("chart of {unit}"), ["time, s", unit], (0.0..end, range), true, |chart| {
        for (curve, colour) in curves.iter().zip(COLOURS) {
            let line = LineSeries::new(curve.points.iter().copied(), colour.stroke_width(2));
            let mark = move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(3));
            chart.draw_series(line)?.label(curve.name).legend(mark);
        }
        if let Some((value, meaning)) = limit {
            let dashes = DashedLineSeries::new([(0.0, value), (end, value)], 6, 4, BLACK.stroke_width(1));
            let mark = |(x, y)| PathElement::new([(x, y), (x + 18, y)], BLACK);
            chart.draw_series(dashes)?.label(meaning).legend(mark);
        }
        Ok(())
    })
}

/// Draws curves in a plane; `axes` are its labels with units.
pub fn traces(axes: [&str; 2], curves: &[Curve]) -> Result<String, ReportError> {
    let is_finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    let points = || curves.iter().flat_map(|curve| &curve.points).filter(|p| is_finite(p));
    let span = |of: fn(&(f64, f64)) -> f64| {
        let low = points().map(of).fold(f64::INFINITY, f64::min);
        let high = points().map(of).fold(f64::NEG_INFINITY, f64::max);
        let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
        let margin = 0.05 * (high - low) + 0.5;
        low - margin..high + margin
    };
    plot(&format!("chart of {}", axes[1]), axes, (span(|p| p.0), span(|p| p.1)), false, |chart| {
        for (curve, colour) in curves.iter().zip(COLOURS) {
            let every = curve.points.len().div_ceil(POINTS).max(1);
            let line = curve.points.iter().step_by(every).copied().filter(is_finite);
            chart.draw_series(LineSeries::new(line, colour.stroke_width(2)))?;
        }
        Ok(())
    })
}

/// Draws a histogram of times with logarithmic axes. `what` is the label of the time axis; `bins`
/// are (upper edge in µs, count).
pub fn histogram(what: &str, bins: &[(f64, u64)], limit_us: f64) -> Result<String, ReportError> {
    let used: Vec<(f64, f64)> =
        bins.iter().filter(|b| b.1 > 0).map(|&(edge, count)| (edge.max(0.01), count as f64)).collect();
    let low = used.first().map_or(0.1, |b| 0.7 * b.0);
    let high = used.last().map_or(1000.0, |b| 1.5 * b.0).max(1.5 * limit_us);
    let most = used.iter().map(|b| b.1).fold(10.0, f64::max);
    let ranges = ((low..high).log_scale(), (0.5..2.0 * most).log_scale());
    plot("histogram", [what, "ticks"], ranges, false, |chart| {
        let width = 10f64.powf(-0.1);
        let bars = used.iter().map(|&(x, n)| Rectangle::new([(x * width, 0.5), (x * 0.97, n)], COLOURS[0].filled()));
        chart.draw_series(bars)?;
        let dashes = DashedLineSeries::new([(limit_us, 0.5), (limit_us, 2.0 * most)], 6, 4, BLACK.stroke_width(1));
        chart.draw_series(dashes).map(drop)
    })
}

/// Thins a curve to [`POINTS`]: of each run of neighbours it keeps the point farthest from zero.
fn thinned(curve: &Curve) -> Curve {
    let run = curve.points.len().div_ceil(POINTS).max(1);
    let farthest = |points: &[(f64, f64)]| points.iter().copied().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    Curve { name: curve.name, points: curve.points.chunks(run).filter_map(farthest).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_peak() {
        let mut points: Vec<(f64, f64)> = (0..20_000).map(|i| (f64::from(i), 0.1)).collect();
        points[12_345].1 = -3.0;
        let thin = thinned(&Curve { name: "f", points });
        assert!(thin.points.len() <= POINTS && thin.points.contains(&(12_345.0, -3.0)));
    }

    #[test]
    fn charts_contain_their_labels_and_work_without_data() {
        let curve = Curve { name: "bone", points: vec![(0.0, 0.0), (1.0, 2.0)] };
        let svg = over_time("force, N", &[curve], Some((3.3, "limit"))).unwrap();
        assert!(svg.contains("force, N") && svg.contains("limit") && svg.contains("bone"));
        assert!(over_time("x", &[], None).unwrap().contains("<svg"));
        assert!(histogram("t, µs", &[], 1000.0).unwrap().contains("<svg"));
        assert!(histogram("t, µs", &[(5.0, 100), (6.3, 3)], 1000.0).unwrap().contains("ticks"));
        assert!(traces(["x", "y"], &[]).unwrap().contains("<svg"));
        let broken = Curve { name: "b", points: vec![(f64::NAN, 1.0), (2.0, f64::INFINITY)] };
        assert!(traces(["x", "y"], &[broken]).unwrap().contains("<svg"));
    }
}
