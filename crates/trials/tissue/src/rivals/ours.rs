//! TLED and the solvers of `trepan-soft` on the block that the other programs step.

use super::{GRAVITY_SHARE, LONGEST_S, Run, SIMULATED_MS, Sample, Solution, block, scene_name, sizes};
use cpu_time::ProcessTime;
use std::time::Instant;
use trepan_evidence::part::Scope;
use trepan_evidence::suite::Findings;
use trepan_geometry::{Vec3, units};
use trepan_rivals::Family;
use trepan_soft::{Body, Loads, Method, SoftSolver};
use trepan_tled::{Config, Tled};

/// Simulated time between two samples, ms.
const SAMPLE_MS: f32 = 25.0;
/// Step of solvers that have no bound, ms.
const LONGEST_MS: f32 = 4.0;
/// Finest mesh that solvers other than TLED step, cells across.
const OTHERS_ACROSS: usize = 6;

/// A solver with its name.
struct Ours {
    name: &'static str,
    threads: usize,
    is_static: bool,
    solver: Box<dyn SoftSolver>,
}

/// Every solver on every mesh.
pub fn run(scope: Scope, truth: &[Solution], findings: &mut Findings) {
    let Some(truth) = truth.last() else { return };
    let finer = scope.pick(&[][..], &[12, 18][..]);
    for &across in sizes(scope).iter().chain(finer) {
        let (body, watched) = block(across);
        for mut ours in solvers(&body, across) {
            let run = hang(&mut ours, &body, watched, scope);
            let row = run.row(&scene_name(&body.mesh), ours.name, &truth.moved_mm);
            findings.rows.push(row.with("threads", ours.threads));
        }
    }
}

fn solvers(body: &Body, across: usize) -> Vec<Ours> {
    let tled = |name, averaged_pressure, threads| {
        let config = Config { averaged_pressure, threads, ..Config::default() };
        let solver = Box::new(Tled::new(body, &config).expect("the block is sound"));
        Ours { name, threads, is_static: false, solver }
    };
    let other = |method: Method| Ours {
        name: method.name(),
        threads: 1,
        is_static: method.descriptor().is_static,
        solver: method.build(body).expect("the block is sound"),
    };
    let both = [1, 2].into_iter().flat_map(|n| [tled("tled", false, n), tled("tled locking-free", true, n)]);
    both.chain(Method::all().into_iter().filter(|_| across <= OTHERS_ACROSS).map(other)).collect()
}

fn hang(ours: &mut Ours, body: &Body, watched: [u32; 3], scope: Scope) -> Run {
    let Ours { solver, is_static, .. } = ours;
    let loads = Loads { gravity: Vec3::NEG_Z * (GRAVITY_SHARE * units::GRAVITY_MM_PER_MS2), ..Loads::default() };
    let steps = if *is_static { 1.0 } else { (SAMPLE_MS / solver.stable_dt_ms().min(LONGEST_MS)).ceil() };
    let dt_ms = SAMPLE_MS / steps;
    let (start, cpu, longest_s) = (Instant::now(), ProcessTime::now(), scope.pick(LONGEST_S[0], LONGEST_S[1]));
    let mut samples: Vec<Sample> = Vec::new();
    let simulated = |samples: &[Sample]| samples.last().map_or(0.0, |sample| sample.simulated_ms);
    while simulated(&samples) < SIMULATED_MS && cpu.elapsed().as_secs_f64() < longest_s {
        (0..steps as usize).for_each(|_| _ = solver.step(&loads, dt_ms));
        let moved = |n: u32| (solver.positions()[n as usize] - body.mesh.positions[n as usize]).as_dvec3().to_array();
        samples.push(Sample {
            simulated_ms: if *is_static { SIMULATED_MS } else { simulated(&samples) + f64::from(SAMPLE_MS) },
            wall_ms: start.elapsed().as_secs_f64() * 1e3,
            cpu_ms: cpu.elapsed().as_secs_f64() * 1e3,
            moved_mm: watched.map(moved),
        });
    }
    Run { setting: String::new(), dt_ms: (!*is_static).then_some(dt_ms.into()), fault: None, samples }
}
