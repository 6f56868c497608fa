//! The solvers of this crate.

use crate::method::{Descriptor, Method};
use crate::rivals::{corotational, linear, mass_spring, reference, xpbd};

/// All of them, in the order of charts.
const METHODS: &[Descriptor] =
    &[linear::METHOD, mass_spring::METHOD, corotational::METHOD, xpbd::METHOD, reference::METHOD];

impl Method {
    /// Every method with its default settings.
    pub fn all() -> Vec<Self> {
        METHODS.iter().map(Self::of).collect()
    }

    /// The method of this name.
    pub fn named(name: &str) -> Option<Self> {
        METHODS.iter().find(|descriptor| descriptor.name == name).map(Self::of)
    }
}
