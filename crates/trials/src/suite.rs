//! What a suite finds: rows of metrics, gates, charts and maps.
//!
//! # Practice
//! A metric's name ends in its unit (`depth_error_voxel`, `step_us`). A gate never hangs on an
//! absolute time: times belong to charts, as ratios in one run.

use crate::picture::{Chart, Map as StabilityMap};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// One method in one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The scene.
    pub scene: String,
    /// The method.
    pub method: String,
    /// The part of the suite that made it.
    #[serde(default)]
    pub part: String,
    /// What was set, by name.
    pub config: Map<String, Value>,
    /// What was measured, by name with unit; `null` in a file is not a number.
    #[serde(deserialize_with = "numbers")]
    pub metrics: BTreeMap<String, f64>,
}

/// JSON has no NaN and no infinity: both are `null` there.
fn numbers<'de, D: serde::Deserializer<'de>>(from: D) -> Result<BTreeMap<String, f64>, D::Error> {
    let read = BTreeMap::<String, Option<f64>>::deserialize(from)?;
    Ok(read.into_iter().map(|(name, value)| (name, value.unwrap_or(f64::NAN))).collect())
}

impl Row {
    /// A row without metrics.
    pub fn new(scene: impl Into<String>, method: impl Into<String>) -> Self {
        let (scene, method) = (scene.into(), method.into());
        Self { scene, method, part: String::new(), config: Map::new(), metrics: BTreeMap::new() }
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

    /// A setting that is a list of numbers.
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        let list = self.config.get(name).and_then(Value::as_array);
        list.into_iter().flatten().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect()
    }
}

/// Which side of a limit is right.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// Not over it.
    #[serde(rename = "<=")]
    AtMost,
    /// Not under it.
    #[serde(rename = ">=")]
    AtLeast,
}

impl std::fmt::Display for Side {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(if *self == Self::AtMost { "<=" } else { ">=" })
    }
}

/// A promise, and whether it was kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gate {
    /// What is promised.
    pub name: String,
    /// What was found; `null` in a file is not a number.
    #[serde(deserialize_with = "number")]
    pub value: f64,
    /// What is allowed.
    pub limit: f64,
    /// On which side of the limit.
    pub op: Side,
    /// Whether it was kept.
    pub pass: bool,
}

/// A number; `null` is none.
pub(crate) fn number<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

impl Gate {
    /// A value that must not be over a limit. A NaN fails.
    pub fn at_most(name: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { name: name.into(), value, limit, op: Side::AtMost, pass: value <= limit }
    }

    /// A value that must not be under a limit. A NaN fails.
    pub fn at_least(name: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { name: name.into(), value, limit, op: Side::AtLeast, pass: value >= limit }
    }
}

/// A number for people: four digits that say something, however small it is.
pub fn shown(value: f64) -> String {
    match value.abs() {
        small if small > 0.0 && small < 0.01 => format!("{value:.3e}"),
        _ => format!("{value:.4}"),
    }
}

/// What a part, or all parts of a suite, found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// Every method in every scene.
    pub rows: Vec<Row>,
    /// Every promise.
    pub gates: Vec<Gate>,
    /// Charts for the page; without any it draws the suite's own over all rows.
    pub charts: Vec<Chart>,
    /// Maps for the page.
    pub maps: Vec<StabilityMap>,
    /// Cells of maps that are worse than the kept border, by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regressions: Vec<String>,
}

impl Findings {
    /// With another part's findings after these.
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
    fn small_numbers_keep_their_digits() {
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
