//! What the cost function needs to know about a mesh.

use crate::error::{VoxelSizeError, checked};
use trepan_mesh::{FACES, MeshError, TetMesh};

/// Means over the tetrahedra of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// How many tetrahedra.
    pub tets: usize,
    /// s: mean over tetrahedra of their longest edge, mm. In the worst case that is the edge of their box.
    pub longest_edge_mm: f64,
    /// Mean over the edges of all tetrahedra, mm.
    pub mean_edge_mm: f64,
    /// A_t: mean area of the facets of all tetrahedra, mm².
    pub facet_mm2: f64,
}

impl Measures {
    /// Measures a mesh. Refuses one without tetrahedra, with indices out of range, with a coordinate that is not finite, or without extent.
    pub fn of(mesh: &TetMesh) -> Result<Self, VoxelSizeError> {
        mesh.check_indices()?;
        if let Some(node) = mesh.positions.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::NotFinite(node).into());
        }
        let (mut longest, mut edges, mut areas) = (0.0, 0.0, 0.0);
        for tet in 0..mesh.tets.len() {
            let corners = mesh.corners(tet).map(|p| p.as_dvec3());
            let lengths =
                [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(i, j)| corners[i].distance(corners[j]));
            longest += lengths.into_iter().fold(0.0, f64::max);
            edges += lengths.iter().sum::<f64>() / 6.0;
            let area = |[i, j, k]: [usize; 3]| 0.5 * (corners[j] - corners[i]).cross(corners[k] - corners[i]).length();
            areas += FACES.map(area).iter().sum::<f64>() / 4.0;
        }
        let tets = mesh.tets.len();
        let [longest_edge_mm, mean_edge_mm, facet_mm2] = [longest, edges, areas].map(|sum| sum / tets as f64);
        Self { tets, longest_edge_mm, mean_edge_mm, facet_mm2 }.checked()
    }

    /// The same numbers, if they are lengths and areas.
    pub fn checked(self) -> Result<Self, VoxelSizeError> {
        let positive =
            |field, value: f64| checked(field, value, value > 0.0 && value.is_finite(), "positive and finite");
        positive("longest_edge_mm", self.longest_edge_mm)?;
        positive("mean_edge_mm", self.mean_edge_mm)?;
        positive("facet_mm2", self.facet_mm2)?;
        Ok(self)
    }

    /// The usual rule (Teschner et al. 2003): the mean edge, mm.
    pub fn traditional_mm(&self) -> f64 {
        self.mean_edge_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    fn corner() -> TetMesh {
        TetMesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z], tets: vec![[0, 1, 2, 3]] }
    }

    #[test]
    fn the_corner_of_a_cube_is_measured_exactly() {
        let measures = Measures::of(&corner()).unwrap();
        let diagonal = 2f64.sqrt();
        assert!((measures.longest_edge_mm - diagonal).abs() < 1e-12);
        assert!((measures.mean_edge_mm - (3.0 + 3.0 * diagonal) / 6.0).abs() < 1e-12);
        assert!((measures.facet_mm2 - (1.5 + 0.75f64.sqrt()) / 4.0).abs() < 1e-12);
    }

    #[test]
    fn bad_meshes_are_refused() {
        assert_eq!(Measures::of(&TetMesh::default()), Err(MeshError::Empty.into()));
        let mut mesh = corner();
        mesh.positions[1].x = f32::NAN;
        assert_eq!(Measures::of(&mesh), Err(MeshError::NotFinite(1).into()));
        let mesh = TetMesh { positions: vec![Vec3::ONE; 4], tets: vec![[0, 1, 2, 3]] };
        assert!(matches!(Measures::of(&mesh), Err(VoxelSizeError::Field { field: "longest_edge_mm", .. })));
    }
}
