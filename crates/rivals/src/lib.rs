//! Methods to compare the simulator's with: contact with bone, collision with tissue, solvers of
//! soft tissue.
//!
//! # Theory
//! A rival answers the same calls as the recommended method of its family, with the same tools,
//! bones, bodies and limits: [`RigidContact`](trepan_rigid::RigidContact),
//! [`Search`](trepan_deformable::Search), [`SoftSolver`](trepan_soft::SoftSolver). Each file ends
//! with what the method says of itself: its name, its source, what it can do.
//!
//! # Practice
//! [`Family`] lists the methods of a family, those of its own crate among them, and finds one by
//! its name:
//!
//! ```
//! use trepan_rigid::Method;
//! use trepan_rivals::Family;
//!
//! let thesis = Method::named("thesis").unwrap();
//! assert!(thesis.has_proxy() && Method::all().contains(&Method::RECOMMENDED));
//! ```
//!
//! # When not to use it
//! In a session, but to feel the difference: the recommended methods are on the front of speed and
//! accuracy, or keep what these lose.

pub mod deformable;
pub mod rigid;
pub mod soft;

#[doc = include_str!("../README.md")]
#[cfg(doctest)]
struct ReadmeExample;

/// A family of methods with the same seam.
pub trait Family: Sized {
    /// Every method in its default configuration, in the order of charts.
    fn all() -> Vec<Self>;

    /// Whether the method has this name.
    fn is(&self, name: &str) -> bool;

    /// The method of this name in its default configuration.
    fn named(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|method| method.is(name))
    }
}

impl Family for trepan_rigid::Method {
    fn all() -> Vec<Self> {
        rigid::METHODS.to_vec()
    }

    fn is(&self, name: &str) -> bool {
        self.name() == name
    }
}

impl Family for trepan_deformable::Method {
    fn all() -> Vec<Self> {
        deformable::METHODS.to_vec()
    }

    fn is(&self, name: &str) -> bool {
        self.name() == name
    }
}

impl Family for trepan_soft::Method {
    fn all() -> Vec<Self> {
        soft::METHODS.to_vec()
    }

    fn is(&self, name: &str) -> bool {
        self.name() == name
    }
}
