//! A row of metrics, and its numbers in files and in print.

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

/// Reads a number; `null` means NaN.
pub(crate) fn number<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

/// Formats a number with four significant digits.
pub fn shown(value: f64) -> String {
    match value.abs() {
        small if small > 0.0 && small < 0.01 => format!("{value:.3e}"),
        _ => format!("{value:.4}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_numbers_keep_significant_digits() {
        assert_eq!([0.0, 0.5, -3.25e-5, 1234.5].map(shown), ["0.0000", "0.5000", "-3.250e-5", "1234.5000"]);
    }
}
