//! Tetrahedra that are taken away while a tool touches them.

mod common;

use trepan_deformable::{Config, Method, Response, TissueCollision, TissueStep};
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_mesh::TetMesh;

const EDGE_MM: f32 = 24.0;

/// A cube of `cells³` split cubes.
fn cube(cells: usize) -> TetMesh {
    common::block([cells; 3], EDGE_MM / cells as f32)
}

fn centre(mesh: &TetMesh, tet: u32) -> Vec3 {
    mesh.corners(tet as usize).into_iter().sum::<Vec3>() / 4.0
}

fn collision(mesh: &TetMesh, method: &str, may_go: impl Fn(u32) -> bool) -> TissueCollision {
    let method = Method::OWN.into_iter().find(|own| own.name() == method).expect("its own");
    let config = Config { method, response: Some(Response::Ball), ..Config::default() };
    let plain = TissueCollision::new(mesh, &Tool::probe(3.0), &config).expect("a sound mesh");
    plain.resectable(mesh, may_go).expect("a search of this crate")
}

/// Depth, force on the hand and sum of the areas of the springs.
fn felt(step: &TissueStep) -> [f32; 5] {
    let force = step.patch.normal * step.patch.force_n;
    [step.manifold.depth_mm, force.x, force.y, force.z, step.surface_springs.iter().map(|s| s.stiffness).sum()]
}

fn alike(a: [f32; 5], b: [f32; 5]) -> bool {
    a.into_iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-4 * (1.0 + a.abs().max(b.abs())))
}

/// A tool that goes down into a hole that is made before it, over waves in the tissue.
#[test]
fn a_hole_is_felt_as_in_the_mesh_without_it_by_every_search() {
    let mesh = cube(8);
    let count = mesh.tets.len() as u32;
    let may_go = |t: u32| centre(&mesh, t).distance(Vec3::new(12.0, 12.0, EDGE_MM)) < 11.0;
    let mut all: Vec<(&str, TissueCollision)> =
        ["walk", "brute", "uniform-grid"].into_iter().map(|name| (name, collision(&mesh, name, may_go))).collect();
    let mut order: Vec<u32> = (0..count).filter(|&t| may_go(t)).collect();
    order.sort_by(|&a, &b| centre(&mesh, b).z.total_cmp(&centre(&mesh, a).z));
    let mut gone = vec![false; count as usize];
    let (velocities, mut touched) = (vec![Vec3::ZERO; mesh.positions.len()], 0);
    for (turn, batch) in order.chunks(9).enumerate() {
        for &tet in batch {
            gone[tet as usize] = true;
            all.iter_mut().for_each(|(_, collision)| collision.thin(tet, 0));
        }
        let wave = |p: &Vec3| *p + Vec3::X * 0.5 * (0.4 * p.z + 0.2 * turn as f32).sin();
        let positions: Vec<Vec3> = mesh.positions.iter().map(wave).collect();
        let z = EDGE_MM + 2.0 - 10.0 * turn as f32 / (order.len() / 9) as f32;
        let tool = ToolState::at(Pose::from_translation(Vec3::new(12.0 + (turn as f32).sin(), 12.5, z)));
        let left = TetMesh {
            tets: (0..count).filter(|&t| !gone[t as usize]).map(|t| mesh.tets[t as usize]).collect(),
            positions: mesh.positions.clone(),
        };
        if turn % 8 != 5 {
            continue;
        }
        let mut anew = TissueStep::default();
        collision(&left, "brute", |_| false).step(&positions, &velocities, &tool, &mut anew);
        for (name, collision) in &mut all {
            let mut step = TissueStep::default();
            // What comes to light presses in full after 20 steps, and the normal follows in 200.
            (0..200).for_each(|_| collision.step(&positions, &velocities, &tool, &mut step));
            assert!(step.points_in_contact == anew.points_in_contact, "{name} in turn {turn}");
            assert!(alike(felt(&step), felt(&anew)), "{name} in turn {turn}: {:?} {:?}", felt(&step), felt(&anew));
            assert_eq!((step.skipped, step.stale, step.overflow), (0, 0, 0), "{name} in turn {turn}");
        }
        touched += u32::from(anew.manifold.depth_mm > 0.1);
    }
    assert!(touched > 3, "{touched}");
}

#[test]
fn until_something_is_removed_every_bit_is_as_without() {
    let mesh = cube(9);
    let config = Config { friction: 0.2, shaft: true, ..Config::default() };
    let plain = || TissueCollision::new(&mesh, &Tool::probe(3.0), &config).expect("a sound mesh");
    let mut both = [plain(), plain().resectable(&mesh, |t| t % 3 > 0).expect("a search of this crate")];
    let (velocities, mut random) = (vec![Vec3::X * 0.01; mesh.positions.len()], common::Random::new(7));
    for turn in 0..60 {
        let positions = common::deformed(&mesh, 0.5, 0.1 * turn as f32, &mut random);
        let tip = Vec3::new(12.0 + 0.1 * turn as f32, 12.0, EDGE_MM + 1.0 - 0.05 * turn as f32);
        let tool = ToolState::at(Pose::from_translation(tip));
        let felt = both.each_mut().map(|collision| {
            let mut step = TissueStep::default();
            collision.step(&positions, &velocities, &tool, &mut step);
            (felt(&step).map(f32::to_bits), step.surface_springs.len(), step.points_in_contact)
        });
        assert_eq!(felt[0], felt[1], "turn {turn}");
    }
}

#[test]
fn all_of_a_body_can_go_and_what_may_not_stays() {
    let mesh = cube(3);
    let mut collision = collision(&mesh, "walk", |_| true);
    let (velocities, mut step) = (vec![Vec3::ZERO; mesh.positions.len()], TissueStep::default());
    let inside = ToolState::at(Pose::from_translation(Vec3::splat(0.5 * EDGE_MM)));
    let mut press = |collision: &mut TissueCollision| {
        collision.step(&mesh.positions, &velocities, &inside, &mut step);
        step.points_in_contact
    };
    assert!(press(&mut collision) > 0);
    (0..mesh.tets.len() as u32).for_each(|t| collision.thin(t, 0));
    assert_eq!(press(&mut collision), 0);
    collision.thin(u32::MAX, 0);
    let mut kept = self::collision(&mesh, "walk", |_| false);
    (0..mesh.tets.len() as u32).for_each(|t| kept.thin(t, 0));
    assert!(press(&mut kept) > 0);
}

/// A ball rests 1 mm deep in a block of which tetrahedra thin out in turn, each over 100 steps.
#[test]
fn the_force_does_not_jump_where_tissue_thins_and_goes() {
    let mesh = cube(8);
    let mut collision = collision(&mesh, "walk", |_| true);
    let tool = ToolState::at(Pose::from_translation(Vec3::new(12.0, 12.5, EDGE_MM + 1.0)));
    let away = |tet: u32| centre(&mesh, tet).distance(tool.tip());
    let (velocities, mut step) = (vec![Vec3::ZERO; mesh.positions.len()], TissueStep::default());
    let mut near: Vec<u32> = (0..mesh.tets.len() as u32).filter(|&tet| away(tet) < 4.0).collect();
    near.sort_by(|&a, &b| away(a).total_cmp(&away(b)));
    let mut press = |collision: &mut TissueCollision| {
        collision.step(&mesh.positions, &velocities, &tool, &mut step);
        step.patch.force_n * step.patch.normal
    };
    let start = press(&mut collision);
    let (mut last, mut jump) = (start, 0.0f32);
    for tet in near {
        for left in (0..100u16).rev() {
            collision.thin(tet, 655 * left);
            let force = press(&mut collision);
            jump = jump.max(force.distance(std::mem::replace(&mut last, force)));
        }
    }
    assert!(start.length() > 1.5 && last.length() < 0.01, "{start} {last}");
    assert!(jump < 0.03 * start.length(), "{jump} of {}", start.length());
}
