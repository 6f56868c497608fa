//! Findings of a suite: rows of metrics, gates, charts and maps.
//!
//! # Practice
//! A metric's name ends in its unit (`depth_error_voxel`, `step_us`). A gate never depends on an
//! absolute time: times belong in charts, as ratios within one run.

use crate::picture::{Chart, Map as StabilityMap, Series, Snapshot, Table};
use crate::row::number;
pub use crate::row::{Row, shown};
use serde::{Deserialize, Serialize};

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
    /// Whether the register of limits knows that it is missed: printed with its value, no failure.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub known_gap: bool,
}

impl Gate {
    /// Creates a gate on a value that must not exceed a limit. A NaN fails.
    pub fn at_most(name: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { name: name.into(), value, limit, op: Side::AtMost, pass: value <= limit, known_gap: false }
    }

    /// Creates a gate on a value that must reach a limit. A NaN fails.
    pub fn at_least(name: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { name: name.into(), value, limit, op: Side::AtLeast, pass: value >= limit, known_gap: false }
    }

    /// Whether it fails a run: missed, and not known to be.
    pub fn breaks(&self) -> bool {
        !self.pass && !self.known_gap
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
    /// Tables for the page.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tables: Vec<Table>,
    /// Lines over frames for the page.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub series: Vec<Series>,
    /// Pictures for the page.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pictures: Vec<Snapshot>,
    /// Conclusions in words, for the page and the terminal.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub conclusions: Vec<String>,
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
        self.tables.append(&mut other.tables);
        self.series.append(&mut other.series);
        self.pictures.append(&mut other.pictures);
        self.conclusions.append(&mut other.conclusions);
        self.regressions.append(&mut other.regressions);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gate_on_a_nan_fails_and_findings_survive_a_file() {
        let missed = Gate::at_most("x", 2.0, 1.0);
        assert!(missed.breaks() && !Gate { known_gap: true, ..missed }.breaks());
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
