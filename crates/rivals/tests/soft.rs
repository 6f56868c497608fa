//! What every method must do, and the reference against closed forms and an independent code.

use glam::{DMat3, DVec3};
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;
use trepan_rivals::Family;
use trepan_soft::reference::{self, Reference};
use trepan_soft::{Body, Loads, Material, Method, NeoHookean, SoftSolver, boxes};

const GRAVITY: Vec3 = Vec3::new(0.0, 0.0, -9.81e-3);

fn block(cells: [usize; 3], size: Vec3, material: Material, fixed: impl Fn(Vec3) -> bool) -> Body {
    let mesh = boxes::split_box(cells, size);
    let fixed = boxes::nodes_where(&mesh, fixed);
    Body::uniform(mesh, fixed, material)
}

fn settle(solver: &mut dyn SoftSolver, loads: &Loads, ms: f32) {
    let dt = solver.stable_dt_ms().min(ms);
    (0..(ms / dt).ceil() as usize).for_each(|_| _ = solver.step(loads, dt));
}

#[test]
fn every_method_rests_without_load_sags_under_gravity_and_keeps_its_supports() {
    let body = block([2, 2, 3], Vec3::new(20.0, 20.0, 30.0), Material::THESIS, |p| p.z < 1e-3);
    for method in Method::all() {
        let mut solver = method.build(&body).unwrap();
        settle(&mut *solver, &Loads::default(), 20.0);
        let moved =
            solver.positions().iter().zip(&body.mesh.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(moved < 1e-9, "{}: {moved} mm", method.name());
        settle(&mut *solver, &Loads { gravity: GRAVITY, ..Loads::default() }, 600.0);
        let top = solver.positions().last().unwrap().z - 30.0;
        assert!((-0.2..-0.08).contains(&top), "{}: {top} mm", method.name());
        assert!(body.fixed.iter().all(|&n| solver.positions()[n as usize] == body.mesh.positions[n as usize]));
    }
}

#[test]
fn names_find_their_methods() {
    for method in Method::all() {
        assert_eq!(Method::named(method.name()), Some(method));
    }
    assert_eq!(Method::named("wishful"), None);
}

#[test]
fn the_reference_passes_the_patch_test_and_gives_the_closed_form_reaction() {
    let size = 10.0;
    let body = block([3, 3, 3], Vec3::splat(size as f32), Material::BRAIN, |p| {
        p.min_element() < 1e-3 || p.max_element() > 9.999
    });
    let stretch = DVec3::new(0.95, 0.95, 1.2);
    let mut solver = Reference::new(&body, &reference::Config::default()).unwrap();
    let wanted = |n: usize| (stretch - DVec3::ONE) * body.mesh.positions[n].as_dvec3();
    body.fixed.iter().for_each(|&n| solver.prescribe(n, wanted(n as usize)));
    assert!(solver.step(&Loads::default(), 1.0).converged);
    for (n, u) in solver.displacements().iter().enumerate() {
        assert!((*u - wanted(n)).length() < 1e-9 * size, "{n}");
    }
    let law = NeoHookean { mu: body.material(0).shear_mpa(), kappa: body.material(0).bulk_mpa() };
    let stress = law.stress(DMat3::from_diagonal(stretch)).z_axis.z;
    let top = boxes::nodes_where(&body.mesh, |p| p.z > 9.999);
    let reactions = solver.reactions(&Loads::default());
    let force: f64 = top.iter().map(|&n| reactions[n as usize].z).sum();
    assert!((force / (stress * size * size) - 1.0).abs() < 1e-6, "{force} {}", stress * size * size);
}

#[test]
fn the_reference_is_where_an_independent_code_is() {
    // scikit-fem, split box of 10×2×2 cells, 30 kPa, ν 0.3, own weight: the tip hangs 55.458 mm
    // down, 17.374 mm back and 7.062 mm aside.
    let body = block([10, 2, 2], Vec3::new(100.0, 20.0, 20.0), Material::THESIS, |p| p.x < 1e-3);
    let mut solver = Reference::new(&body, &reference::Config::default()).unwrap();
    let report = solver.step(&Loads { gravity: GRAVITY, ..Loads::default() }, 1.0);
    assert!(report.converged, "{report:?}");
    let tip = boxes::nodes_where(&body.mesh, |p| p.distance(Vec3::new(100.0, 10.0, 10.0)) < 1e-3)[0];
    let u = solver.displacements()[tip as usize];
    assert!((u.z + 55.45793504085147).abs() < 1e-3 && (u.x + 17.373738376834773).abs() < 1e-3, "{u}");
}

#[test]
fn a_static_solver_refuses_what_floats() {
    let body = block([1, 1, 1], Vec3::ONE, Material::BRAIN, |p| p.z < 1e-3 && p.x < 1e-3);
    assert!(Method::named("reference").unwrap().build(&body).is_err());
}

/// A probe that presses the middle of the top of a 40 mm cube, `depth` mm deep.
fn probe(body: &Body, depth: f32) -> NodalContact {
    let mut contact = NodalContact::none();
    boxes::nodes_where(&body.mesh, |p| p.z > 39.0 && (p.truncate() - glam::Vec2::splat(20.0)).length() < 11.0)
        .iter()
        .for_each(|&n| contact.add(n, 1.0));
    contact.normalise();
    (contact.normal, contact.offset_mm, contact.stiffness) = (Vec3::Z, depth - 40.0, 0.3);
    contact
}

#[test]
fn every_method_adds_springs_up() {
    let body = block([3, 3, 3], Vec3::splat(40.0), Material::THESIS, |p| p.z < 1e-3);
    let (whole, mut side, mut half) = (probe(&body, 1.0), probe(&body, 1.0), probe(&body, 1.0));
    (side.normal, side.offset_mm) = (Vec3::X, -19.5);
    half.stiffness *= 0.5;
    let loads = |springs: &[NodalContact]| {
        let mut loads = Loads::default();
        springs.iter().for_each(|spring| loads.contacts.push(*spring));
        loads
    };
    for method in Method::all() {
        let settled = |loads: Loads| {
            let mut solver = method.build(&body).unwrap();
            settle(&mut *solver, &loads, 100.0);
            let force = solver.step(&loads, solver.stable_dt_ms().min(1.0)).contact_n;
            (force, solver.positions().to_vec())
        };
        let (one, halves) = (settled(loads(&[whole, side])), settled(loads(&[half, side, half])));
        let apart = one.1.iter().zip(&halves.1).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        let moved = one.1.iter().zip(&body.mesh.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(apart < 5e-3 * moved && moved > 0.05, "{}: {apart} {moved}", method.name());
        assert!((one.0 / halves.0 - 1.0).abs() < 5e-3, "{}: {} {}", method.name(), one.0, halves.0);
    }
}

#[test]
fn every_method_feels_a_small_poke_alike_and_comes_back() {
    let body = block([4, 4, 4], Vec3::splat(40.0), Material::THESIS, |p| p.z < 1e-3);
    let loads = Loads { contacts: probe(&body, 1.0).into(), ..Loads::default() };
    let force = |method: Method| {
        let mut solver = method.build(&body).unwrap();
        settle(&mut *solver, &loads, 300.0);
        let pressed = solver.step(&loads, solver.stable_dt_ms().min(1.0)).contact_n;
        settle(&mut *solver, &Loads::default(), 300.0);
        let left = solver.positions().iter().zip(&body.mesh.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        (pressed, left)
    };
    let (exact, _) = force(Method::named("reference").unwrap());
    assert!(exact > 0.1);
    for method in Method::all() {
        let (pressed, left) = force(method);
        // Springs are as stiff as their edges happen to lie.
        let near = if method.name() == "mass-spring" { 0.3 } else { 0.03 };
        assert!((pressed / exact - 1.0).abs() < near, "{}: {pressed} N, reference {exact} N", method.name());
        assert!(left < 2e-3, "{}: {left} mm", method.name());
    }
}

#[test]
fn a_soft_beam_hangs_where_the_reference_says_unless_the_method_is_linear() {
    let material = Material::NeoHookean { young_mpa: 0.06, poisson: 0.3, density_g_mm3: 1e-3 };
    let body = block([10, 2, 2], Vec3::new(100.0, 20.0, 20.0), material, |p| p.x < 1e-3);
    let tip = boxes::nodes_where(&body.mesh, |p| p.distance(Vec3::new(100.0, 10.0, 10.0)) < 1e-3)[0] as usize;
    let hang = |name: &str| {
        let mut solver = Method::named(name).unwrap().build(&body).unwrap();
        settle(&mut *solver, &Loads { gravity: GRAVITY, ..Loads::default() }, 2500.0);
        solver.positions()[tip] - body.mesh.positions[tip]
    };
    let exact = hang("reference");
    assert!(hang("corotational").distance(exact) < 0.05 * exact.length());
    assert!(hang("xpbd").distance(exact) < 0.05 * exact.length());
    assert!(hang("linear").distance(exact) > 0.10 * exact.length(), "a linear beam does not shorten as it hangs");
}

#[test]
fn nonsense_does_not_stay_in_any_method() {
    let body = block([2, 2, 2], Vec3::splat(20.0), Material::BRAIN, |p| p.z < 1e-3);
    for method in Method::all() {
        let mut solver = method.build(&body).unwrap();
        let dt = solver.stable_dt_ms().min(1.0);
        solver.step(&Loads { gravity: Vec3::splat(f32::NAN), ..Loads::default() }, dt);
        for _ in 0..5 {
            solver.step(&Loads { gravity: GRAVITY, ..Loads::default() }, dt);
        }
        assert!(solver.positions().iter().all(|p| p.is_finite()), "{}", method.name());
    }
}
