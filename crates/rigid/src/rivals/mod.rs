//! The methods beside the recommended one: the thesis's, those of other simulators, the oracle.
//!
//! # Practice
//! They are compared with [`god_object_sphere`](crate::god_object_sphere) under the same tools,
//! bones and limits. Each file ends with what the method says of itself.

pub mod brute;
pub mod burr_and_shaft;
mod cell;
pub mod centre_line;
pub mod exposed_faces;
mod frame;
pub mod mesh_shell;
mod obb_tree;
pub mod pointshell;
pub mod ray_trace;
mod shell;
pub mod surface_vertices;
mod sweep;
pub mod thesis;
mod traverse;
pub mod voxel_sum;

pub use sweep::{Ball, Stop, Sweep};
