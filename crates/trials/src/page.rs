//! `index.html`: every suite's chart, gates and rows on one page that needs nothing else.

use crate::part::Suite;
use crate::picture::{Chart, Mark, Outcome};
use crate::report::Report;
use crate::suite::shown;
use plotters::coord::CoordTranslate;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;
use std::fmt::Write;

const SIZE: (u32, u32) = (960, 420);
/// Width of the list of methods beside a chart.
const KEY_WIDTH: u32 = 210;
/// Colours told apart by readers with any colour vision (Okabe and Ito 2008).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// The whole page.
pub fn html(reports: &[(&Suite, Report)]) -> String {
    let mut page = String::from(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>Trepan: validation</title><style>body{font:15px/1.5 system-ui,sans-serif;\
         max-width:1000px;margin:2em auto;padding:0 1em}table{border-collapse:collapse;font-size:13px}td,th{padding:.15em .6em;border-bottom:1px solid #ccc;\
         text-align:right}td:first-child,td:nth-child(2),th{text-align:left}svg{max-width:100%;height:auto}.bad{font-weight:bold;background:#fde3d8}.maps{display:flex;flex-wrap:wrap;gap:1em}\
         figure{margin:0}figcaption{font-size:12px;color:#444;max-width:460px}</style></head><body><h1>Trepan: validation</h1>",
    );
    for (suite, report) in reports {
        _ = write!(
            page,
            "<h2>{}</h2><p>{}? Commit {}, {}.</p>",
            suite.name,
            suite.question,
            report.making.commit,
            machine(report)
        );
        charts(&mut page, suite, report);
        maps(&mut page, report);
        gates(&mut page, report);
        rows(&mut page, report);
    }
    page + "</body></html>\n"
}

fn machine(report: &Report) -> String {
    report.making.machine.values().cloned().collect::<Vec<_>>().join(", ")
}

fn gates(page: &mut String, report: &Report) {
    *page += "<table><tr><th>promise</th><th>found</th><th>limit</th><th></th></tr>";
    for gate in &report.findings.gates {
        let (class, word) = if gate.pass { ("", "kept") } else { (" class=\"bad\"", "broken") };
        _ = write!(
            page,
            "<tr{class}><td>{}</td><td>{}</td><td>{} {}</td><td>{word}</td></tr>",
            gate.name,
            shown(gate.value),
            gate.op,
            gate.limit
        );
    }
    *page += "</table>";
}

fn rows(page: &mut String, report: &Report) {
    *page += "<details><summary>All rows</summary><table><tr><th>scene</th><th>method</th><th>metrics</th></tr>";
    for row in &report.findings.rows {
        let metrics: Vec<String> =
            row.metrics.iter().map(|(name, value)| format!("{name} {}", shown(*value))).collect();
        _ = write!(page, "<tr><td>{}</td><td>{}</td><td>{}</td></tr>", row.scene, row.method, metrics.join("; "));
    }
    *page += "</table></details>";
}

fn charts(page: &mut String, suite: &Suite, report: &Report) {
    let own = &report.findings.charts;
    let drawn = if own.is_empty() { vec![chart_of_all(suite, report)] } else { own.clone() };
    let mut methods: Vec<&str> = Vec::new();
    for mark in drawn.iter().flat_map(|chart| &chart.marks) {
        if !methods.contains(&mark.method.as_str()) {
            methods.push(&mark.method);
        }
    }
    for chart in &drawn {
        if !chart.title.is_empty() {
            _ = write!(page, "<h3>{}</h3>", chart.title);
        }
        let svg = match chart.marks.is_empty() {
            true => Err(format!("no row has {} and {}", chart.cost, chart.error)),
            false => draw(chart, &methods).map_err(|fault| fault.to_string()),
        };
        *page += &svg.unwrap_or_else(|fault| format!("<p>No chart: {fault}.</p>"));
    }
}

/// The suite's own chart, over all rows.
fn chart_of_all(suite: &Suite, report: &Report) -> Chart {
    let (cost, error) = suite.chart;
    let of = |row: &crate::suite::Row| {
        let value = |name: &str| row.metrics.get(name).copied().filter(|v| v.is_finite() && *v >= 0.0);
        Some(Mark { method: row.method.clone(), cost: value(cost)?, error: value(error)? })
    };
    let marks = report.findings.rows.iter().filter_map(of).collect();
    Chart { cost: cost.into(), error: error.into(), marks, ..Chart::default() }
}

fn maps(page: &mut String, report: &Report) {
    if report.findings.maps.is_empty() {
        return;
    }
    let count = |grade: u8| {
        let cells = report.findings.maps.iter().flat_map(|map| map.cells.iter().flatten());
        cells.filter(|cell| Outcome::grade(cell) == grade).count()
    };
    _ = write!(
        page,
        "<h3>Where it works, degrades, fails</h3><p>Green: works ({}); yellow: degrades ({}); red: fails ({}); a letter says why.</p>\
         <div class=\"maps\">",
        count(0),
        count(1),
        count(2)
    );
    report.findings.maps.iter().for_each(|map| *page += &map.svg());
    *page += "</div>";
}

/// Cost against error, both logarithmic, with the front and the budget drawn in.
fn draw(chart: &Chart, methods: &[&str]) -> Result<String, Box<dyn std::error::Error>> {
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

/// A number at an axis: three digits, however small.
fn tick(value: &f64) -> String {
    let digits = (2.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 7.0);
    let text = format!("{value:.*}", digits as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// A method's sign: seven colours as discs, then as triangles, then as crosses.
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
