//! A tetrahedral mesh as plain data.

use trepan_geometry::{Aabb, Vec3};

/// Vertices and 4-node tetrahedra. Invariant after a check: indices in range, positive volumes, no
/// orphan node.
///
/// A tetrahedron `[a, b, c, d]` has positive volume when `(b - a) × (c - a) · (d - a) > 0`; its
/// faces, counterclockwise from outside, are `(a,c,b) (a,b,d) (b,c,d) (a,d,c)`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TetMesh {
    /// Vertices, world mm.
    pub positions: Vec<Vec3>,
    /// Four vertex indices each.
    pub tets: Vec<[u32; 4]>,
}

/// The faces of a tetrahedron as corner numbers, counterclockwise from outside; face f is opposite
/// corner `OPPOSITE[f]`.
pub const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
/// The corner opposite each of [`FACES`].
pub const OPPOSITE: [usize; 4] = [3, 2, 0, 1];

impl TetMesh {
    /// The corners of a tetrahedron, mm.
    pub fn corners(&self, tet: usize) -> [Vec3; 4] {
        self.tets[tet].map(|n| self.positions[n as usize])
    }

    /// Signed volume of a tetrahedron, mm³, in f64.
    pub fn volume_mm3(&self, tet: usize) -> f64 {
        let [a, b, c, d] = self.corners(tet).map(Vec3::as_dvec3);
        (b - a).cross(c - a).dot(d - a) / 6.0
    }

    /// Volume of the whole mesh, mm³.
    pub fn total_mm3(&self) -> f64 {
        (0..self.tets.len()).map(|t| self.volume_mm3(t)).sum()
    }

    /// Box of all vertices, mm.
    pub fn bounds(&self) -> Aabb {
        Aabb::of_points(&self.positions)
    }
}
