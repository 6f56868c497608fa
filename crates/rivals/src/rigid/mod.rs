//! Contact with bone: the thesis's method, those of other simulators.
//!
//! # Practice
//! They are compared with [`god_object_sphere`] under the same tools, bones and limits.

use trepan_rigid::{Method, brute, god_object_sphere};

pub mod burr_and_shaft;
pub mod centre_line;
pub mod exposed_faces;
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

/// Every method of contact with bone, in the order of charts; the oracle is the last.
pub const METHODS: [Method; 13] = [
    Method::of(&thesis::METHOD),
    Method::of(&thesis::AS_PRINTED),
    Method::of(&pointshell::SUM),
    Method::of(&pointshell::AVERAGE),
    Method::of(&ray_trace::METHOD),
    Method::of(&exposed_faces::METHOD),
    Method::of(&voxel_sum::METHOD),
    Method::of(&burr_and_shaft::METHOD),
    Method::of(&centre_line::METHOD),
    Method::of(&surface_vertices::METHOD),
    Method::of(&god_object_sphere::METHOD),
    Method::of(&god_object_sphere::WITH_SHAFT),
    Method::of(&brute::METHOD),
];
