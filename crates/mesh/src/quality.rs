//! Element quality of a mesh: angles, radius ratios, volumes, edges, heights.
//!
//! # Theory
//! The dihedral angle at edge e between the other corners k and l is atan2(|u × v|, u · v) with u =
//! e × (k − i), v = e × (l − i). Angles near 0° or 180° degrade the conditioning of the stiffness
//! matrix and the accuracy of gradients (Shewchuk 2002). The smallest height limits the explicit
//! time step. The radius ratio 3 r_in / r_circum is 1 for the regular tetrahedron and 0 for a
//! degenerate one.
//!
//! # Practice
//! f64 over f32 corners; linear in the size of the mesh.

use crate::TetMesh;
use glam::DVec3;

/// Corners of the six edges of a tetrahedron, and the two remaining corners.
pub(crate) const EDGES: [[usize; 4]; 6] =
    [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]];

/// Extremes and means over all elements of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Smallest dihedral angle, degrees.
    pub min_dihedral_deg: f64,
    /// Largest dihedral angle, degrees.
    pub max_dihedral_deg: f64,
    /// Smallest 3 r_in / r_circum, 0 to 1.
    pub min_radius_ratio: f64,
    /// Mean of 3 r_in / r_circum.
    pub mean_radius_ratio: f64,
    /// Smallest volume, mm³; negative if an element is inverted.
    pub min_mm3: f64,
    /// Largest volume, mm³.
    pub max_mm3: f64,
    /// Total volume, mm³.
    pub total_mm3: f64,
    /// Shortest edge, mm.
    pub min_edge_mm: f64,
    /// Longest edge, mm.
    pub max_edge_mm: f64,
    /// Mean over all elements' edges, mm (an edge counts once for each element around it).
    pub mean_edge_mm: f64,
    /// Smallest height of a corner over the opposite face, mm.
    pub min_height_mm: f64,
    /// Number of dihedral angles in each interval of 10 degrees.
    pub dihedral_histogram: [u32; 18],
}

impl Quality {
    /// Computes the quality of a mesh whose indices are in range. For an empty mesh the minima are
    /// +∞, the maxima −∞ and the means NaN.
    pub fn of(mesh: &TetMesh) -> Self {
        let mut all = Self::NOTHING;
        for tet in 0..mesh.tets.len() {
            all.add(mesh.corners(tet).map(|p| p.as_dvec3()));
        }
        let count = mesh.tets.len() as f64;
        all.mean_radius_ratio /= count;
        all.mean_edge_mm /= 6.0 * count;
        all
    }

    const NOTHING: Self = Self {
        min_dihedral_deg: f64::INFINITY,
        max_dihedral_deg: f64::NEG_INFINITY,
        min_radius_ratio: f64::INFINITY,
        mean_radius_ratio: 0.0,
        min_mm3: f64::INFINITY,
        max_mm3: f64::NEG_INFINITY,
        total_mm3: 0.0,
        min_edge_mm: f64::INFINITY,
        max_edge_mm: f64::NEG_INFINITY,
        mean_edge_mm: 0.0,
        min_height_mm: f64::INFINITY,
        dihedral_histogram: [0; 18],
    };

    fn add(&mut self, corners: [DVec3; 4]) {
        for angle in dihedrals_deg(corners) {
            self.min_dihedral_deg = self.min_dihedral_deg.min(angle);
            self.max_dihedral_deg = self.max_dihedral_deg.max(angle);
            self.dihedral_histogram[((angle / 10.0) as usize).min(17)] += 1;
        }
        for [i, j, ..] in EDGES {
            let length = corners[i].distance(corners[j]);
            self.min_edge_mm = self.min_edge_mm.min(length);
            self.max_edge_mm = self.max_edge_mm.max(length);
            self.mean_edge_mm += length;
        }
        let mm3 = volume(corners);
        self.min_mm3 = self.min_mm3.min(mm3);
        self.max_mm3 = self.max_mm3.max(mm3);
        self.total_mm3 += mm3;
        self.min_height_mm = self.min_height_mm.min(min_height(corners));
        let ratio = radius_ratio(corners);
        self.min_radius_ratio = self.min_radius_ratio.min(ratio);
        self.mean_radius_ratio += ratio;
    }
}

/// Signed volume, mm³.
pub(crate) fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a) / 6.0
}

/// The six dihedral angles, degrees, in the order of [`EDGES`].
pub fn dihedrals_deg(corners: [DVec3; 4]) -> [f64; 6] {
    EDGES.map(|[i, j, k, l]| {
        let edge = corners[j] - corners[i];
        let u = edge.cross(corners[k] - corners[i]);
        let v = edge.cross(corners[l] - corners[i]);
        u.cross(v).length().atan2(u.dot(v)).to_degrees()
    })
}

fn areas(corners: [DVec3; 4]) -> [f64; 4] {
    crate::FACES.map(|[i, j, k]| 0.5 * (corners[j] - corners[i]).cross(corners[k] - corners[i]).length())
}

fn min_height(corners: [DVec3; 4]) -> f64 {
    3.0 * volume(corners).abs() / areas(corners).into_iter().fold(0.0, f64::max)
}

/// The radius ratio 3 r_in / r_circum.
///
/// r_in = 3 V / ΣA, and 24 V r_circum = √(product of Heron's form over the products of opposite
/// edges).
pub fn radius_ratio(corners: [DVec3; 4]) -> f64 {
    let v = volume(corners).abs();
    let length = |i: usize, j: usize| corners[i].distance(corners[j]);
    let [p, q, r] = [length(0, 1) * length(2, 3), length(0, 2) * length(1, 3), length(0, 3) * length(1, 2)];
    let product = (p + q + r) * (-p + q + r) * (p - q + r) * (p + q - r);
    if v <= 0.0 || product <= 0.0 {
        return 0.0;
    }
    let inradius = 3.0 * v / areas(corners).iter().sum::<f64>();
    let circumradius = product.sqrt() / (24.0 * v);
    3.0 * inradius / circumradius
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    #[test]
    fn the_regular_tetrahedron_is_the_best_there_is() {
        let positions =
            vec![Vec3::ONE, Vec3::new(1.0, -1.0, -1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::new(-1.0, -1.0, 1.0)];
        let quality = Quality::of(&TetMesh { positions, tets: vec![[0, 1, 3, 2]] });
        let regular = (1.0f64 / 3.0).acos().to_degrees();
        assert!((quality.min_dihedral_deg - regular).abs() < 1e-9 && (quality.max_dihedral_deg - regular).abs() < 1e-9);
        assert!((quality.min_radius_ratio - 1.0).abs() < 1e-9);
        let edge = 8.0f64.sqrt();
        assert!((quality.mean_edge_mm - edge).abs() < 1e-9);
        assert!((quality.total_mm3.abs() - edge.powi(3) / (6.0 * 2f64.sqrt())).abs() < 1e-9);
        assert!((quality.min_height_mm - edge * (2.0f64 / 3.0).sqrt()).abs() < 1e-9);
        assert_eq!(quality.dihedral_histogram[7], 6);
    }

    #[test]
    fn the_corner_of_a_cube_has_right_angles() {
        let angles = dihedrals_deg([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        assert!(angles[..3].iter().all(|a| (a - 90.0).abs() < 1e-9));
        assert!(angles[3..].iter().all(|a| (a - 2f64.sqrt().atan().to_degrees()).abs() < 1e-9));
    }

    #[test]
    fn a_flat_one_is_the_worst() {
        let flat = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)];
        assert_eq!(radius_ratio(flat), 0.0);
        assert!(dihedrals_deg(flat).iter().any(|a| *a > 179.9));
    }
}
