//! Compares two runs: what got faster, slower, more or less accurate, with confidence intervals.
//!
//! # Theory
//! A metric of a method is compared over all scenes that both runs have, as the ratio r = new / old
//! in each. The reported change is the median of r with its 95 % bootstrap interval (Efron 1979):
//! scenes drawn with replacement, 1000 times. A change counts if the interval excludes 1 and
//! the median is further from 1 than the timing noise of the two runs. That noise is the spread of
//! all time ratios about their median; a loaded or different machine widens it.
//!
//! # Practice
//! Times end in `_us`, `_ms`, `_s`, `_ns` or are rates `_per_s`. They are divided by the median
//! time ratio of the suite, so that a machine that is slower throughout is reported once and
//! not attributed to each method. All other metrics should repeat exactly with the same seed and
//! are
//! compared unscaled.

use crate::part::Suite;
use crate::picture::{Chart, Map, describe_change};
use crate::report::Report;
use crate::store;
use crate::suite::Row;
use anyhow::{Result, bail};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;
use trepan_geometry::quantile;

/// Number of bootstrap draws.
const DRAWS: usize = 1000;
/// 90 % quantile over 50 % quantile of the absolute deviation of a normal distribution. The 50 %
/// quantile is robust if some methods changed.
const NINE_IN_TEN: f64 = 2.44;
/// Smallest relative change of a time that is reported, however narrow its interval.
const LEAST_TIME: f64 = 0.05;
/// Smallest relative change of any other metric that is reported.
const LEAST: f64 = 1e-6;
/// Number of names listed of what only one run has.
const NAMED: usize = 3;

/// Direction in which a metric improves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Better {
    Less,
    More,
    Neither,
}

/// How a metric depends on timing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Nature {
    /// A time or a rate: a slower machine changes it.
    Time,
    /// Derived from times, such as a ratio of them: as noisy as times, but independent of machine
    /// speed.
    OfTimes,
    /// Identical in every run with one seed.
    Exact,
}

/// Nature and better direction of a metric, derived from its name.
fn kind(metric: &str) -> (Nature, Better) {
    let ends = |list: &[&str]| list.iter().any(|end| metric.ends_with(end));
    let has = |list: &[&str]| list.iter().any(|word| metric.contains(word));
    if metric.starts_with("error_over_") {
        (Nature::Exact, Better::Less)
    } else if ends(&["cpu_s_per_s"]) || metric.starts_with("ns_per_") {
        (Nature::Time, Better::Less)
    } else if has(&[
        "spread",
        "times_",
        "_over_",
        "_mb",
        "share_of",
        "halves",
        "predicted",
        "regret",
        "late_",
        "real_time",
    ]) {
        (Nature::OfTimes, Better::Neither)
    } else if ends(&["_per_s", "speedup"]) {
        (Nature::Time, Better::More)
    } else if ends(&["_us", "_ns", "_s"]) || ends(&["_ms"]) && has(&["time", "frame", "step", "cost", "calibration"]) {
        (Nature::Time, Better::Less)
    } else if has(&["error", "missed", "invented", "lost", "drift", "fails", "false", "jump", "differing"]) {
        (Nature::Exact, Better::Less)
    } else if has(&["ssim", "dice", "recovered", "works", "held", "told_before"]) {
        (Nature::Exact, Better::More)
    } else {
        (Nature::Exact, Better::Neither)
    }
}

/// Whether a metric is a time, or a ratio of times, so that it varies from run to run.
pub(crate) fn is_timed(metric: &str) -> bool {
    kind(metric).0 != Nature::Exact
}

/// Change of one metric of one method over all scenes of both runs.
#[derive(Debug)]
struct Change {
    method: String,
    metric: String,
    scenes: usize,
    median: f64,
    low: f64,
    high: f64,
}

/// Text with all differences between the reports of some suites in two folders.
pub fn folders<'a>(suites: impl IntoIterator<Item = &'a Suite>, old: &Path, new: &Path) -> Result<String> {
    let (mut text, mut both) = (String::new(), 0);
    for suite in suites {
        match (store::report(old, suite.name)?, store::report(new, suite.name)?) {
            (Some(old), Some(new)) => {
                both += 1;
                text += &reports(&old, &new);
            }
            (None, None) => {}
            (there, _) => {
                let which = if there.is_some() { "old" } else { "new" };
                _ = writeln!(text, "{}: ONLY IN THE {which} run", suite.name);
            }
        }
    }
    if both == 0 {
        bail!("{} and {} have no suite in common: give folders with SUITE.json", old.display(), new.display());
    }
    Ok(text)
}

/// Text with all differences between two reports of one suite.
pub fn reports(old: &Report, new: &Report) -> String {
    let mut text = format!("{}: {} -> {}\n", new.suite, old.making.commit, new.making.commit);
    if old.making.scope() != new.making.scope() {
        text += "  the runs differ in --quick or --seed: only rows of the same name are compared\n";
    }
    if old.making.machine != new.making.machine {
        text += "  the machines differ: times are hardly comparable\n";
    }
    gates(&mut text, old, new);
    alone(&mut text, old, new);
    metrics(&mut text, &old.findings.rows, &new.findings.rows);
    charts(&mut text, &old.findings.charts, &new.findings.charts);
    maps(&mut text, &old.findings.maps, &new.findings.maps);
    text
}

fn gates(text: &mut String, old: &Report, new: &Report) {
    let was: BTreeMap<&str, bool> = old.findings.gates.iter().map(|gate| (gate.name.as_str(), gate.pass)).collect();
    let both = || new.findings.gates.iter().filter_map(|gate| Some((gate, *was.get(gate.name.as_str())?)));
    let changed: Vec<_> = both().filter(|(gate, was)| gate.pass != *was).collect();
    _ = writeln!(text, "  {} acceptance limits in both, {} with another verdict", both().count(), changed.len());
    for (gate, _) in changed {
        let word = if gate.pass { "now kept" } else { "NOW BROKEN" };
        _ = writeln!(text, "    {word}: {}: {} {} {}", gate.name, gate.value, gate.op, gate.limit);
    }
}

/// Reports gates and method rows that only one of the runs has.
fn alone(text: &mut String, old: &Report, new: &Report) {
    let limits = |report: &Report| {
        let names = report.findings.gates.iter().map(|gate| (gate.name.clone(), gate.name.clone()));
        names.collect::<BTreeMap<_, _>>()
    };
    let rows = |report: &Report| {
        let names = keyed(&report.findings.rows)
            .map(|((key, n), row)| (format!("{key} {n}"), format!("{} in {}", row.method, row.scene)));
        names.collect::<BTreeMap<_, _>>()
    };
    for (what, was, is) in [("acceptance limits", limits(old), limits(new)), ("rows of methods", rows(old), rows(new))]
    {
        for (run, of, other) in [("old", &was, &is), ("new", &is, &was)] {
            let lacking = || of.iter().filter(|(key, _)| !other.contains_key(*key)).map(|(_, name)| name.as_str());
            let mut names: Vec<&str> = lacking().collect::<BTreeSet<_>>().into_iter().collect();
            if names.is_empty() {
                continue;
            }
            if names.len() > NAMED {
                names.splice(NAMED.., ["..."]);
            }
            _ = writeln!(text, "  {} {what} ONLY IN THE {run} run: {}", lacking().count(), names.join(", "));
        }
    }
}

fn metrics(text: &mut String, old: &[Row], new: &[Row]) {
    let ratios = ratios(old, new);
    let mut of_times: Vec<f64> = Vec::new();
    for ((_, metric), all) in &ratios {
        match kind(metric) {
            (Nature::Time, Better::More) => of_times.extend(all.iter().map(|rate| 1.0 / rate)),
            (Nature::Time, _) => of_times.extend(all),
            _ => {}
        }
    }
    of_times.retain(|ratio| ratio.is_finite());
    let machine = quantile(&mut of_times, 0.5);
    let mut wander: Vec<f64> = of_times.iter().map(|ratio| (ratio / machine).ln().abs()).collect();
    let spread = (NINE_IN_TEN * quantile(&mut wander, 0.5)).exp() - 1.0;
    if !of_times.is_empty() {
        _ = writeln!(
            text,
            "  {} times: new over old {machine:.3} in the median, half of them so near to it that nine in ten should be within {:.0} %",
            of_times.len(),
            100.0 * spread
        );
    }
    let control = |rows: &[Row]| rows.iter().find_map(|row| row.metrics.get("sum_p50_us").copied());
    if let (Some(old), Some(new)) = (control(old), control(new)) {
        _ = writeln!(text, "  the machine's own control: new over old {:.3}", new / old);
    }
    let mut reported: BTreeMap<&str, Vec<Change>> = BTreeMap::new();
    let mut same = 0;
    for ((method, metric), all) in ratios {
        let (nature, better) = kind(&metric);
        let by = match (nature, better) {
            (Nature::Time, Better::More) => machine,
            (Nature::Time, _) => 1.0 / machine,
            _ => 1.0,
        };
        let (lost, all): (Vec<f64>, Vec<f64>) = all.into_iter().map(|ratio| ratio * by).partition(|r| r.is_nan());
        if !lost.is_empty() {
            let change = Change::of(method.clone(), metric.clone(), lost);
            reported.entry("NO NUMBER in one of the runs").or_default().push(change);
            if all.is_empty() {
                continue;
            }
        }
        let change = Change::of(method, metric, all);
        match change.word(nature, better, spread) {
            Some(word) => reported.entry(word).or_default().push(change),
            None => same += 1,
        }
    }
    _ = writeln!(text, "  {same} metrics of methods unchanged within their confidence");
    for (word, mut changes) in reported {
        changes.sort_by(|a, b| b.median.ln().abs().total_cmp(&a.median.ln().abs()));
        _ = writeln!(text, "  {word}:");
        for Change { method, metric, scenes, median, low, high } in changes {
            _ = writeln!(text, "    {method}, {metric}: x{median:.3} [{low:.3}, {high:.3}] over {scenes} scene(s)");
        }
    }
}

/// Ratios new / old of every metric that both runs have in the same scene, by method and metric.
/// The
/// ratio is 1 if both are 0 and NaN if one is not finite; metrics not finite in both are skipped.
fn ratios(old: &[Row], new: &[Row]) -> BTreeMap<(String, String), Vec<f64>> {
    let was: BTreeMap<_, &Row> = keyed(old).collect();
    let mut ratios: BTreeMap<(String, String), Vec<f64>> = BTreeMap::new();
    for (key, row) in keyed(new) {
        let Some(before) = was.get(&key) else { continue };
        for (metric, &value) in &row.metrics {
            let Some(&old) = before.metrics.get(metric) else { continue };
            let all = ratios.entry((row.method.clone(), metric.clone())).or_default();
            if !(value.is_nan() && old.is_nan()) {
                all.push(if value == old { 1.0 } else { value / old });
            }
        }
    }
    ratios
}

/// Rows keyed by scene, method, settings and an index among rows that share these: rows come in the
/// same order in every run.
fn keyed(rows: &[Row]) -> impl Iterator<Item = ((String, usize), &Row)> {
    let mut met: BTreeMap<String, usize> = BTreeMap::new();
    rows.iter().map(move |row| {
        let name = format!("{} | {} | {:?}", row.scene, row.method, stable(row));
        let count = met.entry(name.clone()).or_default();
        *count += 1;
        ((name, *count), row)
    })
}

/// Settings that are inputs, not measurements: lists and fractions are left out.
fn stable(row: &Row) -> Vec<(&String, String)> {
    let plain = row.config.iter().filter(|(_, value)| value.is_string() || value.is_u64() || value.is_boolean());
    plain.map(|(name, value)| (name, value.to_string())).collect()
}

impl Change {
    fn of(method: String, metric: String, mut all: Vec<f64>) -> Self {
        let scenes = all.len();
        let mut random = fastrand::Rng::with_seed(1);
        let mut draw = || {
            let mut drawn: Vec<f64> = (0..scenes).map(|_| all[random.usize(..scenes)]).collect();
            quantile(&mut drawn, 0.5)
        };
        let mut medians: Vec<f64> = (0..DRAWS).map(|_| draw()).collect();
        let [low, high] = [0.025, 0.975].map(|share| quantile(&mut medians, share));
        Self { median: quantile(&mut all, 0.5), method, metric, scenes, low, high }
    }

    /// Label of the change if it exceeds the `spread` of all times. A time in a single scene has
    /// none,
    /// because it has no confidence interval.
    fn word(&self, nature: Nature, better: Better, spread: f64) -> Option<&'static str> {
        let is_time = nature != Nature::Exact;
        let least = if is_time { spread.max(LEAST_TIME) } else { LEAST };
        let sure = self.low > 1.0 || self.high < 1.0;
        if !sure || (self.median - 1.0).abs() < least || is_time && self.scenes < 3 {
            return None;
        }
        let grew = self.median > 1.0;
        Some(match (is_time, better) {
            (_, Better::Neither) => "other, neither better nor worse by its name",
            (true, Better::Less) if grew => "SLOWER",
            (true, Better::More) if !grew => "SLOWER",
            (true, _) => "faster",
            (false, Better::Less) if grew => "LESS ACCURATE",
            (false, Better::More) if !grew => "LESS ACCURATE",
            (false, _) => "more accurate",
        })
    }
}

/// Reports methods that joined or left a Pareto front by more than [`Chart::SPREAD`].
fn charts(text: &mut String, old: &[Chart], new: &[Chart]) {
    for chart in new {
        let Some(before) = old.iter().find(|other| other.title == chart.title) else { continue };
        let [was, is] = [before, chart].map(Chart::on_front);
        let left = was.iter().filter(|name| !chart.near_front(name));
        let joined = is.iter().filter(|name| !before.near_front(name));
        let changed: Vec<String> =
            left.map(|name| format!("{name} left")).chain(joined.map(|name| format!("{name} joined"))).collect();
        if !changed.is_empty() {
            _ = writeln!(text, "  front of {:?}: {}", chart.title, changed.join(", "));
        }
    }
}

fn maps(text: &mut String, old: &[Map], new: &[Map]) {
    let (mut same, mut changed) = (0, Vec::new());
    for map in new {
        let Some(before) = old.iter().find(|other| other.title == map.title) else { continue };
        for (row, column, cell) in map.named_cells() {
            match before.cell(row, column) {
                Some(was) if was.grade() != cell.grade() => changed.push(describe_change(map, row, column, was, cell)),
                Some(_) => same += 1,
                None => {}
            }
        }
    }
    if same + changed.len() > 0 {
        _ = writeln!(text, "  {same} cells of maps with the same verdict, {} with another", changed.len());
    }
    changed.iter().for_each(|line| _ = writeln!(text, "    {line}"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::Scope;
    use crate::report::Making;
    use crate::suite::{Findings, Gate};

    fn report(us: impl Fn(usize) -> f64, error: f64, limit: f64) -> Report {
        let row = |n| {
            Row::new(format!("scene {n}"), ["a", "b", "c"][n / 10])
                .metric("tick_p50_us", us(n))
                .metric("depth_error_mm", error)
        };
        let findings = Findings {
            rows: (0..30).map(row).collect(),
            gates: vec![Gate::at_most("depth", error, limit)],
            ..Findings::default()
        };
        let making = Making::here(Scope { quick: true, seed: 1 });
        Report { suite: "s".into(), command: String::new(), making, elsewhere: BTreeMap::new(), findings }
    }

    #[test]
    fn a_slower_method_is_reported_and_a_slower_machine_is_not_attributed_to_methods() {
        let wobble = |n: usize| 1.0 + 0.01 * (n as f64 * 1.7).sin();
        let old = report(wobble, 0.1, 0.2);
        let slower_machine = reports(&old, &report(|n| 1.5 * wobble(n + 3), 0.1, 0.2));
        assert!(slower_machine.contains("1.5") && !slower_machine.contains("SLOWER"), "{slower_machine}");
        let slower_b =
            reports(&old, &report(|n| wobble(n + 3) * if (10..20).contains(&n) { 1.3 } else { 1.0 }, 0.1, 0.2));
        assert!(slower_b.contains("SLOWER") && slower_b.contains("b, tick_p50_us"), "{slower_b}");
        assert!(slower_b.contains("1 acceptance limits in both, 0 with another verdict"));
    }

    #[test]
    fn rows_of_one_name_are_distinguished_by_their_order() {
        let row = |mm: f64| Row::new("s", "m").with("stiffness", mm + 0.5).metric("depth_error_mm", mm);
        let rows: Vec<Row> = (1..5).map(|n| row(f64::from(n))).collect();
        assert_eq!(ratios(&rows, &rows)[&("m".to_string(), "depth_error_mm".to_string())], [1.0; 4]);
    }

    #[test]
    fn a_grown_error_and_a_broken_limit_are_reported() {
        let [old, new] = [0.1, 0.3].map(|error| report(|_| 1.0, error, 0.2));
        let text = reports(&old, &new);
        assert!(text.contains("LESS ACCURATE") && text.contains("NOW BROKEN: depth"), "{text}");
        assert!(reports(&new, &old).contains("more accurate"));
        assert!(!reports(&old, &old).contains("ACCURATE"));
    }

    #[test]
    fn rows_of_one_run_only_and_values_that_are_not_numbers_are_reported() {
        let (old, mut new) = (report(|_| 1.0, 0.1, 0.2), report(|_| 1.0, f64::NAN, 0.2));
        new.findings.gates.push(Gate::at_most("time", 1.0, 2.0));
        new.findings.rows.retain(|row| row.method != "c");
        let text = reports(&old, &new);
        assert!(text.contains("NO NUMBER in one of the runs") && !text.contains("more accurate"), "{text}");
        assert!(text.contains("  1 acceptance limits ONLY IN THE new run: time"), "{text}");
        let lacking = "  10 rows of methods ONLY IN THE old run: c in scene 20, c in scene 21, c in scene 22, ...";
        assert!(text.contains(lacking), "{text}");
        assert!(!reports(&new, &new).contains("NO NUMBER") && !reports(&new, &new).contains("ONLY"));
    }

    #[test]
    fn a_value_lost_in_one_scene_is_reported_and_one_missing_in_both_runs_is_no_change() {
        let (old, mut new) = (report(|_| 1.0, 0.1, 0.2), report(|_| 1.0, 0.1, 0.2));
        new.findings.rows[3].metrics.insert("depth_error_mm".into(), f64::NAN);
        for text in [reports(&old, &new), reports(&new, &old)] {
            assert!(text.contains("NO NUMBER") && text.contains("a, depth_error_mm: xNaN [NaN, NaN] over 1 scene(s)"));
        }
        let slower = |slow: f64| {
            let mut report = report(|_| slow, 0.1, 0.2);
            report.findings.rows.iter_mut().for_each(|row| _ = row.metrics.insert("mesh_s".into(), f64::NAN));
            report
        };
        assert!(!reports(&slower(1.0), &slower(1.5)).contains("mesh_s"), "no machine is slower at no number");
    }

    #[test]
    fn a_time_within_the_spread_of_all_times_is_no_change() {
        let change = Change { median: 1.1, low: 1.08, high: 1.12, ..Change::of("a".into(), "us".into(), vec![1.1; 9]) };
        let word = |spread| change.word(Nature::Time, Better::Less, spread);
        assert_eq!((word(0.02), word(0.2)), (Some("SLOWER"), None));
    }

    #[test]
    fn rates_of_a_slower_machine_are_not_attributed_to_methods() {
        let of = |speed: f64| {
            let mut report = report(|n| (1.0 + 0.01 * (n as f64).sin()) / speed, 0.1, 0.2);
            report.findings.rows.iter_mut().for_each(|row| _ = row.metrics.insert("frames_per_s".into(), 30.0 * speed));
            report
        };
        let text = reports(&of(1.0), &of(0.5));
        assert!(!text.contains("SLOWER") && !text.contains("faster"), "{text}");
    }

    #[test]
    fn times_and_errors_are_distinguished_by_name() {
        assert_eq!(kind("error_over_tolerance"), (Nature::Exact, Better::Less));
        assert_eq!(kind("error_over_motion"), (Nature::Exact, Better::Less));
        assert_eq!(kind("cpu_s_per_s"), (Nature::Time, Better::Less));
        assert_eq!(kind("solver_cpu_s_per_s"), (Nature::Time, Better::Less));
        assert_eq!(kind("ns_per_tetrahedron"), (Nature::Time, Better::Less));
        assert_eq!(kind("late_ticks"), (Nature::OfTimes, Better::Neither));
        assert_eq!(kind("tick_p50_us"), (Nature::Time, Better::Less));
        assert_eq!(kind("time_to_rest_ms"), (Nature::Time, Better::Less));
        assert_eq!(kind("call_spread_percent"), (Nature::OfTimes, Better::Neither));
        assert_eq!(kind("lead_p50_ms"), (Nature::Exact, Better::Neither));
        assert_eq!(kind("frames_per_s"), (Nature::Time, Better::More));
        assert_eq!(kind("depth_error_p95_mm"), (Nature::Exact, Better::Less));
    }
}
