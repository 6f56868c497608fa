//! Removes tetrahedra until the mesh has one closed manifold surface.
//!
//! # Theory
//! Where the surface passes through lattice nodes, tetrahedra may touch in an edge or a node only.
//! Around each edge they should form one fan, around each node one face-connected group with one
//! rim; of several, all but the largest are removed. If the group has two rims, a path of
//! tetrahedra between them is removed. Each round removes tetrahedra, so that the process
//! terminates; the angles of the others do not change.

use super::LabelledMesh;
use crate::{NONE, TetMesh, Topology};

/// The largest face-connected part of a mesh, with a manifold surface.
pub(super) fn repaired(LabelledMesh { mut mesh, mut label_of_tet, .. }: LabelledMesh) -> LabelledMesh {
    loop {
        let topology = Topology::of(&mesh);
        let mut doomed = outside_largest(&mesh, &topology);
        if !doomed.contains(&true) {
            mark_pinches(&mesh, &topology, &mut doomed);
        }
        if !doomed.contains(&true) {
            return LabelledMesh { mesh: mesh.without_orphans(), label_of_tet, ..LabelledMesh::default() };
        }
        let (mut keep, mut keep_label) = (doomed.iter().map(|d| !d), doomed.iter().map(|d| !d));
        mesh.tets.retain(|_| keep.next().unwrap_or(true));
        label_of_tet.retain(|_| keep_label.next().unwrap_or(true));
    }
}

/// Marks all but the face-connected part with most volume.
fn outside_largest(mesh: &TetMesh, topology: &Topology) -> Vec<bool> {
    let (part, parts) = topology.components();
    let mut mm3 = vec![0.0; parts];
    part.iter().enumerate().for_each(|(t, &p)| mm3[p as usize] += mesh.volume_mm3(t));
    let largest = (0..parts).max_by(|&a, &b| mm3[a].total_cmp(&mm3[b]).then(b.cmp(&a))).unwrap_or(0);
    part.iter().map(|&p| p as usize != largest).collect()
}

fn mark_pinches(mesh: &TetMesh, topology: &Topology, doomed: &mut [bool]) {
    for node in 0..mesh.positions.len() {
        let around = topology.tets_of_node.row(node);
        if around.iter().any(|&t| doomed[t as usize]) {
            continue;
        }
        let mut star = Star { mesh, topology, centre: node as u32, tets: around };
        star.mark(doomed);
    }
}

/// The tetrahedra around a node (its star).
struct Star<'a> {
    mesh: &'a TetMesh,
    topology: &'a Topology,
    centre: u32,
    tets: &'a [u32],
}

impl Star<'_> {
    /// Marks tetrahedra for removal, so that the node is interior or on one sheet of the surface.
    fn mark(&mut self, doomed: &mut [bool]) {
        let groups = self.groups(|t, f| self.crossable(t, f).is_some());
        if groups.len() > 1 {
            return self.doom_all_but_largest(&groups, doomed);
        }
        for other in self.rim_nodes() {
            let fans = self.fans(other);
            if fans.len() > 1 {
                return self.doom_all_but_largest(&fans, doomed);
            }
        }
        let rims = self.rims();
        if rims.len() > 1 {
            self.path(&rims[0], &rims[1]).into_iter().for_each(|t| doomed[t as usize] = true);
        }
    }

    /// The neighbour within the star across a face that contains the centre.
    fn crossable(&self, tet: u32, face: usize) -> Option<u32> {
        let corners = self.mesh.tets[tet as usize];
        let holds_centre = corners[crate::OPPOSITE[face]] != self.centre;
        let next = self.topology.neighbours[tet as usize][face];
        (holds_centre && next != NONE).then_some(next)
    }

    /// Groups of the star that are connected through the faces for which `open` holds.
    fn groups(&self, open: impl Fn(u32, usize) -> bool) -> Vec<Vec<u32>> {
        let mut left = self.tets.to_vec();
        let mut groups = Vec::new();
        while let Some(seed) = left.first().copied() {
            let mut group = vec![seed];
            left.remove(0);
            let mut done = 0;
            while done < group.len() {
                let tet = group[done];
                done += 1;
                for face in (0..4).filter(|&f| open(tet, f)) {
                    let next = self.topology.neighbours[tet as usize][face];
                    if let Some(at) = left.iter().position(|&t| t == next) {
                        group.push(left.remove(at));
                    }
                }
            }
            groups.push(group);
        }
        groups
    }

    /// The other ends of the boundary edges at the centre, ascending.
    fn rim_nodes(&self) -> Vec<u32> {
        let mut nodes: Vec<u32> = self.border_faces().into_iter().flat_map(|(_, ends)| ends).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// Boundary faces at the centre: the tetrahedron and the two other nodes.
    fn border_faces(&self) -> Vec<(u32, [u32; 2])> {
        let mut faces = Vec::new();
        for &tet in self.tets {
            let corners = self.mesh.tets[tet as usize];
            for (face, nodes) in crate::FACES.iter().enumerate() {
                let nodes = nodes.map(|c| corners[c]);
                if self.topology.neighbours[tet as usize][face] == NONE && nodes.contains(&self.centre) {
                    let at = nodes.iter().position(|&n| n == self.centre).unwrap_or_default();
                    faces.push((tet, [nodes[(at + 1) % 3], nodes[(at + 2) % 3]]));
                }
            }
        }
        faces
    }

    /// The tetrahedra around the edge to `other`, in fans connected through faces at that edge.
    fn fans(&self, other: u32) -> Vec<Vec<u32>> {
        let at_edge = |t: u32| self.mesh.tets[t as usize].contains(&other);
        let tets: Vec<u32> = self.tets.iter().copied().filter(|&t| at_edge(t)).collect();
        let fan = Star { tets: &tets, ..*self };
        let off_edge = |t: u32, f: usize| self.mesh.tets[t as usize][crate::OPPOSITE[f]];
        fan.groups(|t, f| self.crossable(t, f).is_some() && off_edge(t, f) != other)
    }

    /// Boundary faces at the centre in closed rings, as their tetrahedra.
    fn rims(&self) -> Vec<Vec<u32>> {
        let mut left = self.border_faces();
        let mut rims = Vec::new();
        while let Some((tet, [_, mut end])) = left.pop() {
            let mut rim = vec![tet];
            while let Some(at) = left.iter().position(|(_, [from, _])| *from == end) {
                let (tet, [_, to]) = left.remove(at);
                rim.push(tet);
                end = to;
            }
            rims.push(rim);
        }
        rims
    }

    /// The shortest path through the star between two sets of tetrahedra, including both ends.
    fn path(&self, from: &[u32], to: &[u32]) -> Vec<u32> {
        let mut reached: Vec<(u32, usize)> = from.iter().map(|&t| (t, usize::MAX)).collect();
        let mut done = 0;
        while done < reached.len() {
            let (tet, _) = reached[done];
            if to.contains(&tet) {
                break;
            }
            for next in (0..4).filter_map(|f| self.crossable(tet, f)) {
                if !reached.iter().any(|(t, _)| *t == next) {
                    reached.push((next, done));
                }
            }
            done += 1;
        }
        let mut path = Vec::new();
        let mut at = done.min(reached.len() - 1);
        while at != usize::MAX {
            path.push(reached[at].0);
            at = reached[at].1;
        }
        path
    }

    fn doom_all_but_largest(&self, groups: &[Vec<u32>], doomed: &mut [bool]) {
        let mm3 = |group: &Vec<u32>| group.iter().map(|&t| self.mesh.volume_mm3(t as usize)).sum::<f64>();
        let largest = (0..groups.len()).max_by(|&a, &b| mm3(&groups[a]).total_cmp(&mm3(&groups[b])).then(b.cmp(&a)));
        let others = groups.iter().enumerate().filter(|(at, _)| Some(*at) != largest);
        others.flat_map(|(_, group)| group).for_each(|&t| doomed[t as usize] = true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surface;
    use trepan_geometry::Vec3;

    /// Two stacks of tetrahedra that share one edge; the first has more volume.
    #[test]
    fn the_larger_of_two_parts_sharing_an_edge_is_kept() {
        let positions = vec![Vec3::ZERO, Vec3::Z, 2.0 * Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y];
        let mesh = TetMesh { positions, tets: vec![[0, 4, 5, 1], [0, 2, 3, 1]] };
        let labelled = LabelledMesh { mesh, label_of_tet: vec![4, 7], ..LabelledMesh::default() };
        let LabelledMesh { mesh, label_of_tet, .. } = repaired(labelled);
        assert_eq!(label_of_tet, [7]);
        assert_eq!(mesh.tets.len(), 1);
        assert!((mesh.total_mm3() - 2.0 / 6.0).abs() < 1e-6);
        assert!(Surface::of(&mesh).is_closed());
    }
}
