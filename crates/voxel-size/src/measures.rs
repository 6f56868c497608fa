//! Mesh statistics for the cost function.

use crate::error::{VoxelSizeError, checked, positive};
use trepan_geometry::Vec3;
use trepan_mesh::{FACES, MeshError, TetMesh};

/// Means over the tetrahedra or triangles of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// Number of tetrahedra or triangles.
    pub elements: usize,
    /// s: mean over the elements of their longest edge, mm. In the worst case that is the edge of
    /// their box.
    pub longest_edge_mm: f64,
    /// Mean over the edges of all elements, mm.
    pub mean_edge_mm: f64,
    /// A_t: mean area of the facets, mm².
    pub facet_mm2: f64,
}

impl Measures {
    /// Measures a mesh. Rejects one without tetrahedra, with indices out of range, with a
    /// non-finite coordinate, or without extent.
    pub fn of(mesh: &TetMesh) -> Result<Self, VoxelSizeError> {
        mesh.check_indices()?;
        let of_tet = |tet: usize| {
            let corners = mesh.corners(tet).map(|p| p.as_dvec3());
            let lengths =
                [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(i, j)| corners[i].distance(corners[j]));
            let area = |[i, j, k]: [usize; 3]| 0.5 * (corners[j] - corners[i]).cross(corners[k] - corners[i]).length();
            [
                lengths.into_iter().fold(0.0, f64::max),
                lengths.iter().sum::<f64>() / 6.0,
                FACES.map(area).iter().sum::<f64>() / 4.0,
            ]
        };
        Self::mean(&mesh.positions, mesh.tets.len(), of_tet)
    }

    /// Measures a triangle mesh, for the triangle form of Borro et al. 2004: the same cost with the
    /// triangles' edges and areas. Rejects the same meshes as [`of`](Self::of).
    pub fn of_triangles(positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<Self, VoxelSizeError> {
        if triangles.is_empty() {
            return Err(MeshError::Empty.into());
        }
        let known = |n: &u32| (*n as usize) < positions.len();
        let unknown = triangles.iter().flatten().find(|n| !known(n));
        let wanted = "a node that is there";
        checked("a triangle's node", unknown.copied().unwrap_or(0).into(), unknown.is_none(), wanted)?;
        let of_triangle = |at: usize| {
            let [a, b, c] = triangles[at].map(|n| positions[n as usize].as_dvec3());
            let lengths = [a.distance(b), b.distance(c), c.distance(a)];
            let longest = lengths.into_iter().fold(0.0, f64::max);
            [longest, lengths.iter().sum::<f64>() / 3.0, 0.5 * (b - a).cross(c - a).length()]
        };
        Self::mean(positions, triangles.len(), of_triangle)
    }

    /// Means of longest edge, edge and facet over so many elements.
    fn mean(positions: &[Vec3], elements: usize, of: impl Fn(usize) -> [f64; 3]) -> Result<Self, VoxelSizeError> {
        if let Some(node) = positions.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::NotFinite(node).into());
        }
        let mut sums = [0.0; 3];
        (0..elements).for_each(|at| sums.iter_mut().zip(of(at)).for_each(|(sum, x)| *sum += x));
        let [longest_edge_mm, mean_edge_mm, facet_mm2] = sums.map(|sum| sum / elements as f64);
        Self { elements, longest_edge_mm, mean_edge_mm, facet_mm2 }.checked()
    }

    /// Checks that the values are valid lengths and areas.
    pub fn checked(self) -> Result<Self, VoxelSizeError> {
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
    fn triangles_are_measured_exactly_and_their_cells_follow_the_same_cubic() {
        let positions = [Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 4.0, Vec3::new(3.0, 4.0, 0.0)];
        let measures = Measures::of_triangles(&positions, &[[0, 1, 2], [3, 2, 1]]).unwrap();
        assert_eq!((measures.longest_edge_mm, measures.mean_edge_mm, measures.facet_mm2), (5.0, 4.0, 6.0));
        let model = crate::CostModel::default();
        let best = model.analytic(&measures).unwrap();
        assert!(model.cost(&measures, best) < model.cost(&measures, 1.1 * best).min(model.cost(&measures, 0.9 * best)));
        assert_eq!(Measures::of_triangles(&positions, &[]), Err(MeshError::Empty.into()));
        let field = "a triangle's node";
        assert!(
            matches!(Measures::of_triangles(&positions, &[[0, 1, 4]]), Err(VoxelSizeError::Field { field: f, .. }) if f == field)
        );
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
