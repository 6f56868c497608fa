//! Bodies of more than one material: every method against the closed form of a bar in two parts.

use glam::{DMat3, DVec3};
use trepan_geometry::Vec3;
use trepan_rivals::Family;
use trepan_soft::reference::{self, Reference};
use trepan_soft::{Body, Loads, Material, Method, SoftSolver, boxes};

fn elastic(young_mpa: f32, density_g_mm3: f32) -> Material {
    Material::NeoHookean { young_mpa, poisson: 0.0, density_g_mm3 }
}

/// A column on its base, 20 × 20 × 60 mm, its upper half of the second material.
fn column(cells: [usize; 3], lower: Material, upper: Material) -> Body {
    let mesh = boxes::split_box(cells, Vec3::new(20.0, 20.0, 60.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let mut body = Body::uniform(mesh, fixed, lower);
    body.materials.push(upper);
    for tet in 0..body.mesh.tets.len() {
        let middle: Vec3 = body.mesh.corners(tet).iter().sum::<Vec3>() / 4.0;
        body.material_of_tet[tet] = u8::from(middle.z > 30.0);
    }
    body
}

#[test]
fn a_column_of_two_materials_sags_as_its_parts_in_series_in_every_method() {
    // Without lateral strain (ν = 0): sag = g/E₁ (ρ₁ h²/2 + ρ₂ h h) + g/E₂ ρ₂ h²/2 for halves of
    // height h.
    let (h, g, gravity) = (30.0, 1e-4, Vec3::NEG_Z * 1e-4);
    let body = column([2, 2, 6], elastic(0.01, 1e-3), elastic(0.03, 2e-3));
    let exact = g / 0.01 * (1e-3 * h * h / 2.0 + 2e-3 * h * h) + g / 0.03 * 2e-3 * h * h / 2.0;
    let top = boxes::nodes_where(&body.mesh, |p| p.z > 59.0);
    for method in Method::all() {
        let mut solver = method.build(&body).unwrap();
        let dt = solver.stable_dt_ms().min(1.0);
        let steps = if solver.stable_dt_ms().is_finite() { (800.0 / dt) as usize } else { 1 };
        (0..steps).for_each(|_| _ = solver.step(&Loads { gravity, ..Loads::default() }, dt));
        let sag =
            top.iter().map(|&n| f64::from(60.0 - solver.positions()[n as usize].z)).sum::<f64>() / top.len() as f64;
        // Masses and springs have ν = 1/4, and stiffness that depends on how edges lie.
        let near = if method.name() == "mass-spring" { 0.5 } else { 0.01 };
        assert!((sag / exact - 1.0).abs() < near, "{}: {sag} mm, closed form {exact} mm", method.name());
    }
}

#[test]
fn a_stretched_bar_of_two_materials_has_one_stress_and_two_strains() {
    let body = column([3, 3, 6], Material::BRAIN, Material::BRAIN_OGDEN);
    let laws = [Material::BRAIN.law(), Material::BRAIN_OGDEN.law()];
    let pull =
        |law: usize, stretch: f64| laws[law].stress(DMat3::from_diagonal(DVec3::new(1.0, 1.0, stretch))).z_axis.z;
    let (mut low, mut high) = (0.5, 2.0);
    let wanted = pull(0, 1.2);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if pull(1, middle) < wanted { low = middle } else { high = middle }
    }
    let exact = |p: Vec3| DVec3::Z * (0.2 * f64::from(p.z.min(30.0)) + (low - 1.0) * f64::from((p.z - 30.0).max(0.0)));
    let on_border =
        |p: Vec3| p.truncate().min_element() < 1e-3 || p.truncate().max_element() > 19.9 || !(0.1..59.9).contains(&p.z);
    let body = Body { fixed: boxes::nodes_where(&body.mesh, on_border), ..body };
    let mut solver = Reference::new(&body, &reference::Config::default()).unwrap();
    body.fixed.iter().for_each(|&n| solver.prescribe(n, exact(body.mesh.positions[n as usize])));
    assert!(solver.step(&Loads::default(), 1.0).converged);
    for (n, u) in solver.displacements().iter().enumerate() {
        assert!((*u - exact(body.mesh.positions[n])).length() < 1e-7, "{n}: {u}");
    }
    let reactions = solver.reactions(&Loads::default());
    let top = boxes::nodes_where(&body.mesh, |p| p.z > 59.0);
    let force: f64 = top.iter().map(|&n| reactions[n as usize].z).sum();
    assert!((force / (wanted * 400.0) - 1.0).abs() < 1e-9, "{force} {}", wanted * 400.0);
    assert!((low - 1.2).abs() > 0.003, "the two strains must differ for the test to tell: {low}");
}
