//! The solvers of this crate.

use crate::method::Method;
use crate::reference;

impl Method {
    /// The solver of this crate, the static oracle; `trepan-rivals` has others.
    pub const OWN: [Self; 1] = [Self::of(&reference::METHOD)];
}
