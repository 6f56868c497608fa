//! A method as a value: what it says of itself.
//!
//! # Practice
//! A method is one file with a [`BroadPhase`](crate::BroadPhase) and a [`Descriptor`]. `Method::of`
//! makes it usable from any crate (`tests/toy_method.rs`); its name in a list of `trepan-rivals`
//! brings it to the command lines, suites and charts.

use crate::seam::{Search, SearchInputs};

/// A method: what it is called, what it can, how it is made.
#[derive(Debug)]
pub struct Descriptor {
    /// Name on command lines, in charts and recordings.
    pub name: &'static str,
    /// Paper or chapter that it follows.
    pub source: &'static str,
    /// The response that belongs to it.
    pub response: Response,
    /// Whether it answers slowly and exactly: a truth for the others, not for a collision step.
    pub is_oracle: bool,
    /// Whether it finds every point that is inside.
    pub is_complete: bool,
    /// Whether it reads the moving surface.
    pub uses_surface: bool,
    /// Makes it. All memory is taken here.
    pub build: fn(&SearchInputs) -> Box<dyn Search>,
}

impl Descriptor {
    /// A method that finds every point and answers with the recommended response. The search of a
    /// broad phase is [`Phased`](crate::Phased).
    pub const fn of(name: &'static str, source: &'static str, build: fn(&SearchInputs) -> Box<dyn Search>) -> Self {
        let response = Response::RECOMMENDED;
        Self { name, source, response, is_oracle: false, is_complete: true, uses_surface: false, build }
    }
}

/// How normal and depth come out of the points inside the tissue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Response {
    /// The ball against the moving surface: continuous, and deeper is more.
    Ball,
    /// The thesis's Algorithm 2 as printed: the greatest distance to any surface face of the
    /// tetrahedra hit.
    Printed,
    /// Algorithm 2 with each point measured against the nearest surface face of its tetrahedron.
    NearestFace,
}

impl Response {
    /// The charted choice.
    pub const RECOMMENDED: Self = Self::Ball;
}

/// A described way to find which tool points lie in which tetrahedra.
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

    /// The name used in files and on command lines.
    pub fn name(&self) -> &'static str {
        self.descriptor.name
    }
}

/// Two are the same if they have the same name.
impl PartialEq for Method {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Method {}
