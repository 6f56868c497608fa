//! Computes the cell size of a uniform grid that minimises the cost of collision detection.
//!
//! # Theory
//! A grid with cells of edge δ sorts particles; each tetrahedron visits the cells that its box
//! covers and tests the particles in them. Small cells cost visits, large ones cost tests. Chapter
//! 5 of the thesis (after Borro et al. 2004) gives the cost per tetrahedron,
//!
//! ```text
//! z(δ) = p_nc v_o + (1 − p_nc) v_o p_v r_t
//! v_o = (s/δ + 2)³      p_v = c δ²,  c = 3√3 / (2 A_t)
//! ```
//!
//! with s the mean longest edge (mm), A_t the mean area of a facet (mm²), p_nc the fraction of
//! tetrahedra without contact, r_t = t_p / t_v the cost of a test in visits. Its minimum is the
//! single positive root of a cubic ([`CostModel::analytic`]). [`Expected`] avoids its
//! approximations by using the actual boxes and particles. Triangle meshes (Borro et al. 2004) have
//! the same form with their own [`Measures::of_triangles`]; density volumes have [`Bricks`]. The
//! usual rule, δ = mean edge (Teschner et al. 2003), is [`Measures::traditional_mm`].
//!
//! # Practice
//! Lengths in mm. Everything is offline and uses no clock: times are inputs ([`fit`]), counts are
//! outputs ([`counts::grid`]).
//!
//! ```
//! use trepan_geometry::Vec3;
//! use trepan_mesh::TetMesh;
//! use trepan_voxel_size::{CostModel, Measures};
//!
//! let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
//! let mesh = TetMesh { positions, tets: vec![[0, 1, 2, 3]] };
//! let measures = Measures::of(&mesh)?;
//! let delta = CostModel::default().analytic(&measures)?;
//! assert!(delta > measures.traditional_mm());
//! # Ok::<(), trepan_voxel_size::VoxelSizeError>(())
//! ```

mod bricks;
mod cost;
pub mod counts;
mod error;
mod expected;
mod fit;
mod measures;

pub use bricks::Bricks;
pub use cost::{CostModel, zone_error};
pub use error::VoxelSizeError;
pub use expected::{Expected, MAX_GAPS};
pub use fit::{Prices, Work, fit};
pub use measures::Measures;

/// The examples of the README compile.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
