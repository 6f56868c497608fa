//! How long does a step take at 22 thousand tetrahedra, kernel by kernel? Prints best and median, and the ratio to the scalar kernel.

use std::time::Instant;
use trepan_geometry::Vec3;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Kernel, Tled};

const STEPS: usize = 400;

fn main() -> Result<(), trepan_soft::BodyError> {
    let mesh = boxes::split_box([18, 17, 12], Vec3::new(144.0, 136.0, 96.0));
    let body = Body { fixed: boxes::nodes_where(&mesh, |p| p.z < 1.0), mesh, material: Material::BRAIN };
    println!("{} tetrahedra, {} nodes", body.mesh.tets.len(), body.mesh.positions.len());
    let mut scalar_us = None;
    let runs = Kernel::all().into_iter().filter(|kernel| kernel.runs_here()).map(|kernel| (kernel, 1));
    for (kernel, threads) in runs.chain([(Kernel::Fastest, 2)]) {
        let mut tled = Tled::new(&body, &Config { kernel, threads, ..Config::default() })?;
        let loads = Loads { gravity: Vec3::NEG_Z * 9.81e-3, ..Loads::default() };
        let dt = tled.stable_dt_ms();
        let mut times: Vec<f64> = (0..STEPS).map(|_| timed_us(|| _ = tled.step(&loads, dt))).collect();
        times.sort_by(f64::total_cmp);
        let (best, median) = (times[0], times[STEPS / 2]);
        let scalar = *scalar_us.get_or_insert(best);
        println!(
            "{:8} on {threads}: best {best:6.1} us, median {median:6.1} us, {:.2} times the scalar kernel, {:5.1} million tetrahedra/s, step {dt:.3} ms",
            kernel.name(),
            scalar / best,
            body.mesh.tets.len() as f64 / best,
        );
    }
    Ok(())
}

fn timed_us(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64() * 1e6
}
