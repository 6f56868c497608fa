//! `index.html`: every suite's chart, gates and rows on one page that needs nothing else.

use crate::front::front;
use crate::suite::Report;
use crate::suites::Suite;
use plotters::prelude::*;
use std::fmt::Write;

const SIZE: (u32, u32) = (860, 420);
/// Colours told apart by readers with any colour vision (Okabe and Ito 2008).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

/// One point of a chart.
struct Point {
    method: String,
    cost: f64,
    error: f64,
}

/// The whole page.
pub fn html(reports: &[(&Suite, Report)]) -> String {
    let mut page = String::from(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>Trepan: validation</title><style>body{font:15px/1.5 system-ui,sans-serif;\
         max-width:1000px;margin:2em auto;padding:0 1em}table{border-collapse:collapse;font-size:13px}td,th{padding:.15em .6em;border-bottom:1px solid #ccc;\
         text-align:right}td:first-child,td:nth-child(2),th{text-align:left}svg{max-width:100%;height:auto}.bad{font-weight:bold;background:#fde3d8}</style></head><body><h1>Trepan: validation</h1>",
    );
    for (suite, report) in reports {
        _ = write!(
            page,
            "<h2>{}</h2><p>{}? Commit {}, {}.</p>",
            suite.name,
            suite.question,
            report.commit,
            machine(report)
        );
        page += &chart(suite, report).unwrap_or_else(|fault| format!("<p>No chart: {fault}.</p>"));
        gates(&mut page, report);
        rows(&mut page, report);
    }
    page + "</body></html>\n"
}

fn machine(report: &Report) -> String {
    report.machine.values().cloned().collect::<Vec<_>>().join(", ")
}

fn gates(page: &mut String, report: &Report) {
    *page += "<table><tr><th>promise</th><th>found</th><th>limit</th><th></th></tr>";
    for gate in &report.findings.gates {
        let (class, word) = if gate.pass { ("", "kept") } else { (" class=\"bad\"", "broken") };
        _ = write!(
            page,
            "<tr{class}><td>{}</td><td>{:.4}</td><td>{} {}</td><td>{word}</td></tr>",
            gate.name, gate.value, gate.op, gate.limit
        );
    }
    *page += "</table>";
}

fn rows(page: &mut String, report: &Report) {
    *page += "<details><summary>All rows</summary><table><tr><th>scene</th><th>method</th><th>metrics</th></tr>";
    for row in &report.findings.rows {
        let metrics: Vec<String> = row.metrics.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
        _ = write!(page, "<tr><td>{}</td><td>{}</td><td>{}</td></tr>", row.scene, row.method, metrics.join("; "));
    }
    *page += "</table></details>";
}

/// Cost against error, both logarithmic, with the front drawn in.
fn chart(suite: &Suite, report: &Report) -> Result<String, String> {
    let (cost, error) = suite.chart;
    let of = |row: &crate::suite::Row| {
        let value = |name: &str| row.metrics.get(name).copied().filter(|v| v.is_finite() && *v >= 0.0);
        Some(Point { method: row.method.clone(), cost: value(cost)?.max(1e-3), error: value(error)?.max(1e-5) })
    };
    let points: Vec<Point> = report.findings.rows.iter().filter_map(of).collect();
    if points.is_empty() {
        return Err(format!("no row has {cost} and {error}"));
    }
    draw(&points, cost, error).map_err(|fault| fault.to_string())
}

fn draw(points: &[Point], cost: &str, error: &str) -> Result<String, Box<dyn std::error::Error>> {
    let span = |values: &dyn Fn(&Point) -> f64| {
        let (low, high) = points.iter().map(values).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        0.6 * low..1.8 * high
    };
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let (x, y) = (span(&|p| p.cost), span(&|p| p.error));
        let mut chart = ChartBuilder::on(&root)
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(70)
            .build_cartesian_2d(x.log_scale(), y.log_scale())?;
        chart.configure_mesh().x_desc(cost).y_desc(error).light_line_style(WHITE).draw()?;
        let pairs: Vec<(f64, f64)> = points.iter().map(|p| (p.cost, p.error)).collect();
        let best: Vec<(f64, f64)> = front(&pairs).into_iter().map(|i| pairs[i]).collect();
        chart.draw_series(LineSeries::new(best, BLACK.mix(0.4)))?;
        let mut methods: Vec<&str> = points.iter().map(|p| p.method.as_str()).collect();
        methods.sort_unstable();
        methods.dedup();
        for (at, method) in methods.iter().enumerate() {
            let colour = COLOURS[at % COLOURS.len()];
            let dots = points
                .iter()
                .filter(|p| p.method == *method)
                .map(|p| Circle::new((p.cost, p.error), 5, colour.filled()));
            let drawn = chart.draw_series(dots)?;
            drawn.label(*method).legend(move |(x, y)| Circle::new((x + 8, y), 5, colour.filled()));
        }
        chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
        root.present()?;
    }
    Ok(svg)
}
