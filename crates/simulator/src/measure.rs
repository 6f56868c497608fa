//! How fast this machine is: the numbers that a plan is made from, measured in about a second.
//!
//! # Practice
//! The median of many calls, one method at a time, on small synthetic scenes that stay in the cache as the real ones do.

use crate::run::clock::Clock;
use trepan_budget::Machine;
use trepan_geometry::{Pose, Tool, ToolState, Vec3, units};
use trepan_rigid::{Method, RigidStep};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Tled};
use trepan_volume::{BoneVolume, VoxelVolume};

/// Calls that a median is taken over.
const CALLS: usize = 400;

/// This machine.
pub fn machine() -> Machine {
    let clock = Clock::start();
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get() as u32);
    Machine {
        ns_per_tet_step: ns_per_tet_step(&clock),
        us_per_rigid_tick: us_per_rigid_tick(&clock),
        threads,
        ..Machine::default()
    }
}

fn median_us(clock: &Clock, mut call: impl FnMut(usize)) -> f64 {
    let mut times: Vec<f64> = (0..CALLS)
        .map(|i| {
            let began_ms = clock.now_ms();
            call(i);
            1e3 * (clock.now_ms() - began_ms)
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[CALLS / 2]
}

fn ns_per_tet_step(clock: &Clock) -> f64 {
    let mesh = boxes::split_box([10; 3], Vec3::splat(100.0));
    let tets = mesh.tets.len();
    let fixed = boxes::nodes_where(&mesh, |p| p.z < mesh.bounds().min.z + 1e-3);
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    let mut solver = Tled::new(&body, &Config::default()).expect("a split box is sound");
    let loads = Loads { gravity: Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2, ..Loads::default() };
    let dt_ms = solver.stable_dt_ms();
    1e3 * median_us(clock, |_| _ = solver.step(&loads, dt_ms)) / tets as f64
}

fn us_per_rigid_tick(clock: &Clock) -> f64 {
    let n = 64;
    let mut ct = VoxelVolume::isotropic([n; 3], Vec3::splat(-15.75), 0.5, 0i16);
    for at in 0..ct.data.len() {
        let z = -15.75 + 0.5 * (at / (n * n)) as f32;
        ct.data[at] = (400.0 - 2000.0 * z).clamp(-1000.0, 1500.0) as i16;
    }
    let bone = BoneVolume::new(&ct, 400).expect("half of the box is bone");
    let mut contact = Method::RECOMMENDED.build(&Tool::burr(3.0));
    contact.reset(Pose::from_translation(Vec3::Z * 4.0));
    let mut out = RigidStep::default();
    median_us(clock, |i| {
        let tip = Vec3::new(4.0 * (i as f32 * 0.02).sin(), 0.3, 2.5);
        contact.step(&bone, &ToolState::at(Pose::from_translation(tip)), false, 1.0, &mut out);
    })
}
