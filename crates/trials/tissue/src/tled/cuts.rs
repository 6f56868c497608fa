//! Cuts and removals while a body moves: what many do, how right the opened body is, and what a
//! change of solvers costs.
//!
//! # Theory
//! A cut that opens pushes nothing, so kinetic and elastic energy together may only fall, whatever
//! is cut in whatever order. Each body is cut and emptied at random until nothing of it is left, in
//! batches: after each a solver of the split body goes on from the state of the one before.

use super::{Part, Scope};
use glam::{DMat3, DVec3};
use std::time::Instant;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::Vec3;
use trepan_mesh::{NONE, Split, Splitter, TetMesh};
use trepan_soft::reference::{self, Order, Reference};
use trepan_soft::{Body, Law, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Damping, Relaxation, Tled};

/// Faces that are cut and tetrahedra that are taken away between two changes of solvers.
const BATCH: usize = 150;
/// Steps between two of them: a removal takes ten.
const STEPS: usize = 15;

/// Random cuts and removals, an opened slit at rest, and the cost of a change.
pub fn parts() -> Vec<Part> {
    vec![
        Part::new("cuts, at random", at_random),
        Part::new("cuts, a slit at rest", |_, findings| slit(findings)),
        Part::new("cuts, cost", |_, findings| cost(findings)),
    ]
}

/// What edits of bodies led to.
#[derive(Default)]
struct Torture {
    edits: usize,
    copies: usize,
    faults: u32,
    inverted_at_end: u32,
    least_step: f32,
    mass_error: f64,
    energy_rise: f64,
}

fn at_random(scope: Scope, findings: &mut Findings) {
    let mut all = Torture { least_step: f32::INFINITY, ..Torture::default() };
    let wanted = scope.pick(10_000, 100_000);
    for seed in 0.. {
        if all.edits >= wanted {
            break;
        }
        torture(seed, wanted, &mut all);
    }
    let Torture { edits, copies, faults, inverted_at_end, least_step, mass_error, energy_rise } = all;
    let row = Row::new("cuts at random", "tled").metric("edits", edits as f64).metric("copies of nodes", copies as f64);
    findings.rows.push(row.metric("energy rise", energy_rise).metric("least step", f64::from(least_step)));
    let name = |what: &str| format!("random cuts and removals: {what}");
    findings.gates.extend([
        Gate::at_most(name("non-finite or clamped nodes"), f64::from(faults), 0.0),
        Gate::at_most(name("inverted elements at the end of a batch's rest"), f64::from(inverted_at_end), 0.0),
        Gate::at_least(name("stable step, share of that at first"), f64::from(least_step), 0.5),
        Gate::at_most(name("error of mass and volume, relative"), mass_error, 1e-6),
        Gate::at_most(name("rise of energy, share of the first"), energy_rise, 0.01),
    ]);
}

/// Cuts and empties one body until nothing is left of it, or enough was done.
fn torture(seed: u64, wanted: usize, all: &mut Torture) {
    let mut random = fastrand::Rng::with_seed(seed);
    let mesh = boxes::split_box([8, 8, 8], Vec3::splat(32.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let mut body = Body::uniform(mesh, fixed, Material::BRAIN);
    let config = Config { averaged_pressure: seed % 2 == 1, damping: Damping::None, ..Config::default() };
    let mut first = Tled::new(&body, &config).expect("the block is sound");
    for (n, p) in body.mesh.positions.iter().enumerate() {
        first.set_node(n as u32, Vec3::new(0.05 * p.z, 0.02 * p.z, 0.0), Vec3::ZERO);
    }
    let (tets, step_ms) = (body.mesh.tets.len() as u32, first.stable_dt_ms());
    let mut splitter = Splitter::of(&body.mesh);
    let (mut solver, mut fills): (Box<dyn SoftSolver>, _) = (Box::new(first), vec![u16::MAX; tets as usize]);
    let volume = |mesh: &TetMesh| (0..mesh.tets.len()).map(|t| mesh.volume_mm3(t)).sum::<f64>();
    let whole = [volume(&body.mesh), body.lumped_masses_g().iter().sum::<f64>()];
    let begun = energy(&body, &*solver);
    let mut order: Vec<u32> = (0..5 * tets).collect();
    random.shuffle(&mut order);
    for batch in order.chunks(BATCH) {
        let mut splits: Vec<Split> = Vec::with_capacity(64 * BATCH);
        for edit in batch {
            match edit.checked_sub(4 * tets) {
                Some(tet) => fills[tet as usize] = 0,
                None => {
                    let is_gone = |tet: u32| fills[tet as usize] == 0;
                    splitter.cut(edit / 4, (edit % 4) as usize, is_gone, &mut splits);
                }
            }
        }
        all.edits += batch.len();
        all.copies += splits.iter().filter(|split| split.node as usize >= body.mesh.positions.len()).count();
        let make = solver.split(&splits).expect("TLED can be split");
        let mut next = make().expect("a split body is sound");
        next.resume(&mut *solver, &splits);
        next.lower_fills(&fills);
        solver = next;
        // What came loose is no longer tied: energy is that of the body without ties.
        body.split(&splits).expect("the splits fit");
        let now = [volume(&body.mesh), body.lumped_masses_g().iter().sum::<f64>()];
        let error = whole.iter().zip(now).map(|(was, is)| (is / was - 1.0).abs()).fold(0.0, f64::max);
        all.mass_error = all.mass_error.max(error);
        all.least_step = all.least_step.min(solver.stable_dt_ms() / step_ms);
        let mut inverted = 0;
        for _ in 0..STEPS {
            let report = solver.step(&Loads::default(), solver.next_dt_ms());
            all.faults += report.non_finite + report.limited;
            inverted = report.inverted;
        }
        all.inverted_at_end = all.inverted_at_end.max(inverted);
        // Averaged pressure has an energy of its own, which hides what two elements undo.
        let rise = if config.averaged_pressure { 0.0 } else { energy(&body, &*solver) / begun - 1.0 };
        all.energy_rise = all.energy_rise.max(rise);
        if all.edits >= wanted {
            break;
        }
    }
}

/// Kinetic and elastic energy of what is left, mJ.
fn energy(body: &Body, solver: &dyn SoftSolver) -> f64 {
    let Law::NeoHookean(law) = body.material(0).law() else { return f64::NAN };
    let (positions, fills) = (solver.positions(), solver.fills());
    let mut masses = vec![0.0; positions.len()];
    let mut elastic = 0.0;
    for (tet, corners) in body.mesh.tets.iter().enumerate() {
        let left = f64::from(fills[tet]) / f64::from(u16::MAX);
        let shape = body.shape(tet);
        let column = |(n, g): (&u32, &DVec3)| {
            let x = positions[*n as usize].as_dvec3();
            DMat3::from_cols(x * g.x, x * g.y, x * g.z)
        };
        let f: DMat3 = corners.iter().zip(&shape.gradients).map(column).fold(DMat3::ZERO, |f, part| f + part);
        elastic += left * shape.volume_mm3 * law.energy(f);
        let grams = f64::from(body.material(tet).density_g_mm3()) * shape.volume_mm3 / 4.0;
        // A node that anything is left around keeps the inertia of its whole elements.
        corners.iter().for_each(|&n| masses[n as usize] += grams);
    }
    let kinetic = masses.iter().zip(solver.velocities()).map(|(g, v)| 0.5 * g * f64::from(v.length_squared()));
    elastic + kinetic.sum::<f64>()
}

/// Cuts the faces between both sides of x = 16 mm, above a height; the body and its splits.
fn with_slit(body: &Body, from_mm: f32) -> Vec<Split> {
    let middle = |tet: u32| body.mesh.corners(tet as usize).into_iter().sum::<Vec3>() / 4.0;
    let (mut splitter, mut splits) = (Splitter::of(&body.mesh), Vec::with_capacity(4 * body.mesh.tets.len()));
    for (tet, face) in (0..body.mesh.tets.len() as u32).flat_map(|tet| (0..4).map(move |face| (tet, face))) {
        let next = splitter.neighbours(tet)[face];
        let is_low = middle(tet).z < from_mm;
        if next != NONE && !is_low && (middle(tet).x < 16.0) != (middle(next).x < 16.0) {
            splitter.cut(tet, face, |_| false, &mut splits);
        }
    }
    splits
}

/// A block that is cut in motion and comes to rest, against the implicit solution of its mesh.
///
/// Quadratic tetrahedra say what the linear ones are worth here.
fn slit(findings: &mut Findings) {
    let mesh = boxes::split_box([10, 5, 10], Vec3::new(32.0, 16.0, 32.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let whole = Body::uniform(mesh, fixed, Material::BRAIN);
    let splits = with_slit(&whole, 10.0);
    let loads = Loads { gravity: Vec3::new(2e-3, 0.0, -4e-3), ..Loads::default() };
    let config = Config::default();
    let mut before = Tled::new(&whole, &config).expect("the block is sound");
    (0..100).for_each(|_| _ = before.step(&loads, before.stable_dt_ms()));
    let mut solver = before.split(&splits).and_then(|make| make()).expect("the body can be split");
    solver.resume(&mut before, &splits);
    for _ in 0..20_000 {
        solver.step(&loads, solver.next_dt_ms());
    }
    let mut opened = whole.clone();
    opened.split(&splits).expect("the splits fit");
    let at_rest = |order: Order| {
        let config = reference::Config { order, tolerance: 1e-6, ..reference::Config::default() };
        let mut truth = Reference::new(&opened, &config).expect("the opened block is held");
        let settled = truth.step(&loads, 1.0).converged;
        settled.then(|| truth.positions().to_vec())
    };
    let far = |places: &[Vec3], others: &[Vec3]| -> Vec<f64> {
        places.iter().zip(others).map(|(a, b)| f64::from(a.distance(*b))).collect()
    };
    let error = |truth: Option<Vec<Vec3>>| {
        let Some(truth) = truth else { return [f64::NAN; 3] };
        let most_mm = far(&truth, &opened.mesh.positions).into_iter().fold(0.0, f64::max);
        let mut errors = far(solver.positions(), &truth);
        errors.sort_by(f64::total_cmp);
        let gaps = splits.iter().map(|split| truth[split.node as usize].distance(truth[split.from as usize]));
        [100.0 * errors[errors.len() * 95 / 100] / most_mm, most_mm, gaps.fold(0.0, f32::max).into()]
    };
    let [[same, most_mm, gap_mm], [quadratic, ..]] =
        [Order::Linear, Order::Quadratic].map(|order| error(at_rest(order)));
    let row = Row::new("slit", "tled").metric("error percent", same).metric("against quadratic percent", quadratic);
    findings.rows.push(row.metric("moved mm", most_mm).metric("gapes mm", gap_mm));
    let name =
        "slit under gravity: 95 % of the nodes against the implicit solution, percent of the largest displacement";
    findings.gates.push(Gate::at_most(name, same, 5.0));
}

/// What a change of solvers costs at 20 thousand tetrahedra.
///
/// The solver's thread makes the change; the thread beside it makes the solver.
fn cost(findings: &mut Findings) {
    let mesh = boxes::split_box([15, 15, 15], Vec3::splat(60.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    let config = Config { averaged_pressure: true, relaxation: Relaxation::SOLID_AND_FLUID, ..Config::default() };
    let mut solver = Tled::new(&body, &config).expect("the block is sound");
    let (mut change_us, mut make_ms) = (Vec::new(), Vec::new());
    for turn in 0..20 {
        let splits = with_slit(&body, 30.0 + turn as f32);
        let make = solver.split(&splits).expect("TLED can be split");
        let begun = Instant::now();
        let mut next = make().expect("the body is sound");
        make_ms.push(1e3 * begun.elapsed().as_secs_f64());
        let begun = Instant::now();
        next.resume(&mut solver, &splits);
        change_us.push(1e6 * begun.elapsed().as_secs_f64());
    }
    [&mut change_us, &mut make_ms].into_iter().for_each(|all| all.sort_by(f64::total_cmp));
    let (half, most) = (change_us[10], change_us[19]);
    let row =
        Row::new("change of solvers, 20,250 tetrahedra", "tled").metric("median us", half).metric("largest us", most);
    findings.rows.push(row.metric("making ms", make_ms[10]));
    findings.gates.push(Gate::at_most(
        "a cut at 20 thousand tetrahedra: us on the solver's thread, worst of 20",
        most,
        50.0,
    ));
}
