//! The methods of this crate.

use crate::method::Method;
use crate::{brute, god_object_sphere};

impl Method {
    /// The methods of this crate, the oracle last; `trepan-rivals` has others.
    pub const OWN: [Self; 3] =
        [Self::of(&god_object_sphere::METHOD), Self::of(&god_object_sphere::WITH_SHAFT), Self::of(&brute::METHOD)];
}
