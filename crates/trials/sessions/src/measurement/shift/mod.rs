//! Brain shift, sag in the closed skull, pulse and breathing, retraction.

mod head;
mod opened;
mod retraction;
mod sag;

use anyhow::Result;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::Findings;

/// Lists the parts.
pub fn parts(_: Scope) -> Vec<Part> {
    type Makes = fn(&mut Findings) -> Result<()>;
    let parts: [(&str, Makes); 4] = [
        ("sag in the closed skull", sag::findings),
        ("shift after opening", opened::shift),
        ("pulse and breathing", opened::pulse),
        ("retraction", retraction::findings),
    ];
    parts
        .map(|(name, make)| {
            Part::new(name, move |_, findings| {
                if let Err(fault) = make(findings) {
                    findings.conclusions.push(format!("{name}: not measured: {fault:#}."));
                }
            })
        })
        .into()
}
