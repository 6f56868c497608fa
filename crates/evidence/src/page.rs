//! Writes `index.html`: charts, maps, acceptance limits and rows of every suite on one
//! self-contained page.

use crate::figure::Figure;
use crate::limits::{self, KnownGap};
use crate::part::Suite;
use crate::picture::{Chart, Mark, Outcome};
use crate::report::Report;
use crate::suite::{Row, shown};
use crate::{curve, plot};
use minijinja::value::Serde;
use minijinja::{Environment, Value, context};
use serde::Serialize;

/// What the page shows of one suite.
#[derive(Serialize)]
struct Section<'a> {
    name: &'static str,
    question: &'static str,
    report: &'a Report,
    broken: usize,
    /// Command that runs one part alone.
    command_of_part: String,
    charts: Vec<DrawnChart>,
    series: Vec<DrawnChart>,
    maps: Vec<Figure<'a>>,
    /// Number of map cells that work, degrade, fail and are refused.
    grades: [usize; 4],
    /// Rows with the same metrics share a table.
    tables: Vec<&'a [Row]>,
}

/// A chart, or why there is none.
#[derive(Serialize)]
struct DrawnChart {
    svg: Option<String>,
    fault: Option<String>,
}

impl DrawnChart {
    fn of<E: std::fmt::Display>(svg: Result<String, E>) -> Self {
        Self { fault: svg.as_ref().err().map(E::to_string), svg: svg.ok() }
    }
}

/// The whole page as HTML. `methods`: the lines of the table of all methods.
pub fn html(reports: &[(&Suite, Report)], methods: &impl Serialize) -> Result<String, minijinja::Error> {
    let sections: Vec<Section> = reports.iter().map(|(suite, report)| Section::of(suite, report)).collect();
    let of = |report: &Report| limits::known_gaps(&report.suite, report.making.scope(), &report.findings.gates);
    let gaps: Vec<KnownGap> = reports.iter().flat_map(|(_, report)| of(report)).collect();
    let mut pages = Environment::new();
    pages.add_filter("number", shown);
    pages.add_template("page.html", include_str!("../templates/page.html"))?;
    pages.add_template("map.html", include_str!("../templates/map.html"))?;
    pages.get_template("page.html")?.render(context! {
        style => include_str!("../templates/page.css"),
        script => include_str!("../templates/page.js"),
        methods => Value::from(Serde(methods)),
        gaps => Value::from(Serde(gaps)),
        suites => Value::from(Serde(sections)),
    })
}

impl<'a> Section<'a> {
    fn of(suite: &Suite, report: &'a Report) -> Self {
        let found = &report.findings;
        let mut grades = [0; 4];
        let cells = found.maps.iter().flat_map(|map| map.cells.iter().flatten());
        cells.for_each(|cell| grades[usize::from(Outcome::grade(cell))] += 1);
        Self {
            name: suite.name,
            question: suite.question,
            broken: found.gates.iter().filter(|gate| gate.breaks()).count(),
            command_of_part: report.command.replacen(&report.suite, &format!("{}/PART", report.suite), 1),
            charts: charts(suite, report),
            series: found.series.iter().map(|series| DrawnChart::of(curve::svg(series))).collect(),
            maps: found.maps.iter().map(Figure::of).collect(),
            grades,
            tables: found.rows.chunk_by(|a, b| a.metrics.keys().eq(b.metrics.keys())).collect(),
            report,
        }
    }
}

fn charts(suite: &Suite, report: &Report) -> Vec<DrawnChart> {
    let own = &report.findings.charts;
    let needed = own.is_empty() && report.findings.series.is_empty();
    let drawn = if needed { vec![chart_of_all(suite, report)] } else { own.clone() };
    let mut methods: Vec<&str> = Vec::new();
    for mark in drawn.iter().flat_map(|chart| &chart.marks) {
        if !methods.contains(&mark.method.as_str()) {
            methods.push(&mark.method);
        }
    }
    let draw = |chart: &Chart| {
        DrawnChart::of(match chart.marks.is_empty() {
            true => Err(format!("no row has {} and {}", chart.cost, chart.error)),
            false => plot::svg(chart, &methods).map_err(|fault| fault.to_string()),
        })
    };
    drawn.iter().map(draw).collect()
}

/// The suite's default chart over all rows.
fn chart_of_all(suite: &Suite, report: &Report) -> Chart {
    let (cost, error) = suite.chart;
    let of = |row: &Row| {
        let value = |name: &str| row.metrics.get(name).copied().filter(|v| v.is_finite() && *v >= 0.0);
        Some(Mark { method: row.method.clone(), cost: value(cost)?, error: value(error)? })
    };
    let marks = report.findings.rows.iter().filter_map(of).collect();
    Chart { title: format!("{}?", suite.question), cost: cost.into(), error: error.into(), marks, ..Chart::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::{Scope, nothing_more};
    use crate::picture::{Map, Series, Snapshot, Table};
    use crate::report::Making;
    use crate::suite::{Findings, Gate};
    use std::collections::BTreeMap;

    fn toy() -> Findings {
        let row = |n| {
            let row = Row::new(format!("scene <{n}>"), "a & b").with("points", n);
            row.metric("tick_p50_us", f64::from(n)).metric("depth_error_mm", 0.5 / f64::from(n))
        };
        Findings {
            rows: vec![row(1), row(2), Row::new("other", "c").metric("cost_s", f64::NAN)],
            gates: vec![
                Gate::at_most("depth", 0.3, 0.2),
                Gate::at_most("cost", f64::NAN, 1.0),
                Gate { known_gap: true, ..Gate::at_most("change", 3.0, 1.0) },
            ],
            maps: vec![Map {
                title: "a map".into(),
                columns: vec!["1".into()],
                rows: vec!["r".into()],
                cells: vec![vec![Outcome::Fails("falls <through>".into())]],
                lines: vec![("bound".into(), vec![(0.0, 1.0), (1.0, 0.5)])],
                ..Map::default()
            }],
            tables: vec![Table {
                title: "what <it> changes".into(),
                columns: vec!["key".into(), "force, N".into()],
                rows: vec![vec!["a=1".into(), "0.25".into()]],
            }],
            conclusions: vec!["a=1 changes & costs".into()],
            regressions: vec!["WORSE: a map".into()],
            ..Findings::default()
        }
    }

    #[test]
    fn the_page_shows_rows_limits_maps_and_charts_and_escapes_text() {
        let suite = Suite {
            name: "toy",
            question: "is a < b",
            chart: ("tick_p50_us", "depth_error_mm"),
            parts: |_| vec![],
            judge: nothing_more,
        };
        let findings = toy();
        let making = Making::here(Scope { quick: true, seed: 1 });
        let report = Report {
            suite: "toy".into(),
            command: "validate toy".into(),
            making,
            elsewhere: BTreeMap::new(),
            findings,
        };
        let mut with_lines = report.clone();
        let page = html(&[(&suite, report)], &[(); 0]).unwrap();
        for part in [
            "is a &lt; b?",
            "scene &lt;2&gt;",
            "a &amp; b",
            "points 2",
            "<td>NaN</td>",
            "<code>validate toy&#x2f;PART</code>",
            "<b>a</b> falls &lt;through&gt;",
            "<polyline points=",
            "</span> bound",
            "fails (1)",
            "WORSE: a map",
            "what &lt;it&gt; changes",
            "<td>a=1</td><td>0.25</td>",
            "a=1 changes &amp; costs",
            "<td>known gap</td>",
            "<circle",
        ] {
            assert!(page.contains(part), "{part} is missing in {page}");
        }
        assert_eq!(page.matches("class=\"row bad\"").count(), 2, "{page}");
        assert_eq!(page.matches("<summary>").count(), 1);
        let line = [("own".to_string(), &[0.5, 0.25][..])];
        with_lines.findings.series = vec![Series::over_frames("depth <p>", "mm", line)];
        with_lines.findings.pictures = vec![Snapshot { title: "seen".into(), png: "AAAA".into() }];
        let page = html(&[(&suite, with_lines)], &[(); 0]).unwrap();
        for part in ["depth &lt;p&gt;", "<img alt=\"seen\" src=\"data:image/png;base64,AAAA\">", "<polyline"] {
            assert!(page.contains(part), "{part} is missing");
        }
        assert!(!page.contains("<circle"), "lines replace the default chart");
    }
}
