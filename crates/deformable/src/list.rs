//! The methods of this crate.

use crate::method::Method;
use crate::search::{brute, hashed_grid, uniform_grid, walk};

impl Method {
    /// The methods of this crate, the oracle first; `trepan-rivals` has others.
    pub const OWN: [Self; 5] = [
        Self::of(&brute::METHOD),
        Self::of(&uniform_grid::SCAN),
        Self::of(&uniform_grid::METHOD),
        Self::of(&hashed_grid::METHOD),
        Self::of(&walk::METHOD),
    ];
}
