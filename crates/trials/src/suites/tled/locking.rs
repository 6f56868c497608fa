//! A cube pressed by a fifth between clamped ends, from compressible to nearly incompressible: plain elements, cured ones, and quadratic ones that need no cure.
//!
//! # Sources
//! At ν 0.49 quadratic tetrahedra on 4³, 6³ and 8³ cells give 9.689, 9.415 and 9.298 N: order 1.45, limit 9.07 N. The rows `quadratic` of a full run make them again.
//! At 0.499 their Newton iteration does not start on these meshes, so there the two elements are only set side by side.

use super::Scope;
use crate::suite::{Findings, Gate, Row};
use crate::timer::Samples;
use glam::DVec3;
use std::f32::consts::TAU;
use trepan_geometry::{Vec3, units};
use trepan_soft::reference::{self, Order, Reference};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Settling, Tled};

const EDGE_MM: f32 = 100.0;

/// Poisson's ratio, and the force of the continuum, N, where quadratic tetrahedra have found it.
const CASES: [(f32, Option<f64>); 3] = [(0.45, None), (0.49, Some(9.07)), (0.499, None)];

/// Presses the cube in every way.
pub fn run(scope: Scope, findings: &mut Findings) {
    for (poisson, exact_n) in CASES {
        for &cells in scope.pick(&[8usize, 12][..], &[8, 12, 16][..]) {
            let [plain, cured] = [false, true].map(|cure| explicit(cells, poisson, cure, exact_n, scope, findings));
            if poisson > 0.489 {
                let name =
                    format!("{}, {cells}³ cells: plain element over cured one (locking must show)", title(poisson));
                findings.gates.push(Gate::at_least(name, plain / cured, if poisson > 0.495 { 1.3 } else { 1.05 }));
            }
            if let Some(exact) = exact_n.filter(|_| cells >= 12) {
                let off = |force: f64| 100.0 * (force / exact - 1.0).abs();
                let name = |method| format!("{}, {cells}³ cells, {method}: force off by, percent", title(poisson));
                findings.gates.push(Gate::at_most(name("cured"), off(cured), 5.0));
                findings.gates.push(Gate::at_least(format!("{} (it must fail)", name("plain")), off(plain), 5.0));
            }
        }
    }
    for &cells in scope.pick(&[4usize][..], &[4, 6, 8][..]) {
        quadratic(cells, 0.49, findings);
    }
}

fn title(poisson: f32) -> String {
    format!("cube pressed by a fifth, ν {poisson}")
}

fn method(cure_locking: bool) -> &'static str {
    if cure_locking { "cured" } else { "plain" }
}

fn cube(cells: usize, poisson: f32) -> (Body, Vec<u32>) {
    let mut mesh = boxes::split_box([cells; 3], Vec3::splat(EDGE_MM));
    mesh.positions.iter_mut().for_each(|p| *p = p.map(graded));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3 || p.z > EDGE_MM - 1e-3);
    let top = boxes::nodes_where(&mesh, |p| p.z > EDGE_MM - 1e-3);
    let material = Material::NeoHookean { young_mpa: 0.003, poisson, density_g_mm3: units::WATER_G_PER_MM3 };
    (Body::uniform(mesh, fixed, material), top)
}

/// Crowds nodes towards the faces, where the clamped edges are singular: on even cells every element converges slowly there.
fn graded(x: f32) -> f32 {
    let share = x / EDGE_MM;
    EDGE_MM * (share - 0.7 / TAU * (TAU * share).sin())
}

fn explicit(
    cells: usize,
    poisson: f32,
    cure_locking: bool,
    exact_n: Option<f64>,
    scope: Scope,
    findings: &mut Findings,
) -> f64 {
    let (body, top) = cube(cells, poisson);
    let mut solver = Tled::new(&body, &Config { cure_locking, ..Config::default() }).expect("the cube is sound");
    for (n, p) in body.mesh.positions.iter().enumerate() {
        solver.set_node(n as u32, Vec3::NEG_Z * (0.2 * p.z), Vec3::ZERO);
    }
    let settled = solver.settle(&Loads::default(), &Settling { tolerance_mm: 0.05, steps: scope.pick(1500, 20_000) });
    let dt_ms = solver.stable_dt_ms();
    let times = Samples::of(20, |_| _ = solver.step(&Loads::default(), dt_ms));
    let held: f64 = top.iter().map(|&n| -f64::from(solver.support_force(n).z)).sum();
    let mut row = Row::new(title(poisson), method(cure_locking))
        .with("tets", body.mesh.tets.len())
        .with("steps_to_rest", settled.steps)
        .metric("step_p50_us", times.quantile(0.5))
        .metric("left_mm", f64::from(settled.left_mm))
        .metric("force_n", held);
    if let Some(exact) = exact_n {
        row = row.metric("force_error_percent", 100.0 * (held / exact - 1.0).abs());
    }
    findings.rows.push(row);
    held
}

fn quadratic(cells: usize, poisson: f32, findings: &mut Findings) {
    let (body, top) = cube(cells, poisson);
    let config = reference::Config { order: Order::Quadratic, tolerance: 1e-6, ..reference::Config::default() };
    let mut solver = Reference::new(&body, &config).expect("the cube is held");
    top.iter().for_each(|&n| solver.prescribe(n, DVec3::NEG_Z * 20.0));
    solver.set(|x| (DVec3::NEG_Z * (0.2 * x.z), DVec3::ZERO));
    solver.step(&Loads::default(), 1.0);
    let reactions = solver.reactions(&Loads::default());
    let held: f64 = top.iter().map(|&n| -reactions[n as usize].z).sum();
    let row = Row::new(title(poisson), "quadratic").with("tets", body.mesh.tets.len());
    findings.rows.push(row.metric("force_n", held));
}
