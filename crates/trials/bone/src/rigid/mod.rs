//! Collision and force methods on voxel bone: accuracy, cost, removal by a burr, and failure cases.
//!
//! # Practice
//! Scenes are bone with a closed form and the thesis's cubes and skulls. Each subject has one file
//! that adds its rows, charts, maps and gates. Every method of `Method::all` is in all of them,
//! unless its cost forbids it (the oracle); then its rows are missing.

mod accuracy;
pub mod bones;
mod clearance;
pub mod coupling;
mod energy;
mod faults;
mod hands;
pub mod models;
mod order;
mod published;
pub mod recording;
mod removal;
mod rivals;
mod soak;
pub mod solid;
pub mod walls;

pub use bones::head;
pub use recording::record_all;

use trepan_evidence::part::{Part, Scope};
use trepan_evidence::picture::{Chart, Map, Mark};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_rigid::Method;

/// Stiffness that converts depths to forces, N/mm: the thesis's.
pub const STIFFNESS: f32 = 2.0;
/// Time limit of a tick at 1 kHz, µs.
const BUDGET_US: f64 = 1000.0;

/// Lists the parts of every subject.
pub fn parts(scope: Scope) -> Vec<Part> {
    let mut parts = accuracy::parts();
    parts.extend(models::parts(scope));
    parts.extend(order::parts());
    parts.extend(hands::parts(scope));
    parts.extend(removal::parts(scope));
    parts.push(Part::new("faults", |_, findings| faults::run(findings)));
    parts.extend(walls::parts(scope));
    parts.extend(coupling::parts());
    parts.extend(energy::parts());
    parts.extend(rivals::parts());
    parts
}

/// Adds charts and gates over all methods.
pub fn judge(_: Scope, findings: &mut Findings) {
    accuracy::judge(findings);
    models::judge(findings);
    order::judge(findings);
    hands::judge(findings);
    removal::judge(findings);
    rivals::judge(findings);
}

/// A group's chart with each method's worst cost and worst error over the group's scenes. `gated`
/// adds a gate that the recommended method is on its Pareto front.
fn worst_chart(findings: &mut Findings, group: &str, title: &str, metrics: (&str, &str), gated: bool) -> Option<Chart> {
    let mut marks: Vec<Mark> = Vec::new();
    for row in findings.rows.iter().filter(|row| row.config.get("group").is_some_and(|g| g == group)) {
        let (Some(&cost), Some(&error)) = (row.metrics.get(metrics.0), row.metrics.get(metrics.1)) else { continue };
        // A method that never touched has no finite cost or error.
        if !cost.is_finite() || !error.is_finite() {
            continue;
        }
        match marks.iter_mut().find(|mark| mark.method == row.method) {
            Some(mark) => (mark.cost, mark.error) = (mark.cost.max(cost), mark.error.max(error)),
            None => marks.push(Mark { method: row.method.clone(), cost, error }),
        }
    }
    let name = Method::RECOMMENDED.name();
    let chart = Chart {
        title: title.into(),
        cost: metrics.0.into(),
        error: metrics.1.into(),
        marks,
        budget: Some((BUDGET_US, "1 kHz".into())),
        chosen: Some(name.into()),
    };
    let drawn = !chart.marks.is_empty();
    if drawn && gated {
        let beaten = chart.beaten(name) as f64;
        findings.gates.push(Gate::at_most(format!("{group}: methods that beat {name} in both"), beaten, 0.0));
    }
    drawn.then_some(chart)
}

/// Adds the number of a map's cells of each grade to a row.
fn passes(row: Row, map: &Map) -> Row {
    let count = |grade: u8| map.cells.iter().flatten().filter(|cell| cell.grade() == grade).count() as f64;
    row.metric("works_count", count(0)).metric("degrades_count", count(1)).metric("fails_count", count(2))
}

/// The map, its title marked if it is the recommended method's.
fn map_of(method: &Method, map: Map) -> Map {
    let recommended = *method == Method::RECOMMENDED && map.title.starts_with(method.name());
    let title = if recommended { format!("{} (recommended)", map.title) } else { map.title };
    Map { title, ..map }
}
