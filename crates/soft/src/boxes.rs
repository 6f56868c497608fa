//! Boxes of tetrahedra for tests, examples and validation scenes, and picking their nodes.
//!
//! # Theory
//! Each cell is cut into the six tetrahedra of Kuhn's split, one for each order of the axes along the way from corner 000 to corner 111:
//! all cells are alike, so neighbours share their faces' diagonals.

use trepan_geometry::Vec3;
use trepan_mesh::TetMesh;

const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// A box from the origin to `size`, mm, of `cells` cells of six tetrahedra each.
pub fn split_box(cells: [usize; 3], size: Vec3) -> TetMesh {
    let [nx, ny, nz] = cells;
    let node = |c: [usize; 3]| ((c[2] * (ny + 1) + c[1]) * (nx + 1) + c[0]) as u32;
    let mut mesh = TetMesh::default();
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                let share = Vec3::new(i as f32 / nx as f32, j as f32 / ny as f32, k as f32 / nz as f32);
                mesh.positions.push(share * size);
            }
        }
    }
    for cell in 0..nx * ny * nz {
        let corner = [cell % nx, cell / nx % ny, cell / (nx * ny)];
        for order in ORDERS {
            mesh.tets.push(kuhn(corner, order).map(node));
        }
    }
    for tet in 0..mesh.tets.len() {
        if mesh.volume_mm3(tet) < 0.0 {
            mesh.tets[tet].swap(2, 3);
        }
    }
    mesh
}

/// The nodes whose position satisfies `wanted`.
pub fn nodes_where(mesh: &TetMesh, wanted: impl Fn(Vec3) -> bool) -> Vec<u32> {
    (0..mesh.positions.len() as u32).filter(|&n| wanted(mesh.positions[n as usize])).collect()
}

fn kuhn(corner: [usize; 3], order: [usize; 3]) -> [[usize; 3]; 4] {
    let mut way = [corner; 4];
    for (step, &axis) in order.iter().enumerate() {
        for later in &mut way[step + 1..] {
            later[axis] += 1;
        }
    }
    way
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_filled_exactly_once() {
        let mesh = split_box([3, 2, 4], Vec3::new(6.0, 5.0, 8.0));
        assert_eq!(mesh.tets.len(), 144);
        assert!((mesh.total_mm3() - 240.0).abs() < 1e-3);
        assert!((0..144).all(|t| mesh.volume_mm3(t) > 0.0));
    }
}
