//! What a suite produces: rows of metrics, gates, and one JSON file.
//!
//! # Practice
//! A metric's name ends in its unit (`depth_error_voxel`, `step_us`). A gate never hangs on an absolute time: times belong to charts,
//! as ratios in one run.

use crate::picture::{self, Chart};
use serde::Serialize;
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// One method in one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The scene.
    pub scene: String,
    /// The method.
    pub method: String,
    /// What was set, by name.
    pub config: Map<String, Value>,
    /// What was measured, by name with unit.
    pub metrics: BTreeMap<String, f64>,
}

impl Row {
    /// A row without metrics.
    pub fn new(scene: impl Into<String>, method: impl Into<String>) -> Self {
        Self { scene: scene.into(), method: method.into(), config: Map::new(), metrics: BTreeMap::new() }
    }

    /// With one more setting.
    pub fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.config.insert(name.into(), value.into());
        self
    }

    /// With one more metric.
    pub fn metric(mut self, name: &str, value: f64) -> Self {
        self.metrics.insert(name.into(), value);
        self
    }
}

/// A promise, and whether it was kept.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Gate {
    /// What is promised.
    pub name: String,
    /// What was found.
    pub value: f64,
    /// What is allowed.
    pub limit: f64,
    /// `<=` or `>=`.
    pub op: &'static str,
    /// Whether it was kept.
    pub pass: bool,
}

impl Gate {
    /// A value that must not be over a limit. A NaN fails.
    pub fn at_most(name: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { name: name.into(), value, limit, op: "<=", pass: value <= limit }
    }

    /// A value that must not be under a limit. A NaN fails.
    pub fn at_least(name: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { name: name.into(), value, limit, op: ">=", pass: value >= limit }
    }
}

/// A number for people: four digits that say something, however small it is.
pub fn shown(value: f64) -> String {
    match value.abs() {
        small if small > 0.0 && small < 0.01 => format!("{value:.3e}"),
        _ => format!("{value:.4}"),
    }
}

/// What a suite found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Findings {
    /// Every method in every scene.
    pub rows: Vec<Row>,
    /// Every promise.
    pub gates: Vec<Gate>,
    /// Charts for the page; without any it draws the suite's own over all rows.
    #[serde(skip)]
    pub charts: Vec<Chart>,
    /// Maps for the page.
    #[serde(skip)]
    pub maps: Vec<picture::Map>,
}

/// The whole file of a suite.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Name of the suite.
    pub suite: String,
    /// Commit of the sources, or `unknown`.
    pub commit: String,
    /// The machine, by name.
    pub machine: BTreeMap<String, String>,
    /// What was found.
    #[serde(flatten)]
    pub findings: Findings,
}

impl Report {
    /// A report from here and now.
    pub fn new(suite: &str, findings: Findings) -> Self {
        Self { suite: suite.into(), commit: commit(), machine: machine(), findings }
    }

    /// Whether every promise was kept.
    pub fn passed(&self) -> bool {
        self.findings.gates.iter().all(|gate| gate.pass)
    }
}

fn commit() -> String {
    let out = std::process::Command::new("git").args(["describe", "--always", "--dirty", "--abbrev=12"]).output();
    let said =
        out.ok().filter(|out| out.status.success()).map(|out| String::from_utf8_lossy(&out.stdout).trim().to_string());
    said.unwrap_or_else(|| "unknown".into())
}

fn machine() -> BTreeMap<String, String> {
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let cpu =
        cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':')).map(|(_, name)| name.trim());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    [
        ("cpu", cpu.unwrap_or("unknown").to_string()),
        ("cores", cores.to_string()),
        ("system", format!("{} {}", std::env::consts::OS, std::env::consts::ARCH)),
        ("profile", if cfg!(debug_assertions) { "dev" } else { "release" }.to_string()),
    ]
    .map(|(name, value)| (name.to_string(), value))
    .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_numbers_keep_their_digits() {
        assert_eq!([0.0, 0.5, -3.25e-5, 1234.5].map(shown), ["0.0000", "0.5000", "-3.250e-5", "1234.5000"]);
    }

    #[test]
    fn a_gate_on_a_nan_fails_and_the_file_has_the_stated_fields() {
        assert!(!Gate::at_most("x", f64::NAN, 1.0).pass && !Gate::at_least("x", f64::NAN, 1.0).pass);
        let row = Row::new("plane", "thesis").with("points", 466).metric("depth_error_voxel", 0.1);
        let findings =
            Findings { rows: vec![row], gates: vec![Gate::at_most("depth", 0.1, 0.05)], ..Findings::default() };
        let report = Report::new("rigid", findings);
        assert!(!report.passed());
        let json = serde_json::to_value(&report).unwrap();
        for field in [
            "/suite",
            "/commit",
            "/machine/cpu",
            "/rows/0/config/points",
            "/rows/0/metrics/depth_error_voxel",
            "/gates/0/op",
        ] {
            assert!(json.pointer(field).is_some(), "{field} is missing");
        }
    }
}
