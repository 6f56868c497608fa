//! TLED against closed forms, conservation laws and the f64 reference.

use glam::{DMat3, DVec3};
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;
use trepan_soft::reference::{self, Reference};
use trepan_soft::{Body, Loads, Material, NeoHookean, SoftSolver, boxes};
use trepan_tled::{Config, Damping, FULL, Tled};

const GRAVITY: Vec3 = Vec3::new(0.0, 0.0, -9.81e-3);

fn block(cells: [usize; 3], size: Vec3, fixed: impl Fn(Vec3) -> bool) -> Body {
    let mesh = boxes::split_box(cells, size);
    let fixed = boxes::nodes_where(&mesh, fixed);
    Body::uniform(mesh, fixed, Material::BRAIN)
}

fn run(solver: &mut dyn SoftSolver, loads: &Loads, ms: f32) {
    let dt = solver.stable_dt_ms();
    for _ in 0..(ms / dt).ceil() as usize {
        let report = solver.step(loads, dt);
        assert_eq!((report.non_finite, report.limited, report.skipped_ms), (0, 0, 0.0));
    }
}

fn largest_difference(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

fn law(body: &Body) -> NeoHookean {
    NeoHookean { mu: body.material(0).shear_mpa(), kappa: body.material(0).bulk_mpa() }
}

fn deformation(body: &Body, positions: &[Vec3], tet: usize) -> DMat3 {
    body.shape(tet).gradient_of(body.mesh.tets[tet].map(|n| positions[n as usize].as_dvec3()))
}

fn elastic_energy(body: &Body, positions: &[Vec3]) -> f64 {
    let of = |t| body.shape(t).volume_mm3 * law(body).energy(deformation(body, positions, t));
    (0..body.mesh.tets.len()).map(of).sum()
}

fn kinetic_energy(body: &Body, velocities: &[Vec3]) -> f64 {
    let masses = body.lumped_masses_g();
    velocities.iter().zip(masses).map(|(v, m)| 0.5 * m * v.as_dvec3().length_squared()).sum()
}

#[test]
fn an_unloaded_body_stays_where_it_is() {
    let body = block([3, 3, 3], Vec3::splat(30.0), |p| p.z < 1.0);
    let mut tled = Tled::new(&body, &Config::default()).unwrap();
    run(&mut tled, &Loads::default(), 1000.0);
    assert!(largest_difference(tled.positions(), &body.mesh.positions) < 1e-4);
}

#[test]
fn a_patch_takes_the_affine_deformation_of_its_border() {
    let size = 20.0;
    let on_border = |p: Vec3| p.min_element() < 1e-3 || p.max_element() > size - 1e-3;
    let body = block([4, 4, 4], Vec3::splat(size), on_border);
    let gradient =
        DMat3::from_cols(DVec3::new(0.05, 0.01, 0.0), DVec3::new(0.03, -0.04, 0.02), DVec3::new(0.0, 0.06, 0.02));
    let wanted = |n: usize| (gradient * body.mesh.positions[n].as_dvec3()).as_vec3();
    let mut tled = Tled::new(&body, &Config::default()).unwrap();
    body.fixed.iter().for_each(|&n| tled.set_node(n, wanted(n as usize), Vec3::ZERO));
    run(&mut tled, &Loads::default(), 400.0);
    let affine: Vec<Vec3> = (0..body.mesh.positions.len()).map(|n| body.mesh.positions[n] + wanted(n)).collect();
    let error = largest_difference(tled.positions(), &affine);
    assert!(error < 1e-6 * size * 2.0, "{error}");
}

#[test]
fn uniaxial_stretch_has_the_stress_of_the_closed_form() {
    // Free sides in the f32 solver: stretch z by L and x, y by the T that makes the lateral stress
    // vanish.
    let body = block([2, 2, 2], Vec3::splat(10.0), |_| false);
    for stretch in [0.7f64, 0.9, 1.2, 1.5] {
        let law = law(&body);
        let lateral = |t: f64| {
            let j = t * t * stretch;
            law.mu * j.powf(-2.0 / 3.0) * (t - (2.0 * t * t + stretch * stretch) / (3.0 * t))
                + law.kappa * (j - 1.0) * t * stretch
        };
        let (mut low, mut high) = (0.3, 2.5);
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if lateral(middle) > 0.0 { high = middle } else { low = middle }
        }
        let (t, j) = (low, low * low * stretch);
        let axial = law.mu * j.powf(-2.0 / 3.0) * (stretch - (2.0 * t * t + stretch * stretch) / (3.0 * stretch))
            + law.kappa * (j - 1.0) * t * t;
        let mut tled = Tled::new(&body, &Config { damping: Damping::None, ..Config::default() }).unwrap();
        let scale = DVec3::new(t - 1.0, t - 1.0, stretch - 1.0).as_vec3();
        (0..27).for_each(|n| tled.set_node(n, body.mesh.positions[n as usize] * scale, Vec3::ZERO));
        // One tiny step from rest: the momentum gained by the top face is force times time.
        let dt = 1e-3;
        tled.step(&Loads::default(), dt);
        let masses = body.lumped_masses_g();
        let top = boxes::nodes_where(&body.mesh, |p| p.z > 9.0);
        let force: f64 =
            top.iter().map(|&n| masses[n as usize] * f64::from(tled.velocities()[n as usize].z / dt)).sum();
        let side = boxes::nodes_where(&body.mesh, |p| p.x > 9.0);
        let lateral: f64 =
            side.iter().map(|&n| masses[n as usize] * f64::from(tled.velocities()[n as usize].x / dt)).sum();
        assert!((force / (-axial * 100.0) - 1.0).abs() < 5e-3, "{stretch}: {force} N, closed form {}", -axial * 100.0);
        assert!(lateral.abs() < 5e-3 * force.abs(), "{stretch}: {lateral}");
    }
}

/// A block that swings without damping loses tissue at random, and energy with it.
///
/// Elastic energy counts by what is left of each element; a hundredth may be the steps' own.
#[test]
fn tissue_that_is_taken_away_gives_the_rest_no_energy() {
    let body = block([5, 5, 5], Vec3::splat(50.0), |p| p.z < 1.0);
    let mut tled = Tled::new(&body, &Config { damping: Damping::None, ..Config::default() }).unwrap();
    for (n, p) in body.mesh.positions.iter().enumerate() {
        tled.set_node(n as u32, Vec3::new(0.04 * p.z, 0.0, 0.0), Vec3::ZERO);
    }
    let energy = |tled: &Tled| -> f64 {
        let left = |t: usize| f64::from(tled.fills()[t]) / f64::from(FULL);
        let of = |t| body.shape(t).volume_mm3 * law(&body).energy(deformation(&body, tled.positions(), t)) * left(t);
        (0..body.mesh.tets.len()).map(of).sum::<f64>() + kinetic_energy(&body, tled.velocities())
    };
    let (dt, count, mut random, mut most) = (tled.stable_dt_ms(), body.mesh.tets.len() as u32, 7u32, 0.0f64);
    let first = energy(&tled);
    for step in 0..3400 {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let tet = (random >> 8) % count;
        tled.lower_fill(tet, tled.fills()[tet as usize].saturating_sub(u16::MAX / 2));
        let report = tled.step(&Loads::default(), dt);
        assert_eq!((report.non_finite, report.limited), (0, 0));
        if step % 20 == 0 {
            most = most.max(energy(&tled) / first);
        }
    }
    assert!(most < 1.01, "{most} of the first");
    let gone = tled.fills().iter().filter(|fill| **fill == 0).count();
    assert!(gone > 500 && energy(&tled) < 0.2 * first, "{gone} gone, {} left", energy(&tled) / first);
}

#[test]
fn under_gravity_it_settles_where_the_static_reference_is() {
    let body = block([4, 4, 6], Vec3::new(40.0, 40.0, 60.0), |p| p.z < 1.0);
    let loads = Loads { gravity: GRAVITY, ..Loads::default() };
    let mut exact = Reference::new(&body, &reference::Config::default()).unwrap();
    assert!(exact.step(&loads, 1.0).converged);
    let mut tled = Tled::new(&body, &Config::default()).unwrap();
    run(&mut tled, &loads, 1500.0);
    let sag = largest_difference(exact.positions(), &body.mesh.positions);
    let error = largest_difference(tled.positions(), exact.positions());
    assert!(sag > 2.0 && error < 1e-3 * sag, "sag {sag} mm, error {error} mm");
}

#[test]
fn under_the_tool_it_settles_where_the_static_reference_is() {
    let body = block([5, 5, 4], Vec3::new(50.0, 50.0, 40.0), |p| p.z < 1.0);
    let loads = Loads { contacts: probe(&body, 4.0).into(), ..Loads::default() };
    let mut exact = Reference::new(&body, &reference::Config::default()).unwrap();
    let found = exact.step(&loads, 1.0);
    assert!(found.converged && found.contact_n > 0.05);
    let mut tled = Tled::new(&body, &Config::default()).unwrap();
    run(&mut tled, &loads, 1500.0);
    let report = tled.step(&loads, tled.stable_dt_ms());
    assert!((report.contact_n / found.contact_n - 1.0).abs() < 1e-3, "{} {}", report.contact_n, found.contact_n);
    assert!(largest_difference(tled.positions(), exact.positions()) < 5e-3);
}

/// A probe that presses the middle of the top face `depth` mm down.
fn probe(body: &Body, depth: f32) -> NodalContact {
    let top = body.mesh.bounds().max.z;
    let centre = body.mesh.bounds().centre();
    let mut contact = NodalContact::none();
    for n in boxes::nodes_where(&body.mesh, |p| p.z > top - 0.1 && (p - centre).truncate().length() < 9.0) {
        contact.add(n, 1.0);
    }
    contact.normalise();
    (contact.normal, contact.offset_mm, contact.stiffness) = (Vec3::Z, depth - top, 0.3);
    contact
}

#[test]
fn a_poke_dents_the_tissue_and_it_comes_back_within_a_second() {
    let body = block([6, 6, 5], Vec3::new(120.0, 120.0, 100.0), |p| p.z < 1.0);
    let config = Config { balanced_gravity: GRAVITY, ..Config::default() };
    let mut tled = Tled::new(&body, &config).unwrap();
    let mut loads = Loads { gravity: GRAVITY, ..Loads::default() };
    let mut contact = NodalContact::none();
    boxes::nodes_where(&body.mesh, |p| p.z > 99.0 && (p.truncate() - glam::Vec2::splat(60.0)).length() < 21.0)
        .iter()
        .for_each(|&n| contact.add(n, 1.0));
    contact.normalise();
    (contact.normal, contact.offset_mm, contact.stiffness) = (Vec3::Z, 8.0 - 100.0, 0.3);
    loads.contacts.push(contact);
    run(&mut tled, &loads, 500.0);
    let dent = largest_difference(tled.positions(), &body.mesh.positions);
    assert!(dent > 3.0, "{dent}");
    loads.contacts.clear();
    run(&mut tled, &loads, 1000.0);
    let left = largest_difference(tled.positions(), &body.mesh.positions);
    assert!(left < 0.02 * dent, "dent {dent} mm, left {left} mm");
}

#[test]
fn balanced_gravity_holds_the_scanned_shape_and_turning_the_head_shifts_the_brain() {
    let body = block([4, 4, 4], Vec3::splat(60.0), |p| p.z < 1.0);
    let mut tled = Tled::new(&body, &Config { balanced_gravity: GRAVITY, ..Config::default() }).unwrap();
    run(&mut tled, &Loads { gravity: GRAVITY, ..Loads::default() }, 500.0);
    assert!(largest_difference(tled.positions(), &body.mesh.positions) < 1e-3);
    run(&mut tled, &Loads { gravity: Vec3::X * 9.81e-3, ..Loads::default() }, 500.0);
    assert!(largest_difference(tled.positions(), &body.mesh.positions) > 2.0);
}

#[test]
fn without_damping_energy_is_kept() {
    let body = block([6, 2, 2], Vec3::new(60.0, 20.0, 20.0), |p| p.x < 1.0);
    let mut tled = Tled::new(&body, &Config { damping: Damping::None, ..Config::default() }).unwrap();
    for n in 0..body.mesh.positions.len() as u32 {
        let x = body.mesh.positions[n as usize].x / 60.0;
        if x > 0.0 {
            tled.set_node(n, Vec3::ZERO, Vec3::new(0.0, 0.02, 0.05) * x * x);
        }
    }
    let start = kinetic_energy(&body, tled.velocities());
    let dt = 0.25 * tled.stable_dt_ms();
    let mut worst = 0.0f64;
    for step in 0..20_000 {
        let before = tled.velocities().to_vec();
        tled.step(&Loads::default(), dt);
        if step % 500 == 0 {
            // Velocities live half a step away: the mean of two is the one at the positions between
            // them.
            let earlier: Vec<Vec3> =
                tled.positions().iter().zip(tled.velocities()).map(|(x, v)| *x - *v * dt).collect();
            let middle: Vec<Vec3> = before.iter().zip(tled.velocities()).map(|(a, b)| (*a + *b) * 0.5).collect();
            let total = kinetic_energy(&body, &middle) + elastic_energy(&body, &earlier);
            worst = worst.max((total / start - 1.0).abs());
        }
    }
    assert!(worst < 0.01, "{worst}");
}

#[test]
fn steps_that_change_in_time_with_a_swing_do_not_drive_it() {
    let body = block([2, 2, 2], Vec3::splat(20.0), |p| p.z < 1.0);
    let mut tled = Tled::new(&body, &Config { damping: Damping::None, substeps: 0, ..Config::default() }).unwrap();
    let top = boxes::nodes_where(&body.mesh, |p| p.z > 19.0)[0] as usize;
    let frequency = trepan_soft::lowest_frequency(&body).unwrap() as f32;
    for (n, at) in body.mesh.positions.iter().enumerate().filter(|(_, at)| at.z > 1.0) {
        tled.set_node(n as u32, Vec3::ZERO, Vec3::X * (2e-3 * at.z / 20.0));
    }
    let (start, mut most) = (kinetic_energy(&body, tled.velocities()), 0.0f64);
    for _ in 0..20_000 {
        let (u, v) = ((tled.positions()[top] - body.mesh.positions[top]).x, tled.velocities()[top].x);
        let share = if u.abs() * frequency < v.abs() { 0.1 } else { 0.5 };
        tled.step(&Loads::default(), share * tled.bound_ms());
        most = most.max(kinetic_energy(&body, tled.velocities()));
    }
    assert!(most < 1.1 * start, "{start} {most}");
}

#[test]
fn damping_stops_the_wobble_of_a_free_body_and_not_its_flight() {
    let body = block([3, 4, 5], Vec3::new(30.0, 40.0, 50.0), |_| false);
    let mut tled = Tled::new(&body, &Config::default()).unwrap();
    let (drift, spin) = (Vec3::new(0.01, 0.02, 0.0), Vec3::new(0.0, 2e-4, 5e-4));
    for n in 0..body.mesh.positions.len() as u32 {
        let p = body.mesh.positions[n as usize];
        let wobble = Vec3::new(0.05 * (p.x * 0.2).sin(), 0.0, 0.05 * (p.z * 0.12).cos());
        tled.set_node(n, Vec3::ZERO, drift + spin.cross(p) + wobble);
    }
    let masses = body.lumped_masses_g();
    let momenta = |tled: &Tled| {
        let parts = masses.iter().zip(tled.positions()).zip(tled.velocities());
        parts.fold((DVec3::ZERO, DVec3::ZERO), |(p, l), ((m, x), v)| {
            let mv = *m * v.as_dvec3();
            (p + mv, l + x.as_dvec3().cross(mv))
        })
    };
    let (p0, l0) = momenta(&tled);
    let e0 = elastic_energy(&body, tled.positions()) + kinetic_energy(&body, tled.velocities());
    run(&mut tled, &Loads::default(), 1000.0);
    let (p, l) = momenta(&tled);
    assert!((p - p0).length() < 1e-3 * p0.length(), "{p0} {p}");
    assert!((l - l0).length() < 5e-3 * l0.length(), "{l0} {l}");
    let total: f64 = masses.iter().sum();
    let e = elastic_energy(&body, tled.positions()) + kinetic_energy(&body, tled.velocities());
    let rigid = 0.5 * p.length_squared() / total;
    assert!(e >= rigid && e < 0.6 * e0, "{e0} {e} {rigid}");
}

#[test]
fn a_clamped_beam_swings_at_the_frequency_of_an_independent_code() {
    // scikit-fem, consistent masses, split box of 20×4×4 cells: 1.882 and 2.012 Hz for the two
    // bending planes; lumping lowers it a little.
    let mesh = boxes::split_box([20, 4, 4], Vec3::new(100.0, 20.0, 20.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
    let body = Body::uniform(mesh, fixed, Material::THESIS);
    let mut tled = Tled::new(&body, &Config { damping: Damping::None, ..Config::default() }).unwrap();
    let start: Vec<Vec3> =
        body.mesh.positions.iter().map(|p| Vec3::new(0.0, 0.2, 0.2) * (p.x / 100.0).powi(2)).collect();
    start.iter().enumerate().for_each(|(n, &u)| tled.set_node(n as u32, u, Vec3::ZERO));
    let dt = tled.stable_dt_ms();
    let (mut crossings, mut before, mut time) = (Vec::new(), 1.0f32, 0.0);
    while crossings.len() < 5 && time < 3000.0 {
        tled.step(&Loads::default(), dt);
        time += dt;
        // The part of the motion along the start: higher modes are small in the start and smaller
        // by its square here.
        let parts = tled.positions().iter().zip(&body.mesh.positions).zip(&start);
        let now: f32 = parts.map(|((x, rest), along)| (*x - *rest).dot(*along)).sum();
        if before.signum() != now.signum() {
            crossings.push(time - dt * now / (now - before));
        }
        before = now;
    }
    let hertz = 1000.0 * 2.0 / (crossings[4] - crossings[0]);
    assert!((hertz / 2.012 - 1.0).abs() < 0.02, "{hertz}");
}
