//! Which faces of a mesh are its border while tetrahedra go, and which lie side by side.
//!
//! # Practice
//! A face is `4 · tetrahedron + face`, for life. The face beside it across an edge is found by
//! turning around that edge through the tetrahedra that are left. Only faces around one that goes
//! are looked at.

use trepan_mesh::{FACES, NONE, Split, TetMesh, Topology};

/// Longest turn around an edge, tetrahedra; numerical.
const LONGEST_TURN: usize = 64;

/// Faces of a mesh that are border.
pub struct Border {
    tets: Vec<[u32; 4]>,
    neighbours: Vec<[u32; 4]>,
    is_gone: Vec<bool>,
    /// The face across each edge of each face that is border.
    beside: Vec<[u32; 3]>,
}

impl Border {
    /// Of a whole mesh.
    pub fn of(mesh: &TetMesh) -> Self {
        let neighbours = Topology::of(mesh).neighbours;
        let (count, is_gone) = (mesh.tets.len(), vec![false; mesh.tets.len()]);
        let mut border = Self { tets: mesh.tets.clone(), neighbours, is_gone, beside: vec![[NONE; 3]; 4 * count] };
        (0..4 * count as u32).for_each(|face| border.join(face));
        border
    }

    /// Whether a face is border.
    pub fn is_border(&self, face: u32) -> bool {
        let (tet, at) = split(face);
        self.neighbours.get(tet).is_some_and(|next| next[at] == NONE && !self.is_gone[tet])
    }

    /// The border faces across the edges of one; edge k runs from corner k to the next.
    pub fn beside(&self, face: u32) -> [u32; 3] {
        self.beside[face as usize]
    }

    /// Nodes of a face, counterclockwise from outside.
    pub fn nodes(&self, face: u32) -> [u32; 3] {
        let (tet, at) = split(face);
        FACES[at].map(|corner| self.tets[tet][corner])
    }

    /// Number of faces, border or not.
    pub fn faces(&self) -> usize {
        self.beside.len()
    }

    /// Takes a tetrahedron away and returns the faces that came to light, [`NONE`] for none.
    pub fn remove(&mut self, tet: u32) -> [u32; 4] {
        let mut exposed = [NONE; 4];
        if self.is_gone.get(tet as usize).is_none_or(|gone| *gone) {
            return exposed;
        }
        self.is_gone[tet as usize] = true;
        for (face, next) in std::mem::replace(&mut self.neighbours[tet as usize], [NONE; 4]).into_iter().enumerate() {
            let Some(theirs) = self.neighbours.get_mut(next as usize) else { continue };
            let back = theirs.iter().position(|&other| other == tet).unwrap_or_default();
            theirs[back] = NONE;
            exposed[face] = 4 * next + back as u32;
        }
        exposed.into_iter().filter(|&face| face != NONE).for_each(|face| self.join(face));
        exposed
    }

    /// Follows splits of nodes and returns the faces that came to light.
    pub fn split(&mut self, splits: &[Split]) -> Vec<u32> {
        for split in splits {
            let (tet, corner) = split.place();
            self.tets[tet][corner] = split.node;
        }
        let mut exposed = Vec::new();
        for (tet, at) in splits.iter().flat_map(|split| (0..4).map(|at| (split.place().0, at))) {
            let next = self.neighbours[tet][at] as usize;
            let Some(theirs) = self.tets.get(next).copied() else { continue };
            if FACES[at].iter().all(|&corner| theirs.contains(&self.tets[tet][corner])) {
                continue;
            }
            let back = self.neighbours[next].iter().position(|&other| other == tet as u32).unwrap_or_default();
            (self.neighbours[tet][at], self.neighbours[next][back]) = (NONE, NONE);
            exposed.extend([4 * tet + at, 4 * next + back].map(|face| face as u32));
        }
        if !exposed.is_empty() {
            (0..self.faces() as u32).for_each(|face| self.join(face));
        }
        exposed
    }

    /// Joins a border face with those across its edges.
    fn join(&mut self, face: u32) {
        if !self.is_border(face) {
            return;
        }
        let nodes = self.nodes(face);
        for edge in 0..3 {
            let ends = [nodes[edge], nodes[(edge + 1) % 3]];
            let other = self.turn(face, ends);
            self.beside[face as usize][edge] = other;
            if other != NONE {
                let theirs = self.nodes(other);
                // The neighbour runs along the edge the other way.
                if let Some(back) = (0..3).find(|&k| theirs[k] == ends[1] && theirs[(k + 1) % 3] == ends[0]) {
                    self.beside[other as usize][back] = face;
                }
            }
        }
    }

    /// The border face that is reached by turning around an edge of one.
    fn turn(&self, face: u32, ends: [u32; 2]) -> u32 {
        let (mut tet, mut at) = split(face);
        for _ in 0..LONGEST_TURN {
            let holds = |f: usize| ends.iter().all(|end| FACES[f].iter().any(|&c| self.tets[tet][c] == *end));
            let Some(out) = (0..4).find(|&f| f != at && holds(f)) else { return NONE };
            let next = self.neighbours[tet][out];
            if next == NONE {
                return (4 * tet + out) as u32;
            }
            at = self.neighbours[next as usize].iter().position(|&other| other == tet as u32).unwrap_or_default();
            tet = next as usize;
        }
        NONE
    }
}

/// Tetrahedron and number of a face.
fn split(face: u32) -> (usize, usize) {
    ((face / 4) as usize, (face % 4) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    /// A cube of 3³ cubes of six tetrahedra.
    fn cube() -> TetMesh {
        const SPLIT: [[usize; 4]; 6] =
            [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
        let at = |i: usize| Vec3::new((i % 4) as f32, (i / 4 % 4) as f32, (i / 16) as f32);
        let corner = |cell: usize, c: usize| {
            let (x, y, z) = (cell % 3 + (c & 1), cell / 3 % 3 + (c >> 1 & 1), cell / 9 + (c >> 2));
            (x + 4 * y + 16 * z) as u32
        };
        let tets = (0..27).flat_map(|cell| SPLIT.map(|split| split.map(|c| corner(cell, c)))).collect();
        TetMesh { positions: (0..64).map(at).collect(), tets }
    }

    #[test]
    fn neighbours_on_the_border_are_those_of_the_mesh_that_was_cut() {
        let mut mesh = cube();
        let mut border = Border::of(&mesh);
        let (mut splitter, mut splits) = (trepan_mesh::Splitter::of(&mesh), Vec::with_capacity(999));
        let is_left = |tet: u32| mesh.corners(tet as usize).iter().all(|p| p.x <= 1.0);
        for (tet, face) in (0..mesh.tets.len() as u32).flat_map(|tet| (0..4).map(move |face| (tet, face))) {
            let next = splitter.neighbours(tet)[face];
            if next != NONE && is_left(tet) != is_left(next) && mesh.corners(tet as usize).iter().any(|p| p.z > 1.0) {
                splitter.cut(tet, face, |_| false, &mut splits);
            }
        }
        let exposed = border.split(&splits);
        assert!(exposed.len() > 20 && exposed.iter().all(|&face| border.is_border(face)));
        mesh.split(&splits).unwrap();
        let anew = Border::of(&mesh);
        for face in (0..anew.faces() as u32).filter(|&face| anew.is_border(face)) {
            assert_eq!((anew.nodes(face), anew.beside(face)), (border.nodes(face), border.beside(face)));
        }
        assert!((0..anew.faces() as u32).all(|face| anew.is_border(face) == border.is_border(face)));
    }

    #[test]
    fn neighbours_on_the_border_are_those_of_the_mesh_without_what_went() {
        let mesh = cube();
        let mut border = Border::of(&mesh);
        let mut order: Vec<u32> = (0..mesh.tets.len() as u32).collect();
        order.sort_by_key(|tet| tet.wrapping_mul(2_654_435_761) % 1009);
        let mut gone = vec![false; order.len()];
        for (turn, &tet) in order.iter().enumerate() {
            let exposed = border.remove(tet);
            assert!(exposed.iter().all(|&face| face == NONE || border.is_border(face)));
            assert_eq!(border.remove(tet), [NONE; 4], "only once");
            gone[tet as usize] = true;
            if turn % 5 != 0 {
                continue;
            }
            let left: Vec<usize> = (0..gone.len()).filter(|&t| !gone[t]).collect();
            let rest =
                TetMesh { positions: mesh.positions.clone(), tets: left.iter().map(|&t| mesh.tets[t]).collect() };
            let anew = Border::of(&rest);
            let whole = |face: u32| if face == NONE { NONE } else { 4 * left[face as usize / 4] as u32 + face % 4 };
            for face in 0..anew.faces() as u32 {
                assert_eq!(anew.is_border(face), border.is_border(whole(face)));
                if anew.is_border(face) {
                    assert_eq!(anew.beside(face).map(whole), border.beside(whole(face)), "turn {turn}");
                    for other in anew.beside(face) {
                        assert!(anew.beside(other).contains(&face), "each is beside the other");
                    }
                }
            }
        }
    }
}
