//! The simulators: warnings before breaches, scores that tell hands apart, flaps, replays, tumours
//! that are felt and taken away, long sessions.

mod bench;
mod brain;
mod flap;
mod hands;
mod holes;
mod rates;
pub mod readers;
mod resection;
mod sessions;

use anyhow::Result;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_trials_scenes::case;

/// Length of the long session, minutes.
const LONG_MIN: f64 = 30.0;

/// Every part; one that could not be run misses its limit.
pub fn parts(scope: Scope) -> Vec<Part> {
    let mut parts = holes::parts(scope);
    type OnTheCase = fn(&case::CaseFixture) -> Findings;
    let on_the_table: [(&str, OnTheCase); 3] =
        [("hands", hands::findings), ("rates", rates::findings), ("flap", flap::findings)];
    parts.extend(
        on_the_table.map(|(name, found)| tried(name, move |_| case::CaseFixture::new().map(|table| found(&table)))),
    );
    parts.push(tried("brain", |_| brain::findings()));
    parts.push(tried("resection", resection::findings));
    parts.push(tried("replays", sessions::replays));
    if !scope.quick {
        parts.push(tried("long session", |_| sessions::soak(LONG_MIN)));
    }
    parts
}

/// The acceptance limits over all holes.
pub fn judge(_: Scope, findings: &mut Findings) {
    holes::judge(findings);
}

fn tried(name: &'static str, part: impl FnOnce(Scope) -> Result<Findings> + 'static) -> Part {
    Part::new(name, move |scope, findings| match part(scope) {
        Ok(found) => findings.append(found),
        Err(fault) => {
            findings.rows.push(Row::new(name, "not run").with("fault", format!("{fault:#}")));
            findings.gates.push(Gate::at_least(format!("{name}: runs"), 0.0, 1.0));
        }
    })
}
