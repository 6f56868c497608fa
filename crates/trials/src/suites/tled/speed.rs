//! What a step costs: every kernel and option as a ratio in one run, and the cost of an element over the size of the mesh.

use super::Scope;
use crate::suite::{Findings, Gate, Row};
use std::time::Instant;
use trepan_geometry::{Vec3, units};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Kernel, Relaxation, Tled};

/// Kernels and options on cubes of some sizes.
pub fn run(scope: Scope, findings: &mut Findings) {
    for &side in scope.pick(&[10usize][..], &[9, 15, 18, 24][..]) {
        kernels(side, scope, findings);
    }
}

fn kernels(side: usize, scope: Scope, findings: &mut Findings) {
    let mesh = boxes::split_box([side; 3], Vec3::splat(100.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    let scene = format!("cube, {} tetrahedra", body.mesh.tets.len());
    let mut runs = Vec::new();
    for (name, config) in configs() {
        runs.push((name, Tled::new(&body, &config).expect("the cube is sound"), f64::INFINITY));
    }
    let loads = Loads { gravity: Vec3::new(0.0, 0.0, -units::GRAVITY_MM_PER_MS2), ..Loads::default() };
    // Round by round, so that a busy moment of the machine hits all alike; the best of each is compared.
    for _ in 0..scope.pick(30, 200) {
        for (_, solver, best_us) in &mut runs {
            let (dt_ms, start) = (solver.stable_dt_ms(), Instant::now());
            solver.step(&loads, dt_ms);
            *best_us = best_us.min(start.elapsed().as_secs_f64() * 1e6);
        }
    }
    let bytes = |solver: &Tled| solver.positions().iter().map(|p| p.to_array().map(f32::to_bits)).collect::<Vec<_>>();
    let best_of = |wanted: &str| runs.iter().find(|run| run.0 == wanted).map_or(f64::NAN, |run| run.2);
    let (scalar, plain) = (bytes(&runs[0].1), best_of("fastest"));
    for (name, solver, best_us) in &runs {
        if !name.contains('+') {
            let same = f64::from(bytes(solver) == scalar);
            findings.gates.push(Gate::at_least(format!("{scene}: {name} gives the scalar kernel's bytes"), same, 1.0));
        }
        findings.rows.push(
            Row::new(&scene, *name)
                .with("tets", body.mesh.tets.len())
                .metric("step_best_us", *best_us)
                .metric("ns_per_tetrahedron", 1e3 * best_us / body.mesh.tets.len() as f64)
                .metric("times_faster_than_scalar", runs[0].2 / best_us)
                .metric("cost_over_plain", best_us / plain),
        );
    }
}

fn configs() -> Vec<(&'static str, Config)> {
    let plain = Config::default();
    let of_kernel = |kernel: Kernel| (kernel.name(), Config { kernel, ..plain });
    let mut configs: Vec<_> = Kernel::all().into_iter().filter(|k| k.runs_here()).map(of_kernel).collect();
    configs.extend([
        ("two threads", Config { threads: 2, ..plain }),
        ("+cure", Config { cure_locking: true, ..plain }),
        ("+Prony", Config { relaxation: Relaxation::BRAIN, ..plain }),
        ("+cure+Prony", Config { cure_locking: true, relaxation: Relaxation::BRAIN, ..plain }),
    ]);
    configs
}
