//! What each choice costs and how far it is off, measured once.
//!
//! # Practice
//! The stored rows come from `cargo run -p trepan-budget --example rows`, which measures them anew; rows of a caller's own go to
//! [`plan_with`](crate::plan_with).
//!
//! # Sources
//! Rigid: a ball of 2 mm pressed 0.3 mm into a knob of bone of radius 4 mm, blurred by 0.6 mm as in a clinical CT, from 200 directions; the error is the
//! root mean square of depth against the closed form. Mesh: a cube of 1.2 l of brain, fixed at the bottom and pulled sideways by its weight, f64 static reference; the error
//! is that of the top's displacement against the value extrapolated to infinitely many tetrahedra.

use crate::Scene;

/// One way to represent bone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidRow {
    /// Name of the method in `trepan_rigid`.
    pub method: &'static str,
    /// Edge of a voxel, mm.
    pub spacing_mm: f64,
    /// Points on the burr, where the method has points.
    pub points: usize,
    /// Root mean square error of the depth, mm.
    pub depth_error_mm: f64,
    /// Time of a tick over that of the reference row.
    pub relative_time: f64,
}

/// One fineness of tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshRow {
    /// Number of tetrahedra.
    pub tets: usize,
    /// Error of the displacement, as a share of it.
    pub relative_error: f64,
}

/// All there is to choose from.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// Ways to represent bone.
    pub rigid: Vec<RigidRow>,
    /// Ways to represent tissue.
    pub mesh: Vec<MeshRow>,
}

impl MeshRow {
    /// Error in a scene, mm.
    pub fn error_in(&self, scene: &Scene) -> f64 {
        self.relative_error * scene.tissue_motion_mm
    }
}

impl Rows {
    /// The rows measured by the example: method, voxel in mm, points, depth error in mm, relative time; tetrahedra, relative error.
    pub fn stored() -> Self {
        let rigid = |(method, spacing_mm, points, depth_error_mm, relative_time)| RigidRow {
            method,
            spacing_mm,
            points,
            depth_error_mm,
            relative_time,
        };
        let mesh = |(tets, relative_error)| MeshRow { tets, relative_error };
        Self { rigid: RIGID.map(rigid).to_vec(), mesh: MESH.map(mesh).to_vec() }
    }
}

const RIGID: [(&str, f64, usize, f64, f64); 16] = [
    ("thesis", 1.5, 466, 0.2608, 0.88),
    ("thesis", 1.0, 466, 0.2474, 1.09),
    ("thesis", 0.75, 466, 0.1944, 1.12),
    ("thesis", 0.5, 211, 0.1334, 0.49),
    ("thesis", 0.5, 466, 0.129, 1.0),
    ("thesis", 0.35, 211, 0.0942, 0.52),
    ("thesis", 0.35, 466, 0.0798, 1.05),
    ("thesis", 0.25, 211, 0.0798, 0.5),
    ("thesis", 0.25, 466, 0.0576, 1.01),
    ("thesis", 0.25, 932, 0.0524, 1.99),
    ("distance-field", 1.5, 0, 0.0655, 2.03),
    ("distance-field", 1.0, 0, 0.0329, 2.85),
    ("distance-field", 0.75, 0, 0.0288, 3.71),
    ("distance-field", 0.5, 0, 0.0178, 5.62),
    ("distance-field", 0.35, 0, 0.0086, 8.5),
    ("distance-field", 0.25, 0, 0.0041, 13.89),
];

const MESH: [(usize, f64); 7] = [
    (3072, 0.1535),
    (6000, 0.1246),
    (10_368, 0.1051),
    (16_464, 0.0913),
    (24_576, 0.0812),
    (34_992, 0.0735),
    (48_000, 0.0674),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Every stored method exists, finer voxels and meshes are never worse, and the reference row costs 1.
    #[test]
    fn the_stored_rows_hang_together() {
        let rows = Rows::stored();
        let reference = |r: &RigidRow| r.method == "thesis" && r.spacing_mm == 0.5 && r.points == 466;
        assert!(rows.rigid.iter().any(|r| reference(r) && r.relative_time == 1.0));
        for row in &rows.rigid {
            assert!(trepan_rigid::Method::named(row.method).is_some(), "{}", row.method);
            let coarser =
                |r: &&RigidRow| r.method == row.method && r.points == row.points && r.spacing_mm > row.spacing_mm;
            assert!(rows.rigid.iter().filter(coarser).all(|r| r.depth_error_mm > row.depth_error_mm));
        }
        assert!(rows.mesh.windows(2).all(|w| w[0].tets < w[1].tets && w[0].relative_error > w[1].relative_error));
    }
}
