//! The step on the graphics device: agreement with the processor's, and what a step costs from 5
//! thousand tetrahedra to a million.
//!
//! # Practice
//! Without any adapter it says so and judges nothing. A software driver steps the two smallest
//! sizes only, since its times say nothing of a graphics card.

use super::Scope;
use crate::engine::suite::{Findings, Gate, Row};
use std::time::Instant;
use trepan_geometry::{Vec3, units};
use trepan_gpu::{Gpu, Prefer};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::gpu::GpuTled;
use trepan_tled::{Config, Relaxation, Tled};

/// Bytes that a step reads and writes for a tetrahedron. Corners and slots take 32, rows 48,
/// displacements 64, forces written and read 128; nodes are a fifth as many, 128 each.
const BYTES: f64 = 32.0 + 48.0 + 64.0 + 128.0 + 26.0;

/// Every size, and agreement on the smallest.
pub fn run(scope: Scope, findings: &mut Findings) {
    let gpu = match Gpu::open(Prefer::Hardware) {
        Ok(gpu) => gpu,
        Err(fault) => return println!("  no graphics device, so its step is not judged: {fault}"),
    };
    agreement(&gpu, findings);
    // 5, 22, 50, 250 thousand and a million.
    let sizes: &[[usize; 3]] = &[[10, 10, 9], [18, 17, 12], [22, 20, 19], [36, 35, 33], [56, 55, 54]];
    let count = if gpu.is_software() { scope.pick(1, 2) } else { sizes.len() };
    sizes[..count].iter().for_each(|&cells| cost(&gpu, cells, scope, findings));
}

fn block(cells: [usize; 3]) -> Body {
    let mesh = boxes::split_box(cells, Vec3::from_array(cells.map(|n| 8.0 * n as f32)));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    Body::uniform(mesh, fixed, Material::BRAIN)
}

fn gravity() -> Loads {
    Loads { gravity: Vec3::X * units::GRAVITY_MM_PER_MS2, ..Loads::default() }
}

fn agreement(gpu: &Gpu, findings: &mut Findings) {
    // Short enough that the processor never takes a substep of its own, as the device looks at its
    // elements only between submissions.
    let plain = Config { safety: 0.5, ..Config::default() };
    let options = [
        ("plain", plain),
        ("averaged pressure and Prony", Config { averaged_pressure: true, relaxation: Relaxation::BRAIN, ..plain }),
    ];
    for (name, config) in options {
        for (law, material) in [("neo-Hookean", Material::BRAIN), ("Ogden", Material::BRAIN_OGDEN)] {
            let body = block([6, 5, 4]).with_material(material);
            let mut device = GpuTled::new(gpu, &body, &config).expect("the device has these");
            let mut cpu = Tled::new(&body, &config).expect("the block is sound");
            let dt_ms = device.steps(&gravity(), 300);
            let substeps: u32 = (0..300).map(|_| cpu.step(&gravity(), dt_ms).substeps).sum();
            let read = device.read().is_ok();
            let largest =
                |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(a, b)| f64::from(a.distance(*b))).fold(0.0, f64::max);
            let way = largest(cpu.positions(), &body.mesh.positions);
            let apart = if read { largest(cpu.positions(), device.positions()) / way } else { f64::NAN };
            let scene = format!("device beside processor, {law}, {name}");
            findings.rows.push(
                Row::new(&scene, gpu.name())
                    .metric("moved_mm", way)
                    .metric("apart_share", apart)
                    .metric("substeps_count", f64::from(substeps)),
            );
            findings.gates.push(Gate::at_most(
                format!("{scene}: apart, share of the largest displacement"),
                apart,
                1e-4,
            ));
        }
    }
}

fn cost(gpu: &Gpu, cells: [usize; 3], scope: Scope, findings: &mut Findings) {
    let body = block(cells);
    let mut solver = match GpuTled::new(gpu, &body, &Config::default()) {
        Ok(solver) => solver,
        Err(fault) => return println!("  {} tetrahedra on the device: {fault}", body.mesh.tets.len()),
    };
    let (steps, mut best_us) = (if gpu.is_software() { 20 } else { 500 }, f64::INFINITY);
    for _ in 0..scope.pick(3, 6) {
        let start = Instant::now();
        solver.steps(&gravity(), steps);
        if gpu.wait().is_err() {
            return;
        }
        best_us = best_us.min(start.elapsed().as_secs_f64() * 1e6 / f64::from(steps));
    }
    let tets = body.mesh.tets.len() as f64;
    findings.rows.push(
        Row::new(format!("block on the device, {tets} tetrahedra"), gpu.name())
            .with("tets", body.mesh.tets.len())
            .metric("step_best_us", best_us)
            .metric("tetrahedron_steps_per_s", 1e6 * tets / best_us)
            .metric("bandwidth_gb_per_s", 1e-3 * BYTES * tets / best_us),
    );
}
