//! Writes `index.html`: charts, maps, acceptance limits and rows of every suite on one
//! self-contained page.

use crate::families;
use crate::html::text;
use crate::part::Suite;
use crate::picture::{Chart, Mark, Outcome};
use crate::plot;
use crate::report::Report;
use crate::suite::{Row, shown};
use std::fmt::Write;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The whole page as HTML.
pub fn html(reports: &[(&Suite, Report)]) -> String {
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>Trepan: validation</title><style>{STYLE}</style></head><body>\
         <h1>Trepan: validation</h1><p class=\"tools\"><label>Show rows and acceptance limits with <input id=\"filter\" type=\"search\" placeholder=\"walls god-object-sphere\"></label> \
         <label><input id=\"broken\" type=\"checkbox\"> broken acceptance limits only</label></p>"
    );
    overview(&mut page, reports);
    families::table(&mut page, reports);
    for (suite, report) in reports {
        _ = write!(page, "<section id=\"{0}\"><h2>{0}</h2><p>{1}?</p>", suite.name, text(suite.question));
        making(&mut page, report);
        regressions(&mut page, report);
        charts(&mut page, suite, report);
        maps(&mut page, report);
        gates(&mut page, report);
        rows(&mut page, report);
        page += "</section>";
    }
    page + "<script>" + SCRIPT + "</script></body></html>\n"
}

fn overview(page: &mut String, reports: &[(&Suite, Report)]) {
    *page += "<table><tr><th>suite</th><th>acceptance limits</th><th>broken</th><th>rows</th><th>command</th><th>commit</th><th>seed</th></tr>";
    for (suite, report) in reports {
        let (gates, making) = (&report.findings.gates, &report.making);
        let broken = gates.iter().filter(|gate| !gate.pass).count();
        let class = if broken == 0 { "" } else { " class=\"bad\"" };
        _ = write!(
            page,
            "<tr{class}><td><a href=\"#{0}\">{0}</a></td><td>{1}</td><td>{broken}</td><td>{2}</td><td><code>{3}</code></td><td>{4}</td><td>{5}</td></tr>",
            suite.name,
            gates.len(),
            report.findings.rows.len(),
            text(&report.command),
            text(&making.commit),
            making.seed
        );
    }
    *page += "</table>";
}

/// Command, commit, seed and machines of the numbers below.
fn making(page: &mut String, report: &Report) {
    let named = |machine: &std::collections::BTreeMap<String, String>| {
        text(&machine.iter().map(|(name, value)| format!("{name}: {value}")).collect::<Vec<_>>().join(", "))
    };
    let made = &report.making;
    _ = write!(
        page,
        "<p class=\"made\"><code>{}</code> at commit {}, seed {}, on {}. One part alone: <code>{}</code>.</p>",
        text(&report.command),
        text(&made.commit),
        made.seed,
        named(&made.machine),
        text(&report.command.replacen(&report.suite, &format!("{}/PART", report.suite), 1))
    );
    for (part, machine) in &report.elsewhere {
        _ = write!(page, "<p class=\"made\">Part {} on {}.</p>", text(part), named(machine));
    }
}

fn regressions(page: &mut String, report: &Report) {
    for line in &report.findings.regressions {
        _ = write!(page, "<p class=\"bad\">{}</p>", text(line));
    }
}

fn gates(page: &mut String, report: &Report) {
    *page += "<table><tr><th>acceptance limit</th><th>measured</th><th>limit</th><th></th></tr>";
    for gate in &report.findings.gates {
        let (class, word) = if gate.pass { ("row", "kept") } else { ("row bad", "broken") };
        _ = write!(
            page,
            "<tr class=\"{class}\"><td>{}</td><td>{}</td><td>{} {}</td><td>{word}</td></tr>",
            text(&gate.name),
            shown(gate.value),
            text(&gate.op.to_string()),
            gate.limit
        );
    }
    *page += "</table>";
}

/// Tables of rows; rows with the same metrics share one table, with a column for each metric.
fn rows(page: &mut String, report: &Report) {
    *page += "<details><summary>All rows</summary>";
    let alike = |a: &Row, b: &Row| a.metrics.keys().eq(b.metrics.keys());
    for group in report.findings.rows.chunk_by(alike) {
        *page += "<table><tr><th>scene</th><th>method</th>";
        group[0].metrics.keys().for_each(|name| _ = write!(page, "<th>{}</th>", text(&name.replace('_', " "))));
        *page += "<th>set</th><th>part</th></tr>";
        for row in group {
            _ = write!(page, "<tr class=\"row\"><td>{}</td><td>{}</td>", text(&row.scene), text(&row.method));
            row.metrics.values().for_each(|value| _ = write!(page, "<td>{}</td>", shown(*value)));
            let set: Vec<String> = row.config.iter().map(|(name, value)| format!("{name} {value}")).collect();
            _ = write!(page, "<td class=\"set\">{}</td><td>{}</td></tr>", text(&set.join("; ")), text(&row.part));
        }
        *page += "</table>";
    }
    *page += "</details>";
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
            _ = write!(page, "<h3>{}</h3>", text(&chart.title));
        }
        let svg = match chart.marks.is_empty() {
            true => Err(format!("no row has {} and {}", chart.cost, chart.error)),
            false => plot::svg(chart, &methods).map_err(|fault| fault.to_string()),
        };
        *page += &svg.unwrap_or_else(|fault| format!("<p>No chart: {}.</p>", text(&fault)));
    }
}

/// The suite's default chart over all rows.
fn chart_of_all(suite: &Suite, report: &Report) -> Chart {
    let (cost, error) = suite.chart;
    let of = |row: &Row| {
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
        "<h3>Where it works, degrades, fails</h3><p>Light and empty: works ({}). Yellow: degrades ({}), red: fails ({}), grey: refused ({}); a letter says why.</p>\
         <div class=\"maps\">",
        count(0),
        count(1),
        count(2),
        count(3)
    );
    report.findings.maps.iter().for_each(|map| *page += &map.svg());
    *page += "</div>";
}
