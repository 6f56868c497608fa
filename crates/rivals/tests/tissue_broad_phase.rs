//! Every broad phase gives all pairs that are, none whose boxes say no, and counts what does not
//! fit.

#[path = "../../deformable/tests/common/mod.rs"]
mod common;

use common::{Random, block, deformed};
use glam::{DVec3, Vec3};
use trepan_deformable::search::{HashedGrid, UniformGrid};
use trepan_deformable::{BroadPhase, Indexed, SearchInputs};
use trepan_geometry::Aabb;
use trepan_mesh::TetMesh;
use trepan_rivals::deformable::*;

fn all(mesh: &TetMesh, cell_mm: f32, points: usize) -> Vec<(&'static str, Box<dyn BroadPhase>)> {
    let (tets, inputs) = (mesh.tets.len(), SearchInputs { mesh, points, cell_mm });
    vec![
        ("uniform grid", Box::new(Indexed::new(UniformGrid::new(cell_mm, points), tets))),
        ("hashed grid", Box::new(Indexed::new(HashedGrid::new(cell_mm, points), tets))),
        ("octree", Box::new(Indexed::new(Octree::new(points), tets))),
        ("k-d tree", Box::new(Indexed::new(KdTree::new(points), tets))),
        ("box tree", Box::new(VolumeTree::<Aabox>::new(&inputs))),
        ("ball tree", Box::new(VolumeTree::<Sphere>::new(&inputs))),
        ("k-DOP tree", Box::new(VolumeTree::<KDop>::new(&inputs))),
        ("turned box tree", Box::new(VolumeTree::<Obb>::new(&inputs))),
        ("BSP tree", Box::new(Indexed::new(BspTree::new(points), tets))),
        ("interest matrix", Box::new(InterestMatrix::new(&inputs))),
        ("hybrid tree", Box::new(HybridTree::new(&mesh.positions, &mesh.tets))),
        ("parry", Box::new(ParryTree::new(&inputs))),
    ]
}

/// Every point in every tetrahedron, plainly and in f64: the pairs that no phase may lose.
fn inside(mesh: &TetMesh, positions: &[Vec3], points: &[Vec3]) -> Vec<[u32; 2]> {
    let volume = |c: [DVec3; 4]| (c[1] - c[0]).cross(c[2] - c[0]).dot(c[3] - c[0]);
    let mut pairs = truth(mesh, positions, points);
    pairs.retain(|&[point, tet]| {
        let corners = mesh.tets[tet as usize].map(|n| positions[n as usize].as_dvec3());
        let with =
            |k: usize| core::array::from_fn(|c| if c == k { points[point as usize].as_dvec3() } else { corners[c] });
        (0..4).all(|k| volume(with(k)) * volume(corners) >= 0.0)
    });
    pairs
}

/// Every point against every box, plainly: the pairs that a phase may give.
fn truth(mesh: &TetMesh, positions: &[Vec3], points: &[Vec3]) -> Vec<[u32; 2]> {
    let mut pairs = Vec::new();
    for (t, tet) in mesh.tets.iter().enumerate() {
        let bounds = Aabb::of_points(&tet.map(|n| positions[n as usize]));
        let inside = (0..points.len()).filter(|&i| bounds.contains(points[i]));
        pairs.extend(inside.map(|i| [i as u32, t as u32]));
    }
    pairs
}

#[test]
fn points_all_over_a_moving_mesh() {
    let mesh = block([5, 4, 6], 3.0);
    let mut random = Random::new(3);
    for cell_mm in [0.2, 1.0, 4.35, 50.0] {
        let mut phases = all(&mesh, cell_mm, 300);
        for step in 0..5 {
            let positions = deformed(&mesh, 3.0, step as f32, &mut random);
            let points: Vec<Vec3> = (0..300).map(|_| Vec3::splat(8.0) + random.cube() * 14.0).collect();
            let (must, may) = (inside(&mesh, &positions, &points), truth(&mesh, &positions, &points));
            assert!(must.len() > 20);
            let mut out = Vec::with_capacity(20_000);
            for (name, phase) in &mut phases {
                phase.update(&positions, &mesh.tets, &Aabb::of_points(&points));
                assert_eq!(phase.pairs(&points, &mut out), 0);
                assert!(out.is_sorted_by_key(|pair| pair[1]), "{name}: not ascending by tetrahedron");
                assert!(must.iter().all(|pair| out.contains(pair)), "{name}, cells of {cell_mm}: lost a pair");
                assert!(out.iter().all(|pair| may.contains(pair)), "{name}, cells of {cell_mm}: boxes say no");
                out.sort_unstable();
                out.dedup();
                let tight = ["k-DOP tree", "turned box tree", "ball tree"].contains(name);
                assert!(out.len() == may.len() || tight, "{name}, cells of {cell_mm}: twice or lost");
            }
        }
    }
}

#[test]
fn what_does_not_fit_is_counted_and_nothing_grows() {
    let mesh = block([4, 4, 4], 3.0);
    let mut random = Random::new(5);
    let points: Vec<Vec3> = (0..100).map(|_| Vec3::splat(6.0) + random.cube() * 6.0).collect();
    for (name, mut phase) in all(&mesh, 3.0, 100) {
        let mut out = Vec::with_capacity(10_000);
        phase.update(&mesh.positions, &mesh.tets, &Aabb::of_points(&points));
        assert_eq!(phase.pairs(&points, &mut out), 0);
        let expected = out.len();
        let mut out = Vec::with_capacity(32);
        let room = out.capacity();
        phase.update(&mesh.positions, &mesh.tets, &Aabb::of_points(&points));
        let overflow = phase.pairs(&points, &mut out) as usize;
        assert_eq!((out.len(), out.capacity(), overflow), (room, room, expected - room), "{name}");
    }
}

#[test]
fn nodes_and_points_that_are_nowhere_give_no_pairs_and_spoil_none() {
    let mesh = block([2, 2, 2], 3.0);
    let mut positions = mesh.positions.clone();
    positions[13] = Vec3::NAN; // the middle
    let points = [Vec3::new(0.5, 1.0, 4.5), Vec3::NAN, Vec3::splat(1e30), Vec3::splat(f32::INFINITY)];
    for (name, mut phase) in all(&mesh, 3.0, points.len()) {
        let mut out = Vec::with_capacity(64);
        phase.update(&positions, &mesh.tets, &mesh.bounds());
        assert_eq!(phase.pairs(&points, &mut out), 0);
        out.sort_unstable();
        let sound = |&[_, tet]: &[u32; 2]| !mesh.tets[tet as usize].contains(&13);
        let expected: Vec<_> = truth(&mesh, &mesh.positions, &points[..1]).into_iter().filter(sound).collect();
        assert!(!expected.is_empty() && out == expected, "{name}");
    }
}
