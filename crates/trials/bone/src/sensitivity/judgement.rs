//! Tables of ranks, conclusions and limits over the rows of all scenes.

use std::collections::BTreeMap;
use trepan_evidence::part::Scope;
use trepan_evidence::picture::{Series, Table};
use trepan_evidence::suite::{Findings, Gate, Row};

/// Largest error of an index on the closed forms.
const INDEX_ERROR: f64 = 0.02;

/// Adds tables, charts, conclusions and limits.
pub fn judge(_: Scope, findings: &mut Findings) {
    let mut outputs: BTreeMap<&str, Vec<&Row>> = BTreeMap::new();
    let ranked = |row: &&Row| row.metrics.contains_key("effect_percent");
    for row in findings.rows.iter().filter(ranked) {
        outputs.entry(&row.scene).or_default().push(row);
    }
    let (mut tables, mut series, mut conclusions) = (Vec::new(), Vec::new(), Vec::new());
    let mut unranked = 0;
    for (output, mut rows) in outputs {
        rows.sort_by(|a, b| number(b, "effect_percent").total_cmp(&number(a, "effect_percent")));
        conclusions.push(conclusion(output, &rows));
        tables.push(table(output, &rows));
        series.push(chart(output, &rows));
        unranked += usize::from(!rows.iter().any(|row| number(row, "effect_percent") > 0.0));
    }
    let error = findings.rows.iter().find_map(|row| row.metrics.get("index_error")).copied().unwrap_or(f64::NAN);
    let name = "variance shares of Ishigami's function and the g-function: largest error of a share";
    findings.gates.extend([
        Gate::at_most(name, error, INDEX_ERROR),
        Gate::at_most("outputs that no constant changes", unranked as f64, 0.0),
    ]);
    findings.tables.extend(tables);
    findings.series.extend(series);
    findings.conclusions.extend(conclusions);
}

fn number(row: &Row, metric: &str) -> f64 {
    row.metrics.get(metric).copied().unwrap_or(f64::NAN)
}

/// The output with its band, and the constants that make most of it.
fn conclusion(output: &str, rows: &[&Row]) -> String {
    let mut by_share: Vec<&&Row> = rows.iter().filter(|row| number(row, "total_percent") >= 5.0).collect();
    by_share.sort_by(|a, b| number(b, "total_percent").total_cmp(&number(a, "total_percent")));
    let part = |row: &&&Row| {
        let [share, error] = ["total_percent", "total_error_percent"].map(|metric| number(row, metric));
        format!("{share:.0} ± {error:.0} % from the {}", row.method)
    };
    let parts: Vec<String> = by_share.iter().map(part).collect();
    let [now, low, high] = ["output", "output_p16", "output_p84"].map(|metric| number(rows[0], metric));
    format!("{output}: {now:.3} ({low:.3} to {high:.3} for two thirds of the ranges): {}.", parts.join(", "))
}

fn table(output: &str, rows: &[&Row]) -> Table {
    let columns = [
        "constant",
        "row",
        "factor",
        "mean effect, %",
        "its deviation, %",
        "share alone, %",
        "share with interactions, %",
        "its error, %",
    ];
    let shown = |row: &Row, metric: &str| match number(row, metric) {
        none if none.is_nan() => "not ranked".into(),
        value => format!("{value:.1}"),
    };
    let line = |row: &&Row| {
        let name = row.config.get("row").and_then(|name| name.as_str()).unwrap_or_default();
        let is_calibrated = row.config.get("calibrated").and_then(serde_json::Value::as_bool) == Some(true);
        let name = if is_calibrated { name.to_string() } else { format!("{name} (uncalibrated)") };
        let metrics = ["effect_percent", "effect_deviation_percent", "first_percent", "total_percent"];
        let numbers = metrics.into_iter().chain(["total_error_percent"]).map(|metric| shown(row, metric));
        let factor = format!("{:.2}", number(row, "factor"));
        [row.method.clone(), name, factor].into_iter().chain(numbers).collect()
    };
    Table {
        title: format!("What changes {output}"),
        columns: columns.map(String::from).into(),
        rows: rows.iter().map(line).collect(),
    }
}

/// Mean effects by rank.
fn chart(output: &str, rows: &[&Row]) -> Series {
    let line = |metric: &str| (1..).map(f64::from).zip(rows.iter().map(|row| number(row, metric))).collect();
    let names = rows.iter().enumerate().map(|(at, row)| format!("{} {}", at + 1, row.method));
    let title = format!("Effects on {output}: {}", names.collect::<Vec<_>>().join(", "));
    let lines = [("mean effect", "effect_percent"), ("its deviation", "effect_deviation_percent")];
    Series::over(title, ["rank", "change of the logarithm, %"], lines.map(|(name, metric)| (name.into(), line(metric))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, effect: f64, total: f64) -> Row {
        let row = Row::new("press: force, N", name).with("row", "brain/x").metric("effect_percent", effect);
        row.metric("total_percent", total).metric("total_error_percent", 5.0).metric("output", 0.2)
    }

    #[test]
    fn the_strongest_comes_first_and_an_output_that_nothing_changes_breaks_a_limit() {
        let mut findings =
            Findings { rows: vec![row("weak", 3.0, f64::NAN), row("strong", 80.0, 71.0)], ..Findings::default() };
        findings.rows.push(Row::new("closed forms", "sobol").metric("index_error", 0.01));
        judge(Scope { quick: true, seed: 1 }, &mut findings);
        assert_eq!(findings.tables[0].rows[0][0], "strong");
        assert!(findings.conclusions[0].contains("71 ± 5 % from the strong"), "{:?}", findings.conclusions);
        assert!(findings.gates.iter().all(|gate| gate.pass));
        findings.rows = vec![row("none", 0.0, f64::NAN)];
        findings.gates.clear();
        judge(Scope { quick: true, seed: 1 }, &mut findings);
        assert!(findings.gates.iter().all(|gate| !gate.pass));
    }
}
