//! A membrane on the surface: forces in closed form, and steps as long as without it.

use glam::Vec2;
use trepan_geometry::Vec3;
use trepan_mesh::Surface;
use trepan_soft::{Body, Loads, Material, Membrane, SoftSolver, boxes};
use trepan_tled::{Config, Damping, Pass, Settled, Settling, Tled};

const EDGES_MM: Vec3 = Vec3::new(12.0, 9.0, 8.0);
const SHEAR_N_PER_MM: f32 = 0.12;

/// A block of brain with a membrane on its top.
fn block(shear_n_per_mm: f32, fixed: bool) -> Body {
    let mesh = boxes::split_box([5, 4, 4], EDGES_MM);
    let is_on_top = |t: &[u32; 3]| t.iter().all(|&n| mesh.positions[n as usize].z > EDGES_MM.z - 1e-3);
    let triangles = Surface::of(&mesh).triangles.into_iter().filter(is_on_top).collect();
    let held = boxes::nodes_where(&mesh, |p| fixed && p.z < 1e-3);
    Body { membrane: Membrane { triangles, shear_n_per_mm }, ..Body::uniform(mesh, held, Material::WHOLE_BRAIN) }
}

/// Force on a side of the membrane, along x, of a block whose top is stretched along x and y.
fn pull_n(stretch: Vec2, turned: bool) -> f32 {
    let [with, without] = [SHEAR_N_PER_MM, 0.0].map(|shear| {
        let body = block(shear, false);
        let mut tled = Tled::new(&body, &Config::default()).expect("the block is sound");
        // Turning about y does not change the tension.
        let turn = glam::Quat::from_rotation_y(if turned { 0.9 } else { 0.0 });
        for (n, &p) in body.mesh.positions.iter().enumerate() {
            tled.set_node(n as u32, turn * (p * stretch.extend(1.0)) - p, Vec3::ZERO);
        }
        tled.pass(Pass::Forces, &Loads::default(), 1.0);
        let side = boxes::nodes_where(&body.mesh, |p| p.x > EDGES_MM.x - 1e-3);
        side.into_iter().map(|n| (turn.inverse() * tled.support_force(n)).x).sum::<f32>()
    });
    with - without
}

#[test]
fn its_pull_is_that_of_an_incompressible_sheet_that_wrinkles() {
    for (stretch, per_mm) in [
        (Vec2::new(1.2, 1.1), 1.2 - 1.2f32.powi(-3) * 1.1f32.powi(-2)),
        (Vec2::new(1.02, 1.3), 1.02 - 1.02f32.powi(-3) * 1.3f32.powi(-2)),
        // It wrinkles across its pull, and is slack where it is pulled nowhere.
        (Vec2::new(1.4, 0.6), 1.4 - 1.4f32.powi(-2)),
        (Vec2::new(0.7, 1.5), 0.0),
        (Vec2::new(0.95, 0.9), 0.0),
    ] {
        for turned in [false, true] {
            let (pull, exact) = (pull_n(stretch, turned), SHEAR_N_PER_MM * EDGES_MM.y * per_mm);
            assert!((pull - exact).abs() < 1e-3 * exact + 2e-5, "{stretch} {turned}: {pull} of {exact} N");
        }
    }
}

#[test]
fn at_rest_it_has_no_tension_and_weighs_nothing() {
    let loads = Loads { gravity: Vec3::NEG_Z * 9.81e-3, ..Loads::default() };
    let weights = [1.0, 0.0].map(|shear| {
        let mut tled = Tled::new(&block(shear, true), &Config::default()).unwrap();
        tled.pass(Pass::Forces, &Loads::default(), 1.0);
        assert!((0..tled.positions().len()).all(|n| tled.support_force(n as u32) == Vec3::ZERO));
        let dt_ms = tled.stable_dt_ms();
        (0..(1000.0 / dt_ms) as u32).for_each(|_| _ = tled.step(&loads, dt_ms));
        let held = boxes::nodes_where(&block(0.0, true).mesh, |p| p.z < 1e-3);
        held.into_iter().map(|n| tled.support_force(n).z).sum::<f32>()
    });
    assert!((weights[0] / weights[1] - 1.0).abs() < 1e-3, "{weights:?} N");
}

/// Motion of a shaken body without damping in the last third of 24,000 steps, or of twice as many
/// half as long. It is Σ v² over nodes and steps.
fn motion(selective_mass_scaling: bool, halves: usize) -> f32 {
    let config = Config { damping: Damping::None, selective_mass_scaling, ..Config::default() };
    let (body, bare) = (block(1.0, true), Tled::new(&block(0.0, true), &config).expect("the block is sound"));
    let mut tled = Tled::new(&body, &config).expect("the block is sound");
    assert_eq!(tled.stable_dt_ms(), bare.stable_dt_ms(), "a membrane takes no shorter step");
    let dt_ms = tled.stable_dt_ms() / halves as f32;
    let noise = |i: usize| ((i as f32 * 12.9898).sin() * 43758.547).fract() * 0.02;
    for n in (0..body.mesh.positions.len()).filter(|n| body.mesh.positions[*n].z > 1e-3) {
        tled.set_node(n as u32, Vec3::from([3 * n, 3 * n + 1, 3 * n + 2].map(noise)), Vec3::ZERO);
    }
    let mut motion = 0.0;
    for step in 0..24_000 * halves {
        let report = tled.step(&Loads::default(), dt_ms);
        assert_eq!((report.limited, report.non_finite), (0, 0));
        let now = tled.velocities().iter().map(|v| v.length_squared()).sum::<f32>();
        motion += if step >= 16_000 * halves { now / halves as f32 } else { 0.0 };
    }
    motion
}

/// Motion passes from heavy nodes to light ones for long, so a half step is the comparison.
#[test]
fn steps_as_long_as_without_it_give_a_shaken_body_no_energy() {
    for selective_mass_scaling in [false, true] {
        let [whole, half] = [1, 2].map(|halves| motion(selective_mass_scaling, halves));
        assert!(whole < 1.3 * half, "{selective_mass_scaling}: {whole} of {half} mm²/ms²");
    }
}

/// A hammock: the tension that a load has made is what bears more of it.
#[test]
fn a_stretched_membrane_settles_in_few_steps() {
    let mut body = block(SHEAR_N_PER_MM, false);
    body.fixed = boxes::nodes_where(&body.mesh, |p| p.x < 1e-3 || p.x > EDGES_MM.x - 1e-3);
    let settling = Settling { tolerance_mm: 1e-3, steps: 300 };
    for times in [3.0, 12.0, 25.0, 50.0] {
        let mut tled = Tled::new(&body, &Config::default()).expect("the block is sound");
        let loads = Loads { gravity: Vec3::NEG_Z * (9.81e-3 * times), ..Loads::default() };
        let settled @ Settled { steps, converged, .. } = tled.settle(&loads, &settling);
        assert!(converged && steps < 40, "{times} weights: {settled:?}");
    }
}
