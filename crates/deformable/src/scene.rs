//! What one collision step looks at, borrowed from its owners.

use trepan_geometry::{Aabb, ToolState, Vec3};

/// Tissue and tool at one instant.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// Moved nodes, world mm.
    pub positions: &'a [Vec3],
    /// Node velocities, mm/ms.
    pub velocities: &'a [Vec3],
    /// Corners of the tetrahedra.
    pub tets: &'a [[u32; 4]],
    /// The tetrahedron across each face, in the order of `trepan_mesh::FACES`.
    pub neighbours: &'a [[u32; 4]],
    /// Points on the tool's ball, world mm, and its centre as the last one.
    pub points: &'a [Vec3],
    /// The tool.
    pub tool: &'a ToolState,
    /// Radius of the ball, mm.
    pub radius_mm: f32,
    /// Whether each tetrahedron is still there; empty where none is ever taken away.
    pub live: &'a [bool],
}

impl Scene<'_> {
    /// Corners of a tetrahedron, mm.
    #[inline]
    pub fn corners(&self, tet: u32) -> [Vec3; 4] {
        self.tets[tet as usize].map(|node| self.positions[node as usize])
    }

    /// Whether a tetrahedron is still there.
    #[inline]
    pub fn is_live(&self, tet: u32) -> bool {
        self.live.get(tet as usize).is_none_or(|live| *live)
    }

    /// Box of the ball.
    pub fn ball_box(&self) -> Aabb {
        Aabb::of_sphere(self.tool.tip(), self.radius_mm)
    }

    /// Number of the last point, the centre.
    pub fn centre(&self) -> usize {
        self.points.len() - 1
    }
}
