//! The reference with quadratic elements, in motion and under pressure, against independent codes
//! and closed forms.

use glam::{DMat3, DVec3};
use trepan_geometry::Vec3;
use trepan_mesh::Surface;
use trepan_rivals::soft::linear;
use trepan_soft::reference::{Config, Order, Reference};
use trepan_soft::{Body, Loads, Material, SoftSolver, SurfacePressure, boxes};

const GRAVITY: Vec3 = Vec3::new(0.0, 0.0, -9.81e-3);
const QUADRATIC: Config = Config { iterations: 200, tolerance: 1e-9, order: Order::Quadratic, motion: false };

fn beam() -> (Body, u32) {
    let mesh = boxes::split_box([10, 2, 2], Vec3::new(100.0, 20.0, 20.0));
    let tip = boxes::nodes_where(&mesh, |p| p.distance(Vec3::new(100.0, 10.0, 10.0)) < 1e-3)[0];
    let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
    (Body::uniform(mesh, fixed, Material::THESIS), tip)
}

#[test]
fn quadratic_elements_are_where_an_independent_code_is() {
    // scikit-fem, quadratic tetrahedra on the same split box.
    let (body, tip) = beam();
    let mut solver = Reference::new(&body, &QUADRATIC).unwrap();
    assert!(solver.step(&Loads { gravity: GRAVITY, ..Loads::default() }, 1.0).converged);
    let u = solver.displacements()[tip as usize];
    let exact = DVec3::new(-35.06802349016224, 0.0582863346945654, -73.88716841329142);
    assert!((u - exact).length() < 2e-3, "{u} {exact}");
}

#[test]
fn a_pressed_cube_of_quadratic_elements_does_not_lock() {
    // scikit-fem, quadratic tetrahedra, 4³ cells, top pressed by a fifth: 10.0159 N at ν 0.49;
    // linear ones 17.598 N.
    let mesh = boxes::split_box([4; 3], Vec3::splat(100.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1.0 || p.z > 99.0);
    let top = boxes::nodes_where(&mesh, |p| p.z > 99.0);
    let material = Material::NeoHookean { young_mpa: 0.003, poisson: 0.49, density_g_mm3: 1e-3 };
    let body = Body::uniform(mesh, fixed, material);
    for (order, exact) in [(Order::Linear, 17.598179723493953), (Order::Quadratic, 10.01590359706957)] {
        let mut solver = Reference::new(&body, &Config { order, ..QUADRATIC }).unwrap();
        top.iter().for_each(|&n| solver.prescribe(n, DVec3::NEG_Z * 20.0));
        solver.set(|x| (DVec3::NEG_Z * (0.2 * x.z), DVec3::ZERO));
        assert!(solver.step(&Loads::default(), 1.0).converged);
        let reactions = solver.reactions(&Loads::default());
        let force: f64 = top.iter().map(|&n| -reactions[n as usize].z).sum();
        assert!((force / exact - 1.0).abs() < 1e-3, "{order:?}: {force} N, independent code {exact} N");
    }
}

#[test]
fn motion_keeps_energy_and_has_the_period_of_the_explicit_solver() {
    let mesh = boxes::split_box([6, 2, 2], Vec3::new(60.0, 20.0, 20.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
    let body = Body::uniform(mesh, fixed, Material::THESIS);
    let start = |x: DVec3| DVec3::Z * (0.2 * (x.x / 60.0).powi(2));
    let mut implicit = Reference::new(&body, &Config { motion: true, tolerance: 1e-7, ..Config::default() }).unwrap();
    implicit.set(|x| (start(x), DVec3::ZERO));
    let energy = implicit.energy();
    let undamped = linear::Config { damping_per_ms: Some(0.0), ..linear::Config::default() };
    let mut explicit = linear::Linear::new(&body, &undamped).unwrap();
    explicit.set(|x| (start(x), DVec3::ZERO));
    let crossing = |solver: &mut dyn SoftSolver, dt: f32| {
        let (mut before, mut time) = (1.0, 0.0);
        loop {
            solver.step(&Loads::default(), dt);
            time += dt;
            // The part of the motion along the start: higher modes are small in the start and
            // smaller by its square here.
            let parts = solver.positions().iter().zip(&body.mesh.positions);
            let now: f32 = parts.map(|(x, rest)| (x.z - rest.z) * (rest.x / 60.0).powi(2)).sum();
            if now < 0.0 {
                return time - dt * now / (now - before);
            }
            assert!(time < 200.0, "it never came back");
            before = now;
        }
    };
    let (slow, fast) = (crossing(&mut implicit, 0.5), crossing(&mut explicit, 0.1));
    assert!((slow / fast - 1.0).abs() < 5e-3, "{slow} {fast}");
    assert!((implicit.energy() / energy - 1.0).abs() < 5e-3, "{} {energy}", implicit.energy());
}

#[test]
fn a_ball_like_cube_under_pressure_shrinks_as_its_bulk_modulus_says() {
    let mesh = boxes::split_box([3; 3], Vec3::splat(30.0));
    let middle = boxes::nodes_where(&mesh, |p| (p - Vec3::splat(10.0)).min_element() > -1e-3 && p.max_element() < 20.1);
    let surface = Surface::of(&mesh).triangles;
    let body = Body::uniform(mesh, vec![], Material::BRAIN);
    // A uniform shrinkage by s is exact: P = p s² outwards on every face of the rest shape.
    let law = body.material(0).law();
    let mpa = 2e-4;
    let (mut low, mut high) = (0.5, 1.0);
    for _ in 0..60 {
        let s = 0.5 * (low + high);
        if law.stress(DMat3::from_diagonal(DVec3::splat(s))).z_axis.z < -mpa * s * s { low = s } else { high = s }
    }
    let held = middle.clone();
    let body = Body { fixed: middle, ..body };
    let mut solver = Reference::new(&body, &Config::default()).unwrap();
    let exact = |n: usize| (body.mesh.positions[n].as_dvec3() - DVec3::splat(15.0)) * (low - 1.0);
    held.iter().for_each(|&n| solver.prescribe(n, exact(n as usize)));
    solver.set_pressure(SurfacePressure { triangles: surface, mpa: mpa as f32 });
    assert!(solver.step(&Loads::default(), 1.0).converged);
    for (n, u) in solver.displacements().iter().enumerate() {
        assert!((*u - exact(n)).length() < 1e-5, "{n}: {u} {}", exact(n));
    }
}
