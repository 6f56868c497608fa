//! Soft-tissue solvers: how right each is and what that costs, and where each fails.

mod axial;
mod classes;
pub mod closed_forms;
mod cuts;
mod fronts;
mod locking;
mod motion;
pub mod outside;
mod published;
mod region;
pub mod rivals;
pub mod slender;
mod speed;
pub mod stability;

use crate::card;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::Findings;

/// Every scene.
pub fn parts(scope: Scope) -> Vec<Part> {
    let mut parts = fronts::parts();
    parts.push(Part::new("closed forms", |_, findings| closed_forms::run(findings)));
    parts.extend(locking::parts(scope));
    parts.extend(motion::parts());
    parts.extend([Part::new("region", region::run), card::agreement("device")]);
    parts.extend(axial::parts());
    parts.extend(outside::parts());
    parts.push(Part::new("tissue classes", classes::run));
    parts.extend(cuts::parts());
    parts.extend(slender::parts());
    parts.extend(speed::parts());
    parts.extend(stability::parts());
    parts.push(Part::new("every solver", |_, findings| rivals::run(findings)));
    parts
}

/// The charts, maps and tables of what was found.
pub fn judge(_: Scope, findings: &mut Findings) {
    locking::draw(findings);
    classes::draw(findings);
    stability::draw(findings);
    findings.tables.extend(published::tables(&findings.rows));
}
