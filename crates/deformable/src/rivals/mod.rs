//! The searches beside the recommended one: broad phases, the thesis's, the oracle.
//!
//! # Practice
//! Each file ends with what the method says of itself, `printed.rs` has the thesis's response.
//! [`HashedGrid`] also serves [`MeshCollision`](crate::MeshCollision).

pub mod aabb;
pub mod bottom_up_tree;
pub mod brute;
pub mod bsp_tree;
pub mod hashed_grid;
pub mod hybrid_tree;
pub mod image_space;
pub mod interest_matrix;
pub mod k_dop;
pub mod kd_tree;
mod motion;
pub mod obb;
pub mod octree;
pub mod parry_tree;
pub(crate) mod printed;
pub mod sphere;
pub mod stochastic;
pub mod surface_boxes;
pub mod thesis;
pub mod uniform_grid;
pub mod volume_tree;

pub use aabb::Aabox;
pub use bsp_tree::BspTree;
pub use hashed_grid::HashedGrid;
pub use hybrid_tree::HybridTree;
pub use interest_matrix::InterestMatrix;
pub use k_dop::KDop;
pub use kd_tree::KdTree;
pub use obb::Obb;
pub use octree::Octree;
pub use parry_tree::ParryTree;
pub use sphere::Sphere;
pub use uniform_grid::UniformGrid;
pub use volume_tree::{Volume, VolumeTree};
