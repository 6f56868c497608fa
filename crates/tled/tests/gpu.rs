//! The device's solver against the processor's.
#![cfg(feature = "gpu")]

use trepan_contact::{NodalContact, PlaneContact};
use trepan_geometry::Vec3;
use trepan_gpu::{Gpu, adapter_for_tests as device};
use trepan_soft::{Anchor, Body, Fluid, Loads, Material, Membrane, SoftSolver, boxes};
use trepan_tled::gpu::{GpuTled, GpuTledError, WithSpare};
use trepan_tled::{Config, Relaxation, Tled};

/// A block of brain, the rest of it tumour.
fn body() -> Body {
    let mesh = boxes::split_box([6, 5, 4], Vec3::new(60.0, 50.0, 40.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let mut body = Body::uniform(mesh, fixed, Material::BRAIN);
    body.materials.push(Material::TUMOUR);
    body.material_of_tet.iter_mut().skip(300).for_each(|m| *m = 1);
    body
}

/// Gravity sideways and a tool that presses the top by some mm.
fn loads(body: &Body) -> Loads {
    let mut contact = NodalContact::none();
    (contact.normal, contact.stiffness, contact.damping) = (Vec3::Z, 0.2, 0.05);
    let middle = Vec3::new(30.0, 25.0, 40.0);
    for n in boxes::nodes_where(&body.mesh, |p| p.distance(middle) < 11.0) {
        contact.add(n, 1.0);
    }
    contact.normalise();
    contact.offset_mm = 3.0 - contact.mean(|n| body.mesh.positions[n as usize]).z;
    let mut loads = Loads { gravity: Vec3::new(3e-3, 0.0, -2e-3), contacts: contact.into(), ..Loads::default() };
    // A shaft that lies over some of the same nodes, and a wall beside.
    let slanted = Vec3::new(0.6, 0.0, 0.8);
    let offset_mm = 1.0 - contact.mean(|n| body.mesh.positions[n as usize]).dot(slanted);
    (contact.normal, contact.offset_mm) = (slanted, offset_mm);
    loads.contacts.push(contact);
    let mut wall = NodalContact::none();
    (wall.normal, wall.offset_mm, wall.stiffness) = (Vec3::X, -59.5, 0.4);
    boxes::nodes_where(&body.mesh, |p| p.x > 59.0 && p.z > 15.0).iter().for_each(|&n| wall.add(n, 1.0));
    wall.normalise();
    loads.contacts.push(wall);
    // Springs of one node each, as a tool's foundation gives; some lie under the planes, too.
    for node in boxes::nodes_where(&body.mesh, |p| p.x < 1.0 && p.z > 15.0) {
        let mut alone = NodalContact::none();
        (alone.normal, alone.offset_mm, alone.stiffness, alone.damping) = (Vec3::NEG_X, 0.8, 0.05, 0.02);
        (alone.lateral_velocity, alone.lateral_damping) = (Vec3::new(0.0, 0.01, 0.02), 0.03);
        alone.add(node, 1.0);
        alone.normalise();
        loads.contacts.push(alone);
    }
    // A wall of planes, under nodes that the springs press too; some only come near.
    for node in boxes::nodes_where(&body.mesh, |p| p.y > 49.0 && p.z > 5.0) {
        let offset_mm = -49.6 - 0.05 * (node % 16) as f32;
        let normal = Vec3::Y;
        loads.contacts.push_plane(PlaneContact { node, normal, offset_mm, stiffness: 0.1, damping: 0.05 });
    }
    loads
}

/// Short enough that pressed elements bear the step too, and no solver needs another substep.
fn config() -> Config {
    Config { safety: 0.5, ..Config::default() }
}

fn largest_difference(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

#[test]
fn the_device_agrees_with_the_processor_under_gravity_and_a_pressing_tool() {
    let Some(gpu) = device() else { return };
    let (body, steps) = (body(), 600);
    let loads = loads(&body);
    let mut device = GpuTled::new(&gpu, &body, &config()).unwrap();
    let mut cpu = Tled::new(&body, &config()).unwrap();
    let dt = device.steps(&loads, steps);
    let report = device.read().unwrap();
    let mut last = cpu.step(&loads, dt);
    for _ in 1..steps {
        last = cpu.step(&loads, dt);
        assert_eq!(last.substeps, 1);
    }
    let largest = largest_difference(cpu.positions(), &body.mesh.positions);
    let difference = largest_difference(cpu.positions(), device.positions());
    let force = (report.contact_n - last.contact_n).abs() / last.contact_n;
    println!("{}: {largest} mm, apart by {:e} of it, force by {force:e}", gpu.name(), difference / largest);
    assert!(largest > 1.0 && last.contact_n > 1e-3, "{largest} {last:?}");
    assert!(difference <= 1e-4 * largest, "{difference} of {largest}");
    assert!(force < 1e-3, "{report:?} {last:?}");
    assert_eq!((report.substeps, report.inverted, report.limited, report.non_finite), (steps, 0, 0, 0));
    assert_eq!(gpu.faults().count, 0, "{:?}", gpu.faults());
}

const KIRCHHOFF: Material = Material::StVenantKirchhoff { young_mpa: 0.003, poisson: 0.45, density_g_mm3: 1e-3 };
const MOONEY: Material = Material::MooneyRivlin { c10_mpa: 3e-4, c01_mpa: 2e-4, poisson: 0.45, density_g_mm3: 1e-3 };
const TWO_TERMS: Material =
    Material::Ogden { shear_mpa: [6e-4, 3e-4], exponent: [-4.7, 2.5], poisson: 0.45, density_g_mm3: 1e-3 };

const STIFFENING: Material =
    Material::Stiffening { shear_mpa: 1e-3, share: 0.3, bound: 0.02, poisson: 0.45, density_g_mm3: 1e-3 };

/// Relaxes within what a test lasts.
const FADING: Relaxation = Relaxation { share: [0.45, 0.2, 0.165], time_ms: [20.0, 100.0, 400.0] };

/// Steps both solvers pressed, then with another step length. Gives how far apart they are as a
/// share of the way, and the way.
fn apart(gpu: &Gpu, body: &Body, config: &Config) -> (f32, f32) {
    let mut loads = loads(body);
    // Tools that go on within a step of several substeps.
    loads.contacts.iter_mut().for_each(|spring| spring.tool_normal_velocity = -0.1);
    let mut device = GpuTled::new(gpu, body, config).expect("the device has these");
    let mut cpu = Tled::new(body, config).expect("the body is sound");
    for (share, steps) in [(2.9, 30), (1.0, 60), (0.7, 10)] {
        for _ in 0..steps {
            let dt = share * cpu.stable_dt_ms();
            let (by_device, by_cpu) = (device.step(&loads, dt), cpu.step(&loads, dt));
            assert_eq!((by_device.substeps, by_device.skipped_ms), (by_cpu.substeps, 0.0));
            assert_eq!((by_device.non_finite, by_device.inverted), (0, by_cpu.inverted));
        }
    }
    let way = largest_difference(cpu.positions(), &body.mesh.positions);
    (largest_difference(cpu.positions(), device.positions()) / way, way)
}

/// Anchors on one side, an opening above, and a level that falls through the block.
#[test]
fn anchors_and_a_falling_level_of_fluid_agree_with_the_processor() {
    let Some(gpu) = device() else { return };
    let mut body = body();
    let anchor = |node: u32| {
        let open_mm2 = if body.mesh.positions[node as usize].z > 39.0 { 20.0 } else { 0.0 };
        Anchor { node, normal: Vec3::X, along: 0.02, across: 0.005, in_fluid: 0.5, open_mm2 }
    };
    body.anchors = boxes::nodes_where(&body.mesh, |p| p.x > 59.0).into_iter().map(anchor).collect();
    let mut loads = loads(&body);
    let mut device = GpuTled::new(&gpu, &body, &config()).unwrap();
    let mut cpu = Tled::new(&body, &config()).unwrap();
    for step in 0..400u16 {
        let level_mm = 45.0 - 0.1 * f32::from(step);
        loads.fluid = Fluid { up: Vec3::Z, level_mm, weight: Vec3::NEG_Z * 4e-3, opening_mpa: 2e-4 };
        let dt = cpu.stable_dt_ms();
        cpu.step(&loads, dt);
        device.step(&loads, dt);
    }
    let largest = largest_difference(cpu.positions(), &body.mesh.positions);
    let difference = largest_difference(cpu.positions(), device.positions());
    assert!(largest > 1.0 && difference <= 1e-4 * largest, "{difference} of {largest}");
    assert_eq!(gpu.faults().count, 0, "{:?}", gpu.faults());
}

#[test]
fn every_law_with_averaged_pressure_and_relaxation_agrees_with_the_processor() {
    let Some(gpu) = device() else { return };
    let laws = [Material::BRAIN, KIRCHHOFF, MOONEY, Material::BRAIN_OGDEN, TWO_TERMS, STIFFENING];
    for (material, name) in
        laws.into_iter().zip(["neo-Hookean", "Kirchhoff", "Mooney", "Ogden", "two terms", "stiffening"])
    {
        let body = Body { materials: vec![material, Material::TUMOUR], ..body() };
        for (averaged_pressure, relaxation) in [(false, Relaxation::NONE), (true, Relaxation::NONE), (true, FADING)] {
            let (apart, way) = apart(&gpu, &body, &Config { averaged_pressure, relaxation, ..config() });
            println!(
                "{name}, averaged pressure {averaged_pressure}, fading {}: {apart:e} of {way} mm",
                !relaxation.is_none()
            );
            assert!(way > 0.3 && apart <= 1e-4, "{name} {averaged_pressure} {relaxation:?}: {apart} of {way} mm");
        }
    }
    assert_eq!(gpu.faults().count, 0, "{:?}", gpu.faults());
}

#[test]
fn a_body_of_every_law_at_once_with_a_membrane_and_scaled_masses_agrees_too() {
    let Some(gpu) = device() else { return };
    let mut body = body();
    body.materials =
        vec![Material::BRAIN, KIRCHHOFF, MOONEY, TWO_TERMS, STIFFENING, Material::TUMOUR, Material::VENTRICLE];
    body.material_of_tet.iter_mut().enumerate().for_each(|(t, m)| *m = (t / 17 % 7) as u8);
    let triangles = trepan_mesh::Surface::of(&body.mesh).triangles;
    body.membrane = Membrane { triangles, shear_n_per_mm: 0.02 };
    let config = Config {
        averaged_pressure: true,
        relaxation: FADING,
        mass_scaling: 0.01,
        balanced_gravity: Vec3::Z * 1e-3,
        ..config()
    };
    let (apart, way) = apart(&gpu, &body, &config);
    println!("{apart:e} of {way} mm");
    assert!(way > 0.3 && apart <= 1e-4, "{apart} of {way} mm");
}

#[test]
fn runs_repeat_bit_for_bit_however_they_are_submitted() {
    let Some(gpu) = device() else { return };
    let body = body();
    let loads = loads(&body);
    let config = Config { averaged_pressure: true, relaxation: FADING, ..Config::default() };
    let run = |chunks: &[u32]| {
        let mut device = GpuTled::new(&gpu, &body, &config).unwrap();
        chunks.iter().for_each(|&n| {
            device.steps(&loads, n);
        });
        device.read().unwrap();
        let bits = |values: &[Vec3]| values.iter().flat_map(|p| p.to_array().map(f32::to_bits)).collect::<Vec<_>>();
        (bits(device.positions()), bits(device.velocities()))
    };
    let once = run(&[300]);
    assert!(once == run(&[300]) && once == run(&[100, 1, 199]));
}

#[test]
fn the_seam_steps_and_lets_go_like_the_processor() {
    let Some(gpu) = device() else { return };
    let body = body();
    let pressed = loads(&body);
    let mut device = GpuTled::new(&gpu, &body, &config()).unwrap();
    let mut cpu = Tled::new(&body, &config()).unwrap();
    let dt = 1.9 * cpu.stable_dt_ms();
    for step in 0..60 {
        let loads = if step < 30 { pressed.clone() } else { Loads { gravity: pressed.gravity, ..Loads::default() } };
        let (by_device, by_cpu) = (device.step(&loads, dt), cpu.step(&loads, dt));
        assert_eq!((by_device.substeps, by_device.skipped_ms), (by_cpu.substeps, 0.0), "{step}");
        assert!((by_device.contact_n - by_cpu.contact_n).abs() <= 1e-3 * by_cpu.contact_n, "{step}");
    }
    let largest = largest_difference(cpu.positions(), &body.mesh.positions);
    assert!(largest_difference(cpu.positions(), device.positions()) <= 1e-4 * largest);
    assert!(device.step(&pressed, 100.0 * dt).skipped_ms > 0.0);
    assert_eq!((device.fault(), gpu.faults().count), (None, 0));
}

#[test]
fn what_is_not_sane_is_held_and_counted() {
    let Some(gpu) = device() else { return };
    let body = body();
    let mut device = GpuTled::new(&gpu, &body, &Config { substeps: 0, ..Config::default() }).unwrap();
    let (mut limited, mut inverted) = (0, 0);
    for _ in 0..40 {
        let report = device.step(&loads(&body), 3.0 * device.bound_ms());
        (limited, inverted) = (limited + report.limited, inverted + report.inverted);
        assert!(device.positions().iter().all(|p| p.is_finite()));
    }
    assert!(limited > 0 && inverted > 0, "{limited} {inverted}");
}

#[test]
fn what_the_kernels_lack_is_refused_by_name() {
    let Some(gpu) = device() else { return };
    let name = |body: &Body, config: Config| match GpuTled::new(&gpu, body, &config) {
        Err(GpuTledError::Unsupported { field, .. }) => field,
        Err(other) => panic!("{other}"),
        Ok(_) => "nothing",
    };
    let (plain, free) = (Config::default(), Body { fixed: vec![], ..body() });
    assert_eq!(name(&free, plain), "damping");
    assert_eq!(name(&free, Config { damping: trepan_tled::Damping::None, ..plain }), "nothing");
}

#[test]
fn when_the_device_is_lost_the_processor_goes_on_from_where_it_was() {
    let Some(gpu) = device() else { return };
    let (body, config) = (body(), config());
    let loads = loads(&body);
    let mut spare = WithSpare::new(&gpu, &body, &config).unwrap();
    let mut whole = Tled::new(&body, &config).unwrap();
    let (lost, dt_ms) = (spare.lost(), whole.stable_dt_ms());
    let moved = |before: &[Vec3], solver: &dyn SoftSolver| largest_difference(before, solver.positions());
    for step in 0..120 {
        if step == 60 {
            gpu.device().destroy();
        }
        let [before, expected] = [&spare as &dyn SoftSolver, &whole].map(|solver| solver.positions().to_vec());
        let report = spare.step(&loads, dt_ms);
        whole.step(&loads, dt_ms);
        assert_eq!((lost.load(std::sync::atomic::Ordering::Relaxed), report.skipped_ms), (step >= 60, 0.0), "{step}");
        let (is, was) = (moved(&before, &spare), moved(&expected, &whole));
        assert!((is - was).abs() < 0.02 * was + 1e-5, "{step}: {is} mm in a step, {was} mm without the loss");
    }
    let largest = largest_difference(whole.positions(), &body.mesh.positions);
    assert!(largest_difference(whole.positions(), spare.positions()) < 0.01 * largest);
    // A software driver is never taken for a card.
    let opened = WithSpare::on_a_card(&body, &config);
    let is_card = Gpu::open(trepan_gpu::Prefer::Hardware).is_ok_and(|gpu| !gpu.is_software());
    assert_eq!(opened.is_ok(), is_card);
}
