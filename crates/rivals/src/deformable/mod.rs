//! Searches for the tissue at a tool: broad phases, the thesis's.

use trepan_deformable::Method;
use trepan_deformable::search::{brute, hashed_grid, uniform_grid, walk};

pub mod aabb;
pub mod bottom_up_tree;
pub mod bsp_tree;
pub mod hybrid_tree;
pub mod image_space;
pub mod interest_matrix;
pub mod k_dop;
pub mod kd_tree;
mod motion;
pub mod obb;
pub mod octree;
pub mod parry_tree;
pub mod sphere;
pub mod stochastic;
pub mod surface_boxes;
pub mod thesis;
pub mod volume_tree;

pub use aabb::Aabox;
pub use bsp_tree::BspTree;
pub use hybrid_tree::HybridTree;
pub use interest_matrix::InterestMatrix;
pub use k_dop::KDop;
pub use kd_tree::KdTree;
pub use obb::Obb;
pub use octree::Octree;
pub use parry_tree::ParryTree;
pub use sphere::Sphere;
pub use volume_tree::{Volume, VolumeTree};

/// Every search, the oracle first.
pub const METHODS: [Method; 20] = [
    Method::of(&brute::METHOD),
    Method::of(&uniform_grid::SCAN),
    Method::of(&uniform_grid::METHOD),
    Method::of(&hashed_grid::METHOD),
    Method::of(&octree::METHOD),
    Method::of(&kd_tree::METHOD),
    Method::of(&bsp_tree::METHOD),
    Method::of(&aabb::METHOD),
    Method::of(&sphere::METHOD),
    Method::of(&k_dop::METHOD),
    Method::of(&obb::METHOD),
    Method::of(&bottom_up_tree::METHOD),
    Method::of(&hybrid_tree::METHOD),
    Method::of(&parry_tree::METHOD),
    Method::of(&interest_matrix::METHOD),
    Method::of(&surface_boxes::METHOD),
    Method::of(&image_space::METHOD),
    Method::of(&stochastic::METHOD),
    Method::of(&thesis::METHOD),
    Method::of(&walk::METHOD),
];
