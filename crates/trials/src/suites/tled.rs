//! Soft-tissue solvers: a block of brain that hangs from one side under gravity, against the static f64 reference; forces against the closed form
//! of simple shear; the border of the stable step.

use super::Scope;
use crate::suite::{Findings, Gate, Row};
use crate::timer::Samples;
use trepan_geometry::{Vec3, units};
use trepan_soft::{Body, Loads, Material, Method, SoftSolver, boxes, reference};
use trepan_tled::{Config, Damping, Kernel, Tled};

/// Edge of the block, mm.
const BLOCK_MM: Vec3 = Vec3::new(60.0, 20.0, 20.0);
/// Share of earth's gravity: enough for some mm of sag, little enough that all solvers converge.
const GRAVITY_SHARE: f32 = 0.1;
/// Time until the block rests, ms.
const SETTLE_MS: f32 = 4000.0;

/// Step of solvers that have no bound, ms.
const LONGEST_MS: f32 = 10.0;
/// Shear of the closed form.
const SHEAR: f64 = 0.3;

/// Every solver on blocks of several sizes.
pub fn run(scope: Scope) -> Findings {
    let mut findings = Findings::default();
    let cells = scope.pick(&[3usize, 5][..], &[4, 6, 8, 11, 16][..]);
    for (number, &cells) in cells.iter().enumerate() {
        if scope.takes(number) {
            block(cells, scope, &mut findings);
        }
    }
    let sides = scope.pick(&[10usize][..], &[10, 16, 24][..]);
    for (number, &side) in sides.iter().enumerate() {
        if scope.takes(number + cells.len()) {
            kernels(side, scope, &mut findings);
        }
    }
    let rest: [fn(&mut Findings); 3] = [shear, locking, stability];
    for (number, scene) in rest.into_iter().enumerate() {
        if scope.takes(number + cells.len() + sides.len()) {
            scene(&mut findings);
        }
    }
    findings
}

fn body(cells: usize) -> Body {
    let mesh = boxes::split_box([3 * cells, cells, cells], BLOCK_MM);
    let left = mesh.bounds().min.x + 1e-3;
    let fixed = boxes::nodes_where(&mesh, |p| p.x < left);
    let material = Material::NeoHookean { young_mpa: 0.003, poisson: 0.45, density_g_mm3: units::WATER_G_PER_MM3 };
    Body::uniform(mesh, fixed, material)
}

/// The sag of every solver beside the reference's on the same mesh.
fn block(cells: usize, scope: Scope, findings: &mut Findings) {
    let body = body(cells);
    let loads = Loads { gravity: Vec3::new(0.0, 0.0, -GRAVITY_SHARE * units::GRAVITY_MM_PER_MS2), ..Loads::default() };
    let mut truth = reference::Reference::new(&body, &reference::Config::default()).expect("the block is held");
    truth.step(&loads, 1.0);
    let scene = format!("hanging block, {} tetrahedra", body.mesh.tets.len());
    let tled = Tled::new(&body, &Config::default()).expect("the block is sound");
    let mut solvers: Vec<(&str, Box<dyn SoftSolver>)> = vec![("tled", Box::new(tled))];
    for method in Method::all().into_iter().filter(|m| m.name() != "reference") {
        solvers.push((method.name(), method.build(&body).expect("the block is sound")));
    }
    for (name, mut solver) in solvers {
        let dt_ms = solver.stable_dt_ms().min(LONGEST_MS);
        let steps = (SETTLE_MS / dt_ms) as usize;
        let mut inverted = 0;
        let times = Samples::of(steps, |_| inverted += solver.step(&loads, dt_ms).inverted);
        let error = 100.0 * largest_difference(solver.positions(), truth.positions(), &body);
        findings.rows.push(
            Row::new(&scene, name)
                .with("tets", body.mesh.tets.len())
                .with("dt_ms", f64::from(dt_ms))
                .metric("step_p50_us", times.quantile(0.5))
                .metric("step_p99_us", times.quantile(0.99))
                .metric("displacement_error_percent", error)
                .metric("inverted_count", f64::from(inverted)),
        );
        if name == "tled" {
            let limit = scope.pick(1.0, 1.0);
            findings.gates.push(Gate::at_most(
                format!("{scene}: TLED at rest against the reference, percent"),
                error,
                limit,
            ));
        }
    }
}

/// Largest distance between two shapes over the largest displacement of the second.
fn largest_difference(found: &[Vec3], truth: &[Vec3], body: &Body) -> f64 {
    let largest = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(a, b)| f64::from(a.distance(*b))).fold(0.0, f64::max);
    largest(found, truth) / largest(truth, &body.mesh.positions)
}

/// The same step by every kernel, as a ratio to the scalar one in one run; all must give the same bytes.
fn kernels(side: usize, scope: Scope, findings: &mut Findings) {
    let mesh = boxes::split_box([side; 3], Vec3::splat(100.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < mesh.bounds().min.z + 1e-3);
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    let loads = Loads { gravity: Vec3::new(0.0, 0.0, -units::GRAVITY_MM_PER_MS2), ..Loads::default() };
    let scene = format!("cube, {} tetrahedra", body.mesh.tets.len());
    let mut scalar_us = f64::NAN;
    let mut bytes: Option<Vec<[u32; 3]>> = None;
    for (name, kernel) in [("scalar", Kernel::Scalar), ("wide", Kernel::Wide), ("fastest", Kernel::Fastest)] {
        let mut solver = Tled::new(&body, &Config { kernel, ..Config::default() }).expect("the cube is sound");
        let dt_ms = solver.stable_dt_ms();
        let times = Samples::of(scope.pick(60, 400), |_| {
            solver.step(&loads, dt_ms);
        });
        let step_us = times.quantile(0.5);
        scalar_us = if name == "scalar" { step_us } else { scalar_us };
        let now: Vec<[u32; 3]> = solver.positions().iter().map(|p| p.to_array().map(f32::to_bits)).collect();
        let same = bytes.get_or_insert_with(|| now.clone()) == &now;
        findings.gates.push(Gate::at_least(
            format!("{scene}: {name} gives the scalar kernel's bytes"),
            f64::from(same),
            1.0,
        ));
        findings.rows.push(
            Row::new(&scene, name)
                .with("tets", body.mesh.tets.len())
                .metric("step_p50_us", step_us)
                .metric("ns_per_tetrahedron", 1e3 * step_us / body.mesh.tets.len() as f64)
                .metric("times_faster_than_scalar", scalar_us / step_us),
        );
    }
}

/// Simple shear of a cube: what holds its top, against `τ A` of the closed form. Shear keeps the volume, so J = 1.
///
/// ```text
/// neo-Hookean and Mooney-Rivlin  τ = μ γ          St. Venant-Kirchhoff  τ = μ γ + (λ/2 + μ) γ³
/// ```
fn shear(findings: &mut Findings) {
    let edge_mm = 20.0;
    let mesh = boxes::split_box([4; 3], Vec3::splat(edge_mm));
    let density_g_mm3 = units::WATER_G_PER_MM3;
    let materials = [
        ("neo-Hookean", Material::NeoHookean { young_mpa: 0.003, poisson: 0.45, density_g_mm3 }),
        ("St. Venant-Kirchhoff", Material::StVenantKirchhoff { young_mpa: 0.003, poisson: 0.45, density_g_mm3 }),
        ("Mooney-Rivlin", Material::MooneyRivlin { c10_mpa: 3e-4, c01_mpa: 2e-4, poisson: 0.45, density_g_mm3 }),
    ];
    for (name, material) in materials {
        let body = Body::uniform(mesh.clone(), vec![], material);
        let config = Config { damping: Damping::None, ..Config::default() };
        let mut solver = Tled::new(&body, &config).expect("the cube is sound");
        for (n, p) in body.mesh.positions.iter().enumerate() {
            solver.set_node(n as u32, Vec3::X * (SHEAR as f32 * p.z), Vec3::ZERO);
        }
        solver.step(&Loads::default(), 1e-3);
        let top = boxes::nodes_where(&body.mesh, |p| p.z > edge_mm - 1e-3);
        let held: f64 = top.iter().map(|&n| f64::from(solver.support_force(n).x)).sum();
        let (mu, kappa) = (material.shear_mpa(), material.bulk_mpa());
        let cubic = if name == "St. Venant-Kirchhoff" { 0.5 * kappa + mu * 2.0 / 3.0 } else { 0.0 };
        let exact = (mu * SHEAR + cubic * SHEAR.powi(3)) * f64::from(edge_mm * edge_mm);
        let error = 100.0 * (held / exact - 1.0).abs();
        let scene = format!("simple shear {SHEAR}, {name}");
        findings.rows.push(Row::new(&scene, "tled").metric("force_n", held).metric("force_error_percent", error));
        findings.gates.push(Gate::at_most(format!("{scene}: force against the closed form, percent"), error, 0.5));
    }
}

/// A cube pressed by a fifth between clamped ends, against quadratic tetrahedra of an independent code (scikit-fem), finest mesh.
fn locking(findings: &mut Findings) {
    let mesh = boxes::split_box([8; 3], Vec3::splat(100.0));
    let top = boxes::nodes_where(&mesh, |p| p.z > 99.0);
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1.0 || p.z > 99.0);
    for (poisson, exact_n) in [(0.45, 9.117), (0.49, 9.667)] {
        for (method, cure_locking) in [("plain", false), ("cured", true)] {
            let material = Material::NeoHookean { young_mpa: 0.003, poisson, density_g_mm3: units::WATER_G_PER_MM3 };
            let body = Body::uniform(mesh.clone(), fixed.clone(), material);
            let mut solver =
                Tled::new(&body, &Config { cure_locking, ..Config::default() }).expect("the cube is sound");
            for (n, p) in body.mesh.positions.iter().enumerate() {
                solver.set_node(n as u32, Vec3::NEG_Z * (0.2 * p.z), Vec3::ZERO);
            }
            let dt_ms = solver.stable_dt_ms();
            let times = Samples::of((500.0 / dt_ms) as usize, |_| _ = solver.step(&Loads::default(), dt_ms));
            let held: f64 = top.iter().map(|&n| -f64::from(solver.support_force(n).z)).sum();
            let error = 100.0 * (held / exact_n - 1.0);
            let scene = format!("cube pressed by a fifth, ν {poisson}");
            findings.rows.push(
                Row::new(&scene, method)
                    .with("tets", body.mesh.tets.len())
                    .metric("step_p50_us", times.quantile(0.5))
                    .metric("force_n", held)
                    .metric("force_error_percent", error.abs()),
            );
            let name = format!("{scene}, {method}: force too stiff by, percent");
            let gate = match (cure_locking, poisson > 0.47) {
                (true, _) => Gate::at_most(name, error.abs(), 7.0),
                (false, true) => Gate::at_least(format!("{name} (locking must show)"), error, 25.0),
                (false, false) => Gate::at_most(name, error.abs(), 12.0),
            };
            findings.gates.push(gate);
        }
    }
}

/// Steps of 0.5 to 2 times the true bound, obeyed and guarded: does a kicked undamped block stay as it should?
fn stability(findings: &mut Findings) {
    let body = body(3);
    for share in [0.5f32, 0.8, 0.98, 1.05, 1.5, 2.0] {
        for (method, substeps) in [("obeyed", 0), ("guarded", Config::default().substeps)] {
            let config = Config { substeps, damping: Damping::None, ..Config::default() };
            let mut solver = Tled::new(&body, &config).expect("the block is sound");
            let dt_ms = share * solver.bound_ms();
            for (n, p) in body.mesh.positions.iter().enumerate() {
                solver.set_node(n as u32, Vec3::ZERO, Vec3::Z * (1e-5 * p.x));
            }
            let (mut healed, mut skipped_ms) = (0, 0.0);
            for _ in 0..1500 {
                let report = solver.step(&Loads::default(), dt_ms);
                healed += report.inverted + report.limited + report.non_finite;
                skipped_ms += report.skipped_ms;
            }
            let scene = format!("kicked block, {share} of the bound");
            let stable = f64::from(healed == 0 && skipped_ms == 0.0);
            findings.rows.push(
                Row::new(&scene, method)
                    .with("dt_share_of_bound", f64::from(share))
                    .metric("stable_verdict", stable)
                    .metric("healed_count", f64::from(healed)),
            );
            let wanted = method == "guarded" || share < 1.0;
            let name = format!("{scene}, {method}: stable as theory says");
            findings.gates.push(Gate::at_least(name, f64::from((stable == 1.0) == wanted), 1.0));
        }
    }
}
