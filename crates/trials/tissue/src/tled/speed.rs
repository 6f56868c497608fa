//! Measures what a step costs, as ratios in one run: kernels, options, size of the mesh, and more
//! threads than free cores.

use super::{Part, Scope};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::timer::Samples;
use trepan_geometry::{Vec3, units};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Kernel, Relaxation, Tled};

/// About 22 thousand tetrahedra: the thesis's brain.
const BRAIN: [usize; 3] = [18, 17, 12];

/// A solver and the times of its steps.
struct Run {
    name: String,
    solver: Tled,
    tets: usize,
    step_us: Vec<f64>,
}

impl Run {
    fn best_us(&self) -> f64 {
        self.step_us.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// Every row.
pub fn parts() -> Vec<Part> {
    vec![Part::new("kernels", kernels), Part::new("sizes", sizes), Part::new("loaded machine", loaded)]
}

fn block(cells: [usize; 3]) -> Body {
    let mesh = boxes::split_box(cells, Vec3::from_array(cells.map(|n| 8.0 * n as f32)));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    Body::uniform(mesh, fixed, Material::BRAIN)
}

fn gravity() -> Loads {
    Loads { gravity: Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2, ..Loads::default() }
}

fn prepared(name: impl Into<String>, body: &Body, config: &Config) -> Run {
    let solver = Tled::new(body, config).expect("the block is sound");
    Run { name: name.into(), solver, tets: body.mesh.tets.len(), step_us: Vec::new() }
}

/// Round by round, so that a busy moment of the machine hits all alike; the best of each is
/// compared.
fn race(runs: &mut [Run], rounds: usize) {
    for _ in 0..rounds {
        for run in runs.iter_mut() {
            run.step_us.push(step_us(&mut run.solver));
        }
    }
}

fn step_us(solver: &mut Tled) -> f64 {
    let (loads, dt_ms, start) = (gravity(), solver.stable_dt_ms(), Instant::now());
    solver.step(&loads, dt_ms);
    start.elapsed().as_secs_f64() * 1e6
}

fn kernels(scope: Scope, findings: &mut Findings) {
    let body = block(BRAIN);
    let scene = format!("block, {} tetrahedra", body.mesh.tets.len());
    let mut runs: Vec<Run> = configs().iter().map(|(name, config)| prepared(*name, &body, config)).collect();
    race(&mut runs, scope.pick(120, 1000));
    let bytes = |run: &Run| run.solver.positions().iter().map(|p| p.to_array().map(f32::to_bits)).collect::<Vec<_>>();
    let best_of = |wanted: &str| runs.iter().find(|run| run.name == wanted).map(Run::best_us);
    let (scalar, first, plain) = (bytes(&runs[0]), runs[0].best_us(), best_of("fastest").unwrap_or(f64::NAN));
    for run in &runs {
        if !run.name.contains('+') {
            let same = f64::from(bytes(run) == scalar);
            let name = format!("{scene}: {} gives the scalar kernel's bytes", run.name);
            findings.gates.push(Gate::at_least(name, same, 1.0));
        }
        findings.rows.push(
            row(&scene, run)
                .metric("times_faster_than_scalar", first / run.best_us())
                .metric("cost_over_plain", run.best_us() / plain),
        );
    }
    for (kernel, times) in [("avx512", 3.0), ("avx2", 2.0)] {
        if let Some(best) = best_of(kernel) {
            let name = format!("{scene}, one thread: {kernel} faster than the scalar kernel, times");
            findings.gates.push(Gate::at_least(name, first / best, times));
        }
    }
    let both = best_of("+cure+Prony").unwrap_or(f64::NAN) / plain;
    findings.gates.push(Gate::at_most(format!("{scene}: cure and Prony over the plain step"), both, 1.6));
}

fn row(scene: &str, run: &Run) -> Row {
    Row::new(scene, &run.name)
        .with("tets", run.tets)
        .metric("step_best_us", run.best_us())
        .metric("step_spread_percent", 100.0 * Samples::from(run.step_us.clone()).spread())
        .metric("ns_per_tetrahedron", 1e3 * run.best_us() / run.tets as f64)
}

fn configs() -> Vec<(&'static str, Config)> {
    let plain = Config::default();
    let of_kernel = |kernel: Kernel| (kernel.name(), Config { kernel, ..plain });
    let mut configs: Vec<_> = Kernel::all().into_iter().filter(|k| k.runs_here()).map(of_kernel).collect();
    configs.extend([
        ("two threads", Config { threads: 2, ..plain }),
        ("avx2, two threads", Config { threads: 2, kernel: Kernel::Avx2, ..plain }),
        ("+cure", Config { averaged_pressure: true, ..plain }),
        ("+Prony", Config { relaxation: Relaxation::BRAIN, ..plain }),
        ("+cure+Prony", Config { averaged_pressure: true, relaxation: Relaxation::BRAIN, ..plain }),
    ]);
    configs.retain(|(_, config)| config.kernel.runs_here());
    configs
}

/// Cost of an element from 5 to 80 thousand.
fn sizes(scope: Scope, findings: &mut Findings) {
    let mut runs: Vec<Run> =
        [9, 15, 20, 24].iter().map(|&n| prepared("fastest", &block([n; 3]), &Config::default())).collect();
    race(&mut runs, scope.pick(40, 400));
    let costs: Vec<f64> = runs.iter().map(|run| run.best_us() / run.tets as f64).collect();
    runs.iter().for_each(|run| findings.rows.push(row(&format!("size, {} tetrahedra", run.tets), run)));
    let (low, high) = costs.iter().fold((f64::MAX, 0.0f64), |(l, h), &c| (l.min(c), h.max(c)));
    findings.gates.push(Gate::at_most("cost of an element, 5 to 80 thousand: dearest over cheapest", high / low, 1.3));
}

/// Four threads beside one busy thread a core: the mean step must not be dearer than that of one
/// thread on the same loaded machine.
fn loaded(scope: Scope, findings: &mut Findings) {
    let body = block(BRAIN);
    let mut runs = [1usize, 4].map(|threads| {
        (format!("{threads} threads"), prepared("", &body, &Config { threads, ..Config::default() }), Vec::new())
    });
    let (over, cores) = (AtomicBool::new(false), std::thread::available_parallelism().map_or(1, usize::from));
    std::thread::scope(|scope_of_threads| {
        for _ in 0..cores {
            scope_of_threads.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    std::hint::spin_loop()
                }
            });
        }
        for _ in 0..scope.pick(10, 100) {
            for (_, run, times) in &mut runs {
                times.extend((0..30).map(|_| step_us(&mut run.solver)));
            }
        }
        over.store(true, Ordering::Relaxed);
    });
    let means = runs.map(|(name, run, mut times)| {
        times.sort_by(f64::total_cmp);
        let mean = times.iter().sum::<f64>() / times.len() as f64;
        findings.rows.push(
            Row::new(format!("{cores} busy cores"), name)
                .with("tets", run.tets)
                .metric("step_mean_us", mean)
                .metric("step_p50_us", times[times.len() / 2])
                .metric("step_p99_us", times[times.len() * 99 / 100])
                .metric("step_max_us", times[times.len() - 1]),
        );
        mean
    });
    let name = "as many busy threads as cores: mean step of four threads over that of one";
    findings.gates.push(Gate::at_most(name, means[1] / means[0], 1.5));
}
