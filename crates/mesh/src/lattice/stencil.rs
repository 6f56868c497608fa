//! Isosurface stuffing: a lattice is warped and cut where a surface passes.
//!
//! # Theory
//! (Labelle and Shewchuk 2007.) Each lattice node has a sign: + inside, − outside, 0 on the surface. An edge between + and − has a cut point on the surface.
//! A cut point nearer to a node than α times the edge *violates* it; the node is moved to that point, its sign becomes 0, and its
//! other cut points vanish. No remaining cut is then close to a node, so each remaining tetrahedron falls into one of a few shapes:
//!
//! ```text
//! + and 0 only     kept whole              + + 0 −    a pyramid, two tetrahedra
//! + and cuts/0     one smaller one         + + − −    a wedge, three          + + + −    a prism, three
//! ```
//!
//! A face + + − leaves a quadrilateral that two tetrahedra share, so its diagonal is chosen from the face alone: at the cut of the long edge when
//! there is one, else by the parity rule (at the positive node that lies above the negative one in an even number of coordinates). With α = 0.24999 on long edges and 0.41189 on
//! short ones the paper proves dihedral angles between 10.7° and 164.8°. Here the violating cut is chosen freely (the nearest), which
//! allows 9.3° to 161.7° over all extremes of nodes and cuts (a test goes through them); rough noise stays over 10°, anatomy over 14°.

use super::bcc::Bcc;
use crate::TetMesh;
use glam::DVec3;
use rayon::prelude::*;

/// Violation limits of long and short edges, as fractions of the edge.
const ALPHA_LONG: f64 = 0.24999;
const ALPHA_SHORT: f64 = 0.41189;
/// Halvings of an edge to find its cut point.
const HALVINGS: usize = 24;

/// The lattice with signs, while it is warped and cut.
struct Stuffing<'a> {
    lattice: &'a Bcc,
    positions: Vec<DVec3>,
    signs: Vec<i8>,
    /// Edges with a cut, each `[lower, higher]` node, ascending.
    edges: Vec<[u32; 2]>,
    cuts: Vec<DVec3>,
    tets: Vec<[u32; 4]>,
}

/// The tetrahedra of the lattice inside `inside > 0`, cut at the surface.
pub(super) fn stuff(lattice: &Bcc, inside: impl Fn(DVec3) -> f64 + Sync) -> TetMesh {
    let mut stuffing = Stuffing::new(lattice, &inside);
    stuffing.warp();
    stuffing.fill()
}

impl<'a> Stuffing<'a> {
    fn new(lattice: &'a Bcc, inside: &(impl Fn(DVec3) -> f64 + Sync)) -> Self {
        let positions: Vec<DVec3> = (0..lattice.nodes()).map(|n| lattice.position(n)).collect();
        let signs: Vec<i8> = positions.par_iter().map(|&p| sign(inside(p))).collect();
        let sign_of = |n: u32| signs[n as usize];
        let mut tets = lattice.tets();
        tets.retain(|tet| tet.iter().any(|&n| sign_of(n) > 0));
        let edges = cut_edges(&tets, sign_of);
        let cut = |&[a, b]: &[u32; 2]| {
            let (from, to) = if sign_of(a) > 0 { (a, b) } else { (b, a) };
            crossing(inside, positions[from as usize], positions[to as usize])
        };
        let cuts = edges.par_iter().map(cut).collect();
        Self { lattice, positions, signs, edges, cuts, tets }
    }

    /// Moves each violated node to its nearest violating cut point.
    fn warp(&mut self) {
        let ends = (0..2 * self.edges.len()).map(|n| (self.edges[n / 2][n % 2], (n / 2) as u32));
        let cuts_of_node = crate::Csr::of_pairs(self.positions.len(), ends);
        for node in 0..self.positions.len() {
            if let Some(cut) = self.violation(node, cuts_of_node.row(node)) {
                self.positions[node] = cut;
                self.signs[node] = 0;
            }
        }
    }

    /// The nearest violating cut of a node among those that still exist: both ends of their edge have a sign.
    fn violation(&self, node: usize, cuts: &[u32]) -> Option<DVec3> {
        if self.signs[node] == 0 {
            return None;
        }
        let here = self.positions[node];
        let alive =
            cuts.iter().map(|&c| c as usize).filter(|&c| self.edges[c].iter().all(|&n| self.signs[n as usize] != 0));
        let near = alive
            .map(|c| (self.cuts[c].distance(here), c))
            .filter(|&(distance, c)| distance < self.limit(self.edges[c]));
        near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, c)| self.cuts[c])
    }

    fn limit(&self, edge: [u32; 2]) -> f64 {
        let short = 0.75f64.sqrt();
        self.lattice.spacing * if self.is_long(edge[0], edge[1]) { ALPHA_LONG } else { ALPHA_SHORT * short }
    }

    fn is_long(&self, a: u32, b: u32) -> bool {
        self.lattice.is_centre(a as usize) == self.lattice.is_centre(b as usize)
    }

    fn fill(self) -> TetMesh {
        let mut tets = Vec::with_capacity(self.tets.len() * 5 / 4);
        self.tets.iter().for_each(|&tet| self.emit(tet, &mut tets));
        let corner = |n: u32| {
            self.positions.get(n as usize).copied().unwrap_or_else(|| self.cuts[n as usize - self.positions.len()])
        };
        for tet in &mut tets {
            if crate::quality::volume(tet.map(corner)) < 0.0 {
                tet.swap(2, 3);
            }
        }
        let positions = self.positions.iter().chain(&self.cuts).map(|p| p.as_vec3()).collect();
        TetMesh { positions, tets }.without_orphans()
    }

    /// The pieces of one tetrahedron.
    fn emit(&self, tet: [u32; 4], out: &mut Vec<[u32; 4]>) {
        let with = |wanted: i8| move |n: &u32| self.signs[*n as usize] == wanted;
        let mut inside = tet.into_iter().filter(with(1));
        let mut outside = tet.into_iter().filter(with(-1));
        match (inside.clone().count(), outside.clone().count()) {
            (0, _) => {}
            (_, 0) => out.push(tet),
            (1, _) => {
                let p = inside.next().unwrap_or_default();
                out.push(tet.map(|n| if self.signs[n as usize] < 0 { self.cut(p, n) } else { n }));
            }
            (2, 1) => {
                let (p, n) = (corners::<2>(&mut inside), corners::<1>(&mut outside)[0]);
                let zero = tet.into_iter().find(with(0)).unwrap_or_default();
                out.extend(self.pyramid(zero, p, n));
            }
            (2, _) => out.extend(self.wedge(corners(&mut inside), corners(&mut outside))),
            _ => out.extend(self.prism_under(corners(&mut inside), corners::<1>(&mut outside)[0])),
        }
    }

    /// The node of the cut between two lattice nodes.
    fn cut(&self, a: u32, b: u32) -> u32 {
        let at = self.edges.binary_search(&[a.min(b), a.max(b)]).unwrap_or_default();
        (self.positions.len() + at) as u32
    }

    /// Whether the quadrilateral that the face (p, q, −n) leaves gets its diagonal at p (to the cut of q), else at q.
    fn diagonal_at(&self, p: u32, q: u32, n: u32) -> bool {
        match (self.is_long(p, n), self.is_long(q, n)) {
            (false, true) => true,
            (true, false) => false,
            _ => self.coordinates_above(p, n).is_multiple_of(2),
        }
    }

    /// In how many coordinates one node lies above another. From the two ends of a long edge these counts differ by one.
    fn coordinates_above(&self, node: u32, other: u32) -> usize {
        let (a, b) = (self.lattice.halves(node as usize), self.lattice.halves(other as usize));
        (0..3).filter(|&d| a[d] > b[d]).count()
    }

    fn pyramid(&self, apex: u32, [p, q]: [u32; 2], n: u32) -> [[u32; 4]; 2] {
        let (cp, cq) = (self.cut(p, n), self.cut(q, n));
        if self.diagonal_at(p, q, n) {
            [[apex, p, q, cq], [apex, p, cq, cp]]
        } else {
            [[apex, p, q, cp], [apex, q, cq, cp]]
        }
    }

    /// Three positive nodes over their cuts with one negative.
    fn prism_under(&self, top: [u32; 3], n: u32) -> [[u32; 4]; 3] {
        let beats = |i: usize, j: usize| self.diagonal_at(top[i], top[j], n);
        prism(top, top.map(|p| self.cut(p, n)), [beats(0, 1), beats(0, 2), beats(1, 2)])
    }

    /// Two positive and two negative nodes: a prism between the triangles of the two positive ones.
    fn wedge(&self, [p, q]: [u32; 2], [m, n]: [u32; 2]) -> [[u32; 4]; 3] {
        let top = [p, self.cut(p, m), self.cut(p, n)];
        let bottom = [q, self.cut(q, m), self.cut(q, n)];
        let (over_m, over_n) = (self.diagonal_at(p, q, m), self.diagonal_at(p, q, n));
        // The third quadrilateral lies on the surface: its diagonal is free where it closes no cycle.
        let free = if over_m == over_n { self.shorter(top[1], bottom[2], top[2], bottom[1]) } else { over_n };
        prism(top, bottom, [over_m, over_n, free])
    }

    /// Whether a b is shorter than c d.
    fn shorter(&self, a: u32, b: u32, c: u32, d: u32) -> bool {
        let cut = |n: u32| self.cuts[n as usize - self.positions.len()];
        cut(a).distance_squared(cut(b)) < cut(c).distance_squared(cut(d))
    }
}

/// Splits a prism into three. `wins` says for the pairs (0,1), (0,2), (1,2) whether the diagonal between them starts at the top of the first
/// (else of the second). A cycle cannot be split, so the pairs must give an order.
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

/// The first N nodes of an iterator that has as many.
fn corners<const N: usize>(nodes: &mut impl Iterator<Item = u32>) -> [u32; N] {
    std::array::from_fn(|_| nodes.next().unwrap_or_default())
}

fn sign(value: f64) -> i8 {
    i8::from(value > 0.0) - i8::from(value < 0.0)
}

/// Edges between + and −, ascending.
fn cut_edges(tets: &[[u32; 4]], sign_of: impl Fn(u32) -> i8) -> Vec<[u32; 2]> {
    let mut edges = Vec::new();
    for tet in tets {
        for [i, j, ..] in crate::quality::EDGES {
            let (a, b) = (tet[i].min(tet[j]), tet[i].max(tet[j]));
            if sign_of(a) * sign_of(b) < 0 {
                edges.push([a, b]);
            }
        }
    }
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// A point on the surface between an inner and an outer point.
fn crossing(inside: &impl Fn(DVec3) -> f64, mut inner: DVec3, mut outer: DVec3) -> DVec3 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (inner + outer);
        if inside(middle) > 0.0 {
            inner = middle;
        } else {
            outer = middle;
        }
    }
    0.5 * (inner + outer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Quality, Surface};
    use proptest::prelude::*;

    /// A function with an arbitrary value at each cell of a fine hash: as rough as a surface can be.
    fn noise(seed: u64, p: DVec3) -> f64 {
        let mut h = seed ^ 0x9E37_79B9_7F4A_7C15;
        for c in (p * 64.0).floor().to_array() {
            h = (h ^ (c as i64 as u64)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            h ^= h >> 29;
        }
        (h >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]
        #[test]
        fn angles_stay_within_the_proven_bounds_whatever_the_surface(seed in any::<u64>()) {
            let lattice = Bcc::over(DVec3::ZERO, DVec3::splat(20.0), 1.0, DVec3::ZERO);
            let inner = |p: DVec3| p.cmpgt(DVec3::splat(-0.6)).all() && p.cmplt(DVec3::splat(20.6)).all();
            let mesh = stuff(&lattice, |p| if inner(p) { noise(seed, p) } else { -1.0 });
            let quality = Quality::of(&mesh);
            prop_assert!(quality.min_mm3 > 0.0);
            prop_assert!(quality.min_dihedral_deg > 9.3 && quality.max_dihedral_deg < 164.8, "{quality:?}");
        }
    }

    /// Where a warped node may be at the most: here, or on one of its 14 edges; with the corner of `tet` at the other end.
    fn extremes(lattice: &Bcc, tet: [u32; 4], node: u32) -> Vec<(DVec3, Option<usize>)> {
        let here = lattice.position(node as usize);
        let long = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]).map(|by| (by, ALPHA_LONG));
        let half = |n: u32, d: u32| if n >> d & 1 == 0 { 0.5 } else { -0.5 };
        let short = (0..8).map(|n| (DVec3::new(half(n, 0), half(n, 1), half(n, 2)), ALPHA_SHORT));
        let corner = |end: DVec3| tet.iter().position(|&n| lattice.position(n as usize).distance(end) < 1e-9);
        let moved = long.chain(short).map(|(by, alpha)| (here + alpha * by, corner(here + by)));
        std::iter::once((here, None)).chain(moved).collect()
    }

    /// Whether warped corners can have moved towards these ends: a cut lies between opposite signs, and serves one of its ends.
    fn possible(signs: [i8; 4], ends: [Option<usize>; 4]) -> bool {
        let once = (0..4).all(|n| ends[n].is_none_or(|end| ends[end] != Some(n)));
        let before = |all: usize, n: usize| if signs[n] != 0 { signs[n] } else { 1 - 2 * (all >> n & 1) as i8 };
        once && (0..16).any(|all| (0..4).all(|n| ends[n].is_none_or(|end| before(all, n) != before(all, end))))
    }

    #[test]
    fn no_extreme_of_warped_nodes_and_cuts_leaves_the_stated_angles() {
        let lattice = Bcc::over(DVec3::ZERO, DVec3::ONE, 1.0, DVec3::ZERO);
        let all = lattice.tets();
        let (mut least, mut most) = (f64::INFINITY, 0.0f64);
        for &tet in &all[all.len() / 2..all.len() / 2 + 12] {
            let places = tet.map(|n| extremes(&lattice, tet, n));
            for code in 0..81usize {
                let signs: [i8; 4] = std::array::from_fn(|n| (code / 3usize.pow(n as u32) % 3) as i8 - 1);
                let choices: [usize; 4] = std::array::from_fn(|n| if signs[n] == 0 { 15 } else { 1 });
                if !signs.contains(&1) {
                    continue;
                }
                for choice in 0..choices.iter().product() {
                    let turn = |n: usize| choice / choices[..n].iter().product::<usize>() % choices[n];
                    let chosen: [(DVec3, Option<usize>); 4] = std::array::from_fn(|n| places[n][turn(n)]);
                    if possible(signs, chosen.map(|c| c.1)) {
                        let (low, high) = angles_of_all_cuts(&lattice, tet, signs, chosen.map(|c| c.0));
                        (least, most) = (least.min(low), most.max(high));
                    }
                }
            }
        }
        assert!((9.3..9.4).contains(&least) && (161.6..161.7).contains(&most), "{least} to {most} degrees");
    }

    /// The smallest and largest dihedral angle of the pieces of one tetrahedron, over cuts as near to either end as they may be.
    fn angles_of_all_cuts(lattice: &Bcc, tet: [u32; 4], signs: [i8; 4], corners: [DVec3; 4]) -> (f64, f64) {
        let mut all = Stuffing {
            lattice,
            positions: (0..lattice.nodes()).map(|n| lattice.position(n)).collect(),
            signs: vec![0; lattice.nodes()],
            edges: Vec::new(),
            cuts: Vec::new(),
            tets: Vec::new(),
        };
        for n in 0..4 {
            (all.positions[tet[n] as usize], all.signs[tet[n] as usize]) = (corners[n], signs[n]);
        }
        all.edges = cut_edges(&[tet], |n| all.signs[n as usize]);
        let mut found = (f64::INFINITY, 0.0f64);
        for ends in 0..1usize << all.edges.len() {
            let cut = |(n, &[a, b]): (usize, &[u32; 2])| {
                let alpha = if all.is_long(a, b) { ALPHA_LONG } else { ALPHA_SHORT };
                let share = if ends >> n & 1 == 0 { alpha } else { 1.0 - alpha };
                all.positions[a as usize].lerp(all.positions[b as usize], share)
            };
            all.cuts = all.edges.iter().enumerate().map(cut).collect();
            let mut pieces = Vec::new();
            all.emit(tet, &mut pieces);
            let corner = |n: u32| {
                all.positions.get(n as usize).copied().unwrap_or_else(|| all.cuts[n as usize - all.positions.len()])
            };
            for angle in pieces.iter().flat_map(|piece| crate::quality::dihedrals_deg(piece.map(corner))) {
                found = (found.0.min(angle), found.1.max(angle));
            }
        }
        found
    }

    #[test]
    fn a_ball_is_sound_and_closed() {
        let lattice = Bcc::over(DVec3::splat(-10.0), DVec3::splat(10.0), 1.7, DVec3::splat(0.3));
        let mesh = stuff(&lattice, |p| 10.0 - p.length());
        assert_eq!(mesh.check(), Ok(()));
        assert!(Surface::of(&mesh).is_closed());
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 1000.0;
        assert!((mesh.total_mm3() / ball - 1.0).abs() < 0.02, "{}", mesh.total_mm3() / ball);
    }
}
