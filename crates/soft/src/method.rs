//! A soft-tissue solver as a value: what it says of itself.
//!
//! # Practice
//! A solver is one file with a [`SoftSolver`] and a [`Descriptor`]. `Method::of` makes it usable
//! from any crate (`tests/toy_solver.rs`); its name in a list of `trepan-rivals` brings it to the
//! command lines, suites and charts.

use crate::body::{Body, BodyError};
use crate::solver::SoftSolver;

/// A solver: what it is called, what it can, how it is made.
#[derive(Debug)]
pub struct Descriptor {
    /// Name on command lines, in charts and recordings.
    pub name: &'static str,
    /// Paper that it follows.
    pub source: &'static str,
    /// Whether a step goes to equilibrium, without inertia.
    pub is_static: bool,
    /// Makes it for a body at rest, with its default settings.
    pub build: fn(&Body) -> Result<Box<dyn SoftSolver>, BodyError>,
}

/// A described soft-tissue solver.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    descriptor: &'static Descriptor,
}

impl Method {
    /// The method of a descriptor.
    pub const fn of(descriptor: &'static Descriptor) -> Self {
        Self { descriptor }
    }

    /// What the method says of itself.
    pub fn descriptor(&self) -> &'static Descriptor {
        self.descriptor
    }

    /// Its name on a command line and in charts.
    pub fn name(&self) -> &'static str {
        self.descriptor.name
    }

    /// Makes the solver for a body at rest.
    pub fn build(&self, body: &Body) -> Result<Box<dyn SoftSolver>, BodyError> {
        (self.descriptor.build)(body)
    }
}

/// Two are the same if they have the same name.
impl PartialEq for Method {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}
