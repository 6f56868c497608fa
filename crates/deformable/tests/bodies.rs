//! Shaft, friction, two bodies, one folded on itself, and a wall around: closed forms and conserved
//! momentum.

mod common;

use common::{Random, block, deformed, tool_at};
use glam::{Quat, Vec3};
use trepan_contact::{NodalContacts, PlaneContact, SurfacePatch};
use trepan_deformable::{
    Config, ConfigError, MeshCollision, NodeContact, SlidingWall, TissueCollision, TissueStep, push_apart,
    push_itself_apart,
};
use trepan_geometry::Tool;
use trepan_mesh::TetMesh;

fn moved(mesh: &TetMesh, by: Vec3) -> TetMesh {
    TetMesh { positions: mesh.positions.iter().map(|p| *p + by).collect(), tets: mesh.tets.clone() }
}

fn with(mesh: &TetMesh, config: Config) -> TissueCollision {
    TissueCollision::new(mesh, &Tool::probe(2.0), &config).expect("a sound config")
}

/// Presses a shaft of radius 1.2 mm flat on a block of 32 mm that does not give way. For each mm of
/// length the foundation has, with the axis h over the block and a the half width,
/// `ε h (2 r asinh(a/h) - 2 a)`.
#[test]
fn a_shaft_pressed_flat_into_the_top_has_the_force_of_its_foundation() {
    let mesh = block([16, 16, 12], 2.0);
    let config = Config { shaft: true, ..Config::default() };
    let mut collision = with(&mesh, config.clone());
    let (along_x, still) =
        (Quat::from_rotation_y(core::f32::consts::FRAC_PI_2), vec![Vec3::ZERO; mesh.positions.len()]);
    let mut out = TissueStep::default();
    for depth in [0.3f32, 0.6, 0.9] {
        let tip = Vec3::new(-20.0, 15.3, 24.0 + 1.2 - depth);
        collision.step(&mesh.positions, &still, &tool_at(tip, along_x), &mut out);
        let (h, a) = (1.2 - depth, (1.44 - (1.2 - depth).powi(2)).sqrt());
        let exact_n = 32.0 * config.stiffness_per_mm2 * h * (2.4 * (a / h).asinh() - 2.0 * a);
        let SurfacePatch { force_n, normal, couple_mm, .. } = out.patch;
        assert!((force_n / exact_n - 1.0).abs() < 0.05 && normal.z > 0.9999, "{force_n} N for {exact_n} at {depth}");
        // The middle of the block is 36 mm from the tip along the shaft.
        assert!((couple_mm.y / -36.0 - 1.0).abs() < 0.05 && couple_mm.x.abs() < 0.3, "{couple_mm}");
        let mut forces = still.clone();
        let on_tool = out.push(&mesh.positions, &still, &mut forces);
        assert!((on_tool + forces.iter().sum::<Vec3>()).length() < 1e-5 * force_n.max(1.0));
        assert!((on_tool - normal * force_n).length() < 1e-3 * force_n);
    }
    let far = tool_at(Vec3::new(-20.0, 15.3, 30.0), along_x);
    collision.step(&mesh.positions, &still, &far, &mut out);
    assert!(out.patch.force_n == 0.0 && out.surface_springs.is_empty());
}

/// Pressed 0.6 mm into a block that does not give way, each place drags by `ε s` until `μ p`.
/// Moving tissue carries it along, and what the tool feels the nodes take.
#[test]
fn friction_sticks_slips_and_is_equal_and_opposite() {
    let mesh = block([16, 16, 6], 1.0);
    let config = Config { friction: 0.4, ..Config::default() };
    let still = vec![Vec3::ZERO; mesh.positions.len()];
    let mut out = TissueStep::default();
    let tip = Vec3::new(7.2, 8.1, 6.0 + 2.0 - 0.6);
    let mut collision = with(&mesh, config.clone());
    collision.step(&mesh.positions, &still, &tool_at(tip, Quat::IDENTITY), &mut out);
    let pressed_n = out.patch.force_n;
    assert!(out.patch.normal.z > 0.999, "no drag before it moves: {}", out.patch.normal);
    let mut last_n = 0.0;
    for k in 1..100 {
        let tool = tool_at(tip + Vec3::X * (0.01 * k as f32), Quat::IDENTITY);
        collision.step(&mesh.positions, &still, &tool, &mut out);
        let force = out.patch.normal * out.patch.force_n;
        if k == 1 {
            // A circle of 1.43 mm sticks.
            let sticks_n = config.stiffness_per_mm2 * 0.01 * core::f32::consts::PI * 2.04;
            assert!((-force.x / sticks_n - 1.0).abs() < 0.15, "{} N for {sticks_n}", -force.x);
        }
        assert!(-force.x > last_n - 5e-3 && -force.x < 0.45 * pressed_n, "{force} after {last_n}");
        last_n = -force.x;
        let mut forces = still.clone();
        let on_tool = out.push(&mesh.positions, &still, &mut forces);
        assert!((on_tool + forces.iter().sum::<Vec3>()).length() < 1e-5 && (on_tool - force).length() < 1e-3);
    }
    assert!(last_n > 0.3 * pressed_n, "it slips with {last_n} N of {pressed_n}");
    // Tissue that goes along is not rubbed; it is carried back by what it was dragged before.
    let mut collision = with(&mesh, config);
    for k in 0..50 {
        let by = Vec3::X * (0.02 * k as f32);
        let body = moved(&mesh, by).positions;
        collision.step(&body, &still, &tool_at(tip + by, Quat::IDENTITY), &mut out);
        assert!((out.patch.normal.x * out.patch.force_n).abs() < 1e-3, "{:?} at {k}", out.patch);
    }
    // A turning tool rubs, too.
    let turned = tool_at(tip + Vec3::X * 0.98, Quat::from_rotation_y(0.05));
    collision.step(&moved(&mesh, Vec3::X * 0.98).positions, &still, &turned, &mut out);
    let force = out.patch.normal * out.patch.force_n;
    assert!(force.x > 0.03 && (out.patch.couple_mm.y + 2.0 * out.patch.normal.x).abs() < 0.1, "{force}");
}

/// Every border node of a block that sinks into another is found, no other, with its true depth;
/// momentum stays.
#[test]
fn two_blocks_that_overlap_know_how_deep_and_keep_their_momentum() {
    let lower = block([6, 6, 5], 4.0);
    let upper = moved(&block([3, 3, 3], 3.7), Vec3::new(5.3, 6.1, 20.0 - 1.3));
    let mut collision = MeshCollision::between(&upper, &lower).expect("sound meshes");
    let mut out = Vec::with_capacity(200);
    assert_eq!(collision.step(&upper.positions, &lower.positions, &mut out), 0);
    let inside = |p: &&Vec3| p.z < 20.0;
    assert_eq!(out.len(), upper.positions.iter().filter(inside).count());
    assert!(out.iter().all(|c| (c.depth_mm - 1.3).abs() < 1e-4 && c.normal.z > 0.9999));
    let (on_body, on_other) = forces(&out, &upper, &lower);
    assert!((on_body.iter().sum::<Vec3>() + on_other.iter().sum::<Vec3>()).length() < 1e-4);
    assert!((on_body.iter().sum::<Vec3>().z - 0.5 * 1.3 * 16.0).abs() < 1e-3);
}

/// Both bodies bent and shaken: contacts are finite, and neither momentum nor its moment is made.
#[test]
fn deformed_bodies_make_no_momentum() {
    let (lower, upper) = (block([6, 6, 4], 4.0), moved(&block([4, 4, 3], 4.0), Vec3::new(4.3, 3.1, 14.0)));
    let mut collision = MeshCollision::between(&upper, &lower).expect("sound meshes");
    let (mut out, mut random, mut met) = (Vec::with_capacity(400), Random::new(5), 0);
    for k in 0..60 {
        let bent = |mesh: &TetMesh, random: &mut Random| TetMesh {
            positions: deformed(mesh, 4.0, 0.1 * k as f32, random),
            tets: mesh.tets.clone(),
        };
        let (body, other) = (bent(&upper, &mut random), bent(&lower, &mut random));
        assert_eq!(collision.step(&body.positions, &other.positions, &mut out), 0);
        met += out.len();
        let (on_body, on_other) = forces(&out, &body, &other);
        let moment = |mesh: &TetMesh, forces: &[Vec3]| -> Vec3 {
            mesh.positions.iter().zip(forces).map(|(p, f)| p.cross(*f)).sum()
        };
        let total: Vec3 = on_body.iter().sum::<Vec3>() + on_other.iter().sum::<Vec3>();
        let turn = moment(&body, &on_body) + moment(&other, &on_other);
        assert!(total.length() < 1e-3 && turn.length() < 2e-2, "{total} {turn}");
    }
    assert!(met > 100, "{met}");
}

fn forces(contacts: &[NodeContact], body: &TetMesh, other: &TetMesh) -> (Vec<Vec3>, Vec<Vec3>) {
    let (mut on_body, mut on_other) = (vec![Vec3::ZERO; body.positions.len()], vec![Vec3::ZERO; other.positions.len()]);
    push_apart(contacts, 0.5, &mut on_body, &mut on_other);
    (on_body, on_other)
}

/// A strip bent into more than a full ring meets itself; at rest, and bent a little, it does not.
#[test]
fn a_strip_that_is_rolled_up_meets_itself() {
    let mesh = block([40, 2, 2], 2.0);
    let mut collision = MeshCollision::itself(&mesh).expect("a sound mesh");
    let mut out = Vec::with_capacity(800);
    for (turns, meets) in [(0.0f32, false), (0.5, false), (1.02, true)] {
        let rolled = |p: &Vec3| {
            let angle = turns * core::f32::consts::TAU * p.x / 80.0;
            let radius = if turns == 0.0 { 0.0 } else { 80.0 / (turns * core::f32::consts::TAU) };
            let (s, c) = angle.sin_cos();
            let bent = Vec3::new((radius + p.z) * s, p.y, (radius + p.z) * c - radius);
            if turns == 0.0 { *p } else { bent }
        };
        let positions: Vec<Vec3> = mesh.positions.iter().map(rolled).collect();
        assert_eq!(collision.step(&positions, &positions, &mut out), 0);
        assert_eq!(!out.is_empty(), meets, "{turns} turns: {}", out.len());
        let mut forces = vec![Vec3::ZERO; positions.len()];
        push_itself_apart(&out, 1.0, &mut forces);
        assert!(forces.iter().sum::<Vec3>().length() < 1e-3);
        // The same as springs for a solver.
        for spring in out.iter().map(|contact| contact.spring(1.0, 0.0)) {
            let pressure = spring.pressure_n(spring.mean(|n| positions[n as usize]), Vec3::ZERO);
            spring.nodes().for_each(|(n, w)| forces[n as usize] += pressure * w * spring.normal);
        }
        assert!(forces.iter().all(|force| force.length() < 1e-4));
    }
}

/// A block in a spherical hollow, shifted until corners are in the wall: it is pushed back, and
/// nowhere along the wall.
#[test]
fn a_wall_pushes_back_what_sinks_in_and_lets_it_slide() {
    let mesh = moved(&block([5, 5, 5], 4.0), Vec3::splat(-10.0));
    let wall = SlidingWall::around(&mesh, &[]).expect("a sound mesh");
    let mut out = NodalContacts::none();
    let hollow = |r: f32| move |p: Vec3| (r - p.length(), -p.normalize_or_zero());
    wall.step(&mesh.positions, hollow(18.0), &mut out);
    assert!(out.planes().is_empty());
    let shifted = moved(&mesh, Vec3::X * 3.0);
    wall.step(&shifted.positions, hollow(18.0), &mut out);
    let at = |n: u32| shifted.positions[n as usize];
    let deep = |c: &&PlaneContact| c.depth_mm(at(c.node)) > 0.0;
    assert!(out.planes().iter().filter(deep).count() > 3);
    assert!(out.planes().iter().filter(deep).all(|c| at(c.node).length() > 18.0));
    assert!(out.planes().iter().all(|c| at(c.node).length() > 17.5), "far nodes have no plane");
    let force: Vec3 = out.all().map(|c| c.pressure_n(c.mean(at), Vec3::ZERO) * -c.normal).sum();
    assert!(force.x < -0.5 && force.y.abs() + force.z.abs() < 0.2 * -force.x, "{force}");
    // A flat wall under the whole side of 20 x 20 mm: its stiffness is that of the area, on any
    // mesh.
    let flat = |p: Vec3| (p.z + 9.5, Vec3::Z);
    for cells in [3, 5, 8] {
        let mesh = moved(&block([cells; 3], 20.0 / cells as f32), Vec3::splat(-10.0));
        let wall = SlidingWall::around(&mesh, &[]).expect("a sound mesh");
        out.clear();
        wall.step(&mesh.positions, flat, &mut out);
        let press = |by: Vec3| -> f32 {
            out.all().map(|c| c.pressure_n(c.mean(|n| mesh.positions[n as usize] + by), Vec3::ZERO)).sum()
        };
        // The nodes of the rim have a share of the sides too: 400 mm² below, 4 x 20 mm x half a
        // cell beside.
        let area = 400.0 + 4.0 * 20.0 * 10.0 / cells as f32;
        assert!((press(Vec3::X) - press(Vec3::ZERO)).abs() < 1e-4, "it slides");
        let stiffness = (press(Vec3::Z * -0.1) - press(Vec3::ZERO)) / 0.1;
        assert!((stiffness / (wall.stiffness_per_mm2 * area) - 1.0).abs() < 1e-3, "{cells}: {stiffness} N/mm");
    }
    let nowhere = |_: Vec3| (f32::NAN, Vec3::NAN);
    out.clear();
    wall.step(&mesh.positions, nowhere, &mut out);
    assert!(out.planes().is_empty());
    // Where the body rests in the wall it is left in peace; held nodes are never pushed.
    let mut at_rest = SlidingWall::around(&mesh, &[]).expect("a sound mesh");
    at_rest.rest_in(&mesh.positions, flat);
    at_rest.step(&mesh.positions, flat, &mut out);
    assert!(out.planes().iter().all(|c| c.depth_mm(mesh.positions[c.node as usize]) <= 0.0));
    out.clear();
    let held: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    SlidingWall::around(&mesh, &held).expect("a sound mesh").step(&mesh.positions, flat, &mut out);
    assert!(out.planes().is_empty());
    let lower = moved(&mesh, Vec3::Z * -0.1).positions;
    at_rest.step(&lower, flat, &mut out);
    assert_eq!(out.planes().iter().filter(|c| c.depth_mm(lower[c.node as usize]) > 0.02).count(), 36);
}

#[test]
fn bad_bodies_are_refused_and_bad_arrays_give_nothing() {
    let mesh = block([2, 2, 2], 4.0);
    assert_eq!(MeshCollision::between(&mesh, &TetMesh::default()).err(), Some(ConfigError::EmptyMesh));
    assert_eq!(SlidingWall::around(&TetMesh::default(), &[]).err(), Some(ConfigError::EmptyMesh));
    let mut collision = MeshCollision::itself(&mesh).expect("a sound mesh");
    let mut out = Vec::with_capacity(8);
    assert!(collision.step(&mesh.positions, &[], &mut out) > 0 && out.is_empty());
    let nowhere = vec![Vec3::NAN; mesh.positions.len()];
    assert!(collision.step(&nowhere, &nowhere, &mut out) == 0 && out.is_empty());
    let tool = Tool::probe(2.0);
    let refused = TissueCollision::new(&mesh, &tool, &Config { friction: f32::NAN, ..Config::default() }).err();
    assert!(matches!(refused, Some(ConfigError::Value { field: "friction", .. })));
}
