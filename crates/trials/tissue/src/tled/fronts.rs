//! Charts error against time: a block hangs from one side under gravity, by every solver on meshes
//! of several sizes. The fastest is judged by its time within 5 % and within 1 %.
//!
//! # Theory
//! The truth is the continuum's: quadratic tetrahedra ([`Order::Quadratic`]), where the middle of
//! the free end comes to rest. The error is the distance from there as a share of the way. What
//! counts as cost is the computing time from the first step to rest, [`SETTLE_MS`] of simulated
//! time.

use super::{Part, Scope};
use std::time::Instant;
use trepan_evidence::picture::{Chart, Mark};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Vec3, units};
use trepan_rivals::Family;
use trepan_soft::reference::{self, Order, Reference};
use trepan_soft::{Body, Loads, Material, Method, SoftSolver, boxes};
use trepan_tled::{Config, Tled};

const BLOCK_MM: Vec3 = Vec3::new(60.0, 20.0, 20.0);
const SETTLE_MS: f32 = 2500.0;
/// Step of solvers that have no bound, ms.
const LONGEST_MS: f32 = 4.0;
/// Finest mesh that all solvers step, cells across; on finer ones some of them take many minutes.
const RIVALS_ACROSS: usize = 6;
/// The same for plain elements of TLED.
const PLAIN_ACROSS: usize = 12;
/// Share of earth's gravity: enough for some mm of sag, little enough that all solvers converge.
const GRAVITY_SHARE: f32 = 0.1;

/// One solver on one mesh.
struct Point {
    method: &'static str,
    cost_ms: f64,
    error_percent: f64,
}

/// The front, and TLED beside the reference on the same mesh.
pub fn parts() -> Vec<Part> {
    vec![
        Part::new("hanging block", front),
        Part::new("same mesh", |scope, findings| same_mesh(scope.pick(4, 8), findings)),
    ]
}

/// Hangs the block by every solver.
fn front(scope: Scope, findings: &mut Findings) {
    let (quick, mut points) = (scope.quick, Vec::new());
    let (truth, way) = if quick { continuum(4, findings) } else { continuum(8, findings) };
    for &across in scope.pick(&[2usize, 4][..], &[2, 4, 6, 8, 12, 18][..]) {
        hang(across, truth, way, findings, &mut points);
    }
    for limit in [5.0, 1.0] {
        let reached = points.iter().filter(|p| p.error_percent <= limit);
        if let Some(best) = reached.min_by(|a, b| a.cost_ms.total_cmp(&b.cost_ms)) {
            findings.rows.push(
                Row::new(format!("hanging block: least time for {limit} %"), best.method)
                    .metric("time_to_rest_ms", best.cost_ms)
                    .metric("displacement_error_percent", best.error_percent),
            );
        }
    }
    let mark = |p: &Point| Mark { method: p.method.into(), cost: p.cost_ms, error: p.error_percent };
    findings.charts.push(Chart {
        title: "A block hangs down: error over the time from the first step to rest".into(),
        cost: "time_to_rest_ms".into(),
        error: "displacement_error_percent".into(),
        marks: points.iter().map(mark).collect(),
        ..Chart::default()
    });
}

fn block(across: usize) -> (Body, usize) {
    let mesh = boxes::split_box([3 * across, across, across], BLOCK_MM);
    let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
    let end = Vec3::new(BLOCK_MM.x, 0.5 * BLOCK_MM.y, 0.5 * BLOCK_MM.z);
    let tip = boxes::nodes_where(&mesh, |p| p.distance(end) < 1e-3)[0] as usize;
    (Body::uniform(mesh, fixed, Material::BRAIN), tip)
}

fn gravity() -> Loads {
    Loads { gravity: Vec3::NEG_Z * (GRAVITY_SHARE * units::GRAVITY_MM_PER_MS2), ..Loads::default() }
}

/// Where the free end's middle comes to rest, and how far that is from where it was, mm.
fn continuum(across: usize, findings: &mut Findings) -> (Vec3, f64) {
    let found = [across / 2, across].map(|across| {
        let (body, tip) = block(across);
        let config = reference::Config { order: Order::Quadratic, tolerance: 1e-6, ..reference::Config::default() };
        let mut solver = Reference::new(&body, &config).expect("the block is held");
        solver.step(&gravity(), 1.0);
        let way = solver.positions()[tip] - body.mesh.positions[tip];
        let row = Row::new("hanging block, truth", "quadratic").with("tets", body.mesh.tets.len());
        findings.rows.push(row.metric("way_mm", f64::from(way.length())));
        (solver.positions()[tip], f64::from(way.length()))
    });
    let apart = 100.0 * f64::from(found[0].0.distance(found[1].0)) / found[1].1;
    findings.gates.push(Gate::at_most(
        "hanging block, truth: two meshes of quadratic tetrahedra apart, percent",
        apart,
        3.0,
    ));
    found[1]
}

fn hang(across: usize, truth: Vec3, way_mm: f64, findings: &mut Findings, points: &mut Vec<Point>) {
    let (body, tip) = block(across);
    let scene = format!("hanging block, {} tetrahedra", body.mesh.tets.len());
    for (method, mut solver) in solvers(&body, across) {
        // What solves for rest needs one step.
        let at_once = method == "reference";
        let dt_ms = solver.stable_dt_ms().min(if at_once { SETTLE_MS } else { LONGEST_MS });
        let (steps, start) = ((SETTLE_MS / dt_ms).ceil() as usize, Instant::now());
        (0..steps).for_each(|_| _ = solver.step(&gravity(), dt_ms));
        let cost_ms = start.elapsed().as_secs_f64() * 1e3;
        let error_percent = 100.0 * f64::from(solver.positions()[tip].distance(truth)) / way_mm;
        findings.rows.push(
            Row::new(&scene, method)
                .with("tets", body.mesh.tets.len())
                .with("dt_ms", f64::from(dt_ms))
                .metric("step_p50_us", 1e3 * cost_ms / steps as f64)
                .metric("time_to_rest_ms", cost_ms)
                .metric("displacement_error_percent", error_percent),
        );
        points.push(Point { method, cost_ms, error_percent });
    }
}

fn solvers(body: &Body, across: usize) -> Vec<(&'static str, Box<dyn SoftSolver>)> {
    let tled = |config| Box::new(Tled::new(body, &config).expect("the block is sound")) as Box<dyn SoftSolver>;
    let mut solvers = vec![("tled cured", tled(Config { averaged_pressure: true, ..Config::default() }))];
    if across <= PLAIN_ACROSS {
        solvers.insert(0, ("tled", tled(Config::default())));
    }
    for method in Method::all().into_iter().filter(|_| across <= RIVALS_ACROSS) {
        solvers.push((method.name(), method.build(body).expect("the block is sound")));
    }
    solvers
}

/// TLED at rest beside the static reference on the same mesh.
fn same_mesh(across: usize, findings: &mut Findings) {
    let (body, _) = block(across);
    let mut exact = Reference::new(&body, &reference::Config::default()).expect("the block is held");
    exact.step(&gravity(), 1.0);
    let mut solver = Tled::new(&body, &Config::default()).expect("the block is sound");
    let dt_ms = solver.stable_dt_ms();
    (0..(SETTLE_MS / dt_ms) as usize).for_each(|_| _ = solver.step(&gravity(), dt_ms));
    let largest = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(a, b)| f64::from(a.distance(*b))).fold(0.0, f64::max);
    let error =
        100.0 * largest(solver.positions(), exact.positions()) / largest(exact.positions(), &body.mesh.positions);
    let name =
        format!("hanging block, {} tetrahedra: TLED at rest against the reference, percent", body.mesh.tets.len());
    findings.gates.push(Gate::at_most(name, error, 1.0));
}
