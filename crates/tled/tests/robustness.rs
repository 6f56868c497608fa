//! TLED where such solvers fail: too long steps, elements turned over, hard contact; and the same
//! bytes every time.

use trepan_contact::NodalContact;
use trepan_geometry::Vec3;
use trepan_mesh::TetMesh;
use trepan_soft::{Body, Loads, Material, SoftSolver, StepReport, boxes};
use trepan_tled::{Config, Kernel, Tled};

fn cube() -> Body {
    let mesh = boxes::split_box([4, 4, 4], Vec3::splat(40.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1.0);
    Body::uniform(mesh, fixed, Material::BRAIN)
}

fn noise(i: usize) -> f32 {
    ((i as f32 * 12.9898).sin() * 43758.547).fract()
}

fn shaken(config: &Config, amplitude: f32) -> Tled {
    let body = cube();
    let mut tled = Tled::new(&body, config).expect("the cube is a sound body");
    for n in 0..body.mesh.positions.len() {
        if body.mesh.positions[n].z > 1.0 {
            let kick = Vec3::new(noise(3 * n), noise(3 * n + 1), noise(3 * n + 2)) * amplitude;
            tled.set_node(n as u32, kick, Vec3::ZERO);
        }
    }
    tled
}

fn is_finite(tled: &Tled) -> bool {
    tled.positions().iter().chain(tled.velocities()).all(|p| p.is_finite())
}

fn offset(tled: &Tled) -> f32 {
    tled.positions().iter().zip(&cube().mesh.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

fn press(stiffness: f32, damping: f32) -> Loads {
    let mut contact = NodalContact::none();
    let corner = cube().mesh.positions.len() as u32 - 1;
    contact.add(corner, 1.0);
    (contact.normal, contact.offset_mm, contact.stiffness, contact.damping) = (Vec3::Z, 2.0 - 40.0, stiffness, damping);
    Loads { contacts: contact.into(), ..Loads::default() }
}

/// A stiff spring that presses the corner down by about so much.
fn press_by(depth_mm: f32) -> Loads {
    let mut loads = press(0.3, 0.1);
    loads.contacts[0].offset_mm = depth_mm - 40.0;
    loads
}

#[test]
fn runs_repeat_bit_for_bit_whatever_the_kernel_and_the_number_of_threads() {
    let end = |kernel, threads| {
        let mut tled = shaken(&Config { kernel, threads, dynamic_mass_scaling: 64.0, ..Config::default() }, 1.0);
        let dt = tled.stable_dt_ms();
        (0..500).for_each(|_| _ = tled.step(&press(0.3, 0.1), dt));
        tled.positions().iter().flat_map(|p| p.to_array().map(f32::to_bits)).collect::<Vec<_>>()
    };
    let first = end(Kernel::Fastest, 1);
    assert_eq!(first, end(Kernel::Fastest, 1));
    for kernel in Kernel::all().into_iter().filter(|kernel| kernel.runs_here()) {
        assert!(first == end(kernel, 1), "{}", kernel.name());
    }
    for threads in [2, 3, 8] {
        assert!(first == end(Kernel::Fastest, threads), "{threads} threads");
    }
}

#[test]
fn a_step_over_the_bound_explodes_when_obeyed_and_is_cut_by_default() {
    let mut obeyed = shaken(&Config { substeps: 0, ..Config::default() }, 0.01);
    let dt = 2.0 * obeyed.bound_ms();
    let mut held = 0;
    for _ in 0..400 {
        let report = obeyed.step(&Loads::default(), dt);
        held += report.limited + report.non_finite;
        assert!(is_finite(&obeyed));
    }
    assert!(held > 0 && offset(&obeyed) > 1.0, "{held} {}", offset(&obeyed));
    let mut cut = shaken(&Config::default(), 0.01);
    for _ in 0..400 {
        let report = cut.step(&Loads::default(), dt);
        // Three by the step at rest, four by the elements' of the shaken body.
        assert!((3..=4).contains(&report.substeps), "{}", report.substeps);
        assert_eq!((report.limited, report.non_finite, report.skipped_ms), (0, 0, 0.0));
    }
    assert!(offset(&cut) < 0.02);
    let report = cut.step(&Loads::default(), 100.0);
    assert!(report.substeps == 4 && report.skipped_ms > 90.0);
}

#[test]
fn just_under_the_bound_it_is_stable_and_just_over_it_is_not() {
    let end = |share: f32| {
        let mut tled = shaken(&Config { substeps: 0, ..Config::default() }, 0.001);
        let dt = share * tled.bound_ms();
        (0..3000).for_each(|_| _ = tled.step(&Loads::default(), dt));
        offset(&tled)
    };
    assert!(end(0.99) < 0.01);
    assert!(end(1.05) > 1.0);
}

#[test]
fn elements_turned_over_heal() {
    let mut tled = shaken(&Config::default(), 12.0);
    let dt = 0.5 * tled.stable_dt_ms();
    let first = tled.step(&Loads::default(), dt);
    assert!(first.inverted > 20, "{}", first.inverted);
    let last = (0..4000).map(|_| tled.step(&Loads::default(), dt)).last().unwrap();
    assert!(is_finite(&tled));
    assert_eq!((last.inverted, last.non_finite), (0, 0));
    assert!(offset(&tled) < 0.1, "{}", offset(&tled));
}

#[test]
fn a_body_squashed_flat_or_to_a_point_comes_back() {
    // A mirror image or a point may come out twisted by half a turn about the clamped base, which
    // is an equilibrium too: whole elements suffice there.
    for (squash, to_rest) in [(Vec3::new(1.0, 1.0, 0.0), true), (Vec3::new(0.05, 1.0, 1.0), true), (Vec3::ZERO, false)]
    {
        let body = cube();
        let mut tled = Tled::new(&body, &Config::default()).unwrap();
        for (n, p) in body.mesh.positions.iter().enumerate().filter(|(_, p)| p.z > 1.0) {
            let to = (*p - Vec3::splat(20.0)) * squash + Vec3::splat(20.0);
            tled.set_node(n as u32, to - *p, Vec3::ZERO);
        }
        let dt = 0.5 * tled.stable_dt_ms();
        let last = (0..6000).map(|_| tled.step(&Loads::default(), dt)).last().unwrap();
        assert!(is_finite(&tled), "{squash}");
        assert_eq!(last.inverted, 0, "{squash}");
        assert!(!to_rest || offset(&tled) < 0.2, "{squash}: {}", offset(&tled));
        let now = TetMesh { positions: tled.positions().to_vec(), ..body.mesh.clone() };
        assert!((0..now.tets.len()).all(|t| now.volume_mm3(t) > 0.3 * body.mesh.volume_mm3(t)), "{squash}");
    }
}

#[test]
fn a_hard_hit_at_the_full_step_is_survived_by_substeps() {
    // 3 N at once, 6 mm deep into 10 mm elements: they are squeezed until the step of the rest
    // state is too long for them.
    let body = cube();
    let mut tled = Tled::new(&body, &Config::default()).unwrap();
    let mut contact = NodalContact::none();
    boxes::nodes_where(&body.mesh, |p| p.z > 39.0 && p.x < 31.0).iter().for_each(|&n| contact.add(n, 1.0));
    contact.normalise();
    (contact.normal, contact.offset_mm, contact.stiffness) = (Vec3::Z, 6.0 - 40.0, 0.5);
    let loads = Loads { gravity: Vec3::X * 9.81e-3, contacts: contact.into(), ..Loads::default() };
    let dt = tled.stable_dt_ms();
    let mut most = 0;
    for _ in 0..1500 {
        let report = tled.step(&loads, dt);
        assert_eq!((report.limited, report.non_finite, report.skipped_ms), (0, 0, 0.0));
        most = most.max(report.substeps);
    }
    assert!((2..=4).contains(&most), "{most}");
    assert!(tled.velocities().iter().all(|v| v.length() < 1e-4));
}

/// Under a probe, steps of [`SoftSolver::next_dt_ms`] do the same in fewer substeps.
///
/// Those of the step at rest are cut in two there. With dynamic mass scaling they are as long as at
/// rest.
#[test]
fn the_step_of_the_deformed_body_saves_substeps() {
    let pressed = |next: bool, dynamic_mass_scaling: f32| {
        let mut tled = shaken(&Config { dynamic_mass_scaling, ..Config::default() }, 0.0);
        let (rest_ms, mut now_ms, mut substeps, mut force) = (tled.stable_dt_ms(), 0.0, 0, 0.0);
        assert_eq!(tled.next_dt_ms(), rest_ms);
        while now_ms < 600.0 {
            let dt_ms = if next { tled.next_dt_ms() } else { rest_ms };
            assert!(dt_ms <= rest_ms && dt_ms >= 0.5 * rest_ms);
            let report = tled.step(&press_by(8.0), dt_ms);
            (now_ms, substeps, force) = (now_ms + dt_ms, substeps + report.substeps, report.contact_n);
        }
        (f64::from(substeps) * f64::from(rest_ms) / 600.0, force, tled.positions().to_vec())
    };
    let (cut, cut_n, cut_at) = pressed(false, 1.0);
    let (next, next_n, next_at) = pressed(true, 1.0);
    let (heavy, heavy_n, heavy_at) = pressed(true, 64.0);
    assert!(cut > 1.9 && next < 0.85 * cut, "{cut} and {next} substeps for each at rest");
    assert!(heavy < 1.01, "{heavy} substeps for each at rest");
    for (n, at) in [(next_n, next_at), (heavy_n, heavy_at)] {
        assert!((n / cut_n - 1.0).abs() < 1e-3, "{n} and {cut_n} N");
        let apart = cut_at.iter().zip(&at).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(apart < 5e-3, "{apart} mm apart");
    }
}

#[test]
fn a_contact_stiffer_than_the_step_bears_is_stable() {
    for (stiffness, damping) in [(0.01, 0.0), (1e4, 0.0), (0.3, 1e4), (f32::MAX, 0.0)] {
        let mut tled = shaken(&Config::default(), 0.0);
        let dt = tled.stable_dt_ms();
        for _ in 0..2000 {
            assert_eq!(tled.step(&press(stiffness, damping), dt).non_finite, 0);
        }
        assert!(offset(&tled) < 4.0, "{}", offset(&tled));
    }
}

/// Presses a probe beside a wall on the same light nodes, both damped beyond what an explicit step
/// bears. At rest the tissue bears all of what a hand on the spring feels.
#[test]
fn what_the_hand_feels_the_tissue_gets() {
    let body = cube();
    let mut tled = Tled::new(&body, &Config::default()).unwrap();
    let corner = body.mesh.positions.len() as u32 - 1;
    let spring = |stiffness: f32, normal: Vec3, depth_mm: f32, nodes: &[u32]| {
        let mut spring = NodalContact::none();
        nodes.iter().for_each(|&n| spring.add(n, 1.0 / nodes.len() as f32));
        let rest = spring.mean(|n| body.mesh.positions[n as usize]).dot(normal);
        (spring.normal, spring.offset_mm) = (normal, depth_mm - rest);
        (spring.stiffness, spring.damping) = (stiffness, 30.0 * stiffness);
        spring
    };
    let mut contacts = trepan_contact::NodalContacts::with_room();
    contacts.push(spring(0.3, Vec3::Z, 2.0, &[corner, corner - 1]));
    contacts.push(spring(1.0, Vec3::X, 0.5, &[corner]));
    let loads = Loads { contacts, ..Loads::default() };
    let dt = tled.stable_dt_ms();
    let mut report = StepReport::default();
    (0..8000).for_each(|_| report = tled.step(&loads, dt));
    let felt: f32 =
        loads.contacts.iter().map(|s| s.pressure_n(s.mean(|n| tled.positions()[n as usize]), Vec3::ZERO)).sum();
    assert!(felt > 0.01, "{report:?}, {felt} N felt");
    assert!((report.contact_n / felt - 1.0).abs() < 1e-3, "{} N on the tissue, {felt} N felt", report.contact_n);
}

#[test]
fn loads_that_are_not_numbers_are_healed_and_counted() {
    let mut tled = shaken(&Config::default(), 0.0);
    let dt = tled.stable_dt_ms();
    let bad = Loads { gravity: Vec3::splat(f32::NAN), ..Loads::default() };
    let report = tled.step(&bad, dt);
    assert!(report.non_finite > 0 && is_finite(&tled));
    let mut strange = press(f32::NAN, 0.0);
    strange.contacts[0].add(1_000_000, 0.5);
    tled.step(&strange, dt);
    tled.step(&press(0.3, 0.0), f32::NAN);
    tled.step(&press(0.3, 0.0), -1.0);
    assert!(is_finite(&tled));
}
