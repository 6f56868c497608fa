//! The boundary of a tetrahedral mesh as triangles over the same nodes.
//!
//! # Theory
//! A face with one tetrahedron is on the boundary. Seen from outside its corners run
//! counterclockwise. The boundary is closed if every edge belongs to exactly two triangles that
//! traverse it in opposite directions.

use crate::{FACES, NONE, TetMesh, Topology, TriMesh};
use trepan_geometry::Vec3;

/// Boundary triangles of a [`TetMesh`], ordered by tetrahedron and face.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Surface {
    /// Node indices of the mesh, counterclockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The tetrahedron behind each triangle.
    pub tet_of_triangle: Vec<u32>,
}

impl Surface {
    /// The boundary of a mesh whose indices are in range.
    pub fn of(mesh: &TetMesh) -> Self {
        Self::with(mesh, &Topology::of(mesh))
    }

    /// The boundary, from an existing topology.
    pub fn with(mesh: &TetMesh, topology: &Topology) -> Self {
        let mut surface = Self::default();
        for (tet, neighbours) in topology.neighbours.iter().enumerate() {
            for face in (0..4).filter(|&f| neighbours[f] == NONE) {
                surface.triangles.push(FACES[face].map(|corner| mesh.tets[tet][corner]));
                surface.tet_of_triangle.push(tet as u32);
            }
        }
        surface
    }

    /// Whether every edge has exactly two triangles, in opposite directions; false for an empty
    /// surface.
    pub fn is_closed(&self) -> bool {
        crate::triangles::is_closed(&self.triangles)
    }

    /// The nodes of the surface, ascending.
    pub fn nodes(&self) -> Vec<u32> {
        let mut nodes: Vec<u32> = self.triangles.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// Area, mm², at the given node positions.
    pub fn area_mm2(&self, positions: &[Vec3]) -> f64 {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|n| positions[n as usize].as_dvec3());
            0.5 * (b - a).cross(c - a).length()
        };
        self.triangles.iter().map(area).sum()
    }

    /// Unit outward normal of every node of the mesh, area-weighted over its triangles; zero for
    /// interior nodes.
    pub fn node_normals(&self, positions: &[Vec3]) -> Vec<Vec3> {
        let mut normals = vec![Vec3::ZERO; positions.len()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|n| positions[n as usize]);
            let twice_area = (b - a).cross(c - a);
            triangle.iter().for_each(|&n| normals[n as usize] += twice_area);
        }
        normals.into_iter().map(Vec3::normalize_or_zero).collect()
    }

    /// The surface as a separate mesh with its own node numbering (in the same order).
    pub fn to_tri_mesh(&self, positions: &[Vec3]) -> TriMesh {
        let nodes = self.nodes();
        let renumber = |n: u32| nodes.partition_point(|&m| m < n) as u32;
        TriMesh {
            positions: nodes.iter().map(|&n| positions[n as usize]).collect(),
            triangles: self.triangles.iter().map(|t| t.map(renumber)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_tetrahedron_has_a_closed_surface_that_looks_outwards() {
        let mesh = TetMesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z], tets: vec![[0, 1, 2, 3]] };
        let surface = Surface::of(&mesh);
        assert!(surface.is_closed());
        assert_eq!(surface.triangles, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]);
        let normals = surface.node_normals(&mesh.positions);
        let centre = Vec3::splat(0.25);
        assert!(mesh.positions.iter().zip(&normals).all(|(p, n)| (*p - centre).dot(*n) > 0.1));
        assert!((surface.area_mm2(&mesh.positions) - (1.5 + 0.75f64.sqrt())).abs() < 1e-6);
        assert!((surface.to_tri_mesh(&mesh.positions).volume_mm3() - 1.0 / 6.0).abs() < 1e-9);
    }

    #[test]
    fn two_tetrahedra_on_one_edge_are_no_manifold() {
        let positions = vec![Vec3::ZERO, Vec3::Z, Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y];
        let mesh = TetMesh { positions, tets: vec![[0, 2, 3, 1], [0, 4, 5, 1]] };
        assert_eq!(mesh.check(), Ok(()));
        assert!(!Surface::of(&mesh).is_closed());
        assert!(!Surface::default().is_closed());
    }
}
