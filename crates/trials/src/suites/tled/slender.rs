//! A long thin cylinder, clamped level at one end, hangs under its own weight: against the
//! elastica.
//!
//! # Theory
//! `E I θ'' = -ρ g A (L - s) cos θ`, θ(0) = 0, θ'(L) = 0; shear and stretch, which it leaves out,
//! are of the order `(r/L)²`. I and A are those of the mesh, whose section is a polygon.

use super::{Part, Scope};
use crate::engine::suite::{Findings, Gate, Row};
use trepan_geometry::{Vec3, units};
use trepan_soft::rivals::reference::{self, Order, Reference};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Settling, Tled};

const LENGTH_MM: f32 = 200.0;
const RADIUS_MM: f32 = 5.0;
const YOUNG_MPA: f32 = 1.0;

/// Quadratic tetrahedra always; linear ones, which bend too stiffly, on two meshes in a full run.
pub fn parts() -> Vec<Part> {
    vec![Part::new("slender, quadratic", |_, findings| quadratic(findings)), Part::new("slender, linear", linear)]
}

fn quadratic(findings: &mut Findings) {
    let (body, along) = cylinder(2, 20);
    let config = reference::Config { order: Order::Quadratic, tolerance: 1e-6, ..reference::Config::default() };
    let mut solver = Reference::new(&body, &config).expect("the cylinder is held");
    let settled = solver.step(&gravity(), 1.0).converged;
    let error = judge("quadratic", &body, solver.positions()[along], findings);
    let name = "slender cylinder, quadratic tetrahedra: tip against the elastica, percent";
    findings.gates.push(Gate::at_most(name, if settled { error } else { f64::NAN }, 2.0));
}

fn linear(scope: Scope, findings: &mut Findings) {
    if !scope.quick {
        let errors = [(4, 80), (6, 120)].map(|(across, count)| {
            let (body, along) = cylinder(across, count);
            let config = Config { mass_scaling: f32::INFINITY, ..Config::default() };
            let mut solver = Tled::new(&body, &config).expect("the cylinder is sound");
            solver.settle(&gravity(), &Settling { tolerance_mm: 0.5, steps: 150_000 });
            judge("tled", &body, solver.positions()[along], findings)
        });
        let name = "slender cylinder, TLED: error on the finer mesh over that on the coarser";
        findings.gates.push(Gate::at_most(name, errors[1] / errors[0], 0.7));
    }
}

fn gravity() -> Loads {
    Loads { gravity: Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2, ..Loads::default() }
}

/// The cylinder along x and the node at the middle of its free end; squares of the section become
/// rings.
fn cylinder(across: usize, count: usize) -> (Body, usize) {
    let mut mesh = boxes::split_box([count, across, across], Vec3::new(LENGTH_MM, 2.0, 2.0));
    for p in &mut mesh.positions {
        let (y, z) = (p.y - 1.0, p.z - 1.0);
        let (ring, length) = (y.abs().max(z.abs()), y.hypot(z).max(1e-9));
        (p.y, p.z) = (RADIUS_MM * y * ring / length, RADIUS_MM * z * ring / length);
    }
    let end = Vec3::X * LENGTH_MM;
    let along = boxes::nodes_where(&mesh, |p| p.distance(end) < 1e-3)[0] as usize;
    let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
    let material = Material::NeoHookean { young_mpa: YOUNG_MPA, poisson: 0.3, density_g_mm3: units::WATER_G_PER_MM3 };
    (Body::uniform(mesh, fixed, material), along)
}

/// Distance of the free end from the elastica's, as a percentage of how far that went.
fn judge(method: &str, body: &Body, tip: Vec3, findings: &mut Findings) -> f64 {
    let (x, z) = elastica(body);
    let (tip_x, tip_z) = (f64::from(tip.x), f64::from(tip.z));
    let went = (x - f64::from(LENGTH_MM)).hypot(z);
    let error = 100.0 * (tip_x - x).hypot(tip_z - z) / went;
    findings.rows.push(
        Row::new("slender cylinder", method)
            .with("tets", body.mesh.tets.len())
            .metric("sag_mm", -tip_z)
            .metric("elastica_sag_mm", -z)
            .metric("displacement_error_percent", error),
    );
    error
}

/// Where the elastica's free end is, mm.
fn elastica(body: &Body) -> (f64, f64) {
    let length = f64::from(LENGTH_MM);
    // ∫ z² over a tetrahedron is V/20 (Σ z_i² + (Σ z_i)²).
    let second = |t: usize| {
        let z = body.mesh.corners(t).map(|p| f64::from(p.z));
        let (squares, sum) = (z.iter().map(|z| z * z).sum::<f64>(), z.iter().sum::<f64>());
        body.mesh.volume_mm3(t) / 20.0 * (squares + sum * sum)
    };
    let bending = f64::from(YOUNG_MPA) * (0..body.mesh.tets.len()).map(second).sum::<f64>() / length;
    let weight = f64::from(units::WATER_G_PER_MM3 * units::GRAVITY_MM_PER_MS2) * body.mesh.total_mm3() / length;
    let (mut low, mut high) = (-0.2, 0.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if shoot(middle, weight / bending, length).1 > 0.0 { high = middle } else { low = middle }
    }
    shoot(low, weight / bending, length).0
}

/// The rod that leaves its clamp with the curvature `bend`: its free end, and the curvature there,
/// which should be none.
fn shoot(bend: f64, load: f64, length: f64) -> ((f64, f64), f64) {
    let steps = 2000;
    let h = length / f64::from(steps);
    let slope =
        |s: f64, [theta, bend, ..]: [f64; 4]| [bend, load * (length - s) * theta.cos(), theta.cos(), theta.sin()];
    let mut state = [0.0, bend, 0.0, 0.0];
    for step in 0..steps {
        let s = f64::from(step) * h;
        let ahead = |by: f64, k: [f64; 4]| [0, 1, 2, 3].map(|i| state[i] + by * k[i]);
        let a = slope(s, state);
        let b = slope(s + 0.5 * h, ahead(0.5 * h, a));
        let c = slope(s + 0.5 * h, ahead(0.5 * h, b));
        let d = slope(s + h, ahead(h, c));
        state = [0, 1, 2, 3].map(|i| state[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
    }
    ((state[2], state[3]), state[1])
}
