//! Published measurements of tissue, bone, drilling and hands, as constants with their source.
//!
//! # Practice
//! Every table of `fixtures/measurements` is a module here, every key in it a constant: a [`Row`],
//! or a slice of rows for a curve. A physical constant of the program is written in terms of such a
//! row, so that it changes with the table, and [`Row::is_calibrated`] says whether something was
//! measured. Rows with [`Mark::Fit`] come from `cargo xtask calibrate`.
//!
//! ```
//! use trepan_measurements::{Mark, brain};
//!
//! let curve = brain::CORTEX_TENSION;
//! assert_eq!((curve[0].unit, curve[0].mark), ("kPa", Mark::Table));
//! assert!(curve.windows(2).all(|pair| pair[0].at < pair[1].at && pair[0].value < pair[1].value));
//! ```

/// Factor of a measured value of which no spread was published: a fifth, as for "inside" on the
/// page "Against measurement".
pub const NO_SPREAD: f64 = 1.2;
/// Factor of a value that nobody measured, and of a fit without an error.
pub const NOT_MEASURED: f64 = 2.0;

/// One measured value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Module and file that it stands in.
    pub table: &'static str,
    /// Name of the quantity.
    pub key: &'static str,
    /// Place on the abscissa of a curve, in the unit that `condition` names; else NaN.
    pub at: f64,
    /// The value, in `unit`.
    pub value: f64,
    /// Standard deviation in `unit`, NaN where none was given.
    pub spread: f64,
    /// Unit of value and spread; empty for a number without unit.
    pub unit: &'static str,
    /// Conditions of the measurement.
    pub condition: &'static str,
    /// Where the value was read.
    pub source: &'static str,
    /// How it was read there.
    pub mark: Mark,
}

/// How a value came into its table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// Read from a published table or data file.
    Table,
    /// Read from an abstract; the paper was not read.
    Abstract,
    /// As tabulated by a later author.
    Secondary,
    /// Derived from other rows by arithmetic.
    Derived,
    /// From memory, unchecked.
    Memory,
    /// Fitted to other rows by `cargo xtask calibrate`.
    Fit,
    /// Assumed: nothing measured was found.
    Uncalibrated,
}

impl Mark {
    /// The mark in one word, as in the tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Table => "table",
            Self::Abstract => "abstract",
            Self::Secondary => "secondary",
            Self::Derived => "derived",
            Self::Memory => "memory",
            Self::Fit => "fit",
            Self::Uncalibrated => "uncalibrated",
        }
    }
}

impl Row {
    /// The value as f32, in `unit`.
    pub const fn f32(&self) -> f32 {
        self.value as f32
    }

    /// Whether the value goes back to a measurement.
    pub const fn is_calibrated(&self) -> bool {
        !matches!(self.mark, Mark::Uncalibrated | Mark::Memory)
    }

    /// The name by which documents and faults refer to the row: `table/key`.
    pub fn name(&self) -> String {
        format!("{}/{}", self.table.replace('_', "-"), self.key)
    }

    /// Factor by which the value may be larger or smaller.
    ///
    /// One standard deviation where a spread was given, else [`NO_SPREAD`] for a measured value and
    /// [`NOT_MEASURED`] for any other.
    pub fn factor(&self) -> f64 {
        let share = self.relative_spread();
        match share.is_finite() {
            true => 1.0 + share,
            false if self.is_calibrated() && !matches!(self.mark, Mark::Fit) => NO_SPREAD,
            false => NOT_MEASURED,
        }
    }

    /// Spread as a share of the value; NaN where none was given.
    pub fn relative_spread(&self) -> f64 {
        self.spread / self.value.abs()
    }
}

/// The rows of `TABLE/KEY`; `None` if there is no such key.
pub fn find(name: &str) -> Option<&'static [Row]> {
    ALL.iter().copied().find(|rows| rows[0].name() == name)
}

include!(concat!(env!("OUT_DIR"), "/tables.rs"));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_is_found_by_its_name_and_has_a_unit_on_all_its_rows() {
        for rows in ALL {
            assert!(find(&rows[0].name()).is_some_and(|found| found[0].name() == rows[0].name()));
            assert!(rows.iter().all(|row| row.unit == rows[0].unit && row.value.is_finite()));
        }
        assert_eq!(find("brain/nothing"), None);
    }

    #[test]
    fn a_factor_comes_from_the_spread_else_from_what_kind_of_value_it_is() {
        let with = |spread, mark| Row { spread, value: -2.0, mark, ..brain::DENSITY }.factor();
        assert_eq!(with(0.5, Mark::Uncalibrated), 1.25);
        let factors = [Mark::Abstract, Mark::Memory, Mark::Fit].map(|mark| with(f64::NAN, mark));
        assert_eq!(factors, [NO_SPREAD, NOT_MEASURED, NOT_MEASURED]);
    }

    #[test]
    fn spreads_are_positive_and_curves_run_along_their_abscissa() {
        for rows in ALL {
            assert!(rows.iter().all(|row| row.spread.is_nan() || row.spread > 0.0), "{}", rows[0].name());
            let rises = rows.windows(2).all(|pair| pair[0].at < pair[1].at);
            assert!(rises || rows.len() == 1, "{}", rows[0].name());
        }
    }
}
