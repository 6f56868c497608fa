//! Bodies of more than one material against closed forms and the f64 reference.

use glam::{DMat3, DVec3};
use trepan_geometry::Vec3;
use trepan_soft::reference::{self, Reference};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Tled};

/// A block, held at its base, with an inclusion in its middle.
fn inclusion(matrix: Material, inside: Material) -> Body {
    let mesh = boxes::split_box([6, 6, 6], Vec3::splat(60.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let mut body = Body::uniform(mesh, fixed, matrix);
    body.materials.push(inside);
    for tet in 0..body.mesh.tets.len() {
        let middle: Vec3 = body.mesh.corners(tet).iter().sum::<Vec3>() / 4.0;
        body.material_of_tet[tet] = u8::from((middle - Vec3::splat(30.0)).abs().max_element() < 10.0);
    }
    body
}

fn distance(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

#[test]
fn a_stiff_inclusion_settles_where_the_static_reference_is() {
    let ogden = Material::Ogden { shear_mpa: [4e-3, 0.0], exponent: [-4.7, 1.0], poisson: 0.45, density_g_mm3: 1e-3 };
    let kirchhoff = Material::StVenantKirchhoff { young_mpa: 0.02, poisson: 0.4, density_g_mm3: 1.1e-3 };
    for (matrix, inside) in [
        (Material::BRAIN, Material::TUMOUR),
        (Material::BRAIN, ogden),
        (Material::BRAIN_OGDEN, kirchhoff),
        (Material::TUMOUR, Material::VENTRICLE),
    ] {
        let body = inclusion(matrix, inside);
        let loads = Loads { gravity: Vec3::new(4e-3, 0.0, -9.81e-3), ..Loads::default() };
        let mut exact = Reference::new(&body, &reference::Config::default()).unwrap();
        assert!(exact.step(&loads, 1.0).converged);
        let mut tled = Tled::new(&body, &Config::default()).unwrap();
        let dt = tled.stable_dt_ms();
        (0..(1500.0 / dt) as usize).for_each(|_| _ = tled.step(&loads, dt));
        let moved = distance(exact.positions(), &body.mesh.positions);
        let error = distance(exact.positions(), tled.positions());
        assert!(moved > 1.0 && error < 2e-3 * moved, "{inside:?}: moved {moved} mm, error {error} mm");
        let mut without = Reference::new(&body.clone().with_material(matrix), &reference::Config::default()).unwrap();
        without.step(&loads, 1.0);
        let apart = distance(exact.positions(), without.positions());
        assert!(apart > 0.02 * moved, "the inclusion must matter for the test to tell: {apart} of {moved} mm");
    }
}

#[test]
fn a_stretched_bar_of_two_materials_has_one_stress_and_two_strains() {
    let soft = Material::BRAIN;
    let stiff = Material::NeoHookean { young_mpa: 0.009, poisson: 0.3, density_g_mm3: 1e-3 };
    let pull =
        |material: Material, s: f64| material.law().stress(DMat3::from_diagonal(DVec3::new(1.0, 1.0, s))).z_axis.z;
    let (wanted, mut low, mut high) = (pull(soft, 1.2), 0.9, 1.5);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if pull(stiff, middle) < wanted { low = middle } else { high = middle }
    }
    let u = |p: Vec3| Vec3::Z * (0.2 * p.z.min(30.0) + (low - 1.0) as f32 * (p.z - 30.0).max(0.0));
    let mesh = boxes::split_box([3, 3, 6], Vec3::new(20.0, 20.0, 60.0));
    let on_border =
        |p: Vec3| p.truncate().min_element() < 1e-3 || p.truncate().max_element() > 19.9 || !(0.1..59.9).contains(&p.z);
    let fixed = boxes::nodes_where(&mesh, on_border);
    let mut body = Body::uniform(mesh, fixed, soft);
    body.materials.push(stiff);
    for tet in 0..body.mesh.tets.len() {
        body.material_of_tet[tet] = u8::from(body.mesh.corners(tet).iter().map(|p| p.z).sum::<f32>() > 120.0);
    }
    for averaged_pressure in [false, true] {
        let mut tled = Tled::new(&body, &Config { averaged_pressure, ..Config::default() }).unwrap();
        body.fixed.iter().for_each(|&n| tled.set_node(n, u(body.mesh.positions[n as usize]), Vec3::ZERO));
        let dt = tled.stable_dt_ms();
        (0..(400.0 / dt) as usize).for_each(|_| _ = tled.step(&Loads::default(), dt));
        let affine: Vec<Vec3> = body.mesh.positions.iter().map(|&p| p + u(p)).collect();
        let error = distance(tled.positions(), &affine);
        assert!(error < 2e-5, "{error}");
        let top = boxes::nodes_where(&body.mesh, |p| p.z > 59.0);
        let force: f64 = top.iter().map(|&n| f64::from(tled.support_force(n).z)).sum();
        assert!((force / (wanted * 400.0) - 1.0).abs() < 1e-4, "{force} {}", wanted * 400.0);
    }
}

#[test]
fn averaged_pressure_bears_a_jump_in_stiffness_of_a_thousand() {
    let stiff = Material::NeoHookean { young_mpa: 3.0, poisson: 0.45, density_g_mm3: 1e-3 };
    let body = inclusion(Material::BRAIN, stiff);
    let loads = Loads { gravity: Vec3::X * 9.81e-3, ..Loads::default() };
    let [plain, averaged] = [false, true].map(|averaged_pressure| {
        let mut tled = Tled::new(&body, &Config { averaged_pressure, ..Config::default() }).unwrap();
        let dt = tled.stable_dt_ms();
        for _ in 0..4000 {
            let report = tled.step(&loads, dt);
            assert_eq!((report.inverted, report.limited, report.non_finite), (0, 0, 0));
        }
        tled.positions().to_vec()
    });
    let moved = distance(&plain, &body.mesh.positions);
    assert!(moved > 0.5 && distance(&plain, &averaged) < 0.2 * moved, "{moved} {}", distance(&plain, &averaged));
}
