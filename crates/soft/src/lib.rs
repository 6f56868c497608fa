//! Soft tissue: the seam that every solver sits behind, materials and an f64 implicit reference.
//!
//! # Theory
//! A body is a mesh of 4-node tetrahedra with lumped masses. With nodal positions `x = X + u` every
//! solver here answers the same semi-discrete equation `M ü + C u̇ + f_int(u) = f_ext`, or its
//! static limit.
//!
//! # Practice
//! Units mm, ms, g: stiffness in MPa, forces in N, densities in g/mm³. [`SoftSolver`] is the seam,
//! [`Method`] a solver as a value; the fast explicit solver lives in `trepan-tled` behind the same
//! seam, others to compare it with in `trepan-rivals`. Nothing here does I/O, reads a clock or
//! starts a thread.
//!
//! ```
//! use trepan_soft::{Body, Loads, Material, Method, boxes, reference};
//!
//! let mesh = boxes::split_box([2, 2, 2], trepan_geometry::Vec3::splat(20.0));
//! let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
//! let body = Body::uniform(mesh, fixed, Material::BRAIN);
//! let mut solver = Method::of(&reference::METHOD).build(&body)?;
//! let gravity = trepan_geometry::Vec3::new(0.0, 0.0, -9.81e-3);
//! let report = solver.step(&Loads { gravity, ..Loads::default() }, 1.0);
//! assert_eq!(report.inverted, 0);
//! # Ok::<(), trepan_soft::BodyError>(())
//! ```

mod body;
mod bound;
pub mod boxes;
mod contact;
mod energy;
mod factor;
mod fluid;
mod law;
mod list;
mod material;
mod membrane;
mod method;
mod mixture;
mod operator;
mod pressure;
pub mod reference;
pub mod simd;
mod solver;
mod stiffening;
mod tangent;
mod tetra;

pub use body::{Body, BodyError, split_triangles};
pub use bound::{
    element_bound_ms, element_omega2, highest_frequency, lowest_frequency, lowest_frequency_of, power_bound_ms,
    power_bound_of_ms,
};
pub use contact::{FreeNode, Gain, ImplicitSprings};
pub use energy::{FADE_BELOW, NeoHookean, VolumeWall, cofactor};
pub use fluid::{Anchor, Fluid, LEVEL_BAND_MM};
pub use law::{LEAST_STRETCH, Law};
pub use material::{Material, MaterialError};
pub use membrane::{Membrane, TriangleShape};
pub use method::{Descriptor, Method};
pub use mixture::Bound;
pub use operator::{Hooke, Stiffness};
pub use pressure::SurfacePressure;
pub use solver::{Loads, MakeSolver, NodeState, SoftSolver, StepReport};
pub use stiffening::{STIFFENING_POWER, Stiffening};
pub use tangent::Tangent;
pub use tetra::Shape;
