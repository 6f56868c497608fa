//! Splits of nodes where faces are cut, so that a mesh opens along them.
//!
//! # Theory
//! A cut face joins its two tetrahedra no longer. Around each of its nodes the tetrahedra are
//! joined by the faces that are left; where the two sides of the cut are no longer joined, the side
//! with fewer tetrahedra gets a copy of the node. So a cut opens from the border inwards, and along
//! its front, where the sides still meet, nodes stay whole: no hinge and no sliver arises, and no
//! tetrahedron changes its shape at rest.
//!
//! # Practice
//! A cut costs about a microsecond for each node, and allocates nothing. Who follows a mesh takes
//! the list of splits in its order ([`TetMesh::split`]): nodes keep their numbers, copies come
//! after them.
//!
//! # Sources
//! Node splitting along faces: Nienhuys and van der Stappen, Eurographics Short Papers, 2000.

use crate::{FACES, NONE, TetMesh, Topology};

/// A corner of a tetrahedron that moves from a node to its copy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Split {
    /// `4 · tetrahedron + corner`.
    pub corner: u32,
    /// The node that it had.
    pub from: u32,
    /// The node that it has: the next new one, or the one of the split before.
    pub node: u32,
}

impl Split {
    /// The tetrahedron, and which of its corners.
    pub fn place(self) -> (usize, usize) {
        ((self.corner / 4) as usize, (self.corner % 4) as usize)
    }
}

impl TetMesh {
    /// Splits nodes; a copy lies where its node does. `None`, and no change, where a split does not
    /// fit the mesh.
    pub fn split(&mut self, splits: &[Split]) -> Option<()> {
        let mut nodes = self.positions.len() as u32;
        for split in splits {
            let fits = split.corner < 4 * self.tets.len() as u32 && split.from < split.node && split.node <= nodes;
            nodes = fits.then(|| nodes.max(split.node + 1))?;
        }
        for split in splits {
            if split.node as usize == self.positions.len() {
                self.positions.push(self.positions[split.from as usize]);
            }
            let (tet, corner) = split.place();
            self.tets[tet][corner] = split.node;
        }
        Some(())
    }
}

/// Which tetrahedra of a mesh are joined, while faces are cut.
#[derive(Clone, Debug)]
pub struct Splitter {
    tets: Vec<[u32; 4]>,
    neighbours: Vec<[u32; 4]>,
    nodes: u32,
    /// The side that is looked at, and the search that saw each tetrahedron last.
    side: Vec<u32>,
    seen: Vec<u32>,
    searches: u32,
}

/// Most tetrahedra on a side of a cut at a node; a larger side is taken as joined. Numerical.
const MOST_AROUND: usize = 256;

impl Splitter {
    /// Of a whole mesh.
    pub fn of(mesh: &TetMesh) -> Self {
        Self {
            neighbours: Topology::of(mesh).neighbours,
            seen: vec![0; mesh.tets.len()],
            searches: 0,
            side: Vec::with_capacity(MOST_AROUND),
            nodes: mesh.positions.len() as u32,
            tets: mesh.tets.clone(),
        }
    }

    /// The tetrahedron across each face of one; [`NONE`] across the border or a cut.
    pub fn neighbours(&self, tet: u32) -> [u32; 4] {
        self.neighbours[tet as usize]
    }

    /// Corners of a tetrahedron.
    pub fn corners(&self, tet: u32) -> [u32; 4] {
        self.tets[tet as usize]
    }

    /// Nodes, with all copies.
    pub fn nodes(&self) -> u32 {
        self.nodes
    }

    /// Cuts a face, and appends the splits that follow; those that would not fit `to`'s capacity
    /// are not made. Tetrahedra for which `is_gone` holds join nothing. Returns whether the face
    /// joined two tetrahedra before.
    pub fn cut(&mut self, tet: u32, face: usize, is_gone: impl Fn(u32) -> bool, to: &mut Vec<Split>) -> bool {
        let next = self.neighbours[tet as usize][face];
        let Some(back) = self.neighbours.get(next as usize).and_then(|all| all.iter().position(|&n| n == tet)) else {
            return false;
        };
        self.neighbours[tet as usize][face] = NONE;
        self.neighbours[next as usize][back] = NONE;
        for corner in FACES[face] {
            let node = self.tets[tet as usize][corner];
            let sides = [tet, next].map(|from| {
                let is_joined = self.gather(from, node, [tet, next], &is_gone);
                (self.side.len(), is_joined, from)
            });
            if sides.iter().any(|(count, is_joined, _)| *is_joined || *count == 0) {
                continue;
            }
            let (_, _, smaller) = sides.into_iter().min().unwrap_or_default();
            self.gather(smaller, node, [NONE; 2], &is_gone);
            self.copy(node, to);
        }
        true
    }

    /// Takes over what another one cut and split. `None` where that does not fit the mesh.
    pub fn restore(&mut self, cuts: &[u32], splits: &[Split]) -> Option<()> {
        let mut mesh = TetMesh { positions: vec![Default::default(); self.nodes as usize], tets: self.tets.clone() };
        mesh.split(splits)?;
        for &cut in cuts {
            let (tet, face) = ((cut / 4) as usize, (cut % 4) as usize);
            let next = std::mem::replace(self.neighbours.get_mut(tet)?.get_mut(face)?, NONE);
            let theirs = self.neighbours.get_mut(next as usize)?;
            theirs.iter_mut().filter(|back| **back == tet as u32).for_each(|back| *back = NONE);
        }
        (self.nodes, self.tets) = (mesh.positions.len() as u32, mesh.tets);
        self.side.reserve(MOST_AROUND);
        Some(())
    }

    /// Finds the tetrahedra around a node that are joined to one; whether both `ends` are among
    /// them, or too many.
    fn gather(&mut self, from: u32, node: u32, ends: [u32; 2], is_gone: &impl Fn(u32) -> bool) -> bool {
        self.searches += 1;
        self.side.clear();
        self.seen[from as usize] = self.searches;
        if !is_gone(from) {
            self.side.push(from);
        }
        let mut at = 0;
        while let Some(tet) = self.side.get(at).copied() {
            at += 1;
            let corners = self.tets[tet as usize];
            for (face, next) in FACES.iter().zip(self.neighbours[tet as usize]) {
                let holds = next != NONE && face.iter().any(|&corner| corners[corner] == node);
                if holds && self.seen[next as usize] != self.searches && !is_gone(next) {
                    if self.side.len() == MOST_AROUND {
                        return true;
                    }
                    self.seen[next as usize] = self.searches;
                    self.side.push(next);
                }
            }
        }
        ends.iter().all(|end| self.side.contains(end))
    }

    /// Gives the present side a copy of a node.
    fn copy(&mut self, node: u32, to: &mut Vec<Split>) {
        if to.capacity() - to.len() < self.side.len() {
            return;
        }
        for &tet in &self.side {
            let corners = &mut self.tets[tet as usize];
            let Some(corner) = corners.iter().position(|&n| n == node) else { continue };
            corners[corner] = self.nodes;
            to.push(Split { corner: 4 * tet + corner as u32, from: node, node: self.nodes });
        }
        self.nodes += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surface;
    use trepan_geometry::Vec3;

    /// A block of cubes of six tetrahedra, 1 mm each.
    fn block(n: [u32; 3]) -> TetMesh {
        const PATHS: [[usize; 4]; 6] =
            [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
        let [nx, ny, nz] = n;
        let at = |x: u32, y: u32, z: u32| x + (nx + 1) * (y + (ny + 1) * z);
        let mut mesh = TetMesh::default();
        for (z, y, x) in (0..=nz).flat_map(|z| (0..=ny).flat_map(move |y| (0..=nx).map(move |x| (z, y, x)))) {
            mesh.positions.push(Vec3::new(x as f32, y as f32, z as f32));
            if x < nx && y < ny && z < nz {
                let corner = |c: usize| at(x + (c as u32 & 1), y + (c as u32 >> 1 & 1), z + (c as u32 >> 2));
                mesh.tets.extend(PATHS.map(|path| path.map(corner)));
            }
        }
        mesh
    }

    fn middle(mesh: &TetMesh, tet: usize) -> Vec3 {
        mesh.corners(tet).into_iter().sum::<Vec3>() / 4.0
    }

    /// Cuts all faces in the plane x = 2 for which `cuts` holds of their middle.
    fn cut_at_two(mesh: &TetMesh, cuts: impl Fn(Vec3) -> bool) -> (TetMesh, Vec<Split>) {
        let (mut splitter, mut splits) = (Splitter::of(mesh), Vec::with_capacity(1000));
        for tet in 0..mesh.tets.len() {
            for (face, nodes) in FACES.iter().enumerate() {
                let corners = nodes.map(|corner| mesh.corners(tet)[corner]);
                if corners.iter().all(|p| p.x == 2.0) && cuts(corners.into_iter().sum::<Vec3>() / 3.0) {
                    splitter.cut(tet as u32, face, |_| false, &mut splits);
                }
            }
        }
        let mut opened = mesh.clone();
        opened.split(&splits).unwrap();
        assert_eq!((&opened.tets, opened.positions.len() as u32), (&splitter.tets, splitter.nodes));
        (opened, splits)
    }

    #[test]
    fn a_block_cut_through_is_two_blocks() {
        let mesh = block([4, 3, 3]);
        let (opened, splits) = cut_at_two(&mesh, |_| true);
        let (part, parts) = Topology::of(&opened).components();
        assert_eq!((parts, opened.positions.len() - mesh.positions.len()), (2, 16));
        for (tet, part) in part.iter().enumerate() {
            assert_eq!(*part == part_of_first(&opened), middle(&mesh, tet).x < 2.0);
        }
        assert!(splits.iter().all(|split| opened.positions[split.node as usize].x == 2.0));
        let volume = |mesh: &TetMesh| (0..mesh.tets.len()).map(|t| mesh.volume_mm3(t)).sum::<f64>();
        assert_eq!(volume(&opened), volume(&mesh));
        assert!(Surface::of(&opened).is_closed());
    }

    fn part_of_first(mesh: &TetMesh) -> u32 {
        Topology::of(mesh).components().0[0]
    }

    #[test]
    fn a_slit_opens_from_the_border_and_not_at_its_front() {
        let mesh = block([4, 3, 3]);
        let (opened, _) = cut_at_two(&mesh, |middle| middle.z > 1.0);
        let copies = &opened.positions[mesh.positions.len()..];
        assert_eq!(copies.len(), 8);
        assert!(copies.iter().all(|p| p.z > 1.0), "the front at z = 1 stays whole");
        assert_eq!(Topology::of(&opened).components().1, 1);
        let (inside, _) = cut_at_two(&mesh, |middle| (middle - Vec3::new(2.0, 1.5, 1.5)).abs().max_element() < 0.5);
        assert_eq!(inside.positions.len(), mesh.positions.len(), "a cut without a way out opens nothing");
    }

    #[test]
    fn what_is_gone_joins_nothing() {
        let mesh = block([4, 1, 1]);
        let is_gone = |tet: u32| middle(&mesh, tet as usize).x > 2.0;
        let (mut splitter, mut splits) = (Splitter::of(&mesh), Vec::with_capacity(100));
        let right = (0..mesh.tets.len() as u32).find(|tet| is_gone(*tet)).unwrap();
        let face = splitter.neighbours(right).iter().position(|&n| n != NONE).unwrap();
        assert!(splitter.cut(right, face, is_gone, &mut splits) && splits.is_empty());
        assert!(!splitter.cut(right, face, is_gone, &mut splits), "it is cut once");
    }

    #[test]
    fn a_split_that_does_not_fit_changes_nothing() {
        let mesh = block([1, 1, 1]);
        let nodes = mesh.positions.len() as u32;
        for wrong in [
            Split { corner: 24, from: 0, node: nodes },
            Split { corner: 0, from: 0, node: nodes + 1 },
            Split { corner: 0, from: nodes, node: nodes },
        ] {
            let mut same = mesh.clone();
            assert_eq!(same.split(&[Split { corner: 0, from: 0, node: nodes }, wrong]).is_some(), wrong.node > nodes);
            same = mesh.clone();
            assert!(same.split(&[wrong]).is_none() && same == mesh);
        }
        // No room: nothing is opened that nobody would hear of.
        let mut splitter = Splitter::of(&block([2, 1, 1]));
        let mut none = Vec::new();
        (0..12).for_each(|tet| (0..4).for_each(|face| _ = splitter.cut(tet, face, |_| false, &mut none)));
        assert!(none.is_empty() && splitter.nodes() == 12);
    }
}
