//! Stress of brain regions in tension, compression and shear.

use super::comparison::{Comparison, How};
use crate::engine::suite::Findings;
use crate::suites::{Part, Scope};
use trepan_measurements::brain;

/// Lists the parts.
pub fn parts(_: Scope) -> Vec<Part> {
    vec![Part::new("brain density", |_, findings| density(findings))]
}

fn density(findings: &mut Findings) {
    let ours = f64::from(trepan_soft::Material::BRAIN.density_g_mm3()) * 1e3;
    findings.rows.push(Comparison::of(&brain::DENSITY, How::Predicted, ours).row());
}
