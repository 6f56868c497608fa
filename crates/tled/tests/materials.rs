//! Every material against the f64 reference, relaxation against its curve, and locking with and
//! without averaged pressure.

use glam::{Quat, Vec3};
use trepan_contact::NodalContact;
use trepan_soft::reference::{self, Reference};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Relaxation, Tled};

fn materials() -> [Material; 5] {
    [
        Material::BRAIN,
        Material::StVenantKirchhoff { young_mpa: 0.003, poisson: 0.45, density_g_mm3: 1e-3 },
        Material::MooneyRivlin { c10_mpa: 3e-4, c01_mpa: 2e-4, poisson: 0.45, density_g_mm3: 1e-3 },
        Material::BRAIN_OGDEN,
        Material::Stiffening { shear_mpa: 1e-3, share: 0.3, bound: 0.02, poisson: 0.45, density_g_mm3: 1e-3 },
    ]
}

fn distance(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

#[test]
fn every_material_settles_where_the_static_reference_is() {
    for material in materials() {
        let mesh = boxes::split_box([4, 4, 4], Vec3::splat(40.0));
        let fixed = boxes::nodes_where(&mesh, |p| p.z < 1.0);
        let body = Body::uniform(mesh, fixed, material);
        let mut contact = NodalContact::none();
        boxes::nodes_where(&body.mesh, |p| p.z > 39.0 && p.x < 31.0).iter().for_each(|&n| contact.add(n, 1.0));
        contact.normalise();
        (contact.normal, contact.offset_mm, contact.stiffness) = (Vec3::Z, 3.0 - 40.0, 0.5);
        let loads = Loads { gravity: Vec3::X * 2e-3, contacts: contact.into(), ..Loads::default() };
        let mut exact = Reference::new(&body, &reference::Config::default()).unwrap();
        let report = exact.step(&loads, 1.0);
        assert!(report.converged, "{material:?} {report:?}");
        let mut tled = Tled::new(&body, &Config::default()).unwrap();
        let dt = tled.stable_dt_ms();
        for i in 0..(1500.0 / dt) as usize {
            // Slowly: St. Venant-Kirchhoff snaps through when an element is hit down to 0.6 of its
            // height.
            let mut now = loads.clone();
            now.contacts[0].offset_mm = -40.0 + (0.01 * dt * i as f32).min(3.0);
            tled.step(&now, dt);
        }
        let moved = distance(exact.positions(), &body.mesh.positions);
        let error = distance(exact.positions(), tled.positions());
        assert!(moved > 2.0 && error < 2e-3 * moved, "{material:?}: moved {moved} mm, error {error} mm");
    }
}

/// Force on the top of a block sheared by a fifth, every quarter of a ms, the block turned by
/// `turn` after 20 ms.
fn sheared(material: Material, relaxation: Relaxation, turn: Quat) -> Vec<f32> {
    let mesh = boxes::split_box([2, 2, 2], Vec3::splat(10.0));
    let fixed = (0..27).collect();
    let body = Body::uniform(mesh, fixed, material);
    let mut tled = Tled::new(&body, &Config { relaxation, ..Config::default() }).expect("a sound body");
    let top = boxes::nodes_where(&body.mesh, |p| p.z > 9.0);
    let place = |tled: &mut Tled, turn: Quat| {
        for (n, p) in body.mesh.positions.iter().enumerate() {
            tled.set_node(n as u32, turn * (*p + Vec3::X * (0.2 * p.z)) - *p, Vec3::ZERO);
        }
    };
    place(&mut tled, Quat::IDENTITY);
    let step = |t: usize| {
        if t == 80 {
            place(&mut tled, turn);
        }
        assert_eq!(tled.step(&Loads::default(), 0.25).substeps, 1);
        top.iter().map(|&n| tled.support_force(n)).sum::<Vec3>().dot(if t < 80 { Vec3::X } else { turn * Vec3::X })
    };
    (0..240).map(step).collect()
}

#[test]
fn a_held_shear_relaxes_along_the_curve_whatever_way_it_is_turned() {
    let relaxation = Relaxation { share: [0.4, 0.2, 0.1], time_ms: [5.0, 40.0, 20.0] };
    for material in materials() {
        let elastic = sheared(material, Relaxation::NONE, Quat::IDENTITY);
        for turn in [Quat::IDENTITY, Quat::from_rotation_y(1.0)] {
            for (t, force) in sheared(material, relaxation, turn).into_iter().enumerate() {
                let ms = 0.25 * t as f32;
                let left = 1.0
                    - 0.4 * (1.0 - (-ms / 5.0).exp())
                    - 0.2 * (1.0 - (-ms / 40.0).exp())
                    - 0.1 * (1.0 - (-ms / 20.0).exp());
                let ratio = force / elastic[0];
                assert!((ratio - left).abs() < 0.01, "{material:?}: {ratio} after {ms} ms, the curve says {left}");
            }
        }
    }
}

/// Force that presses a 100 mm cube of 8³ cells down by a fifth, ends clamped.
fn pressed(poisson: f32, averaged_pressure: bool) -> f32 {
    let mesh = boxes::split_box([8, 8, 8], Vec3::splat(100.0));
    let ends = boxes::nodes_where(&mesh, |p| p.z < 1.0 || p.z > 99.0);
    let top = boxes::nodes_where(&mesh, |p| p.z > 99.0);
    let material = Material::NeoHookean { young_mpa: 0.003, poisson, density_g_mm3: 1e-3 };
    let body = Body::uniform(mesh, ends, material);
    let mut tled = Tled::new(&body, &Config { averaged_pressure, ..Config::default() }).expect("a sound body");
    for (n, p) in body.mesh.positions.iter().enumerate() {
        tled.set_node(n as u32, Vec3::NEG_Z * (0.2 * p.z), Vec3::ZERO);
    }
    let dt = tled.stable_dt_ms();
    (0..(500.0 / dt) as usize).for_each(|_| _ = tled.step(&Loads::default(), dt));
    -top.iter().map(|&n| tled.support_force(n).z).sum::<f32>()
}

#[test]
fn the_plain_element_is_the_independent_codes_and_the_averaged_one_does_not_lock() {
    // scikit-fem, same cells: linear tetrahedra 9.961 N (ν 0.45) and 12.905 N (0.49); quadratic
    // ones, finest, 9.117 and 9.667 N.
    let (plain_45, plain_49) = (pressed(0.45, false), pressed(0.49, false));
    assert!((plain_45 / 9.961 - 1.0).abs() < 0.02 && (plain_49 / 12.905 - 1.0).abs() < 0.02, "{plain_45} {plain_49}");
    let (averaged_45, averaged_49) = (pressed(0.45, true), pressed(0.49, true));
    println!("{plain_45} {averaged_45} {plain_49} {averaged_49}");
    assert!(
        (averaged_45 / 9.117 - 1.0).abs() < 0.05 && (averaged_49 / 9.667 - 1.0).abs() < 0.07,
        "{averaged_45} {averaged_49}"
    );
    assert!(plain_49 / 9.667 > 1.25, "the plain element must be seen to lock");
}

/// Faults and skipped time, ms, of a press of 8 mm into a block of 30 mm. Then how far the block is
/// from rest 3 s after, mm, and 3 s after it was squashed to a share of its height.
fn pressed_and_squashed(material: Material, height: f32) -> (u32, f32, [f32; 2]) {
    let mesh = boxes::split_box([6; 3], Vec3::splat(30.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1.0);
    let body = Body::uniform(mesh, fixed, material);
    let config = Config { averaged_pressure: true, dynamic_mass_scaling: 16.0, ..Config::default() };
    let mut tled = Tled::new(&body, &config).expect("a sound body");
    let mut contact = NodalContact::none();
    let near = |p: Vec3| p.z > 29.0 && p.truncate().distance([15.0; 2].into()) < 6.0;
    boxes::nodes_where(&body.mesh, near).iter().for_each(|&n| contact.add(n, 1.0));
    contact.normalise();
    (contact.normal, contact.stiffness, contact.damping) = (Vec3::Z, 0.3, 0.05);
    let (mut loads, mut faults, mut skipped_ms) = (Loads { contacts: contact.into(), ..Loads::default() }, 0, 0.0);
    let mut at_ms = 0.0f32;
    while at_ms < 300.0 {
        loads.contacts[0].offset_mm = (0.04 * at_ms).min(8.0) - 30.0;
        let dt_ms = tled.next_dt_ms();
        let report = tled.step(&loads, dt_ms);
        faults += report.inverted + report.limited + report.non_finite;
        skipped_ms += report.skipped_ms;
        at_ms += dt_ms;
    }
    let mut rested = |squashed: bool| {
        for (n, p) in body.mesh.positions.iter().enumerate().filter(|(_, p)| squashed && p.z > 1.0) {
            tled.set_node(n as u32, Vec3::Z * ((height - 1.0) * p.z), Vec3::ZERO);
        }
        let mut at_ms = 0.0;
        while at_ms < 3000.0 {
            let dt_ms = tled.next_dt_ms();
            tled.step(&Loads::default(), dt_ms);
            at_ms += dt_ms;
        }
        distance(tled.positions(), &body.mesh.positions)
    };
    (faults, skipped_ms, [rested(false), rested(true)])
}

#[test]
fn brain_as_fitted_bears_a_deep_press_and_comes_back_from_it_and_from_a_squash() {
    for material in [Material::CORTEX, Material::CORONA_RADIATA, Material::CORPUS_CALLOSUM] {
        let (faults, skipped_ms, left_mm) = pressed_and_squashed(material, 0.3);
        println!("{faults} faults, {skipped_ms} ms skipped, {left_mm:?} mm left: {material:?}");
        assert!(faults == 0 && skipped_ms == 0.0 && left_mm.iter().all(|mm| *mm < 0.05), "{material:?} {left_mm:?}");
    }
}
