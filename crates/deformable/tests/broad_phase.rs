//! Every broad phase gives exactly the pairs whose boxes say so, and counts what does not fit.

mod common;

use common::{Random, block, deformed};
use glam::Vec3;
use trepan_deformable::BroadPhase;
use trepan_deformable::broad::{AabbTree, HashedGrid, UniformGrid};
use trepan_geometry::Aabb;
use trepan_mesh::TetMesh;

fn all(mesh: &TetMesh, cell_mm: f32, points: usize) -> Vec<(&'static str, Box<dyn BroadPhase>)> {
    let tets = mesh.tets.len();
    vec![
        ("uniform grid", Box::new(UniformGrid::new(cell_mm, points, tets))),
        ("hashed grid", Box::new(HashedGrid::new(cell_mm, points, tets))),
        ("tree", Box::new(AabbTree::new(&mesh.positions, &mesh.tets))),
    ]
}

/// Every point against every box, plainly.
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
            let expected = truth(&mesh, &positions, &points);
            let mut out = Vec::with_capacity(20_000);
            for (name, phase) in &mut phases {
                phase.update(&positions, &mesh.tets, &Aabb::of_points(&points));
                assert_eq!(phase.pairs(&points, &mut out), 0);
                assert!(out.is_sorted_by_key(|pair| pair[1]), "{name}: not ascending by tetrahedron");
                out.sort_unstable_by_key(|&[point, tet]| (tet, point));
                assert_eq!(out, expected, "{name}, cells of {cell_mm}");
            }
        }
    }
}

#[test]
fn what_does_not_fit_is_counted_and_nothing_grows() {
    let mesh = block([4, 4, 4], 3.0);
    let mut random = Random::new(5);
    let points: Vec<Vec3> = (0..100).map(|_| Vec3::splat(6.0) + random.cube() * 6.0).collect();
    let expected = truth(&mesh, &mesh.positions, &points).len();
    for (name, mut phase) in all(&mesh, 3.0, 100) {
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
