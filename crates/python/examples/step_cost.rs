//! Times a solver step and a tick on bone in Rust, as `benchmarks.py` does from Python: prints µs.

use std::time::Instant;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = boxes::split_box([12; 3], Vec3::splat(100.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1.0);
    let mut tled = trepan_tled::Tled::new(&Body::uniform(mesh, fixed, Material::BRAIN), &Default::default())?;
    let (loads, dt) = (Loads { gravity: Vec3::Z * -9.81e-3, ..Loads::default() }, tled.stable_dt_ms());
    let solver_us = least_us(|_| _ = tled.step(&loads, dt));

    let mut ct = trepan_volume::VoxelVolume::isotropic([64; 3], Vec3::splat(-15.75), 0.5, 0);
    let hu = |at: usize| (400.0 - 2000.0 * (-15.75 + 0.5 * (at / 4096) as f32)).clamp(-1000.0, 1200.0);
    ct.data.iter_mut().enumerate().for_each(|(at, sample)| *sample = hu(at) as i16);
    let bone = trepan_bone::BoneVolume::new(&ct, 400)?;
    let mut burr = trepan_rigid::Method::RECOMMENDED.build(&Tool::burr(3.0));
    burr.reset(Pose::from_translation(4.0 * Vec3::Z));
    let mut out = trepan_rigid::RigidStep::default();
    let tip = |at: u32| Pose::from_translation(Vec3::new(2.0 * (0.01 * at as f32).sin(), 0.0, 2.7));
    let tick_us = least_us(|at| burr.step(&bone, &ToolState::at(tip(at)), false, 1.0, &mut out));
    println!("{solver_us:.2} {tick_us:.2}");
    Ok(())
}

fn least_us(mut f: impl FnMut(u32)) -> f64 {
    let mut batch = |n: u32| {
        let begin = Instant::now();
        (0..200).for_each(|at| f(200 * n + at));
        begin.elapsed().as_secs_f64() * 5e3
    };
    (0..25).map(&mut batch).fold(f64::INFINITY, f64::min)
}
