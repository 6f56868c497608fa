//! Every search against the f64 oracle, over random poses, jumps, deformed, torn and degenerate
//! meshes.

#[path = "../../deformable/tests/common/mod.rs"]
mod common;

use common::{Random, block, deformed, tool_at};
use glam::Vec3;
use trepan_deformable::search::{brute, uniform_grid};
use trepan_deformable::{Config, Method, TissueCollision, TissueStep};
use trepan_geometry::Tool;
use trepan_mesh::TetMesh;
use trepan_rivals::Family;
use trepan_rivals::deformable::thesis;

/// Steps all complete methods over the same poses and meshes; at every step all must find what the
/// oracle finds.
fn same_points_as_oracle(mesh: &TetMesh, radius: f32, poses: usize, jump: f32, seed: u64) {
    let tool = Tool::probe(radius);
    let new = |method| {
        TissueCollision::new(mesh, &tool, &Config { method, points: 60, ..Config::default() }).expect("a sound config")
    };
    let mut oracle = new(Method::of(&brute::METHOD));
    let mut tested: Vec<_> = complete().map(|method| (method, new(method))).collect();
    let (mut found, mut truth) = (TissueStep::default(), TissueStep::default());
    let mut random = Random::new(seed);
    let edge = mesh.positions[1].distance(mesh.positions[0]);
    let bounds = mesh.bounds().inflated(radius);
    let mut tip = bounds.centre();
    let still = vec![Vec3::ZERO; mesh.positions.len()];
    let mut hits = 0;
    for pose in 0..poses {
        let positions = deformed(mesh, edge, pose as f32 * 0.01, &mut random);
        let anywhere = bounds.min + (random.cube() * 0.5 + 0.5) * bounds.size();
        tip = if random.unit() < jump { anywhere } else { tip + random.cube() * 0.5 };
        let state = tool_at(tip, random.rotation());
        oracle.step(&positions, &still, &state, &mut truth);
        for (method, collision) in &mut tested {
            collision.step(&positions, &still, &state, &mut found);
            let name = method.name();
            assert_eq!(found.points_in_contact, truth.points_in_contact, "{name} at pose {pose}, tip {tip}");
            assert_eq!((found.overflow, found.stale), (0, 0), "{name}");
            assert_eq!(found.manifold, truth.manifold, "{name} at pose {pose}");
        }
        hits += u32::from(truth.points_in_contact > 0);
    }
    assert!(hits as usize > poses / 10, "the poses hardly touch: {hits}");
}

fn complete() -> impl Iterator<Item = Method> {
    Method::all().into_iter().filter(|&method| !method.descriptor().is_oracle && method.descriptor().is_complete)
}

#[test]
fn small_steps_on_a_deforming_block() {
    let mesh = block([6, 5, 4], 5.0);
    same_points_as_oracle(&mesh, 2.0, 250, 0.02, 7);
}

#[test]
fn jumps_at_every_step() {
    let mesh = block([6, 5, 4], 5.0);
    same_points_as_oracle(&mesh, 2.0, 250, 1.0, 11);
}

#[test]
fn a_tool_much_larger_than_the_tetrahedra() {
    let mesh = block([6, 6, 6], 2.0);
    same_points_as_oracle(&mesh, 5.0, 120, 0.2, 13);
}

#[test]
fn a_tool_much_smaller_than_the_tetrahedra() {
    let mesh = block([2, 2, 1], 30.0);
    same_points_as_oracle(&mesh, 1.0, 250, 0.3, 17);
}

#[test]
fn two_blocks_apart() {
    let mut mesh = block([3, 3, 3], 4.0);
    let first = mesh.positions.len() as u32;
    let other = mesh.clone();
    mesh.positions.extend(other.positions.iter().map(|p| *p + Vec3::new(20.0, 0.0, 0.0)));
    mesh.tets.extend(other.tets.iter().map(|t| t.map(|n| n + first)));
    same_points_as_oracle(&mesh, 1.5, 250, 0.1, 19);
}

/// Inverted, flat and NaN tetrahedra: the searches agree on what is left, count what they skip, and
/// put out no NaN.
#[test]
fn degenerate_meshes_lose_nothing_and_give_no_nan() {
    let mesh = block([4, 4, 3], 4.0);
    let tool = Tool::probe(2.0);
    let still = vec![Vec3::ZERO; mesh.positions.len()];
    for method in complete() {
        let new = |m| {
            TissueCollision::new(&mesh, &tool, &Config { method: m, points: 60, ..Config::default() })
                .expect("a sound config")
        };
        let (mut tested, mut oracle) = (new(method), new(Method::of(&brute::METHOD)));
        let (mut found, mut truth) = (TissueStep::default(), TissueStep::default());
        let mut random = Random::new(23);
        let mut skipped = 0;
        for pose in 0..300 {
            let mut positions = deformed(&mesh, 4.0, 0.0, &mut random);
            let place = |random: &mut Random| ((random.unit() * still.len() as f32) as usize).min(still.len() - 1);
            let (nan, moved, doubled) = (place(&mut random), place(&mut random), place(&mut random));
            positions[nan] = if pose % 3 == 0 { Vec3::NAN } else { positions[nan] };
            positions[moved] += random.cube() * 8.0;
            positions[doubled] = positions[moved];
            let tip = (random.cube() * 0.5 + 0.5) * Vec3::new(16.0, 16.0, 12.0);
            let state = tool_at(tip, random.rotation());
            tested.step(&positions, &still, &state, &mut found);
            oracle.step(&positions, &still, &state, &mut truth);
            assert_eq!(found.points_in_contact, truth.points_in_contact, "{} at pose {pose}", method.name());
            assert!(found.manifold.is_finite() && found.nodal.offset_mm.is_finite() && found.patch.force_n.is_finite());
            assert!(found.nodal.nodes().all(|(n, w)| w.is_finite() && positions[n as usize].is_finite()));
            skipped += found.skipped;
        }
        assert!(skipped > 0);
    }
}

/// Nodes thrown, doubled and nowhere, others at every step: the walk finds every point and the same
/// depth as a look at every box.
#[test]
fn a_mesh_torn_anew_at_every_step_hides_nothing_from_the_walk() {
    let mesh = block([5, 5, 5], 5.0);
    let tool = Tool::probe(2.0);
    let new = |method| {
        TissueCollision::new(&mesh, &tool, &Config { method, points: 60, ..Config::default() }).expect("a sound config")
    };
    let (mut walk, mut scan) = (new(Method::RECOMMENDED), new(Method::of(&uniform_grid::SCAN)));
    let (mut found, mut truth) = (TissueStep::default(), TissueStep::default());
    let still = vec![Vec3::ZERO; mesh.positions.len()];
    let (mut random, mut tip, mut touching) = (Random::new(31), Vec3::splat(12.5), 0);
    for pose in 0..6000 {
        let mut positions = deformed(&mesh, 5.0, pose as f32 * 0.01, &mut random);
        for k in 0..4 {
            let mut node = || ((random.unit() * still.len() as f32) as usize).min(still.len() - 1);
            let (thrown, nowhere, doubled, other) = (node(), node(), node(), node());
            positions[thrown] += random.cube() * 10.0;
            positions[nowhere] = if (pose + k) % 8 < 3 { Vec3::NAN } else { positions[nowhere] };
            positions[doubled] = positions[other];
        }
        let anywhere = Vec3::splat(12.5) + random.cube() * 16.0;
        tip = if random.unit() < 0.3 { anywhere } else { tip + random.cube() * 0.5 };
        let state = tool_at(tip, random.rotation());
        walk.step(&positions, &still, &state, &mut found);
        scan.step(&positions, &still, &state, &mut truth);
        assert_eq!(found.points_in_contact, truth.points_in_contact, "pose {pose}, tip {tip}");
        assert_eq!(found.manifold.depth_mm, truth.manifold.depth_mm, "pose {pose}, tip {tip}");
        touching += u32::from(truth.points_in_contact > 0);
    }
    assert!(touching > 2000, "{touching}");
}

#[test]
fn the_thesis_never_sees_a_point_that_is_not_there() {
    let mesh = block([6, 5, 4], 5.0);
    let tool = Tool::probe(2.0);
    let still = vec![Vec3::ZERO; mesh.positions.len()];
    let new =
        |method| TissueCollision::new(&mesh, &tool, &Config { method, ..Config::default() }).expect("a sound config");
    let (mut thesis, mut oracle) = (new(Method::of(&thesis::METHOD)), new(Method::of(&brute::METHOD)));
    let (mut found, mut truth) = (TissueStep::default(), TissueStep::default());
    let mut random = Random::new(29);
    for _ in 0..200 {
        let positions = deformed(&mesh, 5.0, 0.0, &mut random);
        let state = tool_at((random.cube() * 0.6 + 0.5) * Vec3::new(30.0, 25.0, 20.0), random.rotation());
        thesis.step(&positions, &still, &state, &mut found);
        oracle.step(&positions, &still, &state, &mut truth);
        assert!(found.points_in_contact <= truth.points_in_contact);
        assert_eq!(
            found.points_in_contact > 0,
            truth.points_in_contact > 0,
            "two rings may miss points, not the contact"
        );
    }
}

/// Methods that may miss points give none that are not there, and on a tool that moves slowly into
/// a deforming block they find most. The thesis's two rings are too few for this tool.
#[test]
fn what_may_miss_points_invents_none_and_finds_most() {
    let (mesh, tool) = (block([8, 8, 6], 4.0), Tool::probe(3.0));
    let still = vec![Vec3::ZERO; mesh.positions.len()];
    let new = |method| {
        TissueCollision::new(&mesh, &tool, &Config { method, points: 100, ..Config::default() })
            .expect("a sound config")
    };
    let incomplete = Method::all().into_iter().filter(|method| !method.descriptor().is_complete);
    for method in incomplete.filter(|method| *method != Method::of(&thesis::METHOD)) {
        let (mut tested, mut oracle) = (new(method), new(Method::of(&brute::METHOD)));
        let (mut found, mut truth) = (TissueStep::default(), TissueStep::default());
        let mut random = Random::new(37);
        let (mut all, mut met) = (0, 0);
        for step in 0..300 {
            let positions = deformed(&mesh, 4.0, step as f32 * 0.01, &mut random);
            let down = 28.0 - 12.0 * (step as f32 / 300.0);
            let state = tool_at(Vec3::new(16.0, 15.0, down) + random.cube() * 0.1, random.rotation());
            tested.step(&positions, &still, &state, &mut found);
            oracle.step(&positions, &still, &state, &mut truth);
            assert!(found.points_in_contact <= truth.points_in_contact, "{} at {step}", method.name());
            (all, met) = (all + truth.points_in_contact, met + found.points_in_contact);
        }
        let share = f64::from(met) / f64::from(all);
        assert!(all > 10_000 && share > 0.9, "{}: {share} of {all}", method.name());
    }
}

/// A plate with more surface than is fitted in one step, waving and shaking: nothing is missed and
/// nothing is stale.
#[test]
fn a_surface_too_large_to_fit_whole_at_every_step() {
    let mesh = block([40, 40, 2], 4.0);
    let tool = Tool::probe(2.0);
    let still = vec![Vec3::ZERO; mesh.positions.len()];
    let new = |method| {
        TissueCollision::new(&mesh, &tool, &Config { method, points: 60, ..Config::default() }).expect("a sound config")
    };
    let (mut walk, mut scan) = (new(Method::RECOMMENDED), new(Method::of(&uniform_grid::SCAN)));
    let (mut found, mut truth) = (TissueStep::default(), TissueStep::default());
    let mut random = Random::new(31);
    let mut tip = Vec3::new(80.0, 80.0, 9.0);
    let mut touched = 0;
    for step in 0..400 {
        let positions = deformed(&mesh, 4.0, step as f32 * 0.02, &mut random);
        let anywhere = Vec3::new(random.unit() * 160.0, random.unit() * 160.0, 8.0 + 4.0 * random.unit());
        tip = if random.unit() < 0.1 { anywhere } else { tip + random.cube() * 0.5 };
        let state = tool_at(tip, random.rotation());
        walk.step(&positions, &still, &state, &mut found);
        scan.step(&positions, &still, &state, &mut truth);
        assert_eq!((found.points_in_contact, found.stale), (truth.points_in_contact, 0), "step {step}, tip {tip}");
        touched += u32::from(truth.points_in_contact > 0);
    }
    assert!(touched > 100);
}

/// One corner of the plate leaps while the rest has been at rest: boxes that could not know are
/// counted.
#[test]
fn a_leap_of_far_surface_is_counted() {
    let mesh = block([40, 40, 2], 4.0);
    let still = vec![Vec3::ZERO; mesh.positions.len()];
    let mut walk = TissueCollision::new(&mesh, &Tool::probe(2.0), &Config::default()).expect("a sound config");
    let mut out = TissueStep::default();
    let state = tool_at(Vec3::new(10.0, 10.0, 9.5), glam::Quat::IDENTITY);
    let mut stale = 0;
    for step in 0..20 {
        let leap = |p: &Vec3| if step > 8 && p.x > 140.0 && p.y > 140.0 { *p + Vec3::Z * 20.0 } else { *p };
        walk.step(&mesh.positions.iter().map(leap).collect::<Vec<_>>(), &still, &state, &mut out);
        assert!(step > 8 || out.stale == 0);
        stale += out.stale;
        assert!((out.manifold.depth_mm - 0.5).abs() < 1e-3);
    }
    assert!(stale > 0);
}
