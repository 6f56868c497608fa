//! Measures the speed of this machine for a plan, in under two seconds.
//!
//! # Practice
//! Each number is the median of many calls of one method on one thread, on small synthetic scenes
//! that stay in the CPU cache as real ones do. Parts that are not wanted keep the number of
//! [`Machine::default`].

use crate::ingredients::Ingredients;
use crate::measure::PlannedParts;
use std::f32::consts::TAU;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_budget::Machine;
use trepan_geometry::{Pose, Tool, ToolState, Vec3, quantile, units};
use trepan_mesh::Surface;
use trepan_patient::TissueClass;
use trepan_patient::progress::Stopwatch;
use trepan_render::{Camera, Frame, ProcessorRenderer, SceneData, SliceLook};
use trepan_rigid::{Method, RigidStep};
use trepan_soft::{Body, Loads, Material, Membrane, SoftSolver, boxes};
use trepan_tled::{Config, Tled};
use trepan_volume::{AIR_HU, VoxelVolume};

/// Calls per median.
const CALLS: usize = 400;
/// Pictures per median.
const PICTURES: usize = 9;
/// Edge of a picture, pixels.
const PIXELS: u32 = 160;

/// Measures this machine. `device_draws`: whether a graphics card draws; tissue is stepped with
/// these ingredients, on one thread.
pub fn machine(wanted: PlannedParts, device_draws: bool, ingredients: &Ingredients) -> Machine {
    let (clock, usual) = (Stopwatch::start(), Machine::default());
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get() as u32);
    Machine {
        ns_per_tet_step: if wanted.tissue { ns_per_tet_step(&clock, ingredients) } else { usual.ns_per_tet_step },
        us_per_rigid_tick: if wanted.bone { us_per_rigid_tick(&clock) } else { usual.us_per_rigid_tick },
        ns_per_ray: if wanted.picture && !device_draws { ns_per_ray(&clock) } else { usual.ns_per_ray },
        threads,
        solver_threads: None,
        device_draws,
    }
}

/// Median time of a call, µs.
fn median_us(clock: &Stopwatch, calls: usize, mut call: impl FnMut(usize)) -> f64 {
    let time_us = |i| {
        let began_ms = clock.now_ms();
        call(i);
        1e3 * (clock.now_ms() - began_ms)
    };
    quantile(&mut (0..calls).map(time_us).collect::<Vec<_>>(), 0.5)
}

/// Median time per tetrahedron of a TLED step, ns.
fn ns_per_tet_step(clock: &Stopwatch, ingredients: &Ingredients) -> f64 {
    let mesh = boxes::split_box([10; 3], Vec3::splat(100.0));
    let tets = mesh.tets.len();
    let fixed = boxes::nodes_where(&mesh, |p| p.z < mesh.bounds().min.z + 1e-3);
    let material = ingredients.laws[0].material(TissueClass::Brain, Material::BRAIN.young_mpa() as f32);
    let membrane =
        Membrane { triangles: Surface::of(&mesh).triangles, shear_n_per_mm: ingredients.pia_arachnoid_n_per_mm };
    let body = Body { membrane, ..Body::uniform(mesh, fixed, material) };
    let config = Config { threads: 1, still_mm: 0.0, selective_mass_scaling: false, ..ingredients.config() };
    let mut solver = Tled::new(&body, &config).expect("a split box is a valid mesh");
    // A small load: under the whole weight every element of a bare box would stiffen.
    let loads = Loads { gravity: Vec3::NEG_Z * (0.02 * units::GRAVITY_MM_PER_MS2), ..Loads::default() };
    let step = |_| {
        let dt_ms = solver.next_dt_ms();
        solver.step(&loads, dt_ms);
    };
    1e3 * median_us(clock, CALLS, step) / tets as f64
}

/// Median tick of `god-object-sphere` with a burr of 3 mm on 0.5 mm voxels, µs.
fn us_per_rigid_tick(clock: &Stopwatch) -> f64 {
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
    median_us(clock, CALLS, |i| {
        let tip = Vec3::new(4.0 * (i as f32 * 0.02).sin(), 0.3, 2.5);
        contact.step(&bone, &ToolState::at(Pose::from_translation(tip)), false, 1.0, &mut out);
    })
}

/// Time per ray on a wavy shell of bone, ns. Each picture has another view direction, so that
/// nothing is reused.
fn ns_per_ray(clock: &Stopwatch) -> f64 {
    let n = 96;
    let mut ct = VoxelVolume::isotropic([n; 3], Vec3::splat(-95.0), 2.0, AIR_HU);
    for at in 0..ct.data.len() {
        let p = 2.0 * Vec3::new((at % n) as f32, (at / n % n) as f32, (at / (n * n)) as f32) - 95.0;
        let depth_mm = (p.length() - 80.0 - 2.0 * (0.15 * p.x).sin() * (0.15 * p.z).cos()).abs();
        ct.data[at] = (400.0 + 250.0 * (4.0 - depth_mm)).clamp(-1000.0, 1400.0) as i16;
    }
    let bone = BoneVolume::new(&ct, 400).expect("the shell is bone");
    let data = SceneData { bone: Some(Arc::new(bone)), brain: None, mri: None, tint: None, cortex: None };
    let mut processor = ProcessorRenderer::new(&data, [PIXELS; 2]).expect("a picture has pixels");
    processor.threads = 1;
    let us = median_us(clock, PICTURES, |i| {
        let (sin, cos) = (i as f32 / PICTURES as f32 * TAU).sin_cos();
        let camera = Camera::viewed_from(Vec3::ZERO, Vec3::new(cos, sin, 0.5), 330.0);
        let slices = SliceLook { shown: false, ..SliceLook::default() };
        _ = processor.draw(&Frame { slices, ..Frame::of(camera) });
    });
    1e3 * us / f64::from(PIXELS * PIXELS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_that_are_not_wanted_are_not_measured() {
        let usual = Machine::default();
        let machine = machine(PlannedParts { bone: true, tissue: false, picture: true }, true, &Ingredients::default());
        assert_eq!((machine.ns_per_tet_step, machine.ns_per_ray), (usual.ns_per_tet_step, usual.ns_per_ray));
        assert!(machine.us_per_rigid_tick > 0.0 && machine.us_per_rigid_tick != usual.us_per_rigid_tick);
    }
}
