//! Boxes of tetrahedra for tests, examples and validation scenes, and picking their nodes.
//!
//! # Theory
//! Each cell is cut into the six tetrahedra of Kuhn's split, one for each order of the axes along
//! the way from corner 000 to corner 111: all cells are alike, so neighbours share their faces'
//! diagonals. A centred box has a node in the middle of each cell besides; four tetrahedra lie
//! around the line between two middles (the body-centred lattice of the mesher), two on every face
//! of the box.

use trepan_geometry::Vec3;
use trepan_mesh::TetMesh;

const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// A box from the origin to `size`, mm, of `cells` cells with six tetrahedra each.
pub fn split_box(cells: [usize; 3], size: Vec3) -> TetMesh {
    let nodes = cells.map(|n| n + 1);
    let mut mesh = TetMesh { positions: spread(nodes, 0.0, cells, size).collect(), ..TetMesh::default() };
    for cell in each(cells) {
        mesh.tets.extend(ORDERS.map(|order| kuhn(cell, order).map(|corner| number(nodes, corner))));
    }
    outside_in(&mut mesh);
    mesh
}

/// A box from the origin to `size`, mm, of `cells` cells with a node in the middle of each. It has
/// about twelve tetrahedra a cell, as the mesher lays them.
pub fn centred_box(cells: [usize; 3], size: Vec3) -> TetMesh {
    let nodes = cells.map(|n| n + 1);
    let mut mesh = TetMesh { positions: spread(nodes, 0.0, cells, size).collect(), ..TetMesh::default() };
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(spread(cells, 0.5, cells, size));
    let middle = |cell: [usize; 3]| first + number(cells, cell);
    let step = |at: [usize; 3], axis: usize| -> [usize; 3] { std::array::from_fn(|k| at[k] + usize::from(k == axis)) };
    for (c, axis) in each(cells).flat_map(|c| [0, 1, 2].map(|axis| (c, axis))) {
        let (second, third) = ((axis + 1) % 3, (axis + 2) % 3);
        let around = |c: [usize; 3]| {
            [c, step(c, second), step(step(c, second), third), step(c, third)].map(|corner| number(nodes, corner))
        };
        let half = |[a, b, d, e]: [u32; 4]| [[a, b, d, middle(c)], [a, d, e, middle(c)]];
        if c[axis] == 0 {
            mesh.tets.extend(half(around(c)));
        }
        let far = around(step(c, axis));
        if c[axis] + 1 == cells[axis] {
            mesh.tets.extend(half(far));
        } else {
            let next = middle(step(c, axis));
            mesh.tets.extend((0..4).map(|k| [far[k], far[(k + 1) % 4], next, middle(c)]));
        }
    }
    outside_in(&mut mesh);
    mesh
}

/// Every place of a grid of so many, x first.
fn each([nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..nx * ny * nz).map(move |n| [n % nx, n / nx % ny, n / (nx * ny)])
}

/// Number of a place in the order of [`each`].
fn number([nx, ny, _]: [usize; 3], [x, y, z]: [usize; 3]) -> u32 {
    ((z * ny + y) * nx + x) as u32
}

/// Positions of a grid's places, `shift` cells from the origin, in a box of so many cells, mm.
fn spread(places: [usize; 3], shift: f32, cells: [usize; 3], size: Vec3) -> impl Iterator<Item = Vec3> {
    each(places).map(move |c| Vec3::from_array(std::array::from_fn(|k| (c[k] as f32 + shift) / cells[k] as f32)) * size)
}

/// Swaps corners where a tetrahedron is inside out.
fn outside_in(mesh: &mut TetMesh) {
    for tet in 0..mesh.tets.len() {
        if mesh.volume_mm3(tet) < 0.0 {
            mesh.tets[tet].swap(2, 3);
        }
    }
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
    fn a_centred_box_is_filled_exactly_once() {
        let mesh = centred_box([3, 2, 4], Vec3::new(6.0, 5.0, 8.0));
        // Four around each of the 46 inner faces, two on each of the 52 outer ones.
        assert_eq!((mesh.tets.len(), mesh.positions.len()), (288, 84));
        assert!((mesh.total_mm3() - 240.0).abs() < 1e-3);
        assert!((0..288).all(|t| mesh.volume_mm3(t) > 0.0));
        let outside = trepan_mesh::Surface::of(&mesh).triangles;
        assert_eq!(outside.len(), 104);
    }

    #[test]
    fn a_box_is_filled_exactly_once() {
        let mesh = split_box([3, 2, 4], Vec3::new(6.0, 5.0, 8.0));
        assert_eq!(mesh.tets.len(), 144);
        assert!((mesh.total_mm3() - 240.0).abs() < 1e-3);
        assert!((0..144).all(|t| mesh.volume_mm3(t) > 0.0));
    }
}
