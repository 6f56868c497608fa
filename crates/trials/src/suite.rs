//! Findings of a suite: rows of metrics, gates, charts and maps.
//!
//! # Practice
//! A metric's name ends in its unit (`depth_error_voxel`, `step_us`). A gate never depends on an
//! absolute time: times belong in charts, as ratios within one run.

use crate::picture::{Chart, Map as StabilityMap};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Measurements of one method in one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Scene name.
    pub scene: String,
    /// Method name.
    pub method: String,
    /// Part of the suite that made the row.
    #[serde(default)]
    pub part: String,
    /// Settings by name.
    pub config: Map<String, Value>,
    /// Measured values by name with unit; `null` in a file means NaN.
    #[serde(deserialize_with = "numbers")]
    pub metrics: BTreeMap<String, f64>,
}

/// Reads metrics; JSON has no NaN and no infinity, so `null` stands for both.
fn numbers<'de, D: serde::Deserializer<'de>>(from: D) -> Result<BTreeMap<String, f64>, D::Error> {
    let read = BTreeMap::<String, Option<f64>>::deserialize(from)?;
    Ok(read.into_iter().map(|(name, value)| (name, value.unwrap_or(f64::NAN))).collect())
}

impl Row {
    /// Creates a row without metrics.
    pub fn new(scene: impl Into<String>, method: impl Into<String>) -> Self {
        let (scene, method) = (scene.into(), method.into());
        Self { scene, method, part: String::new(), config: Map::new(), metrics: BTreeMap::new() }
    }

    /// Adds a setting.
    pub fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.config.insert(name.into(), value.into());
        self
    }

    /// Adds a metric.
    pub fn metric(mut self, name: &str, value: f64) -> Self {
        self.metrics.insert(name.into(), value);
        self
    }

    /// Reads a setting that is a list of numbers.
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        let list = self.config.get(name).and_then(Value::as_array);
        list.into_iter().flatten().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect()
    }
}

/// Allowed side of a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// Up to the limit.
    #[serde(rename = "<=")]
    AtMost,
    /// From the limit on.
    #[serde(rename = ">=")]
    AtLeast,
}

impl std::fmt::Display for Side {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(if *self == Self::AtMost { "<=" } else { ">=" })
    }
}

/// Acceptance limit on a measured value, and whether it is met.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gate {
    /// Description of the limited quantity.
    pub name: String,
    /// Measured value; `null` in a file means NaN.
    #[serde(deserialize_with = "number")]
    pub value: f64,
    /// Limit.
    pub limit: f64,
    /// Allowed side of the limit.
    pub op: Side,
    /// Whether the limit is met.
    pub pass: bool,
}

/// Reads a number; `null` means NaN.
pub(crate) fn number<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

impl Gate {
    /// Creates a gate on a value that must not exceed a limit. A NaN fails.
    pub fn at_most(name: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { name: name.into(), value, limit, op: Side::AtMost, pass: value <= limit }
    }

    /// Creates a gate on a value that must reach a limit. A NaN fails.
    pub fn at_least(name: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { name: name.into(), value, limit, op: Side::AtLeast, pass: value >= limit }
    }
}

/// Formats a number with four significant digits.
pub fn shown(value: f64) -> String {
    match value.abs() {
        small if small > 0.0 && small < 0.01 => format!("{value:.3e}"),
        _ => format!("{value:.4}"),
    }
}

/// Results of a part, or of all parts of a suite.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// Rows of every method in every scene.
    pub rows: Vec<Row>,
    /// All acceptance limits.
    pub gates: Vec<Gate>,
    /// Charts for the page; if empty, the page draws the suite's default chart.
    pub charts: Vec<Chart>,
    /// Maps for the page.
    pub maps: Vec<StabilityMap>,
    /// Names of map cells that are worse than the kept boundary.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regressions: Vec<String>,
}

impl Findings {
    /// Appends another part's findings.
    pub fn append(&mut self, mut other: Self) {
        self.rows.append(&mut other.rows);
        self.gates.append(&mut other.gates);
        self.charts.append(&mut other.charts);
        self.maps.append(&mut other.maps);
        self.regressions.append(&mut other.regressions);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_numbers_keep_significant_digits() {
        assert_eq!([0.0, 0.5, -3.25e-5, 1234.5].map(shown), ["0.0000", "0.5000", "-3.250e-5", "1234.5000"]);
    }

    #[test]
    fn a_gate_on_a_nan_fails_and_findings_survive_a_file() {
        assert!(!Gate::at_most("x", f64::NAN, 1.0).pass && !Gate::at_least("x", f64::NAN, 1.0).pass);
        let row = Row::new("plane", "thesis").with("points", 466).metric("depth_error_voxel", 0.1);
        let row = row.with("cells_mm", vec![1.0, 2.5]).metric("no_number", f64::INFINITY);
        assert_eq!(row.numbers("cells_mm"), [1.0, 2.5]);
        let findings =
            Findings { rows: vec![row], gates: vec![Gate::at_most("depth", 0.1, 0.05)], ..Findings::default() };
        let back: Findings = serde_json::from_str(&serde_json::to_string(&findings).unwrap()).unwrap();
        assert!(back.rows[0].metrics["no_number"].is_nan());
        assert_eq!((back.gates, back.rows[0].config.clone()), (findings.gates, findings.rows[0].config.clone()));
    }
}
