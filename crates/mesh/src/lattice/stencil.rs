//! Isosurface stuffing: warps a lattice and cuts it where labels meet.
//!
//! # Theory
//! (Labelle and Shewchuk 2007; several labels after the idea of Bronson, Levine and Whitaker 2012.)
//! Each lattice node has a label. An edge between two labels has a cut point where both are equal.
//! A cut point nearer to a node than α times the edge *violates* it; the node is moved to that
//! point, counts as on the boundary of every label from then on, and its other cut points are
//! removed. No remaining cut is then close to a node. Each remaining tetrahedron is divided at its
//! cuts, identically on both sides of a boundary (∘ is a node on a boundary).
//!
//! The outer surface comes first: cuts with the outside move nodes as if there were one label.
//! Then a node with a cut left with the outside counts as on the boundary of its labels where it
//! is, and other nodes are moved to boundaries between labels; both remain inside for the outer
//! surface. So a tetrahedron with a node outside is cut as with one label, and the outer surface
//! does not depend on labels inside. Where one reaches it, that label's border is accurate to half
//! a spacing.
//!
//! ```text
//! A A A A, A ∘ ∘ ∘   whole            A A A B    a prism, three, and a corner
//! A B ∘ ∘            two corners      A A B B    two wedges, three each, that share four cuts
//! A A B ∘            a pyramid, two, and a corner
//! A B C ∘            three corners, and the middle between their cuts
//! A A B C            two corners, a prism, and a pyramid up to the cut B-C: the rest is A's
//! A B C D            four corners, and the octahedron between the six cuts in four
//! ```
//!
//! The region between the cuts of three or four labels goes to the label at its centre, the rest of
//! A A B C to A. Where three labels meet, their common line is therefore accurate to about half a
//! lattice spacing. Every face still has the same triangles on both sides, so that there is no gap
//! or overlap.
//!
//! A face A A B leaves a quadrilateral that two tetrahedra share, so that its diagonal depends on
//! the face alone: it starts at the cut of the longer edge, and for equal edges at the cut of the
//! node with the higher number. This order of edges is total, so that no prism has a cyclic choice
//! of diagonals, and the two wedges of A A B B never need different diagonals on their common
//! quadrilateral.
//!
//! With α = 0.24999 on long edges and 0.41189 on short ones the paper proves dihedral angles
//! between 10.7° and 164.8° for one label. Here the nearest violating cut is chosen, which allows
//! 9.3° to 161.7° for one to four labels, over all extremes of nodes and cuts on cubes of one size
//! (a test enumerates them). Not covered is a tetrahedron with all four nodes on boundaries: it is
//! removed if one of them was outside and kept otherwise; on boundaries of pure noise its angles
//! were 10.5° to 162.6°.

use super::LabelledMesh;
use super::octree::Lattice;
use super::regions::Partition;
use crate::TetMesh;
use crate::quality::{EDGES, dihedrals_deg, volume};
use glam::DVec3;
use rayon::prelude::*;

/// Violation limits along the axes and across, as fractions of the edge.
pub(super) const ALPHA_LONG: f64 = 0.24999;
pub(super) const ALPHA_SHORT: f64 = 0.41189;
/// A short edge of a uniform lattice, in spacings.
const SHORT: f64 = 0.866_025_403_784_438_6;
/// Bisection steps to find an edge's cut point.
const HALVINGS: usize = 24;
/// Smallest volume that warping may leave a lattice tetrahedron, in cubes of the finest spacing; at
/// rest the smallest has 1/12.
const LEAST_VOLUME: f64 = 1e-4;
/// Dihedral angles that cutting leaves on cubes of one size, degrees.
const LEAST_DEG: f64 = 9.3;
const MOST_DEG: f64 = 161.7;
/// The label of a node on the outer surface.
pub(super) const ON: u16 = u16::MAX;
/// The label of a node on a boundary between labels inside.
pub(super) const INNER: u16 = u16::MAX - 1;

/// The labelled lattice during warping and cutting.
pub(super) struct Stuffing<'a, P> {
    pub(super) lattice: &'a Lattice,
    pub(super) regions: &'a P,
    pub(super) positions: Vec<DVec3>,
    pub(super) labels: Vec<u16>,
    /// Whether a node was outside before warping.
    pub(super) outside: Vec<bool>,
    /// Edges with a cut, each `[lower, higher]` node, ascending.
    pub(super) edges: Vec<[u32; 2]>,
    pub(super) cuts: Vec<DVec3>,
    pub(super) tets: Vec<[u32; 4]>,
}

/// Tetrahedra and their labels.
#[derive(Default)]
pub(super) struct Pieces {
    pub(super) tets: Vec<[u32; 4]>,
    pub(super) labels: Vec<u16>,
}

impl Pieces {
    fn add(&mut self, label: u16, tets: &[[u32; 4]]) {
        self.tets.extend(tets);
        self.labels.resize(self.tets.len(), label);
    }
}

/// The tetrahedra of the lattice inside any nonzero label, cut where labels meet.
pub(super) fn stuff<P: Partition>(lattice: &Lattice, regions: &P) -> LabelledMesh {
    let mut stuffing = Stuffing::new(lattice, regions);
    stuffing.warp();
    stuffing.fill()
}

impl<'a, P: Partition> Stuffing<'a, P> {
    fn new(lattice: &'a Lattice, regions: &'a P) -> Self {
        let positions = lattice.positions();
        let labels: Vec<u16> = positions.par_iter().map(|&p| regions.label_at(p)).collect();
        let label_of = |n: u32| labels[n as usize];
        let mut tets = lattice.tets.clone();
        tets.retain(|tet| tet.iter().any(|&n| label_of(n) != 0));
        let edges = cut_edges(&tets, label_of);
        let cut = |&[a, b]: &[u32; 2]| {
            let [a, b] = if label_of(a) > label_of(b) { [a, b] } else { [b, a] };
            let beats = |p| regions.lead(label_of(a), label_of(b), p) > 0.0;
            crossing(beats, positions[a as usize], positions[b as usize])
        };
        let cuts = edges.par_iter().map(cut).collect();
        let outside = labels.iter().map(|&label| label == 0).collect();
        Self { lattice, regions, positions, labels, outside, edges, cuts, tets }
    }

    /// Moves each violated node to its nearest violating cut point: first to the outer surface.
    fn warp(&mut self) {
        let ends = (0..2 * self.edges.len()).map(|n| (self.edges[n / 2][n % 2], (n / 2) as u32));
        let cuts_of_node = crate::Csr::of_pairs(self.positions.len(), ends);
        let corners = self.tets.iter().enumerate().flat_map(|(t, tet)| tet.iter().map(move |&n| (n, t as u32)));
        let tets_of_node = crate::Csr::of_pairs(self.positions.len(), corners);
        let reach = self.reach();
        for to in [ON, INNER] {
            for node in 0..self.positions.len() {
                if let Some(cut) = self.violation(node, reach[node], to, cuts_of_node.row(node))
                    && !self.flattens(node, cut, tets_of_node.row(node))
                {
                    if to == ON || !self.sharpens(node, cut, tets_of_node.row(node)) {
                        self.positions[node] = cut;
                    }
                    self.labels[node] = to;
                }
            }
            if to == ON {
                self.hold_rim();
            }
        }
    }

    /// Counts each node that has cuts with the outside and with another label as on the boundary
    /// inside, where it is.
    fn hold_rim(&mut self) {
        let mut rim = vec![false; self.positions.len()];
        for &[a, b] in self.edges.iter().filter(|&&edge| self.alive(edge, ON)) {
            [a, b].into_iter().for_each(|n| rim[n as usize] = true);
        }
        let inner: Vec<[u32; 2]> = self.edges.iter().copied().filter(|&edge| self.alive(edge, INNER)).collect();
        for n in inner.into_iter().flatten().filter(|&n| rim[n as usize]) {
            self.labels[n as usize] = INNER;
        }
    }

    /// Whether an edge still has its cut, with the outside if `to` is [`ON`], else between labels.
    fn alive(&self, edge: [u32; 2], to: u16) -> bool {
        let labels = edge.map(|n| self.labels[n as usize]);
        labels.iter().all(|&label| label < INNER) && (labels.contains(&0) == (to == ON))
    }

    /// Whether moving a node would leave a tetrahedron at it almost without volume. Only where
    /// cubes of several sizes and several labels meet; the node then stays, and its cut makes a
    /// short edge.
    fn flattens(&self, node: usize, to: DVec3, tets: &[u32]) -> bool {
        let left = |&t: &u32| {
            let tet = self.tets[t as usize];
            let now = volume(tet.map(|n| self.positions[n as usize]));
            let then = volume(tet.map(|n| if n as usize == node { to } else { self.positions[n as usize] }));
            then / now.signum()
        };
        let least = LEAST_VOLUME * self.lattice.spacing.powi(3);
        tets.iter().map(left).any(|volume| volume.is_nan() || volume < least)
    }

    /// Whether moving a node would sharpen a tetrahedron whose other nodes are on boundaries, which
    /// is not cut.
    fn sharpens(&self, node: usize, to: DVec3, tets: &[u32]) -> bool {
        let is_whole = |tet: &[u32; 4]| tet.iter().all(|&n| n as usize == node || self.labels[n as usize] >= INNER);
        let place = |n: u32| if n as usize == node { to } else { self.positions[n as usize] };
        let is_sharp = |angle: f64| !(LEAST_DEG..=MOST_DEG).contains(&angle);
        let whole = tets.iter().map(|&t| self.tets[t as usize]).filter(is_whole);
        whole.flat_map(|tet| dihedrals_deg(tet.map(place))).any(is_sharp)
    }

    /// Spacing of the finest lattice at each node, mm.
    fn reach(&self) -> Vec<f64> {
        let mut quarters = vec![u64::MAX; self.positions.len()];
        for tet in &self.tets {
            for [i, j, ..] in EDGES {
                let (squared, straight) = self.lattice.edge(tet[i], tet[j]);
                // A short edge is half the diagonal of a cube: a² = 4/3 of its square.
                let squared = if straight { 3 * squared } else { 4 * squared };
                for end in [i, j].map(|n| tet[n] as usize) {
                    quarters[end] = quarters[end].min(squared);
                }
            }
        }
        quarters.into_iter().map(|n| self.lattice.spacing * (n as f64 / 12.0).sqrt()).collect()
    }

    /// The nearest violating cut of a node whose edge still has labels at both ends.
    fn violation(&self, node: usize, reach: f64, to: u16, cuts: &[u32]) -> Option<DVec3> {
        let here = self.positions[node];
        let alive = cuts.iter().map(|&c| c as usize).filter(|&c| self.alive(self.edges[c], to));
        let near = alive
            .map(|c| (self.cuts[c].distance(here), c))
            .filter(|&(distance, c)| distance < self.limit(self.edges[c]).min(self.limit_at(reach, self.edges[c])));
        near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, c)| self.cuts[c])
    }

    /// Distance from an edge's end within which a cut violates it, mm.
    fn limit(&self, [a, b]: [u32; 2]) -> f64 {
        let (squared, straight) = self.lattice.edge(a, b);
        0.5 * self.lattice.spacing * (squared as f64).sqrt() * if straight { ALPHA_LONG } else { ALPHA_SHORT }
    }

    /// The same for a node whose finest lattice has the spacing `reach`.
    fn limit_at(&self, reach: f64, [a, b]: [u32; 2]) -> f64 {
        reach * if self.lattice.edge(a, b).1 { ALPHA_LONG } else { ALPHA_SHORT * SHORT }
    }

    fn fill(self) -> LabelledMesh {
        let mut pieces = Pieces::default();
        self.tets.iter().for_each(|&tet| self.emit(tet, &mut pieces));
        for tet in &mut pieces.tets {
            if volume(tet.map(|n| self.place(n))) < 0.0 {
                tet.swap(2, 3);
            }
        }
        let positions = self.positions.iter().chain(&self.cuts).map(|p| p.as_vec3()).collect();
        let mesh = TetMesh { positions, tets: pieces.tets }.without_orphans();
        LabelledMesh { mesh, label_of_tet: pieces.labels, ..LabelledMesh::default() }
    }

    /// Position of a node or a cut.
    pub(super) fn place(&self, n: u32) -> DVec3 {
        self.positions.get(n as usize).copied().unwrap_or_else(|| self.cuts[n as usize - self.positions.len()])
    }

    fn middle<const N: usize>(&self, nodes: [u32; N]) -> DVec3 {
        nodes.iter().map(|&n| self.place(n)).sum::<DVec3>() / N as f64
    }

    /// Adds the pieces of one tetrahedron that are not outside.
    pub(super) fn emit(&self, tet: [u32; 4], out: &mut Pieces) {
        let mut nodes = tet;
        nodes.sort_unstable_by_key(|&n| (self.labels[n as usize], n));
        let label = |n: u32| self.labels[n as usize];
        let outer = nodes.iter().filter(|&&n| label(n) == 0).count();
        if outer > 0 {
            return self.emit_inside(nodes, outer, out);
        }
        let held = nodes.iter().filter(|&&n| label(n) < INNER).count();
        let first = out.tets.len();
        let (held, on) = nodes.split_at(held);
        let mut groups = held.chunk_by(|&a, &b| label(a) == label(b));
        match [groups.next(), groups.next(), groups.next(), groups.next()] {
            [None, ..] if on.iter().any(|&n| label(n) == INNER) => {
                out.add(self.regions.inner_at(self.middle(tet)), &[tet]);
            }
            [None, ..] if tet.iter().any(|&n| self.outside[n as usize]) => {}
            [None, ..] => out.add(self.regions.label_at(self.middle(tet)), &[tet]),
            [Some(a), None, ..] => out.add(label(a[0]), &[tet]),
            [Some(a), Some(b), None, _] => {
                self.side(label(a[0]), a, b, on, out);
                self.side(label(b[0]), b, a, on, out);
            }
            [Some(a), Some(b), Some(c), None] => self.three([a, b, c], on, out),
            [Some(_), Some(_), Some(_), Some(_)] => self.four(nodes, out),
        }
        out.keep_inside(first);
    }

    /// Adds the pieces inside of a tetrahedron whose first nodes are outside. Those inside have one
    /// label or are on its boundary, so that the cut is that of one label.
    fn emit_inside(&self, nodes: [u32; 4], outer: usize, out: &mut Pieces) {
        let (outer, rest) = nodes.split_at(outer);
        let on = rest.iter().filter(|&&n| self.labels[n as usize] == ON).count();
        let (own, on) = rest.split_at(rest.len() - on);
        let Some(&first) = own.first() else { return };
        let middle = || own.iter().map(|&n| self.place(n)).sum::<DVec3>() / own.len() as f64;
        let label = match self.labels[first as usize] {
            INNER => self.regions.inner_at(middle()),
            label => label,
        };
        let mut own = own.to_vec();
        own.sort_unstable();
        self.side(label, &own, outer, on, out);
    }

    /// One label's part of a tetrahedron with two labels.
    fn side(&self, label: u16, own: &[u32], other: &[u32], on: &[u32], out: &mut Pieces) {
        match (own, other) {
            (&[p], _) => out.add(label, &[self.corner(p, other, on)]),
            (&[p, q], &[n]) => out.add(label, &self.pyramid(on[0], [p, q], n)),
            (&[p, q], _) => out.add(label, &self.wedge([p, q], [other[0], other[1]])),
            _ => out.add(label, &self.prism_under([own[0], own[1], own[2]], other[0])),
        }
    }

    fn three(&self, groups: [&[u32]; 3], on: &[u32], out: &mut Pieces) {
        let ones: Vec<u32> = groups.iter().filter(|g| g.len() == 1).map(|g| g[0]).collect();
        let pair = groups.into_iter().find(|g| g.len() == 2);
        for &p in &ones {
            let others: Vec<u32> = groups.iter().flat_map(|g| *g).copied().filter(|&n| n != p).collect();
            out.add(self.labels[p as usize], &[self.corner(p, &others, on)]);
        }
        if let Some(&[p, q]) = pair {
            return self.fork([p, q], [ones[0], ones[1]], out);
        }
        let [a, b, c] = [ones[0], ones[1], ones[2]];
        let cuts = [self.cut(a, b), self.cut(b, c), self.cut(a, c)];
        let label = self.regions.strongest(&[a, b, c].map(|n| self.labels[n as usize]), self.middle(cuts));
        out.add(label, &[[on[0], cuts[0], cuts[1], cuts[2]]]);
    }

    /// The part of two nodes of one label in a tetrahedron with two more labels.
    fn fork(&self, [p, q]: [u32; 2], [b, c]: [u32; 2], out: &mut Pieces) {
        let top = [p, self.cut(p, b), self.cut(p, c)];
        let bottom = [q, self.cut(q, b), self.cut(q, c)];
        let (over_b, over_c) = (self.diagonal_at(p, q, b), self.diagonal_at(p, q, c));
        let free = if over_b == over_c { self.shorter([top[1], bottom[2]], [top[2], bottom[1]]) } else { over_c };
        let label = self.labels[p as usize];
        out.add(label, &prism(top, bottom, [over_b, over_c, free]));
        let apex = self.cut(b, c);
        let ring = if free { [top[1], top[2], bottom[2], bottom[1]] } else { [top[2], bottom[2], bottom[1], top[1]] };
        out.add(label, &[[apex, ring[0], ring[1], ring[2]], [apex, ring[0], ring[2], ring[3]]]);
    }

    /// Four labels: their corners, and the octahedron of the six cuts around its shortest diagonal.
    fn four(&self, nodes: [u32; 4], out: &mut Pieces) {
        for p in nodes {
            let others: Vec<u32> = nodes.into_iter().filter(|&n| n != p).collect();
            out.add(self.labels[p as usize], &[self.corner(p, &others, &[])]);
        }
        let cut = |i: usize, j: usize| self.cut(nodes[i], nodes[j]);
        let axes = [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2]];
        let length = |[i, j, k, l]: [usize; 4]| self.place(cut(i, j)).distance_squared(self.place(cut(k, l)));
        let shortest = (0..3).min_by(|&a, &b| length(axes[a]).total_cmp(&length(axes[b]))).unwrap_or(0);
        let [i, j, k, l] = axes[shortest];
        let ring = [cut(i, k), cut(j, k), cut(j, l), cut(i, l)];
        let label = self.regions.strongest(&nodes.map(|n| self.labels[n as usize]), self.middle(ring));
        for n in 0..4 {
            out.add(label, &[[cut(i, j), cut(k, l), ring[n], ring[(n + 1) % 4]]]);
        }
    }

    /// The tetrahedron between a node, its cuts with others, and boundary nodes.
    fn corner(&self, p: u32, others: &[u32], on: &[u32]) -> [u32; 4] {
        let mut far = others.iter().map(|&n| self.cut(p, n)).chain(on.iter().copied());
        [p, far.next().unwrap_or(p), far.next().unwrap_or(p), far.next().unwrap_or(p)]
    }

    /// The index of the cut between two lattice nodes.
    fn cut(&self, a: u32, b: u32) -> u32 {
        let at = self.edges.binary_search(&[a.min(b), a.max(b)]).unwrap_or_default();
        (self.positions.len() + at) as u32
    }

    /// Whether the quadrilateral of the face (p, q | n) has its diagonal at p (to the cut of q),
    /// else at q.
    fn diagonal_at(&self, p: u32, q: u32, n: u32) -> bool {
        (self.lattice.edge(p, n).0, p) < (self.lattice.edge(q, n).0, q)
    }

    fn pyramid(&self, apex: u32, [p, q]: [u32; 2], n: u32) -> [[u32; 4]; 2] {
        let (cp, cq) = (self.cut(p, n), self.cut(q, n));
        if self.diagonal_at(p, q, n) {
            [[apex, p, q, cq], [apex, p, cq, cp]]
        } else {
            [[apex, p, q, cp], [apex, q, cq, cp]]
        }
    }

    /// The prism between three nodes and their cuts with one of another label.
    fn prism_under(&self, top: [u32; 3], n: u32) -> [[u32; 4]; 3] {
        let beats = |i: usize, j: usize| self.diagonal_at(top[i], top[j], n);
        prism(top, top.map(|p| self.cut(p, n)), [beats(0, 1), beats(0, 2), beats(1, 2)])
    }

    /// The wedge of two nodes against two: a prism between the triangles of the first two.
    fn wedge(&self, [p, q]: [u32; 2], [m, n]: [u32; 2]) -> [[u32; 4]; 3] {
        let top = [p, self.cut(p, m), self.cut(p, n)];
        let bottom = [q, self.cut(q, m), self.cut(q, n)];
        let wins = [self.diagonal_at(p, q, m), self.diagonal_at(p, q, n), self.border_diagonal([p, q], [m, n])];
        prism(top, bottom, wins)
    }

    /// Whether the quadrilateral between two nodes and two of another label is split from p–m to
    /// q–n.
    /// The prism of either side decides if it needs a diagonal, else the shorter one is taken.
    fn border_diagonal(&self, [p, q]: [u32; 2], [m, n]: [u32; 2]) -> bool {
        let own = [self.diagonal_at(p, q, m), self.diagonal_at(p, q, n)];
        let other = [self.diagonal_at(m, n, p), self.diagonal_at(m, n, q)];
        match (own[0] == own[1], other[0] == other[1]) {
            (false, _) => own[1],
            (_, false) => other[1],
            _ => self.shorter([self.cut(p, m), self.cut(q, n)], [self.cut(p, n), self.cut(q, m)]),
        }
    }

    /// Whether the first of two lines is shorter.
    fn shorter(&self, [a, b]: [u32; 2], [c, d]: [u32; 2]) -> bool {
        let squared = |a: u32, b: u32| self.place(a).distance_squared(self.place(b));
        squared(a, b) < squared(c, d)
    }
}

impl Pieces {
    /// Removes the outside's pieces from `first` on.
    fn keep_inside(&mut self, first: usize) {
        let mut kept = first;
        for at in first..self.tets.len() {
            if self.labels[at] != 0 {
                (self.tets[kept], self.labels[kept]) = (self.tets[at], self.labels[at]);
                kept += 1;
            }
        }
        self.tets.truncate(kept);
        self.labels.truncate(kept);
    }
}

/// Splits a prism into three. `wins` gives for the pairs (0,1), (0,2), (1,2) whether the diagonal
/// starts at the top of the first (else of the second). A cyclic choice cannot be split, so that
/// the pairs must define an order.
fn prism(top: [u32; 3], bottom: [u32; 3], wins: [bool; 3]) -> [[u32; 4]; 3] {
    let score = [
        usize::from(wins[0]) + usize::from(wins[1]),
        usize::from(!wins[0]) + usize::from(wins[2]),
        usize::from(!wins[1]) + usize::from(!wins[2]),
    ];
    let mut order = [0, 1, 2];
    order.sort_unstable_by_key(|&i| 2 - score[i]);
    let [a, b, c] = order;
    [
        [top[a], top[b], top[c], bottom[c]],
        [top[a], top[b], bottom[b], bottom[c]],
        [top[a], bottom[a], bottom[b], bottom[c]],
    ]
}

/// Edges between two labels, ascending.
pub(super) fn cut_edges(tets: &[[u32; 4]], label_of: impl Fn(u32) -> u16) -> Vec<[u32; 2]> {
    let mut edges = Vec::new();
    for tet in tets {
        for [i, j, ..] in EDGES {
            let (a, b) = (tet[i].min(tet[j]), tet[i].max(tet[j]));
            if label_of(a) != label_of(b) && label_of(a) != ON && label_of(b) != ON {
                edges.push([a, b]);
            }
        }
    }
    edges.par_sort_unstable();
    edges.dedup();
    edges
}

/// Bisects for a boundary point between a point that `holds` and one that does not.
fn crossing(holds: impl Fn(DVec3) -> bool, mut inner: DVec3, mut outer: DVec3) -> DVec3 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (inner + outer);
        if holds(middle) {
            inner = middle;
        } else {
            outer = middle;
        }
    }
    0.5 * (inner + outer)
}
