//! Limits, chart, table and conclusions from the rows of all runs.

use super::change::{BONE_N, PICTURE_PERCENT, SHOWN_MM, tissue_tolerance_n};
use super::{AGAIN, EFFECT, LEFT_OUT, NOT_RUN, SCENE};
use crate::scripted::worst;
use trepan_evidence::part::Scope;
use trepan_evidence::picture::{Chart, Mark, Table};
use trepan_evidence::suite::{Findings, Gate, Row};

/// Change of a force and of the shown surface that rounding may make, N and mm.
const ROUNDING_N: f64 = 1e-3;
const ROUNDING_MM: f64 = 1e-3;
/// A change under this part of its tolerance is not drawn.
const DRAWN: f64 = 0.01;

/// Adds limits, charts, the table and the conclusions.
pub fn judge(_: Scope, findings: &mut Findings) {
    let rows: Vec<Row> = findings.rows.iter().filter(|row| row.scene == SCENE).cloned().collect();
    rows.iter().filter(|row| has_run(row)).for_each(|row| findings.gates.extend(limits(row)));
    let charts = [
        ("Change of force at the hand", "hand_change_over_tolerance"),
        ("All changes: force, shown surface, picture", "change_over_tolerance"),
    ];
    findings.charts.extend(charts.map(|(title, change)| chart(&rows, title, change)));
    findings.tables.push(table(&rows));
    findings.conclusions.extend(conclusions(&rows));
}

fn number(row: &Row, name: &str) -> f64 {
    row.metrics.get(name).copied().unwrap_or(f64::NAN)
}

fn has_run(row: &Row) -> bool {
    !row.config.contains_key(NOT_RUN)
}

fn effect(row: &Row) -> &str {
    row.config.get(EFFECT).and_then(|effect| effect.as_str()).unwrap_or_default()
}

/// Whether a run leaves out what the default has.
fn is_left_out(row: &Row) -> bool {
    row.config.get(LEFT_OUT).and_then(|left_out| left_out.as_bool()).unwrap_or_default()
}

/// Limits of a run. An ingredient that changes more than the tolerance is a known gap of the
/// default, which does not have it.
fn limits(row: &Row) -> Vec<Gate> {
    let name = &row.method;
    let at_most = |what: &str, value: f64, limit: f64| Gate::at_most(format!("{name}: {what}"), value, limit);
    let at_least = |what: &str, metric: &str| Gate::at_least(format!("{name}: {what}"), number(row, metric), 1.0);
    let mut limits =
        vec![at_least("the skull is opened", "opened"), at_least("every force and node is finite", "finite")];
    match effect(row) {
        "cost" => {
            limits.push(at_most("ticks and looks that differ by a bit", number(row, "ticks_and_looks_unequal"), 0.0))
        }
        "rounding" => {
            let force_n = worst(["bone_force_change_max_n", "tissue_force_change_max_n"].map(|name| number(row, name)));
            limits.push(at_most("change of force by rounding, largest, N", force_n, ROUNDING_N));
            limits.push(at_most(
                "change of surface by rounding, p95, mm",
                number(row, "shown_change_p95_mm"),
                ROUNDING_MM,
            ));
        }
        _ if is_left_out(row) => {}
        _ => limits.push(at_most("worst change over its tolerance", number(row, "change_over_tolerance"), 1.0)),
    }
    limits
}

fn chart(rows: &[Row], title: &str, change: &str) -> Chart {
    let mark =
        |row: &Row| Mark { method: row.method.clone(), cost: number(row, "cpu_s_per_s"), error: number(row, change) };
    let drawn = |mark: &Mark| mark.cost.is_finite() && mark.error >= DRAWN;
    let marks: Vec<Mark> = rows.iter().map(mark).filter(drawn).collect();
    let usual = rows.iter().find(|row| row.method == AGAIN).map(|row| number(row, "cpu_s_per_s"));
    Chart {
        title: format!("{title}, one value against the default (without changes under {DRAWN} of the tolerance)"),
        cost: "cpu_s_per_s".into(),
        error: change.into(),
        marks,
        budget: usual.filter(|cores| cores.is_finite()).map(|cores| (cores, "default".into())),
        chosen: None,
    }
}

/// Two significant digits.
fn short(value: f64) -> String {
    match value.abs() {
        _ if value.is_nan() => "not a number".into(),
        0.0 => "0".into(),
        size if size < 5e-5 => format!("{value:.0e}"),
        size => format!("{value:.*}", (1.0 - size.log10().floor()).clamp(0.0, 6.0) as usize),
    }
}

/// A change of cost with its sign.
fn signed(value: f64) -> String {
    format!("{value:+.3}")
}

const COLUMNS: [&str; 14] = [
    "value",
    "force on bone, p95 (largest), N",
    "% of peak",
    "force on tissue, p95 (largest), N",
    "% of peak",
    "shown surface, p95, mm",
    "nodes, p95, mm",
    "picture, %",
    "worst change / tolerance",
    "cores: haptic, collision, solver",
    "cores against the default",
    "µs per haptic tick",
    "µs per solver step (by the clock)",
    "memory against the default, MB",
];

fn table(rows: &[Row]) -> Table {
    let line = |row: &Row| {
        if let Some(why) = row.config.get(NOT_RUN) {
            let why = why.as_str().unwrap_or_default();
            let mut cells = vec![row.method.clone(), format!("not run: {why}")];
            cells.resize(COLUMNS.len(), String::new());
            return cells;
        }
        let of = |name: &str| short(number(row, name));
        let pair = |a: &str, b: &str| format!("{} ({})", of(a), of(b));
        let cores = ["haptic", "collision", "solver"].map(|part| of(&format!("{part}_cpu_s_per_s")));
        vec![
            row.method.clone(),
            pair("bone_force_change_p95_n", "bone_force_change_max_n"),
            pair("bone_force_change_p95_percent", "bone_force_change_max_percent"),
            pair("tissue_force_change_p95_n", "tissue_force_change_max_n"),
            pair("tissue_force_change_p95_percent", "tissue_force_change_max_percent"),
            of("shown_change_p95_mm"),
            of("node_change_p95_mm"),
            of("picture_change_percent"),
            of("change_over_tolerance"),
            cores.join(", "),
            signed(number(row, "cpu_change_s_per_s")),
            of("haptic_tick_us"),
            pair("solver_step_us", "solver_step_wall_us"),
            format!("{:+.1}", number(row, "memory_change_mb")),
        ]
    };
    Table {
        title: "What each value changes against the default, and what it costs".into(),
        columns: COLUMNS.map(String::from).to_vec(),
        rows: rows.iter().map(line).collect(),
    }
}

/// Which ingredients change more than the tolerance and what they cost, in words.
fn conclusions(rows: &[Row]) -> Vec<String> {
    let of_model = || rows.iter().filter(|row| has_run(row) && effect(row) == "model");
    let over = |row: &&Row| number(row, "change_over_tolerance") > 1.0;
    let mut all: Vec<String> = of_model().filter(over).map(beyond).collect();
    let list = |rows: Vec<&Row>| rows.iter().map(|row| row.method.as_str()).collect::<Vec<_>>().join(", ");
    let within: Vec<&Row> = of_model().filter(|row| number(row, "change_over_tolerance") <= 1.0).collect();
    let lost: Vec<&Row> = of_model().filter(|row| number(row, "change_over_tolerance").is_nan()).collect();
    let absent: Vec<&Row> = rows.iter().filter(|row| !has_run(row)).collect();
    for (what, rows) in [("Within every tolerance", within), ("Not compared, no number", lost), ("Not run", absent)] {
        if !rows.is_empty() {
            all.push(format!("{what}: {}.", list(rows)));
        }
    }
    if let Some(again) = rows.iter().find(|row| row.method == AGAIN) {
        let cores = number(again, "cpu_change_s_per_s").abs();
        all.push(format!("A second run of the default differs by {} cores: smaller costs are noise.", short(cores)));
    }
    all
}

/// A row that changes more than the tolerance.
fn beyond(row: &Row) -> String {
    let tissue_n = tissue_tolerance_n(number(row, "tissue_force_peak_n"));
    let parts = [
        ("force on bone", "bone_force_change_p95_n", BONE_N, "N"),
        ("force on tissue", "tissue_force_change_p95_n", tissue_n, "N"),
        ("shown surface", "shown_change_p95_mm", SHOWN_MM, "mm"),
        ("picture", "picture_change_percent", PICTURE_PERCENT, "%"),
    ];
    let missed = parts.iter().filter(|(_, name, limit, _)| number(row, name) > *limit);
    let parts = missed.map(|(what, name, limit, unit)| {
        format!("{what} by {} {unit} ({} allowed)", short(number(row, name)), short(*limit))
    });
    let cores = number(row, "cpu_s_per_s");
    let change = number(row, "cpu_change_s_per_s");
    format!(
        "{} changes more than the tolerance: {}. It costs {} cores ({:+.0} %) and {:+.1} MB.",
        row.method,
        parts.collect::<Vec<_>>().join(", "),
        signed(change),
        100.0 * change / (cores - change),
        number(row, "memory_change_mb"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, effect: &str) -> Row {
        let metrics = [
            ("opened", 1.0),
            ("finite", 1.0),
            ("ticks_and_looks_unequal", 0.0),
            ("bone_force_change_p95_n", 0.0),
            ("bone_force_change_max_n", 0.0),
            ("tissue_force_change_p95_n", 0.06),
            ("tissue_force_change_max_n", 0.1),
            ("tissue_force_peak_n", 0.5),
            ("shown_change_p95_mm", 0.1),
            ("picture_change_percent", 0.2),
            ("change_over_tolerance", 1.2),
            ("hand_change_over_tolerance", 1.2),
            ("cpu_s_per_s", 0.6),
            ("cpu_change_s_per_s", 0.1),
            ("memory_change_mb", 2.0),
        ];
        let row = Row::new(SCENE, name).with(EFFECT, effect);
        metrics.into_iter().fold(row, |row, (name, value)| row.metric(name, value))
    }

    fn judged(rows: Vec<Row>) -> Findings {
        let mut findings = Findings { rows, ..Findings::default() };
        let scope = Scope { quick: true, seed: 1 };
        judge(scope, &mut findings);
        trepan_evidence::limits::mark("ablation", scope, &mut findings.gates);
        findings
    }

    #[test]
    fn a_model_that_changes_more_is_a_known_gap_told_in_words_and_a_closed_skull_breaks() {
        let found = judged(vec![
            row("element=locking-free", "model"),
            row("quiet=on", "model").metric("change_over_tolerance", 0.4),
        ]);
        assert!(found.gates.iter().all(|gate| !gate.breaks()));
        assert_eq!(found.gates.iter().filter(|gate| gate.known_gap).count(), 1);
        let line = "element=locking-free changes more than the tolerance: force on tissue by 0.060 N (0.050 allowed). \
                    It costs +0.100 cores (+20 %) and +2.0 MB.";
        assert_eq!(found.conclusions, [line, "Within every tolerance: quiet=on."]);
        assert_eq!((found.charts[0].marks.len(), found.tables[0].rows.len()), (2, 2));
        let broken = |name: &str, metric: &str| {
            let found = judged(vec![row(name, "model").metric(metric, 0.0)]);
            found.gates.iter().filter(|gate| gate.breaks()).count()
        };
        assert_eq!([broken("rigid=thesis", "opened"), broken("rigid=centre-line", "opened")], [1, 0]);
        assert_eq!([broken("element=locking-free", "finite"), broken("solver=linear", "finite")], [1, 0]);
    }

    #[test]
    fn what_must_keep_the_result_breaks_a_limit_by_a_bit_or_by_more_than_rounding() {
        let broken = |row: Row| judged(vec![row]).gates.iter().filter(|gate| gate.breaks()).count();
        assert_eq!(broken(row("threads=2", "cost")), 0);
        assert_eq!(broken(row("threads=2", "cost").metric("ticks_and_looks_unequal", 1.0)), 1);
        let same = row("search=scan", "rounding").metric("tissue_force_change_max_n", 1e-5);
        let same = same.metric("shown_change_p95_mm", 1e-6);
        assert_eq!(broken(same.clone()), 0);
        assert_eq!(broken(same.clone().metric("tissue_force_change_max_n", 0.01)), 1);
        assert_eq!(broken(same.metric("shown_change_p95_mm", f64::NAN)), 1);
    }

    #[test]
    fn a_value_without_its_device_has_a_line_and_no_limit() {
        let absent = Row::new(SCENE, "device=gpu").with(EFFECT, "rounding").with(NOT_RUN, "no graphics card");
        let found = judged(vec![absent]);
        assert!(found.gates.is_empty());
        assert_eq!(found.tables[0].rows[0][1], "not run: no graphics card");
        assert_eq!(found.conclusions, ["Not run: device=gpu."]);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.0, 6.7e-6, 0.0123, 1.26, 140.0].map(short), ["0", "7e-6", "0.012", "1.3", "140"]);
        assert_eq!(signed(-0.02), "-0.020");
    }
}
