//! The seam of the searches: which tetrahedron holds each tool point.

use crate::narrow::Hits;
use crate::scene::Scene;
use crate::surface::MovingSurface;
use trepan_mesh::TetMesh;

/// Finds the tetrahedron that holds each tool point, with a memory from step to step.
///
/// Called once in every collision step: no allocation, no lock, no panic.
pub trait Search: Send {
    /// Fills `hits` for the scene's points.
    fn find(&mut self, scene: &Scene, surface: &mut MovingSurface, hits: &mut Hits);

    /// Forgets where the tool was.
    fn reset(&mut self) {}
}

/// What a search is made for.
#[derive(Clone, Copy, Debug)]
pub struct SearchInputs<'a> {
    /// The mesh at rest.
    pub mesh: &'a TetMesh,
    /// Number of tool points.
    pub points: usize,
    /// Edge of a grid cell, mm, for the methods with a grid.
    pub cell_mm: f32,
}
