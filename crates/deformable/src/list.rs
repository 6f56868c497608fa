//! The methods of this crate.

use crate::method::{Descriptor, Method, Response};
use crate::response::{Ball, Respond};
use crate::rivals::parry_tree;
use crate::rivals::printed::Faces;
use crate::rivals::{aabb, bottom_up_tree, brute, bsp_tree, hashed_grid, hybrid_tree, image_space, interest_matrix};
use crate::rivals::{k_dop, kd_tree, obb, octree, sphere, stochastic, surface_boxes, thesis, uniform_grid};
use crate::search::walk;

/// All of them, the oracle first.
const METHODS: &[Descriptor] = &[
    brute::METHOD,
    uniform_grid::SCAN,
    uniform_grid::METHOD,
    hashed_grid::METHOD,
    octree::METHOD,
    kd_tree::METHOD,
    bsp_tree::METHOD,
    aabb::METHOD,
    sphere::METHOD,
    k_dop::METHOD,
    obb::METHOD,
    bottom_up_tree::METHOD,
    hybrid_tree::METHOD,
    parry_tree::METHOD,
    interest_matrix::METHOD,
    surface_boxes::METHOD,
    image_space::METHOD,
    stochastic::METHOD,
    thesis::METHOD,
    walk::METHOD,
];

impl Method {
    /// Every method.
    pub fn all() -> Vec<Self> {
        METHODS.iter().map(Self::of).collect()
    }

    /// The method of this name.
    pub fn named(name: &str) -> Option<Self> {
        METHODS.iter().find(|descriptor| descriptor.name == name).map(Self::of)
    }
}

/// Makes a response.
pub(crate) fn responder(response: Response) -> Box<dyn Respond> {
    match response {
        Response::Ball => Box::new(Ball::new()),
        Response::Printed => Box::new(Faces { nearest: false }),
        Response::NearestFace => Box::new(Faces { nearest: true }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_leads_back_to_its_method() {
        for method in Method::all() {
            assert_eq!(Method::named(method.name()), Some(method));
        }
        assert_eq!(Method::named("octree of dreams"), None);
    }
}
