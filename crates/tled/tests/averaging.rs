//! Selective mass scaling: the same equilibria, momentum and slow motion in longer steps.

use trepan_contact::{NodalContact, NodalContacts};
use trepan_geometry::Vec3;
use trepan_mesh::TetMesh;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Damping, Tled};

/// Edge of the block, mm: its step is short enough for accelerations to be averaged.
const EDGE_MM: f32 = 12.0;

fn block(cells: usize, is_fixed: bool) -> Body {
    let mut mesh = boxes::split_box([cells; 3], Vec3::splat(EDGE_MM));
    // Elements of many sizes: cells grow from one corner to the other.
    mesh.positions.iter_mut().for_each(|p| *p *= (*p + EDGE_MM) / (2.0 * EDGE_MM));
    let fixed = boxes::nodes_where(&mesh, |p| is_fixed && p.z < 0.1);
    Body::uniform(mesh, fixed, Material::WHOLE_BRAIN)
}

fn solver(body: &Body, config: Config) -> [Tled; 2] {
    [false, true].map(|selective_mass_scaling| {
        Tled::new(body, &Config { selective_mass_scaling, averaged_pressure: true, ..config }).expect("a sound body")
    })
}

fn pressed(mesh: &TetMesh, depth_mm: f32) -> Loads {
    let mut contact = NodalContact::none();
    let middle = Vec3::new(6.0, 6.0, EDGE_MM);
    boxes::nodes_where(mesh, |p| p.distance(middle) < 3.5).iter().for_each(|&n| contact.add(n, 1.0));
    contact.normalise();
    (contact.normal, contact.offset_mm, contact.stiffness) = (Vec3::Z, depth_mm - EDGE_MM, 0.3);
    Loads { contacts: contact.into(), ..Loads::default() }
}

fn noise(i: usize) -> f32 {
    ((i as f32 * 12.9898).sin() * 43758.547).fract() - 0.5
}

#[test]
fn steps_are_longer_and_the_tissue_rests_where_it_did() {
    let body = block(5, true);
    let [mut plain, mut averaged] = solver(&body, Config { dynamic_mass_scaling: 16.0, ..Config::default() });
    assert!((averaged.stable_dt_ms() / plain.stable_dt_ms() - 3f32.sqrt()).abs() < 1e-5);
    let loads = pressed(&body.mesh, 2.0);
    let forces = [&mut plain, &mut averaged].map(|tled| {
        let (mut now_ms, mut force_n) = (0.0, 0.0);
        while now_ms < 1500.0 {
            let dt_ms = tled.next_dt_ms();
            let report = tled.step(&loads, dt_ms);
            assert_eq!((report.inverted, report.limited, report.non_finite), (0, 0, 0));
            (now_ms, force_n) = (now_ms + dt_ms, report.contact_n);
        }
        force_n
    });
    let apart = plain.positions().iter().zip(averaged.positions()).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    assert!(forces[0] > 0.02 && (forces[0] / forces[1] - 1.0).abs() < 1e-4, "{forces:?} N");
    assert!(apart < 1e-3, "{apart} mm");
}

/// Shakes every node, undamped, in the longest stable steps, alone and under stiff springs. An
/// unstable step would grow without end, as that of the plain solver does.
#[test]
fn it_is_stable_at_its_bound_where_plain_steps_are_not() {
    let body = block(5, true);
    let config = Config { damping: Damping::None, substeps: 0, ..Config::default() };
    let [plain, averaged] = [false, true]
        .map(|selective_mass_scaling| Tled::new(&body, &Config { selective_mass_scaling, ..config }).unwrap());
    // The elements' bound, or more where the plain solver's own is above it.
    let dt_ms = (0.999 * averaged.stable_dt_ms() / config.safety).max(1.1 * plain.bound_ms());
    let mut springs = Loads { contacts: NodalContacts::with_room(), ..Loads::default() };
    for &n in &boxes::nodes_where(&body.mesh, |p| p.z > EDGE_MM - 0.1) {
        let mut spring = NodalContact::none();
        spring.add(n, 1.0);
        spring.normal = Vec3::new(noise(n as usize), noise(3 * n as usize), 1.0).normalize();
        spring.offset_mm = 0.005 - body.mesh.positions[n as usize].dot(spring.normal);
        spring.stiffness = 10f32.powf(4.0 * noise(7 * n as usize));
        springs.contacts.push(spring);
    }
    let farthest_mm = |mut tled: Tled, loads: &Loads| {
        for (n, p) in body.mesh.positions.iter().enumerate().filter(|(_, p)| p.z > 0.1) {
            let kick = Vec3::new(noise(3 * n), noise(3 * n + 1), noise(3 * n + 2)) * 2e-4 * p.z;
            tled.set_node(n as u32, kick, Vec3::ZERO);
        }
        (0..6000).for_each(|_| _ = tled.step(loads, dt_ms));
        tled.positions().iter().zip(&body.mesh.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
    };
    let again = || Tled::new(&body, &Config { selective_mass_scaling: true, ..config }).unwrap();
    let most = [farthest_mm(averaged, &Loads::default()), farthest_mm(again(), &springs)];
    assert!(most[0] < 0.02 && most[1] < 0.05, "{most:?} mm");
    assert!(farthest_mm(plain, &Loads::default()) > 1.0);
}

/// Nodes beside a sleeping part neither coast nor are dragged along while they rest.
#[test]
fn a_body_that_sleeps_is_where_one_that_does_not_is() {
    let mesh = boxes::split_box([48, 6, 5], Vec3::new(96.0, 12.0, 10.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 0.1);
    let body = Body::uniform(mesh, fixed, Material::WHOLE_BRAIN);
    let [_, mut awake] = solver(&body, Config::default());
    let [_, mut sleepy] = solver(&body, Config { still_mm: 0.003, ..Config::default() });
    let run = |tled: &mut Tled, loads: &Loads, ms: f32| {
        let dt_ms = 0.8 * tled.stable_dt_ms();
        (0..(ms / dt_ms) as usize).for_each(|_| _ = tled.step(loads, dt_ms));
    };
    run(&mut sleepy, &Loads::default(), 60.0);
    assert_eq!(sleepy.awake_share(), 0.0);
    let mut contact = NodalContact::none();
    let under = Vec3::new(6.0, 6.0, 10.0);
    boxes::nodes_where(&body.mesh, |p| p.distance(under) < 3.0 && p.z > 9.9).iter().for_each(|&n| contact.add(n, 1.0));
    contact.normalise();
    (contact.normal, contact.offset_mm, contact.stiffness) = (Vec3::Z, 1.0 - 10.0, 0.3);
    let pressed = Loads { contacts: contact.into(), ..Loads::default() };
    for (loads, ms) in [(&pressed, 5.0), (&pressed, 300.0), (&Loads::default(), 300.0)] {
        run(&mut sleepy, loads, ms);
        run(&mut awake, loads, ms);
        let share = sleepy.awake_share();
        assert!(share < 1.0, "{share}");
        let apart = sleepy.positions().iter().zip(awake.positions()).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(apart < 0.01, "{apart} mm after {ms} ms");
    }
}

#[test]
fn a_free_body_keeps_its_momentum_and_falls_as_a_whole() {
    let body = block(5, false);
    let [_, mut tled] = solver(&body, Config { damping: Damping::None, ..Config::default() });
    let masses = body.lumped_masses_g();
    for n in 0..masses.len() {
        tled.set_node(n as u32, Vec3::new(noise(n), noise(2 * n), noise(5 * n)) * 0.05, Vec3::X * 0.01);
    }
    let momentum = |tled: &Tled| -> Vec3 {
        tled.velocities().iter().zip(&masses).map(|(v, m)| *v * *m as f32).sum::<Vec3>()
            / masses.iter().sum::<f64>() as f32
    };
    let (dt_ms, gravity) = (tled.stable_dt_ms(), Vec3::NEG_Y * 9.81e-3);
    (0..200).for_each(|_| _ = tled.step(&Loads { gravity, ..Loads::default() }, dt_ms));
    let expected = Vec3::X * 0.01 + gravity * (200.0 * dt_ms);
    // Velocities are those of the middle of a step.
    let half = 0.5 * dt_ms * gravity.length();
    assert!(momentum(&tled).distance(expected) < half, "{} for {expected}", momentum(&tled));
}

/// The lowest mode's period by its zero crossings, on a block of five edges: averaging slows short
/// waves, and this one by 3 percent.
#[test]
fn slow_motion_is_hardly_slower() {
    let body = block(5, true);
    let config = Config { damping: Damping::None, ..Config::default() };
    let periods_ms = solver(&body, config).map(|mut tled| {
        for (n, p) in body.mesh.positions.iter().enumerate() {
            tled.set_node(n as u32, Vec3::X * 0.02 * p.z * p.z / (EDGE_MM * EDGE_MM), Vec3::ZERO);
        }
        let top = body.mesh.positions.len() - 1;
        let (dt_ms, rest) = (0.25 * tled.stable_dt_ms(), body.mesh.positions[top].x);
        let (mut crossings, mut before, mut now_ms) = (Vec::new(), 1.0, 0.0f32);
        while crossings.len() < 5 {
            tled.step(&Loads::default(), dt_ms);
            now_ms += dt_ms;
            let x = tled.positions()[top].x - rest;
            if before * x < 0.0 {
                crossings.push(now_ms - dt_ms * x / (x - before));
            }
            before = x;
        }
        0.5 * (crossings[4] - crossings[0])
    });
    assert!((1.01..1.04).contains(&(periods_ms[1] / periods_ms[0])), "{periods_ms:?} ms");
}

#[test]
fn the_bytes_are_the_same_for_any_number_of_threads() {
    // Several parts, and several runs of nodes.
    let body = block(9, true);
    let ends = [1, 2, 3].map(|threads| {
        let [_, mut tled] = solver(&body, Config { threads, dynamic_mass_scaling: 4.0, ..Config::default() });
        (0..300).for_each(|_| _ = tled.step(&pressed(&body.mesh, 5.0), tled.next_dt_ms()));
        tled.positions().iter().flat_map(|p| p.to_array().map(f32::to_bits)).collect::<Vec<_>>()
    });
    assert!(ends[0] == ends[1] && ends[0] == ends[2]);
}
