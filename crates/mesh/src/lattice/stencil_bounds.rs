//! Tests angle bounds of the cut lattice, over all extremes and over noisy boundaries.

use super::octree::tests::uniform;
use super::octree::{Cube, Lattice};
use super::regions::Partition;
use super::stencil::{ALPHA_LONG, ALPHA_SHORT, ON, Pieces, Stuffing, cut_edges, stuff};
use crate::{Quality, Surface, Topology};
use glam::DVec3;
use proptest::prelude::*;

/// A partition defined by a function.
struct By<F>(F);

impl<F: Fn(DVec3) -> f64 + Sync> Partition for By<F> {
    fn lead(&self, label: u16, _: u16, p: DVec3) -> f64 {
        if label == 0 { -(self.0)(p) } else { (self.0)(p) }
    }

    fn label_at(&self, p: DVec3) -> u16 {
        u16::from((self.0)(p) > 0.0)
    }

    fn inner_at(&self, _: DVec3) -> u16 {
        1
    }
}

/// Labels with random values at each cell of a fine hash.
struct Noise {
    seed: u64,
    labels: u16,
}

impl Noise {
    fn hold(&self, label: u16, p: DVec3) -> f64 {
        let inner = p.cmpgt(DVec3::splat(-0.6)).all() && p.cmplt(DVec3::splat(20.6)).all();
        if !inner {
            return if label == 0 { 1.0 } else { -1.0 };
        }
        let mut h = self.seed ^ 0x9E37_79B9_7F4A_7C15 ^ u64::from(label) << 40;
        for c in (p * 64.0).floor().to_array() {
            h = (h ^ (c as i64 as u64)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            h ^= h >> 29;
        }
        (h >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }
}

impl Partition for Noise {
    fn lead(&self, label: u16, other: u16, p: DVec3) -> f64 {
        self.hold(label, p) - self.hold(other, p)
    }

    fn label_at(&self, p: DVec3) -> u16 {
        let all: Vec<u16> = (0..self.labels).collect();
        self.strongest(&all, p)
    }

    fn inner_at(&self, p: DVec3) -> u16 {
        let all: Vec<u16> = (1..self.labels).collect();
        self.strongest(&all, p)
    }
}

/// A body defined by a function, divided by noise.
struct Divided<F>(F, Noise);

impl<F: Fn(DVec3) -> f64 + Sync> Partition for Divided<F> {
    fn lead(&self, label: u16, other: u16, p: DVec3) -> f64 {
        match (label, other) {
            (0, _) => -(self.0)(p),
            (_, 0) => (self.0)(p),
            _ => self.1.lead(label, other, p),
        }
    }

    fn label_at(&self, p: DVec3) -> u16 {
        if (self.0)(p) > 0.0 { self.inner_at(p) } else { 0 }
    }

    fn inner_at(&self, p: DVec3) -> u16 {
        self.1.inner_at(p)
    }
}

/// The corners of the surface's triangles, in order.
fn surface_of(mesh: &crate::TetMesh) -> Vec<[[u32; 3]; 3]> {
    let corner = |n: u32| mesh.positions[n as usize].to_array().map(f32::to_bits);
    let mut all: Vec<_> = Surface::of(mesh).triangles.iter().map(|triangle| triangle.map(corner)).collect();
    all.iter_mut().for_each(|triangle| triangle.sort_unstable());
    all.sort_unstable();
    all
}

#[test]
fn labels_inside_leave_every_triangle_of_the_outer_surface_as_it_is() {
    let waves = |p: DVec3| 7.0 + 1.5 * (1.3 * p.x).sin() * (1.1 * p.y).cos() - p.distance(DVec3::splat(10.0));
    for (seed, lattice) in [uniform(20.0, 1.7), uniform(20.0, 0.9), graded()].into_iter().enumerate() {
        let plain = stuff(&lattice, &By(waves)).mesh;
        let divided = stuff(&lattice, &Divided(waves, Noise { seed: seed as u64, labels: 5 }));
        assert_eq!(surface_of(&divided.mesh), surface_of(&plain));
        assert!((divided.mesh.total_mm3() / plain.total_mm3() - 1.0).abs() < 1e-6);
        assert_eq!(Topology::of(&divided.mesh).crowded_face, None);
        assert!(Quality::of(&divided.mesh).min_mm3 > 0.0);
    }
}

/// The elements that the bounds cover: those with a node inside.
fn covered(mut mesh: crate::TetMesh) -> crate::TetMesh {
    let outer = Surface::of(&mesh).nodes();
    mesh.tets.retain(|tet| tet.iter().any(|node| outer.binary_search(node).is_err()));
    mesh
}

#[test]
fn only_an_element_with_all_its_nodes_on_the_surface_has_had_a_larger_angle() {
    let mesh = stuff(&uniform(20.0, 1.0), &Noise { seed: 17168601643188875487, labels: 2 }).mesh;
    let (all, covered) = (Quality::of(&mesh), Quality::of(&covered(mesh)));
    assert!((162.5..162.7).contains(&all.max_dihedral_deg), "{all:?}");
    assert!(covered.min_dihedral_deg > 9.3 && covered.max_dihedral_deg < 161.7, "{covered:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]
    #[test]
    fn angles_of_one_label_stay_within_the_stated_bounds_whatever_the_surface(seed in any::<u64>()) {
        let mesh = stuff(&uniform(20.0, 1.0), &Noise { seed, labels: 2 }).mesh;
        prop_assert!(Quality::of(&mesh).min_mm3 > 0.0);
        let quality = Quality::of(&covered(mesh));
        prop_assert!(quality.min_dihedral_deg > 9.3 && quality.max_dihedral_deg < 161.7, "{quality:?}");
    }

    #[test]
    fn angles_of_several_labels_stay_within_the_stated_bounds_and_no_gap_opens(seed in any::<u64>(), labels in 3u16..6) {
        let labelled = stuff(&uniform(20.0, 1.0), &Noise { seed, labels });
        let quality = Quality::of(&labelled.mesh);
        prop_assert!(quality.min_mm3 > 0.0);
        prop_assert!(quality.min_dihedral_deg > 9.3 && quality.max_dihedral_deg < 161.7, "{quality:?}");
        prop_assert_eq!(Topology::of(&labelled.mesh).crowded_face, None);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]
    #[test]
    fn boundaries_across_cube_sizes_leave_no_gap_and_no_flat_element(seed in any::<u64>(), labels in 2u16..5) {
        let labelled = stuff(&graded(), &Noise { seed, labels });
        prop_assert!(Quality::of(&labelled.mesh).min_mm3 > 0.0);
        prop_assert_eq!(Topology::of(&labelled.mesh).crowded_face, None);
    }
}

/// Angles across cube sizes have no proven bound. The paper proves 1.66° to 174.72° for its cutting
/// of cubes of several sizes with one body; here a node may be moved to another cut. The worst of
/// 1,200 lattices of noise were 2.1° to 176.4° for one body, 0.7° to 179.0° for more labels.
#[test]
fn angles_across_cube_sizes_stay_within_those_of_many_lattices() {
    let angles = |seed: u64, labels: u16| {
        let Quality { min_dihedral_deg, max_dihedral_deg, .. } =
            Quality::of(&stuff(&graded(), &Noise { seed, labels }).mesh);
        (min_dihedral_deg, max_dihedral_deg)
    };
    for (seed, labels) in (0..6).map(|n| (0x9E37_79B9_7F4A_7C15u64.wrapping_mul(n), 2 + (n % 3) as u16)) {
        let (least, most) = if labels == 2 { (1.0, 178.0) } else { (0.2, 179.7) };
        let (low, high) = angles(seed, labels);
        assert!(low > least && high < most, "{seed}, {labels} labels: {low} to {high} degrees");
    }
    // Known gap: a lattice of one body that random search found over the limit of 178 degrees.
    let (low, high) = angles(10_623_495_746_571_118_104, 2);
    assert!((1.0..1.2).contains(&low) && (178.2..178.3).contains(&high), "{low} to {high} degrees");
}

/// A lattice of noise whose warp had left a tetrahedron without volume.
#[test]
fn a_node_stays_where_its_warp_would_flatten_a_tetrahedron() {
    let labelled = stuff(&graded(), &Noise { seed: 8_760_264_896_629_956_405, labels: 4 });
    assert!(Quality::of(&labelled.mesh).min_mm3 > 0.0);
    assert_eq!(Topology::of(&labelled.mesh).crowded_face, None);
}

/// A lattice of four cube sizes, finest around one point.
fn graded() -> Lattice {
    let point = DVec3::new(7.0, 9.0, 8.0);
    let judge = |centre: DVec3, level: u32| {
        let split = level > 0 && centre.distance(point) < 2.5 * f64::from(1 << level);
        if split { Cube::Split } else { Cube::Keep }
    };
    let bounds = [DVec3::ZERO, DVec3::splat(20.0)];
    Lattice::over(bounds, 0.5, DVec3::ZERO, 3, usize::MAX, judge).unwrap()
}

/// Extreme positions of a warped node: itself, or on one of its 14 edges.
/// Each comes with the corner of `tet` at the edge's other end, if any.
fn extremes(at: &[DVec3], tet: [u32; 4], node: u32) -> Vec<(DVec3, Option<usize>)> {
    let here = at[node as usize];
    let long = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]).map(|by| (by, ALPHA_LONG));
    let half = |n: u32, d: u32| if n >> d & 1 == 0 { 0.5 } else { -0.5 };
    let short = (0..8).map(|n| (DVec3::new(half(n, 0), half(n, 1), half(n, 2)), ALPHA_SHORT));
    let corner = |end: DVec3| tet.iter().position(|&n| at[n as usize].distance(end) < 1e-9);
    let moved = long.chain(short).map(|(by, alpha)| (here + alpha * by, corner(here + by)));
    std::iter::once((here, None)).chain(moved).collect()
}

/// Whether warped corners can have moved towards these ends: a cut is between two labels and
/// belongs to one of its ends.
fn possible(labels: [u16; 4], ends: [Option<usize>; 4], most: u16) -> bool {
    let once = (0..4).all(|n| ends[n].is_none_or(|end| ends[end] != Some(n)));
    let before = |all: u16, n: usize| if labels[n] != ON { labels[n] } else { all / most.pow(n as u32) % most };
    once && (0..most.pow(4)).any(|all| (0..4).all(|n| ends[n].is_none_or(|end| before(all, n) != before(all, end))))
}

/// All assignments of equal or different labels, or none, to four corners: the first is 0, a new
/// one the next number.
fn labellings() -> impl Iterator<Item = [u16; 4]> {
    let code = |all: u16| [0, 1, 2, 3].map(|n| if all / 5u16.pow(n) % 5 == 4 { ON } else { all / 5u16.pow(n) % 5 });
    let in_order = |labels: &[u16; 4]| {
        let mut next = 0;
        labels.iter().filter(|l| **l != ON).all(|&l| {
            next += u16::from(l == next);
            l < next
        })
    };
    (0..625).map(code).filter(in_order)
}

/// Extreme angles of a tetrahedron's pieces, over the labellings selected by `wanted`.
fn extremes_of_angles(most: u16, wanted: impl Fn(&[u16; 4]) -> bool) -> (f64, f64) {
    let lattice = uniform(1.0, 1.0);
    let (at, all) = (lattice.positions(), &lattice.tets);
    let mut found = (f64::INFINITY, 0.0f64);
    for &tet in &all[all.len() / 2..all.len() / 2 + 12] {
        let places = tet.map(|n| extremes(&at, tet, n));
        for labels in labellings().filter(&wanted) {
            let choices: [usize; 4] = std::array::from_fn(|n| if labels[n] == ON { 15 } else { 1 });
            for choice in 0..choices.iter().product() {
                let turn = |n: usize| choice / choices[..n].iter().product::<usize>() % choices[n];
                let chosen: [(DVec3, Option<usize>); 4] = std::array::from_fn(|n| places[n][turn(n)]);
                if possible(labels, chosen.map(|c| c.1), most) {
                    let (low, high) = angles_of_all_cuts(&lattice, &at, tet, labels, chosen.map(|c| c.0));
                    found = (found.0.min(low), found.1.max(high));
                }
            }
        }
    }
    found
}

/// Smallest and largest dihedral angle of the pieces of one tetrahedron, over extreme cut
/// positions.
fn angles_of_all_cuts(
    lattice: &Lattice,
    at: &[DVec3],
    tet: [u32; 4],
    labels: [u16; 4],
    corners: [DVec3; 4],
) -> (f64, f64) {
    let mut all = Stuffing {
        lattice,
        regions: &By(|_| 1.0),
        positions: at.to_vec(),
        labels: vec![ON; at.len()],
        outside: vec![false; at.len()],
        edges: Vec::new(),
        cuts: Vec::new(),
        tets: Vec::new(),
    };
    for n in 0..4 {
        // Plus one, so that no side is dropped as the outside.
        let label = if labels[n] == ON { ON } else { labels[n] + 1 };
        (all.positions[tet[n] as usize], all.labels[tet[n] as usize]) = (corners[n], label);
    }
    all.edges = cut_edges(&[tet], |n| all.labels[n as usize]);
    let mut found = (f64::INFINITY, 0.0f64);
    for ends in 0..1usize << all.edges.len() {
        let cut = |(n, &[a, b]): (usize, &[u32; 2])| {
            let alpha = if lattice.edge(a, b).1 { ALPHA_LONG } else { ALPHA_SHORT };
            let share = if ends >> n & 1 == 0 { alpha } else { 1.0 - alpha };
            all.positions[a as usize].lerp(all.positions[b as usize], share)
        };
        all.cuts = all.edges.iter().enumerate().map(cut).collect();
        let mut pieces = Pieces::default();
        all.emit(tet, &mut pieces);
        for angle in pieces.tets.iter().flat_map(|piece| crate::quality::dihedrals_deg(piece.map(|n| all.place(n)))) {
            found = (found.0.min(angle), found.1.max(angle));
        }
    }
    found
}

fn distinct(labels: &[u16; 4]) -> u16 {
    let mut all: Vec<u16> = labels.iter().copied().filter(|l| *l != ON).collect();
    all.sort_unstable();
    all.dedup();
    all.len() as u16
}

#[test]
fn no_extreme_of_warped_nodes_and_cuts_leaves_the_stated_angles() {
    for count in 1..5 {
        let (least, most) = extremes_of_angles(count.max(2), |labels| distinct(labels) == count);
        assert!(least > 9.3 && most < 161.7, "{count} labels: {least} to {most} degrees");
        let tight = (9.3..9.6).contains(&least) && (158.0..161.7).contains(&most);
        assert!(tight || count == 4, "{count} labels: {least} to {most} degrees");
    }
}

#[test]
fn a_ball_is_sound_and_closed() {
    let centre = DVec3::splat(10.0);
    let mesh = stuff(&uniform(20.0, 1.7), &By(|p: DVec3| 10.0 - p.distance(centre))).mesh;
    assert_eq!(mesh.check(), Ok(()));
    assert!(Surface::of(&mesh).is_closed());
    let ball = 4.0 / 3.0 * std::f64::consts::PI * 1000.0;
    assert!((mesh.total_mm3() / ball - 1.0).abs() < 0.02, "{}", mesh.total_mm3() / ball);
}

/// The wedges of two labels share four cuts: for any lengths and numbers, neither needs a cyclic
/// choice of diagonals.
#[test]
fn the_order_of_edges_suits_both_wedges() {
    for lengths in 0..81u32 {
        for order in 0..24usize {
            let mut left = vec![0, 1, 2, 3];
            let number = [order / 6, order / 2 % 3, order % 2, 0].map(|n| left.remove(n));
            let length = |a: usize, b: usize| lengths / 3u32.pow((2 * a + b) as u32) % 3;
            // Nodes p, q are 0, 1; m, n are 2, 3: edge (a, b) joins a of the former and b of the
            // latter.
            let own = [0, 1].map(|b| (length(0, b), number[0]) < (length(1, b), number[1]));
            let other = [0, 1].map(|a| (length(a, 0), number[2]) < (length(a, 1), number[3]));
            assert!(own[0] == own[1] || other[0] == other[1] || own[1] == other[1], "{lengths} {order}");
        }
    }
}
