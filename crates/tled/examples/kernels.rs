//! How long does a step take at 22 thousand tetrahedra? Prints best and median of each kernel and
//! option, of a single substep, and the ratio to the scalar kernel.

use std::time::Instant;
use trepan_geometry::Vec3;
use trepan_soft::{Body, BodyError, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Kernel, Pass, Relaxation, Tled};

const ROUNDS: usize = 40;
const STEPS: usize = 10;

fn main() -> Result<(), BodyError> {
    let mesh = boxes::split_box([18, 17, 12], Vec3::new(36.0, 34.0, 24.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1.0);
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    println!("{} tetrahedra, {} nodes", body.mesh.tets.len(), body.mesh.positions.len());
    let plain = Config::default();
    let of_kernel = |kernel: Kernel| (kernel.name(), Config { kernel, ..plain });
    let mut runs: Vec<_> = Kernel::all().into_iter().filter(|kernel| kernel.runs_here()).map(of_kernel).collect();
    runs.push(("two threads", Config { threads: 2, ..plain }));
    runs.push(("locking-free", Config { averaged_pressure: true, ..plain }));
    runs.push(("locking-free, two threads", Config { threads: 2, averaged_pressure: true, ..plain }));
    runs.push(("Prony terms", Config { relaxation: Relaxation::BRAIN, ..plain }));
    let both = Config { averaged_pressure: true, relaxation: Relaxation::BRAIN, ..plain };
    runs.push(("averaged pressure and Prony", both));
    runs.push(("the same, selective mass scaling", Config { selective_mass_scaling: true, ..both }));
    let mut solvers = Vec::new();
    for (name, config) in &runs {
        solvers.push((*name, Tled::new(&body, config)?, Vec::new()));
    }
    // Round by round, so that a busy moment of the machine hits all alike.
    for _ in 0..ROUNDS {
        for (_, tled, times) in &mut solvers {
            times.extend((0..STEPS).map(|_| timed_us(tled)));
        }
    }
    let best_of_rounds = |name: &str| -> Vec<f64> {
        let (_, _, times) = solvers.iter().find(|(of, ..)| *of == name).expect("a run of that name");
        times.chunks(STEPS).map(|round| round.iter().copied().fold(f64::INFINITY, f64::min)).collect()
    };
    let pairs = best_of_rounds("locking-free").into_iter().zip(best_of_rounds("fastest"));
    let mut ratios: Vec<f64> = pairs.map(|(free, plain)| free / plain).collect();
    ratios.sort_by(f64::total_cmp);
    println!("locking-free: {:.2} times the plain step, median of {ROUNDS} rounds", ratios[ROUNDS / 2]);
    solvers.iter_mut().for_each(|(_, _, times)| times.sort_by(f64::total_cmp));
    let scalar = solvers[0].2[0];
    for (name, _, times) in &solvers {
        let (best, median) = (times[0], times[times.len() / 2]);
        let million = body.mesh.tets.len() as f64 / best;
        println!(
            "{name:14} best {best:7.1} us, median {median:7.1} us, {:.2} times scalar, {million:5.1} million/s",
            scalar / best
        );
    }
    for threads in [1, 2] {
        let mut tled = Tled::new(&body, &Config { threads, averaged_pressure: true, ..plain })?;
        let bests = Pass::ALL.map(|pass| (0..400).map(|_| passed_us(&mut tled, pass)).fold(f64::INFINITY, f64::min));
        let words: Vec<_> = Pass::ALL.iter().zip(bests).map(|(p, us)| format!("{} {us:.1} us", p.name())).collect();
        println!("passes of a locking-free step by {threads} threads, best: {}", words.join(", "));
    }
    Ok(())
}

fn passed_us(tled: &mut Tled, pass: Pass) -> f64 {
    let (dt_ms, start) = (tled.stable_dt_ms(), Instant::now());
    tled.pass(pass, &Loads::default(), dt_ms);
    start.elapsed().as_secs_f64() * 1e6
}

fn timed_us(tled: &mut Tled) -> f64 {
    let loads = Loads { gravity: Vec3::NEG_Z * 9.81e-3, ..Loads::default() };
    let dt = tled.next_dt_ms();
    let start = Instant::now();
    let substeps = tled.step(&loads, dt).substeps;
    start.elapsed().as_secs_f64() * 1e6 / f64::from(substeps.max(1))
}
