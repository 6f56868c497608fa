//! Adjacency of tetrahedra: across faces and around nodes.
//!
//! # Theory
//! A face is the set of its three nodes. Faces with the same smallest node are collected in one
//! bucket and sorted there; equal ones are neighbours. Without a hash map the result depends on the
//! mesh alone.
//!
//! # Practice
//! 16 bytes per tetrahedron for neighbours, and as many for the tetrahedra of nodes. Built once per
//! mesh; deformation keeps it valid. Indices must be in range ([`TetMesh::check_indices`]).

use crate::{FACES, TetMesh};

/// No neighbour: the face is on the boundary.
pub const NONE: u32 = u32::MAX;

/// A compressed list of u32 rows: row r is `items[starts[r]..starts[r + 1]]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Csr {
    /// Start of each row, and one extra entry.
    pub starts: Vec<u32>,
    /// The items of all rows.
    pub items: Vec<u32>,
}

impl Csr {
    /// Sorts `(row, item)` pairs into `rows` rows, keeping their order within a row.
    pub fn of_pairs(rows: usize, pairs: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let mut starts = vec![0u32; rows + 1];
        pairs.clone().for_each(|(row, _)| starts[row as usize + 1] += 1);
        for row in 0..rows {
            starts[row + 1] += starts[row];
        }
        let mut next = starts.clone();
        let mut items = vec![0; starts[rows] as usize];
        for (row, item) in pairs {
            items[next[row as usize] as usize] = item;
            next[row as usize] += 1;
        }
        Self { starts, items }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The items of a row.
    pub fn row(&self, row: usize) -> &[u32] {
        &self.items[self.starts[row] as usize..self.starts[row + 1] as usize]
    }
}

/// Adjacency of the tetrahedra of a mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// The tetrahedron across each face, in the order of [`FACES`]; [`NONE`] at the boundary.
    pub neighbours: Vec<[u32; 4]>,
    /// The tetrahedra around each node, ascending.
    pub tets_of_node: Csr,
    /// A tetrahedron with a face shared by more than two; such a face links only the first two.
    pub crowded_face: Option<u32>,
}

impl Topology {
    /// The topology of a mesh whose indices are in range.
    pub fn of(mesh: &TetMesh) -> Self {
        let around = |corner_of: usize, t: usize| (mesh.tets[t][corner_of], t as u32);
        let pairs = (0..mesh.tets.len()).flat_map(move |t| (0..4).map(move |c| around(c, t)));
        let tets_of_node = Csr::of_pairs(mesh.positions.len(), pairs);
        let (neighbours, crowded_face) = link_faces(mesh);
        Self { neighbours, tets_of_node, crowded_face }
    }

    /// Index of each tetrahedron's face-connected part, and the number of parts; part 0 contains
    /// tetrahedron 0.
    pub fn components(&self) -> (Vec<u32>, usize) {
        let mut part = vec![NONE; self.neighbours.len()];
        let mut parts = 0;
        let mut open = Vec::new();
        for seed in 0..part.len() {
            if part[seed] != NONE {
                continue;
            }
            part[seed] = parts;
            open.push(seed);
            while let Some(tet) = open.pop() {
                for &next in self.neighbours[tet].iter().filter(|&&n| n != NONE) {
                    if part[next as usize] == NONE {
                        part[next as usize] = parts;
                        open.push(next as usize);
                    }
                }
            }
            parts += 1;
        }
        (part, parts as usize)
    }

    /// The tetrahedra at most `rings` faces away from `tet`: itself first, then ring by ring, each
    /// ascending.
    pub fn rings(&self, tet: u32, rings: usize) -> Vec<u32> {
        let mut found = vec![tet];
        let mut ring_start = 0;
        for _ in 0..rings {
            let ring = ring_start..found.len();
            ring_start = ring.end;
            let mut next: Vec<u32> = found[ring].iter().flat_map(|&t| self.neighbours[t as usize]).collect();
            next.sort_unstable();
            next.dedup();
            next.retain(|n| *n != NONE && !found.contains(n));
            found.extend(next);
        }
        found
    }
}

/// A face: its nodes in ascending order, and its tetrahedron and local index.
type Face = ([u32; 3], u32, u32);

fn link_faces(mesh: &TetMesh) -> (Vec<[u32; 4]>, Option<u32>) {
    let mut neighbours = vec![[NONE; 4]; mesh.tets.len()];
    let mut crowded = None;
    let mut bucket: Vec<Face> = Vec::new();
    let buckets = faces_by_smallest_node(mesh);
    for node in 0..buckets.len() {
        bucket.clear();
        bucket.extend(buckets.row(node).iter().map(|&id| (sorted_face(mesh, id), id / 4, id % 4)));
        bucket.sort_unstable();
        for same in bucket.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
            let (_, t0, f0) = same[0];
            let (_, t1, f1) = same[1];
            neighbours[t0 as usize][f0 as usize] = t1;
            neighbours[t1 as usize][f1 as usize] = t0;
            if same.len() > 2 {
                crowded = crowded.or(Some(t0));
            }
        }
    }
    (neighbours, crowded)
}

/// Face ids `4 · tet + face`, one row for each node.
fn faces_by_smallest_node(mesh: &TetMesh) -> Csr {
    let ids = 0..4 * mesh.tets.len() as u32;
    Csr::of_pairs(mesh.positions.len(), ids.map(|id| (sorted_face(mesh, id)[0], id)))
}

fn sorted_face(mesh: &TetMesh, id: u32) -> [u32; 3] {
    let mut nodes = FACES[id as usize % 4].map(|corner| mesh.tets[id as usize / 4][corner]);
    nodes.sort_unstable();
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    /// Two tetrahedra that share a face, and a separate one.
    fn pair_and_one() -> TetMesh {
        let mut positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE];
        positions.extend([5.0, 6.0].map(|x| Vec3::new(x, 0.0, 0.0)));
        positions.extend([Vec3::new(5.0, 1.0, 0.0), Vec3::new(5.0, 0.0, 1.0)]);
        TetMesh { positions, tets: vec![[0, 1, 2, 3], [1, 4, 2, 3], [5, 6, 7, 8]] }
    }

    #[test]
    fn neighbours_follow_the_order_of_faces() {
        let topology = Topology::of(&pair_and_one());
        assert_eq!(topology.neighbours, [[NONE, NONE, 1, NONE], [NONE, NONE, NONE, 0], [NONE; 4]]);
        assert_eq!(topology.tets_of_node.row(2), [0, 1]);
        assert_eq!(topology.tets_of_node.row(8), [2]);
        assert_eq!(topology.components(), (vec![0, 0, 1], 2));
        assert_eq!(topology.rings(0, 2), [0, 1]);
        assert_eq!(topology.crowded_face, None);
    }
}
