//! Phantoms: bodies of silicone and gel with published shapes and forces.

use crate::suites::{Part, Scope};

/// Lists the parts.
pub fn parts(_: Scope) -> Vec<Part> {
    Vec::new()
}
