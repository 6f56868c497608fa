//! The smallest brain mesh.

use glam::Vec3;
use trepan_mesh::TetMesh;

/// A cube of five tetrahedra, from `-r` to `r`.
pub fn cube(r: f32) -> TetMesh {
    let positions =
        (0..8).map(|n| Vec3::new(n as f32 % 2.0, (n / 2) as f32 % 2.0, (n / 4) as f32) * 2.0 * r - r).collect();
    TetMesh { positions, tets: vec![[0, 1, 2, 4], [3, 2, 1, 7], [5, 1, 4, 7], [6, 2, 7, 4], [1, 2, 4, 7]] }
}
