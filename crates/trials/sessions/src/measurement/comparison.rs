//! A published value beside ours, and whether ours lies inside its spread.
//!
//! # Theory
//! Inside is within one standard deviation of the published value; where none was published, within
//! [`NO_SPREAD`] of it. A value that took part in a fit is called fitted, any other predicted.

use serde_json::Value;
use trepan_evidence::suite::Row;
use trepan_measurements::Row as Measured;

/// Share of a value within which ours is inside where no spread was published.
pub const NO_SPREAD: f64 = 0.2;

/// How our value came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum How {
    /// The constants were fitted to this value, among others.
    Fitted,
    /// Nothing was fitted to it.
    Predicted,
}

impl How {
    /// The word on the page.
    pub fn name(self) -> &'static str {
        if self == Self::Fitted { "fitted" } else { "predicted" }
    }
}

/// A published value beside ours.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Row of the register, as `table/key`.
    pub name: String,
    /// What is compared, in words, with the condition.
    pub quantity: String,
    /// Unit of all three numbers.
    pub unit: String,
    /// The published value.
    pub measured: f64,
    /// Its standard deviation, NaN where none was published.
    pub spread: f64,
    /// This project's value.
    pub ours: f64,
    /// Fitted or predicted.
    pub how: How,
    /// Why ours is outside; empty where it is inside or nobody knows.
    pub why: String,
    /// Where the published value was read.
    pub source: String,
}

impl Comparison {
    /// Compares `ours`, in the row's unit, with a row of the register.
    pub fn of(row: &Measured, how: How, ours: f64) -> Self {
        let (name, quantity, unit) = (row.name(), row.condition.into(), row.unit.into());
        let (measured, spread, source) = (row.value, row.spread, format!("{} ({})", row.source, row.mark.name()));
        Self { name, quantity, unit, measured, spread, ours, how, why: String::new(), source }
    }

    /// Explains why ours is outside; kept only where it is.
    pub fn why(mut self, why: &str) -> Self {
        if !self.is_inside() {
            self.why = why.into();
        }
        self
    }

    /// Whether ours lies inside.
    pub fn is_inside(&self) -> bool {
        let room = if self.spread.is_nan() { NO_SPREAD * self.measured.abs() } else { self.spread };
        (self.ours - self.measured).abs() <= room
    }

    /// The row of findings that carries it.
    pub fn row(&self) -> Row {
        Row::new(&self.name, self.how.name())
            .with("quantity", self.quantity.as_str())
            .with("unit", self.unit.as_str())
            .with("why", self.why.as_str())
            .with("source", self.source.as_str())
            .metric("measured", self.measured)
            .metric("spread", self.spread)
            .metric("ours", self.ours)
    }

    /// The comparison that a row of findings carries; `None` for any other row.
    pub fn of_row(row: &Row) -> Option<Self> {
        let text = |name: &str| row.config.get(name).and_then(Value::as_str).map(String::from);
        let number = |name: &str| row.metrics.get(name).copied();
        Some(Self {
            name: row.scene.clone(),
            quantity: text("quantity")?,
            unit: text("unit")?,
            measured: number("measured")?,
            spread: number("spread")?,
            ours: number("ours")?,
            how: if row.method == How::Fitted.name() { How::Fitted } else { How::Predicted },
            why: text("why")?,
            source: text("source")?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(spread: f64, ours: f64) -> Comparison {
        let row = trepan_measurements::Row { spread, value: 10.0, ..trepan_measurements::brain::DENSITY };
        Comparison::of(&row, How::Predicted, ours).why("because")
    }

    #[test]
    fn inside_is_one_standard_deviation_or_a_fifth() {
        assert!(of(1.0, 10.9).is_inside() && !of(1.0, 11.1).is_inside());
        assert!(of(f64::NAN, 12.0).is_inside() && !of(f64::NAN, 7.9).is_inside() && !of(1.0, f64::NAN).is_inside());
        assert_eq!((of(1.0, 10.9).why.as_str(), of(1.0, 11.1).why.as_str()), ("", "because"));
    }

    #[test]
    fn a_row_of_findings_carries_all_of_it() {
        let there = of(1.0, 3.0);
        assert_eq!(Comparison::of_row(&there.row()), Some(there));
        assert_eq!(Comparison::of_row(&Row::new("a", "b")), None);
    }
}
