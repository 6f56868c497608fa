//! What a step, a session's solver and a picture cost on a graphics card, beside the processor and
//! the card's own floors.
//!
//! # Practice
//! `cargo xtask validate card` runs it here, and `cargo xtask bundle gpu` makes a folder that runs
//! it on a machine with nothing installed. A software driver makes small scenes only, for their
//! agreement: its times say nothing of a card, and no limit is judged by them.

mod floors;
mod pictures;
mod session;
mod step;

use trepan_evidence::part::{Part, Scope};
use trepan_evidence::picture::Table;
use trepan_evidence::suite::{Findings, Row, shown};
use trepan_gpu::{Gpu, Prefer};

/// A part's work on an open device.
type Work = fn(&Gpu, Scope, &mut Findings);

/// Every part.
pub fn parts(_: Scope) -> Vec<Part> {
    let all: [(&str, Work); 6] = [
        ("agreement", step::agreement),
        ("step", step::run),
        ("contact", step::contact),
        ("session", session::run),
        ("loss", session::loss),
        ("pictures", pictures::run),
    ];
    all.map(|(name, work)| part(name, work)).into()
}

/// Device beside processor and f64 reference, for other suites.
pub fn agreement(name: &str) -> Part {
    part(name, step::agreement)
}

fn part(name: &str, work: Work) -> Part {
    Part::new(name, move |scope, findings| match Gpu::open(Prefer::Hardware) {
        Ok(gpu) => work(&gpu, scope, findings),
        Err(fault) => println!("  no graphics device, so nothing is measured: {fault}"),
    })
}

/// A table for each part that has rows.
pub fn judge(_: Scope, findings: &mut Findings) {
    let mut tables: Vec<Table> = Vec::new();
    for row in &findings.rows {
        let columns = ["scene".into(), "by".into()].into_iter().chain(row.metrics.keys().cloned()).collect();
        let title = format!("{}: {}", row.part, row.metrics.keys().cloned().collect::<Vec<_>>().join(", "));
        let cells = [row.scene.clone(), row.method.clone()].into_iter().chain(row.metrics.values().map(|v| shown(*v)));
        match tables.iter_mut().find(|table| table.title == title) {
            Some(table) => table.rows.push(cells.collect()),
            None => tables.push(Table { title, columns, rows: vec![cells.collect()] }),
        }
    }
    findings.tables.extend(tables);
}

/// A row of a scene by a named device.
fn row(scene: impl Into<String>, by: impl Into<String>) -> Row {
    Row::new(scene, by)
}
