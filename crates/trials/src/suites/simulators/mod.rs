//! The simulators: warnings before breaches, scores that tell hands apart, flaps, replays, tumours that are felt, long sessions.

mod bench;
mod brain;
mod case;
mod flap;
mod hands;
mod holes;
mod rates;
pub mod readers;
mod sessions;

use super::Scope;
use crate::suite::{Findings, Gate, Row};
use anyhow::Result;

/// Length of the long session, minutes.
const LONG_MIN: f64 = 30.0;

/// Every part; one that could not be run is a broken promise.
pub fn run(scope: Scope) -> Findings {
    let mut findings = Findings::default();
    let mut add = |name: &str, part: Result<Findings>| match part {
        Ok(mut part) => {
            findings.rows.append(&mut part.rows);
            findings.gates.append(&mut part.gates);
        }
        Err(fault) => {
            findings.rows.push(Row::new(name, "not run").with("fault", format!("{fault:#}")));
            findings.gates.push(Gate::at_least(format!("{name}: runs"), 0.0, 1.0));
        }
    };
    if scope.takes(0) {
        add("holes", Ok(holes::findings(scope)));
    }
    if scope.takes(1) {
        match case::Table::new() {
            Ok(table) => {
                add("hands", Ok(hands::findings(&table)));
                add("rates", Ok(rates::findings(&table)));
                add("flap", Ok(flap::findings(&table)));
            }
            Err(fault) => add("the built-in case", Err(fault)),
        }
        add("the brain", brain::findings());
    }
    if scope.takes(2) {
        add("replays", sessions::replays(scope));
    }
    if scope.takes(3) && !scope.quick {
        add("long session", sessions::soak(LONG_MIN));
    }
    findings
}
