//! Contact as plain data, what force it makes, and the guard that stands before every hand.

mod force;
mod manifold;
mod nodal;
mod patch;

pub use force::ForceModel;
pub use manifold::{Contact, ContactManifold, MAX_CONTACTS};
pub use nodal::{MAX_NODES, NodalContact};
pub use patch::SurfacePatch;
