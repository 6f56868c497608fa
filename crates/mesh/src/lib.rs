//! Tetrahedral and triangle meshes.

mod tets;

pub use tets::{FACES, OPPOSITE, TetMesh};
