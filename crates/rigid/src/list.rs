//! The methods of this crate.

use crate::god_object_sphere;
use crate::method::{Descriptor, Method};
use crate::rivals::{brute, burr_and_shaft, centre_line, exposed_faces, pointshell};
use crate::rivals::{ray_trace, surface_vertices, thesis, voxel_sum};

/// All of them, in the order of charts.
const METHODS: &[Descriptor] = &[
    thesis::METHOD,
    thesis::AS_PRINTED,
    pointshell::SUM,
    pointshell::AVERAGE,
    ray_trace::METHOD,
    exposed_faces::METHOD,
    voxel_sum::METHOD,
    burr_and_shaft::METHOD,
    centre_line::METHOD,
    surface_vertices::METHOD,
    god_object_sphere::METHOD,
    god_object_sphere::WITH_SHAFT,
    brute::METHOD,
];

impl Method {
    /// Every method in its default configuration.
    pub fn all() -> Vec<Self> {
        METHODS.iter().map(Self::of).collect()
    }

    /// The method of that name in its default configuration.
    pub fn named(name: &str) -> Option<Self> {
        let is = |descriptor: &&Descriptor| descriptor.name == name;
        METHODS.iter().find(is).map(Self::of)
    }
}
