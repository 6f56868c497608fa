//! Register of acceptance limits: source, history and known gaps of every limit of a suite.
//!
//! # Practice
//! `limits/SUITE.toml` in the sources has one entry for each limit. A measured limit without an
//! entry, or with another value than its entry's, breaks the run. No entry may be wider than any
//! value in its own history, so a limit that was once set can only be tightened. A missed limit
//! whose entry has a gap for this kind of run is a known gap: it is printed with its value and does
//! not break the run, unless it is worse than the gap's `known` value.
//!
//! `gate` is the limit's name with `*` for any text; the entry with the most literal characters
//! applies.

use crate::part::Scope;
use crate::picture::Table;
use crate::suite::{Findings, Gate, Side, shown};
use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name of the limit on the register itself.
const OWN: &str = "limits that the register lacks or has with another value";
/// Register of the limits that every suite has.
const COMMON: &str = "every-suite";

/// Register of one suite.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Register {
    /// Entries, in the order of the file.
    #[serde(default, rename = "limit")]
    pub limits: Vec<Limit>,
}

/// Entry of one limit.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    /// Name of the limit, with `*` for any text.
    pub gate: String,
    /// Allowed side.
    pub side: Side,
    /// Value that holds.
    pub limit: f64,
    /// Where the value comes from: a goal of this project, a paper, a data sheet, a definition.
    pub source: String,
    /// All values that it has had, oldest first.
    pub history: Vec<Change>,
    /// Runs in which it is known to be missed.
    #[serde(default)]
    pub gaps: Vec<Gap>,
}

/// A value that a limit has had.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// Day, as year-month-day.
    pub date: String,
    /// Value from that day on.
    pub limit: f64,
    /// Reason for the change.
    pub why: String,
}

/// Known gap: how far a limit is missed, and in which kind of run.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gap {
    /// Kind of run: `quick`, `full` or `both`.
    pub run: Run,
    /// Value beyond which the run breaks all the same; NaN where no number can be measured.
    pub known: f64,
    /// Day of the measurement, as year-month-day.
    pub date: String,
    /// Cause, and what would close the gap.
    pub why: String,
}

/// Kind of run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Run {
    /// Quick runs.
    Quick,
    /// Full runs.
    Full,
    /// Every run.
    Both,
}

/// Path of a suite's register.
fn place(suite: &str) -> PathBuf {
    let sources = || Path::new(env!("CARGO_MANIFEST_DIR")).join("limits");
    trepan_fixtures::beside_program("limits").unwrap_or_else(sources).join(format!("{suite}.toml"))
}

/// Whether a value is on the allowed side of a limit.
fn within(side: Side, value: f64, limit: f64) -> bool {
    match side {
        Side::AtMost => value <= limit,
        Side::AtLeast => value >= limit,
    }
}

impl Register {
    /// Reads the register of a suite and what all suites share; an absent file is an empty one. An
    /// entry of the suite's own, with its own known gaps, stands for the shared one of that name.
    pub fn of(suite: &str) -> Result<Self> {
        let mut limits = Self::read(suite)?.limits;
        let mut shared = Self::read(COMMON)?.limits;
        shared.retain(|common| !limits.iter().any(|own| own.gate == common.gate && own.side == common.side));
        limits.extend(shared);
        Ok(Self { limits })
    }

    fn read(name: &str) -> Result<Self> {
        let file = place(name);
        match std::fs::read_to_string(&file) {
            Ok(text) => toml::from_str(&text).with_context(|| format!("register of limits {}", file.display())),
            Err(fault) if fault.kind() == std::io::ErrorKind::NotFound => Ok(Self::default()),
            Err(fault) => Err(fault).with_context(|| format!("cannot read {}", file.display())),
        }
    }

    /// Entry of a limit: among those that fit its name, the one with the most literal characters.
    pub fn entry(&self, gate: &Gate) -> Option<&Limit> {
        let fits = self.limits.iter().filter(|limit| limit.side == gate.op && fits(&limit.gate, &gate.name));
        fits.max_by_key(|limit| limit.gate.chars().filter(|c| *c != '*').count())
    }

    /// Marks known gaps among missed limits, and returns what the register lacks or has otherwise.
    fn mark(&self, scope: Scope, gates: &mut [Gate]) -> Vec<String> {
        let mut unknown = Vec::new();
        for gate in gates {
            match self.entry(gate) {
                None => unknown.push(format!("NO ENTRY in the register of limits: {}", gate.name)),
                Some(entry) if !same(entry.limit, gate.limit) => unknown.push(format!(
                    "OTHER LIMIT than the register's {}: {} {} {}",
                    entry.limit, gate.name, gate.op, gate.limit
                )),
                Some(entry) => gate.known_gap = !gate.pass && entry.gap(scope).is_some_and(|gap| gap.holds(gate)),
            }
        }
        unknown
    }
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs())
}

impl Limit {
    /// Gap in this kind of run.
    fn gap(&self, scope: Scope) -> Option<&Gap> {
        self.gaps.iter().find(|gap| gap.run == Run::Both || (gap.run == Run::Quick) == scope.quick)
    }
}

impl Gap {
    fn holds(&self, gate: &Gate) -> bool {
        self.known.is_nan() || within(gate.op, gate.value, self.known)
    }
}

/// Whether a name fits a pattern in which `*` stands for any text.
fn fits(pattern: &str, name: &str) -> bool {
    let mut pieces = pattern.split('*');
    let Some(mut rest) = pieces.next().and_then(|first| name.strip_prefix(first)) else { return false };
    let mut last = None;
    for piece in pieces {
        if let Some(middle) = last.replace(piece) {
            let Some((_, after)) = rest.split_once(middle) else { return false };
            rest = after;
        }
    }
    last.map_or(rest.is_empty(), |end| rest.ends_with(end))
}

/// Missed limit that the register knows of.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KnownGap {
    /// Name of the suite.
    pub suite: String,
    /// The missed limit.
    pub gate: Gate,
    /// Day since when the gap is known, as year-month-day.
    pub since: String,
    /// Cause, and what would close the gap.
    pub why: String,
}

impl std::fmt::Display for KnownGap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Gate { name, value, op, limit, .. } = &self.gate;
        write!(f, "{}: {name}: {}, allowed {op} {limit} ({}: {})", self.suite, shown(*value), self.since, self.why)
    }
}

/// Known gaps of a suite's report.
pub fn known_gaps(suite: &str, scope: Scope, gates: &[Gate]) -> Vec<KnownGap> {
    let register = Register::of(suite).unwrap_or_default();
    let known = |gate: &Gate| {
        let gap = register.entry(gate)?.gap(scope)?;
        let (since, why) = (gap.date.clone(), gap.why.clone());
        Some(KnownGap { suite: suite.into(), gate: gate.clone(), since, why })
    };
    gates.iter().filter(|gate| gate.known_gap).filter_map(known).collect()
}

/// Marks the known gaps among a part's limits.
pub fn mark(suite: &str, scope: Scope, gates: &mut [Gate]) {
    if let Ok(register) = Register::of(suite) {
        register.mark(scope, gates);
    }
}

/// Marks the known gaps of a suite and adds a limit on what the register lacks.
pub fn judge(suite: &str, scope: Scope, findings: &mut Findings) {
    let register = Register::of(suite);
    let unknown = match &register {
        Ok(register) => register.mark(scope, &mut findings.gates),
        Err(fault) => vec![format!("{fault:#}")],
    };
    findings.gates.push(Gate::at_most(OWN, unknown.len() as f64, 0.0));
    findings.regressions.extend(unknown);
    if let Ok(register) = &register {
        findings.tables.push(table(register, &findings.gates));
    }
}

/// Table of a register: worst measured value, limit, source, history and gaps of each entry.
fn table(register: &Register, gates: &[Gate]) -> Table {
    let row = |limit: &Limit| {
        let own = gates.iter().filter(|gate| register.entry(gate) == Some(limit));
        let worst = own.map(|gate| gate.value).reduce(|a, b| if within(limit.side, a, b) { b } else { a });
        let history = limit.history.iter().map(|was| format!("{}: {} ({})", was.date, was.limit, was.why));
        let gaps = limit.gaps.iter().map(|gap| format!("{}: up to {} ({})", gap.date, gap.known, gap.why));
        vec![
            limit.gate.clone(),
            worst.map_or("not in this run".into(), shown),
            format!("{} {}", limit.side, limit.limit),
            limit.source.clone(),
            history.collect::<Vec<_>>().join("; "),
            gaps.collect::<Vec<_>>().join("; "),
        ]
    };
    Table {
        title: "Acceptance limits, their sources and their history".into(),
        columns: ["limit", "worst measured", "allowed", "source", "history", "known gaps"].map(String::from).into(),
        rows: register.limits.iter().map(row).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn no_limit_is_wider_than_its_history_and_every_entry_has_a_source() {
        let files = std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("limits")).unwrap();
        let suites = files.map(|file| file.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned());
        for suite in suites {
            let register = Register::read(&suite).unwrap();
            let mut names = BTreeSet::new();
            for limit in &register.limits {
                let name = format!("{suite}: {}", limit.gate);
                assert!(!limit.source.is_empty() && !limit.history.is_empty(), "{name} lacks source or history");
                let dates: Vec<&str> = limit.history.iter().map(|was| was.date.as_str()).collect();
                assert!(dates.is_sorted(), "{name}: history in the order of time");
                assert!(limit.history.iter().all(|was| was.date.len() == 10 && !was.why.is_empty()), "{name}");
                assert_eq!(limit.history.last().map(|was| was.limit), Some(limit.limit), "{name}");
                for was in &limit.history {
                    assert!(within(limit.side, limit.limit, was.limit), "{name} is wider than it was on {}", was.date);
                }
                for gap in &limit.gaps {
                    assert!(!gap.why.is_empty() && !within(limit.side, gap.known, limit.limit), "{name}: gap");
                }
                assert!(names.insert((limit.gate.clone(), limit.side.to_string())), "{name} is there twice");
            }
        }
    }

    #[test]
    fn names_fit_patterns() {
        for (pattern, name, expected) in [
            ("depth", "depth", true),
            ("depth", "depths", false),
            ("*: depth", "box: depth", true),
            ("cube *, path *: jump", "cube 7, path a: b: jump", true),
            ("a*b*c", "abxbc", true),
            ("a*b*c", "ac", false),
            ("*", "", true),
        ] {
            assert_eq!(fits(pattern, name), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn a_miss_is_a_known_gap_only_in_its_run_and_up_to_its_value() {
        let text = r#"
            [[limit]]
            gate = "*: error"
            side = "<="
            limit = 1.0
            source = "goal"
            history = [{ date = "2026-11-21", limit = 1.0, why = "set" }]
            gaps = [{ run = "full", known = 1.5, date = "2026-11-26", why = "coarse mesh" }]
        "#;
        let register: Register = toml::from_str(text).unwrap();
        let marked = |value: f64, quick: bool| {
            let mut gates = [Gate::at_most("a: error", value, 1.0)];
            assert!(register.mark(Scope { quick, seed: 1 }, &mut gates).is_empty());
            (gates[0].known_gap, gates[0].breaks())
        };
        assert_eq!(marked(0.5, false), (false, false));
        assert_eq!(marked(1.4, false), (true, false));
        assert_eq!(marked(1.6, false), (false, true));
        assert_eq!(marked(1.4, true), (false, true));
        assert_eq!(marked(f64::NAN, false), (false, true));
        let mut others = [Gate::at_most("a: error", 0.5, 2.0), Gate::at_most("b", 0.5, 1.0)];
        assert_eq!(register.mark(Scope { quick: true, seed: 1 }, &mut others).len(), 2);
    }
}
