//! Brain shift, sag in the closed skull, retraction.

use crate::suites::{Part, Scope};

/// Lists the parts.
pub fn parts(_: Scope) -> Vec<Part> {
    Vec::new()
}
