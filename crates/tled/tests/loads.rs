//! Moving supports, pressure, equilibrium and mass scaling against the f64 reference.

use glam::DVec3;
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;
use trepan_mesh::Surface;
use trepan_soft::reference::{self, Reference};
use trepan_soft::{Body, Loads, Material, SoftSolver, SurfacePressure, boxes};
use trepan_tled::{Config, Settling, Tled};

const GRAVITY: Vec3 = Vec3::new(0.0, 0.0, -9.81e-3);

fn block() -> Body {
    let mesh = boxes::split_box([4, 4, 6], Vec3::new(40.0, 40.0, 60.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1.0);
    Body::uniform(mesh, fixed, Material::BRAIN)
}

fn distance(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

fn exact(body: &Body, loads: &Loads, set: impl Fn(&mut Reference)) -> Vec<Vec3> {
    let mut reference = Reference::new(body, &reference::Config::default()).expect("the block is held");
    set(&mut reference);
    assert!(reference.step(loads, 1.0).converged);
    reference.positions().to_vec()
}

/// A share of the spring that rose when a pressed body cut its steps would push back harder than it
/// was pushed.
#[test]
fn a_tool_that_presses_so_hard_that_steps_are_cut_comes_to_rest() {
    let mesh = boxes::split_box([12, 8, 6], Vec3::new(48.0, 32.0, 24.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let mut contact = NodalContact::none();
    (contact.normal, contact.stiffness, contact.damping) = (Vec3::Z, 0.3, 0.05);
    let under = Vec3::new(16.0, 16.0, 24.0);
    boxes::nodes_where(&mesh, |p| p.distance(under) < 7.0 && p.z > 23.9).iter().for_each(|&n| contact.add(n, 1.0));
    contact.normalise();
    contact.offset_mm = 3.0 - 24.0;
    let loads = Loads { contacts: contact.into(), ..Loads::default() };
    for averaged_pressure in [false, true] {
        let body = Body::uniform(mesh.clone(), fixed.clone(), Material::BRAIN);
        let mut tled = Tled::new(&body, &Config { averaged_pressure, ..Config::default() }).unwrap();
        let dt_ms = tled.stable_dt_ms();
        let cut = (0..(1000.0 / dt_ms) as usize).filter(|_| tled.step(&loads, dt_ms).substeps > 1).count();
        let fastest = tled.velocities().iter().map(|v| v.length()).fold(0.0, f32::max);
        println!("averaged pressure {averaged_pressure}: {fastest:e} mm/ms, {cut} steps cut");
        assert!(cut > 0 && fastest < 1e-4, "{cut} {fastest}");
    }
}

/// One call of three substeps is three calls of one, between which the tool goes on.
#[test]
fn a_tool_goes_on_within_a_call() {
    let body = block();
    let mut contact = NodalContact::none();
    (contact.normal, contact.stiffness, contact.tool_normal_velocity) = (Vec3::Z, 0.3, -0.04);
    contact.offset_mm = -60.0;
    boxes::nodes_where(&body.mesh, |p| p.z > 59.9 && p.x < 21.0).iter().for_each(|&n| contact.add(n, 1.0));
    contact.normalise();
    let pressed_n = |calls: u32| {
        let mut tled = Tled::new(&body, &Config { safety: 0.5, ..Config::default() }).unwrap();
        let mut loads = Loads { contacts: contact.into(), ..Loads::default() };
        let dt_ms = 3.0 * tled.stable_dt_ms() / calls as f32;
        let mut forces = (0..30 * calls).map(|_| {
            let report = tled.step(&loads, dt_ms);
            loads.contacts.follow_tool(dt_ms);
            assert_eq!(report.substeps * calls, 3);
            report.contact_n
        });
        forces.by_ref().last().unwrap()
    };
    let [one, three] = [1, 3].map(pressed_n);
    assert!(three > 0.1 && (one / three - 1.0).abs() < 1e-4, "{one} and {three} N");
}

#[test]
fn a_lid_that_moves_down_presses_the_tissue_to_where_the_reference_is() {
    let mesh = boxes::split_box([4, 4, 4], Vec3::splat(40.0));
    let ends = boxes::nodes_where(&mesh, |p| p.z < 1.0 || p.z > 39.0);
    let lid = boxes::nodes_where(&mesh, |p| p.z > 39.0);
    let body = Body::uniform(mesh, ends, Material::BRAIN);
    let wanted = exact(&body, &Loads::default(), |r| lid.iter().for_each(|&n| r.prescribe(n, DVec3::NEG_Z * 4.0)));
    let mut tled = Tled::new(&body, &Config::default()).unwrap();
    let dt = tled.stable_dt_ms();
    let steps = (200.0 / dt).ceil();
    lid.iter().for_each(|&n| tled.set_node(n, Vec3::ZERO, Vec3::NEG_Z * (4.0 / (steps * dt))));
    (0..steps as usize).for_each(|_| _ = tled.step(&Loads::default(), dt));
    lid.iter().for_each(|&n| assert!((tled.positions()[n as usize].z - 36.0).abs() < 1e-3));
    lid.iter().for_each(|&n| tled.set_node(n, Vec3::NEG_Z * 4.0, Vec3::ZERO));
    assert!(tled.settle(&Loads::default(), &Settling::default()).converged);
    let error = distance(tled.positions(), &wanted);
    assert!(error < 0.01, "{error} mm");
}

#[test]
fn pressure_on_a_side_bends_the_block_as_far_as_the_reference() {
    let body = block();
    let side = |t: &[u32; 3]| t.iter().all(|&n| body.mesh.positions[n as usize].x < 1e-3);
    let triangles: Vec<[u32; 3]> = Surface::of(&body.mesh).triangles.into_iter().filter(side).collect();
    assert_eq!(triangles.len(), 48);
    let pressure = SurfacePressure { triangles, mpa: 4e-5 };
    let wanted = exact(&body, &Loads::default(), |r| r.set_pressure(pressure.clone()));
    let moved = distance(&wanted, &body.mesh.positions);
    let mut tled = Tled::new(&body, &Config::default()).unwrap();
    tled.set_pressure(pressure.clone());
    let settled = tled.settle(&Loads::default(), &Settling::default());
    let error = distance(tled.positions(), &wanted);
    assert!(settled.converged && moved > 1.0 && error < 2e-3 * moved, "{settled:?} {error} of {moved} mm");
    let push: Vec3 = body.fixed.iter().map(|&n| tled.support_force(n)).sum();
    // A twelfth of the side hangs on the fixed nodes themselves.
    assert!((push.x / (-4e-5 * 40.0 * 60.0 * 11.0 / 12.0) - 1.0).abs() < 0.03, "{push}");
    let mut strange = pressure;
    strange.triangles.push([0, 1, 9999]);
    tled.set_pressure(strange);
    assert_eq!(tled.step(&Loads::default(), 0.1).non_finite, 0);
}

#[test]
fn relaxation_finds_the_rest_under_gravity_and_says_how_far_it_is_from_it() {
    let body = block();
    for (tolerance_mm, gravity) in [(0.1, GRAVITY), (0.01, GRAVITY), (0.01, Vec3::X * 9.81e-3)] {
        let loads = Loads { gravity, ..Loads::default() };
        let wanted = exact(&body, &loads, |_| ());
        let mut tled = Tled::new(&body, &Config::default()).unwrap();
        let rate = tled.damping_per_ms();
        let settled = tled.settle(&loads, &Settling { tolerance_mm, ..Settling::default() });
        let error = distance(tled.positions(), &wanted);
        println!("{settled:?} error {error}");
        assert!(settled.converged && error < tolerance_mm, "{settled:?} {error}");
        assert!(settled.left_mm > 0.3 * error - 2e-3, "{settled:?} {error}");
        assert_eq!(tled.damping_per_ms(), rate);
        assert!(tled.velocities().iter().all(|v| *v == Vec3::ZERO));
    }
    let short = Tled::new(&body, &Config::default())
        .unwrap()
        .settle(&Loads { gravity: GRAVITY, ..Loads::default() }, &Settling { steps: 1, ..Settling::default() });
    assert!(!short.converged && short.left_mm > 0.1, "{short:?}");
}

#[test]
fn a_brain_shift_is_found_from_the_scanned_shape_when_the_head_is_turned() {
    let body = block();
    let turned = Vec3::new(6e-3, 0.0, -6e-3);
    let config = Config { balanced_gravity: GRAVITY, ..Config::default() };
    let wanted = exact(&body, &Loads { gravity: turned - GRAVITY, ..Loads::default() }, |_| ());
    let mut tled = Tled::new(&body, &config).unwrap();
    let settled = tled.settle(&Loads { gravity: turned, ..Loads::default() }, &Settling::default());
    let (error, shift) = (distance(tled.positions(), &wanted), distance(&wanted, &body.mesh.positions));
    assert!(settled.converged && shift > 5.0 && error < 0.01, "{settled:?} shift {shift} mm, error {error} mm");
}

#[test]
fn what_floats_does_not_settle() {
    let body = Body { fixed: vec![], ..block() };
    let settled = Tled::new(&body, &Config::default()).unwrap().settle(&Loads::default(), &Settling::default());
    assert!(!settled.converged && settled.left_mm == f32::INFINITY && settled.steps == 0);
}

/// The block with a few slivers.
fn with_slivers() -> Body {
    let mut body = block();
    let node = boxes::nodes_where(&body.mesh, |p| p.distance(Vec3::new(10.0, 20.0, 10.0)) < 1e-3)[0];
    body.mesh.positions[node as usize].z += 9.7;
    body
}

#[test]
fn a_hundredth_of_the_mass_buys_a_longer_step_and_leaves_rest_where_it_was() {
    let body = with_slivers();
    let loads = Loads { gravity: GRAVITY, ..Loads::default() };
    let wanted = exact(&body, &loads, |_| ());
    let mut before = 0.0;
    for mass_scaling in [0.0, 0.01, f32::INFINITY] {
        let mut tled = Tled::new(&body, &Config { mass_scaling, ..Config::default() }).unwrap();
        let settled = tled.settle(&loads, &Settling::default());
        let error = distance(tled.positions(), &wanted);
        println!(
            "{mass_scaling}: bound {} ms, added {}, {settled:?}, error {error}",
            tled.bound_ms(),
            tled.mass_added()
        );
        assert!(settled.converged && error < 0.01, "{settled:?} {error}");
        assert!(mass_scaling.is_infinite() || (tled.mass_added() - mass_scaling).abs() < 1e-6);
        assert!(tled.bound_ms() > 1.1 * before);
        before = tled.bound_ms();
    }
}

#[test]
fn the_scaled_bound_is_true() {
    let body = with_slivers();
    let end = |share: f32| {
        let config = Config { substeps: 0, mass_scaling: 0.01, ..Config::default() };
        let mut tled = Tled::new(&body, &config).unwrap();
        let dt = share * tled.bound_ms();
        for n in 0..body.mesh.positions.len() as u32 {
            let kick = |k: u32| (((3 * n + k) as f32 * 12.9898).sin() * 43758.547).fract() * 0.001;
            if body.mesh.positions[n as usize].z > 1.0 {
                tled.set_node(n, Vec3::new(kick(0), kick(1), kick(2)), Vec3::ZERO);
            }
        }
        (0..3000).for_each(|_| _ = tled.step(&Loads::default(), dt));
        distance(tled.positions(), &body.mesh.positions)
    };
    assert!(end(0.98) < 0.01 && end(1.06) > 1.0, "{} {}", end(0.98), end(1.06));
}
