//! A session's solver on the card: the built-in brain under a moving press, and the loss of the
//! card.
//!
//! # Practice
//! The solver alone, called as a session calls it: one call after the other, each as long as the
//! solver recommends, with the state back on the host after each. Real time is a ms of tissue in a
//! ms of the clock.

use super::row;
use super::step::pressed;
use crate::render::scenes;
use std::sync::atomic::Ordering;
use std::time::Instant;
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Gate};
use trepan_evidence::timer::Samples;
use trepan_geometry::Vec3;
use trepan_gpu::Gpu;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::gpu::WithSpare;
use trepan_tled::{Config, Relaxation, Tled};

/// Tetrahedra of the brain, about.
const SIZES: [usize; 5] = [8_000, 22_000, 50_000, 100_000, 200_000];
/// The press goes to this depth and back, mm, twice a second.
const DEPTH_MM: f32 = 2.0;

/// The options of `--quality auto`.
fn config(threads: usize) -> Config {
    Config {
        averaged_pressure: true,
        relaxation: Relaxation::SOLID_AND_FLUID,
        mass_scaling: 0.01,
        dynamic_mass_scaling: 16.0,
        threads,
        ..Config::default()
    }
}

/// The brain of the built-in case, held at its base, and the top of it.
fn brain(tets: usize) -> (Body, Vec3) {
    let (mesh, _) = scenes::brain(tets);
    let low = mesh.bounds().min.z;
    let fixed = boxes::nodes_where(&mesh, |p| p.z < low + 20.0);
    let top = mesh.positions.iter().copied().max_by(|a, b| a.z.total_cmp(&b.z)).expect("the mesh has nodes");
    (Body::uniform(mesh, fixed, Material::WHOLE_BRAIN), top)
}

/// Steps for some ms of the clock under a press that moves; returns ms of tissue a ms, and the
/// what the calls took.
fn run_for(ms: f64, solver: &mut dyn SoftSolver, (body, top): (&Body, Vec3)) -> SteppingTime {
    let mut spring = pressed(body, top, 1)[0];
    let held = spring.mean(|n| body.mesh.positions[n as usize]).dot(spring.normal);
    let start = Instant::now();
    let (mut tissue_ms, mut times, mut faults, mut substeps) = (0.0, Vec::new(), 0, 0);
    while start.elapsed().as_secs_f64() * 1e3 < ms {
        let phase = std::f64::consts::TAU * 2e-3 * tissue_ms;
        spring.offset_mm = 0.5 * DEPTH_MM * (1.0 - phase.cos() as f32) - held;
        let loads = Loads { contacts: spring.into(), ..Loads::default() };
        let dt_ms = solver.next_dt_ms();
        let begun = Instant::now();
        let report = solver.step(&loads, dt_ms);
        times.push(begun.elapsed().as_secs_f64() * 1e6);
        tissue_ms += f64::from(dt_ms - report.skipped_ms);
        substeps += report.substeps;
        faults += u64::from(report.inverted + report.limited + report.non_finite);
    }
    SteppingTime {
        share: tissue_ms / (start.elapsed().as_secs_f64() * 1e3),
        calls: times.into(),
        substeps_per_ms: f64::from(substeps) / tissue_ms,
        faults: faults as f64,
    }
}

/// What a time of stepping was like.
struct SteppingTime {
    /// Ms of tissue in a ms of the clock.
    share: f64,
    calls: Samples,
    substeps_per_ms: f64,
    faults: f64,
}

/// Real time by the number of tetrahedra, on one thread, on some, on the card.
pub fn run(gpu: &Gpu, scope: Scope, findings: &mut Findings) {
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get()).min(8);
    let sizes = &SIZES[..if gpu.is_software() { 1 } else { scope.pick(3, 5) }];
    for tets in sizes {
        let (body, top) = brain(*tets);
        let all: [(String, Option<Box<dyn SoftSolver>>); 3] = [
            ("processor, 1 thread".into(), Tled::new(&body, &config(1)).ok().map(|s| Box::new(s) as _)),
            (
                format!("processor, {threads} threads"),
                Tled::new(&body, &config(threads)).ok().map(|s| Box::new(s) as _),
            ),
            (gpu.name(), WithSpare::new(gpu, &body, &config(1)).ok().map(|s| Box::new(s) as _)),
        ];
        for (name, solver) in all {
            let Some(mut solver) = solver else { continue };
            run_for(100.0, &mut *solver, (&body, top));
            let ran = run_for(scope.pick(300.0, 1000.0), &mut *solver, (&body, top));
            findings.rows.push(
                row(format!("built-in brain, {} tetrahedra, pressed", body.mesh.tets.len()), name)
                    .metric("real_time_share", ran.share)
                    .metric("call_p50_us", ran.calls.quantile(0.5))
                    .metric("call_p99_us", ran.calls.quantile(0.99))
                    .metric("substeps_per_ms", ran.substeps_per_ms)
                    .metric("faults_count", ran.faults),
            );
        }
    }
}

/// The card is taken away in the middle: the processor goes on.
pub fn loss(_: &Gpu, scope: Scope, findings: &mut Findings) {
    // A device of its own, since it ends here.
    let Ok(gpu) = Gpu::open(trepan_gpu::Prefer::Hardware) else { return };
    let (body, top) = brain(SIZES[0]);
    let Ok(mut solver) = WithSpare::new(&gpu, &body, &config(1)) else { return };
    let loads = Loads { contacts: pressed(&body, top, 1), ..Loads::default() };
    let step = |solver: &mut WithSpare| {
        let dt_ms = solver.next_dt_ms();
        solver.step(&loads, dt_ms);
    };
    (0..scope.pick(500, 2000)).for_each(|_| step(&mut solver));
    let before = solver.positions().to_vec();
    gpu.device().destroy();
    let begun = Instant::now();
    step(&mut solver);
    let call_ms = begun.elapsed().as_secs_f64() * 1e3;
    let jump = before.iter().zip(solver.positions()).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    let share = run_for(100.0, &mut solver, (&body, top)).share;
    findings.rows.push(
        row("the card is lost", gpu.name())
            .metric("call_ms", call_ms)
            .metric("jump_mm", jump.into())
            .metric("real_time_share", share),
    );
    let lost = f64::from(u8::from(solver.lost().load(Ordering::Relaxed)));
    findings.gates.extend([
        Gate::at_least("the card is lost: the processor goes on", lost * f64::from(u8::from(share > 0.0)), 1.0),
        Gate::at_most("the card is lost: largest motion of a node in that call, mm", jump.into(), 0.05),
    ]);
}
