//! Measures what a plan needs: the speed of this machine, and the error of each choice in this
//! case.

pub mod bone;
mod case_errors;
pub mod in_case;
mod machine;
pub mod picture;
pub mod tissue;

use serde::{Deserialize, Serialize};

pub use case_errors::{CaseErrors, Sight};
pub use machine::machine;

/// One value for each part that a plan chooses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Parts<T> {
    /// Haptic ticks on bone.
    pub bone: T,
    /// Solver steps of tissue.
    pub tissue: T,
    /// Rays of the picture.
    pub picture: T,
}

/// Which parts a plan chooses.
pub type PlannedParts = Parts<bool>;

impl PlannedParts {
    /// Whether any part is wanted.
    pub fn any(self) -> bool {
        self.bone || self.tissue || self.picture
    }
}
