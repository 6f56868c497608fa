//! The recommended search, a walk through neighbours with floods for the points that it loses; the
//! grids of [`MeshCollision`](crate::MeshCollision); the oracle.

pub mod brute;
mod degenerate;
mod flood;
pub mod hashed_grid;
mod lost;
pub mod uniform_grid;
pub mod walk;

pub use flood::Flood;
pub use hashed_grid::HashedGrid;
pub use lost::Lost;
pub use uniform_grid::UniformGrid;
