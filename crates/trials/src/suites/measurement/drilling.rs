//! Bone, drilling, and hands that drill.

use crate::suites::{Part, Scope};

/// Lists the parts.
pub fn parts(_: Scope) -> Vec<Part> {
    Vec::new()
}
