//! Bending, indentation, Cook's membrane and a pressed cube, from compressible to nearly
//! incompressible: plain elements and cured ones against the continuum.
//!
//! # Theory
//! What is driven by a prescribed displacement `u = d s(x)` is judged by the force that works with
//! d, `Σ f·s` over the held nodes; what hangs, by where the middle of its free end goes.
//!
//! # Practice
//! Meshes are centred boxes, as the mesher lays them, of a size at which cured elements are right;
//! on finer ones plain elements get right too where ν is 0.49 (Cook's membrane: 4.3 % at 24
//! thousand tetrahedra). Settling with masses scaled until all elements have the same bound: only
//! rest is wanted here.
//!
//! # Sources
//! The continuum is that of `fixtures/fem/taylor_hood.py`: quadratic displacements and linear
//! pressure, an independent code on its own meshes; the numbers of its meshes and the limit stand
//! beside it.

use super::{Part, Scope};
use glam::DVec3;
use std::f32::consts::TAU;
use std::time::Instant;
use trepan_evidence::picture::{Chart, Mark};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::timer::Samples;
use trepan_geometry::{Vec3, units};
use trepan_mesh::TetMesh;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Settling, Tled};

/// A body, what is done to it, and what the continuum answers.
struct Scene {
    title: &'static str,
    mesh: fn(usize) -> TetMesh,
    young_mpa: f32,
    /// Where a held node goes, mm; `None` for free ones.
    held: fn(Vec3) -> Option<Vec3>,
    /// How far the held nodes go, mm, or 0 for a body that hangs.
    travel_mm: f32,
    /// What is read of a body that hangs: the displacement here.
    tip: Vec3,
    tolerance_mm: f32,
    /// Poisson's ratio, what the continuum answers (N, or mm), and the sizes of a quick and of a
    /// full run.
    truth: &'static [(f32, [f64; 3], [usize; 2])],
}

static SCENES: [Scene; 5] = [
    Scene {
        title: "cantilever 100 mm",
        mesh: |size| boxes::centred_box([40, size, size], Vec3::new(100.0, 20.0, 20.0)),
        young_mpa: 0.030,
        held: |p| (p.x < 1e-3).then_some(Vec3::ZERO),
        travel_mm: 0.0,
        tip: Vec3::new(100.0, 10.0, 10.0),
        tolerance_mm: 0.4,
        truth: &[(0.3, [-35.53, 0.0, -74.41], [4, 6])],
    },
    Scene {
        title: "cantilever 60 mm",
        mesh: |size| boxes::centred_box([4 * size, size, size], Vec3::new(60.0, 20.0, 20.0)),
        young_mpa: 0.030,
        held: |p| (p.x < 1e-3).then_some(Vec3::ZERO),
        travel_mm: 0.0,
        tip: Vec3::new(60.0, 10.0, 10.0),
        tolerance_mm: 0.2,
        truth: &[(0.49, [-2.09, 0.0, -16.09], [6, 6]), (0.499, [-2.08, 0.0, -16.05], [0, 8])],
    },
    Scene {
        title: "block indented 5 mm",
        mesh: |size| {
            let mut mesh = boxes::centred_box([size, size, size * 6 / 10], Vec3::new(100.0, 100.0, 1.0));
            mesh.positions.iter_mut().for_each(|p| p.z = 60.0 * (1.0 - (1.0 - p.z).powf(1.5)));
            mesh
        },
        young_mpa: 0.003,
        held: |p| {
            let dent = (-(p - Vec3::new(50.0, 50.0, p.z)).length_squared() / 225.0).exp();
            let top = (p.z > 59.999).then_some(Vec3::NEG_Z * (5.0 * dent));
            if p.z < 1e-3 { Some(Vec3::ZERO) } else { top }
        },
        travel_mm: 5.0,
        tip: Vec3::ZERO,
        tolerance_mm: 0.01,
        truth: &[
            (0.3, [0.2821, 0.0, 0.0], [20, 20]),
            (0.49, [0.296, 0.0, 0.0], [14, 20]),
            (0.499, [0.298, 0.0, 0.0], [14, 20]),
        ],
    },
    Scene {
        title: "Cook's membrane moved 10 mm",
        mesh: |size| {
            let mut mesh = boxes::centred_box([2 * size, 2 * size, size / 2], Vec3::splat(1.0));
            mesh.positions.iter_mut().for_each(|p| {
                let (x, y) = (crowded(p.x), crowded(p.y));
                *p = Vec3::new(48.0 * x, 44.0 * x + (44.0 - 28.0 * x) * y, 10.0 * p.z);
            });
            mesh
        },
        young_mpa: 0.003,
        held: |p| {
            let right = (p.x > 47.999).then_some(Vec3::Y * 10.0);
            if p.x < 1e-3 { Some(Vec3::ZERO) } else { right }
        },
        travel_mm: 10.0,
        tip: Vec3::ZERO,
        tolerance_mm: 0.02,
        truth: &[
            (0.3, [0.0440, 0.0, 0.0], [8, 10]),
            (0.49, [0.0438, 0.0, 0.0], [6, 10]),
            (0.499, [0.0439, 0.0, 0.0], [0, 10]),
        ],
    },
    Scene {
        title: "cube pressed by a fifth",
        mesh: |size| {
            let mut mesh = boxes::centred_box([size; 3], Vec3::splat(1.0));
            mesh.positions.iter_mut().for_each(|p| *p = p.map(crowded) * 100.0);
            mesh
        },
        young_mpa: 0.003,
        held: |p| {
            let top = (p.z > 99.999).then_some(Vec3::NEG_Z * 20.0);
            if p.z < 1e-3 { Some(Vec3::ZERO) } else { top }
        },
        travel_mm: 20.0,
        tip: Vec3::ZERO,
        tolerance_mm: 0.05,
        truth: &[(0.49, [9.00, 0.0, 0.0], [9, 13]), (0.499, [9.07, 0.0, 0.0], [9, 13])],
    },
];

/// Every scene at every ν, with both elements.
pub fn parts(scope: Scope) -> Vec<Part> {
    let of = |scene: &'static Scene| {
        let sized =
            scene.truth.iter().map(move |&(poisson, truth, sizes)| (poisson, truth, scope.pick(sizes[0], sizes[1])));
        sized.filter(|(.., size)| *size > 0).map(move |(poisson, truth, size)| {
            Part::new(format!("{}, ν {poisson}", scene.title), move |_, findings| {
                judge(scene, poisson, DVec3::from_array(truth), size, findings);
            })
        })
    };
    SCENES.iter().flat_map(of).collect()
}

/// The chart of what was found.
pub fn draw(findings: &mut Findings) {
    chart(
        "Force under a prescribed displacement: error over the time to rest, all scenes and ν",
        "force_error_percent",
        findings,
    );
}

fn chart(title: &str, error: &str, findings: &mut Findings) {
    let mark = |row: &Row| {
        Some(Mark { method: row.method.clone(), cost: *row.metrics.get(COST)?, error: *row.metrics.get(error)? })
    };
    let marks = findings.rows.iter().filter_map(mark).collect();
    findings.charts.push(Chart {
        title: title.into(),
        cost: COST.into(),
        error: error.into(),
        marks,
        ..Chart::default()
    });
}

/// Poisson's ratio over which a hanging body starts from where tissue of this ν comes to rest. That
/// is most of the way in a fifth of the steps.
const EASY: f32 = 0.49;

/// The metric of cost.
const COST: &str = "time_to_rest_ms";

/// Crowds nodes towards both ends of 0 to 1, where clamped edges are singular.
fn crowded(x: f32) -> f32 {
    x - 0.7 / TAU * (TAU * x).sin()
}

fn judge(scene: &Scene, poisson: f32, truth: DVec3, size: usize, findings: &mut Findings) {
    let title = format!("{}, ν {poisson}", scene.title);
    let cured = off_percent(scene, &title, poisson, truth, size, true, findings);
    let limit = if poisson < 0.4 { 2.0 } else { 5.0 };
    findings.gates.push(Gate::at_most(format!("{title}, cured: off by, percent"), cured, limit));
    if poisson > 0.4 {
        let plain = off_percent(scene, &title, poisson, truth, size, false, findings);
        findings.gates.push(Gate::at_least(format!("{title}, plain: off by, percent (it must fail)"), plain, limit));
    }
}

fn off_percent(
    scene: &Scene,
    title: &str,
    poisson: f32,
    truth: DVec3,
    size: usize,
    averaged_pressure: bool,
    findings: &mut Findings,
) -> f64 {
    let hangs = scene.travel_mm == 0.0;
    let gravity = if hangs { Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2 } else { Vec3::ZERO };
    let (loads, start) = (Loads { gravity, ..Loads::default() }, Instant::now());
    let (body, mut solver) = solver(scene, poisson, size, averaged_pressure);
    if hangs && poisson > EASY {
        let (easy, mut before) = self::solver(scene, EASY, size, averaged_pressure);
        before.settle(&loads, &Settling { tolerance_mm: scene.tolerance_mm, steps: 30_000 });
        let moved = before.positions().iter().zip(&easy.mesh.positions).map(|(x, rest)| *x - *rest);
        moved.enumerate().for_each(|(n, u)| solver.set_node(n as u32, u, Vec3::ZERO));
    }
    let settled = solver.settle(&loads, &Settling { tolerance_mm: scene.tolerance_mm, steps: 30_000 });
    let cost_ms = start.elapsed().as_secs_f64() * 1e3;
    let dt_ms = solver.stable_dt_ms();
    let times = Samples::of(20, |_| _ = solver.step(&loads, dt_ms));
    let found = if hangs { moved(scene, &body, &solver) } else { DVec3::X * force_n(scene, &body, &solver) };
    let error = 100.0 * found.distance(truth) / truth.length();
    let (of, error_name) =
        if hangs { ("moved_mm", "displacement_error_percent") } else { ("force_n", "force_error_percent") };
    findings.rows.push(
        Row::new(title, if averaged_pressure { "tled cured" } else { "tled" })
            .with("tets", body.mesh.tets.len())
            .with("steps_to_rest", settled.steps)
            .metric("step_p50_us", times.quantile(0.5))
            .metric("step_spread_percent", 100.0 * times.spread())
            .metric(COST, cost_ms)
            .metric("left_mm", f64::from(settled.left_mm))
            .metric(of, found.length())
            .metric(error_name, error),
    );
    error
}

/// The body in its held state; what is driven from above starts as if it were pressed evenly.
fn solver(scene: &Scene, poisson: f32, size: usize, averaged_pressure: bool) -> (Body, Tled) {
    let mesh = (scene.mesh)(size);
    let fixed = boxes::nodes_where(&mesh, |p| (scene.held)(p).is_some());
    let material = Material::NeoHookean { young_mpa: scene.young_mpa, poisson, density_g_mm3: units::WATER_G_PER_MM3 };
    let body = Body::uniform(mesh, fixed, material);
    let config = Config { averaged_pressure, mass_scaling: f32::INFINITY, ..Config::default() };
    let mut solver = Tled::new(&body, &config).expect("the body is sound");
    if scene.travel_mm > 0.0 {
        drive(scene, &body, &mut solver);
    }
    (body, solver)
}

/// Moves the held nodes to where they go, in 200 steps, so that no element is crushed on the way.
fn drive(scene: &Scene, body: &Body, solver: &mut Tled) {
    let (steps, dt_ms) = (200, solver.stable_dt_ms());
    let to = |n: u32| (scene.held)(body.mesh.positions[n as usize]).unwrap_or_default();
    body.fixed.iter().for_each(|&n| solver.set_node(n, Vec3::ZERO, to(n) / (steps as f32 * dt_ms)));
    (0..steps).for_each(|_| _ = solver.step(&Loads::default(), dt_ms));
    body.fixed.iter().for_each(|&n| solver.set_node(n, to(n), Vec3::ZERO));
}

fn force_n(scene: &Scene, body: &Body, solver: &Tled) -> f64 {
    let of = |&n: &u32| {
        let share = (scene.held)(body.mesh.positions[n as usize]).unwrap_or_default() / scene.travel_mm;
        solver.support_force(n).as_dvec3().dot(share.as_dvec3())
    };
    body.fixed.iter().map(of).sum()
}

fn moved(scene: &Scene, body: &Body, solver: &Tled) -> DVec3 {
    let tip = boxes::nodes_where(&body.mesh, |p| p.distance(scene.tip) < 1e-3)[0] as usize;
    (solver.positions()[tip] - body.mesh.positions[tip]).as_dvec3()
}
