//! A tool's ball against a moving tetrahedral mesh: which points are inside, how deep, and what
//! pushes back.
//!
//! # Theory
//! Detection: 211 points on the ball, each in a tetrahedron or in none (thesis chapter 4).
//! Response: one contact whose normal and depth stay continuous while the points change tetrahedra
//! ([`Response`]). The load goes to the nodes under the contact as springs, one for each node under
//! the ball ([`TissueStep::surface_springs`]), equal and opposite.
//!
//! # Practice
//! [`MeshCollision`] is for two meshes or one against itself, [`SlidingWall`] for tissue in a
//! hollow. [`TissueCollision::step`] runs in the collision thread, once for each new state of the
//! tissue; it allocates nothing, and what it found is one plain struct, [`TissueStep`]. Searches
//! are described values, [`Method`]: [`search::walk`] is recommended, [`search::brute`] is an f64
//! oracle, `trepan-rivals` has the others.
//!
//! # When not to use it
//! For cutting: connections of the mesh are fixed.

mod bodies;
mod bounded;
mod config;
mod extent;
pub mod kit;
mod list;
mod method;
mod narrow;
mod outcome;
mod phase;
mod response;
mod scene;
mod seam;
pub mod search;
mod step;
mod surface;
mod wall;

pub use bodies::{MeshCollision, NodeContact, push_apart, push_itself_apart};
pub use config::{Config, ConfigError};
pub use method::{Descriptor, Method, Response};
pub use outcome::TissueStep;
pub use phase::{BroadPhase, Indexed, Phased};
pub use seam::{Search, SearchInputs};
pub use step::TissueCollision;
pub use wall::{BorderNode, Hollow, SlidingWall};

#[doc = include_str!("../README.md")]
#[cfg(doctest)]
struct ReadmeExample;
