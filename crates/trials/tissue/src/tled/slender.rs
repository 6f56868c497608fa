//! A long thin cylinder, clamped level at one end, hangs under its own weight: against the
//! elastica.
//!
//! # Theory
//! `E I θ'' = -ρ g A (L - s) cos θ`, θ(0) = 0, θ'(L) = 0; shear and stretch, which it leaves out,
//! are of the order `(r/L)²`. I and A are those of the mesh, whose section is a polygon.

use super::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Vec3, units};
use trepan_soft::reference::{self, Order, Reference};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Settling, Tled};

const LENGTH_MM: f32 = 200.0;
const RADIUS_MM: f32 = 5.0;
const YOUNG_MPA: f32 = 1.0;

/// A rod on which damped motion took 300,000 steps and reported 1,600 mm to go, mm.
const ROD: Rod = Rod { length_mm: 182.0, radius_mm: 4.25 };
/// Evaluations of the forces to rest, at most: a tenth of those steps.
const EVALUATIONS: f64 = 30_000.0;
/// Tolerance of rest, mm.
const TOLERANCE_MM: f32 = 0.05;

/// A cylinder along x.
#[derive(Clone, Copy, Debug)]
pub struct Rod {
    /// Length, mm.
    pub length_mm: f32,
    /// Radius of the section, mm.
    pub radius_mm: f32,
}

/// Quadratic tetrahedra, linear ones on two meshes, and what is said of rest.
pub fn parts() -> Vec<Part> {
    vec![
        Part::new("slender, quadratic", |_, findings| quadratic(findings)),
        Part::new("slender, linear", |_, findings| linear(findings)),
        Part::new("slender, rest", rest),
    ]
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

fn linear(findings: &mut Findings) {
    let errors = [(4, 80), (6, 120)].map(|(across, count)| {
        let (body, along) = cylinder(across, count);
        let mut solver = Tled::new(&body, &Config::default()).expect("the cylinder is sound");
        solver.settle(&gravity(), &Settling { tolerance_mm: TOLERANCE_MM, ..Settling::default() });
        judge("tled", &body, solver.positions()[along], findings)
    });
    let name = "slender cylinder, TLED: error on the finer mesh over that on the coarser";
    findings.gates.push(Gate::at_most(name, errors[1] / errors[0], 0.7));
}

/// Whether a rod is at rest when it is said to be, and how soon.
fn rest(scope: Scope, findings: &mut Findings) {
    let meshes = [(2, 40, 0.3), (4, 80, 0.3), (2, 60, 0.49), (4, 80, 0.49)];
    let (mut ratio, mut most) = (0.0f64, 0.0f64);
    for (across, count, poisson) in meshes.into_iter().take(scope.pick(3, 4)) {
        let averaged_pressure = poisson > 0.4;
        let (body, along) = ROD.body([count, across], silicone(poisson));
        let config = Config { averaged_pressure, ..Config::default() };
        let mut solver = Tled::new(&body, &config).expect("the rod is sound");
        let settled = solver.settle(&gravity(), &Settling { tolerance_mm: TOLERANCE_MM, ..Settling::default() });
        let there = solver.positions().to_vec();
        let finer = Settling { tolerance_mm: 0.01 * TOLERANCE_MM, ..Settling::default() };
        let at_end = solver.settle(&gravity(), &finer).converged;
        let away = there.iter().zip(solver.positions()).map(|(a, b)| f64::from(a.distance(*b))).fold(0.0, f64::max);
        let evaluations = if settled.converged && at_end { f64::from(settled.steps) } else { f64::NAN };
        ratio = ratio.max(away / f64::from(settled.left_mm));
        // NaN, where it did not come to rest, stays.
        most = if evaluations <= most { most } else { evaluations + 0.0 * most };
        findings.rows.push(
            Row::new("rod of 182 mm at rest", if averaged_pressure { "tled cured" } else { "tled" })
                .with("tets", body.mesh.tets.len())
                .with("poisson", poisson)
                .metric("steps_count", evaluations)
                .metric("factored_count", f64::from(settled.factored))
                .metric("sag_mm", f64::from(-there[along].z))
                .metric("estimated_error_mm", f64::from(settled.left_mm))
                .metric("error_mm", away),
        );
    }
    findings.gates.push(Gate::at_most("rod of 182 mm: distance from rest over what is reported", ratio, 3.0));
    findings.gates.push(Gate::at_most("rod of 182 mm: evaluations of the forces to rest", most, EVALUATIONS));
}

fn silicone(poisson: f32) -> Material {
    Material::NeoHookean { young_mpa: YOUNG_MPA, poisson, density_g_mm3: units::WATER_G_PER_MM3 }
}

fn gravity() -> Loads {
    Loads { gravity: Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2, ..Loads::default() }
}

fn cylinder(across: usize, count: usize) -> (Body, usize) {
    Rod { length_mm: LENGTH_MM, radius_mm: RADIUS_MM }.body([count, across], silicone(0.3))
}

impl Rod {
    /// The rod, held at x = 0, and the node in the middle of its free end. Cells lie along and
    /// across it; squares of the section become rings.
    pub fn body(self, [count, across]: [usize; 2], material: Material) -> (Body, usize) {
        let mut mesh = boxes::split_box([count, across, across], Vec3::new(self.length_mm, 2.0, 2.0));
        for p in &mut mesh.positions {
            let (y, z) = (p.y - 1.0, p.z - 1.0);
            let (ring, length) = (y.abs().max(z.abs()), y.hypot(z).max(1e-9));
            (p.y, p.z) = (self.radius_mm * y * ring / length, self.radius_mm * z * ring / length);
        }
        let end = Vec3::X * self.length_mm;
        let along = boxes::nodes_where(&mesh, |p| p.distance(end) < 1e-3)[0] as usize;
        let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
        (Body::uniform(mesh, fixed, material), along)
    }
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
