//! Strokes over and drills into a synthetic head and prints the cost of a tick. The head has 425 x
//! 403 x 283 voxels; every method runs, or the one named: `tick [METHOD [RADIUS_MM [TASK]]]`.
//!
//! `touch` and `drill` go over the head at 50 mm/s, half a millimetre deep; `feed` goes into it at
//! 1 mm/s, and `hole` through it at 2.4 mm/s, a hand that leads its burr by 2 mm.

use std::time::Instant;
use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_rigid::{Method, RigidStep};
use trepan_rivals::Family;
use trepan_volume::VoxelVolume;

fn main() -> Result<(), trepan_bone::BoneError> {
    let head = head();
    println!(
        "{:<18} {:<6} {:>8} {:>8} {:>8} {:>10} {:>8}",
        "method", "task", "p50 us", "p99 us", "max us", "N/ms max", "mm³"
    );
    let only = std::env::args().nth(1);
    let radius_mm = std::env::args().nth(2).and_then(|text| text.parse().ok()).unwrap_or(3.0);
    for method in Method::all().into_iter().filter(|m| only.as_ref().is_none_or(|name| m.name() == name)) {
        let asked = std::env::args().nth(3);
        let tasks = ["touch", "drill", "feed", "hole"].into_iter();
        for task in tasks.filter(|task| asked.as_ref().is_none_or(|asked| asked == task)) {
            let bone = BoneVolume::new(&head, 400)?;
            stroke(&method, &bone, task, radius_mm, if method.descriptor().is_oracle { 50 } else { 2500 });
        }
    }
    Ok(())
}

/// An ellipsoidal shell 7 mm thick with a softer middle layer, half a millimetre a voxel.
fn head() -> VoxelVolume<i16> {
    let dims = [425, 403, 283];
    let mut ct = VoxelVolume::isotropic(dims, Vec3::new(-106.0, -100.5, -70.5), 0.5, -1000i16);
    for at in 0..ct.data.len() {
        let voxel = [at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])];
        let p = ct.centre_of(voxel).as_vec3();
        let radius = p.length().max(1.0);
        let out = (radius - SKULL * radius / (p / Vec3::new(1.0, 0.95, 0.65)).length()) / 0.5;
        let middle = (out + 7.0).abs();
        let bone = if middle < 3.0 { 700.0 } else { 1500.0 };
        ct.data[at] = (400.0 - 1000.0 * (middle - 7.0)).clamp(-1000.0, bone) as i16;
    }
    ct
}

/// Radius of the skull along x, mm.
const SKULL: f32 = 95.0;
#[inline(never)]
fn stroke(method: &Method, bone: &BoneVolume, task: &str, radius_mm: f32, ticks: u32) {
    let mut contact = method.build(&Tool::burr(radius_mm));
    let (mut out, mut times, mut worst, mut removed) = (RigidStep::default(), Vec::new(), 0.0f32, 0.0);
    let mut last = Vec3::ZERO;
    for t in 0..ticks {
        // Over the top in a curve, pressed about half a millimetre in; or straight in.
        let fed = |mm_per_ms: f32| (0.3, mm_per_ms * t as f32 - 0.2);
        let (phase, pressed) = match task {
            "feed" => fed(1e-3),
            "hole" => fed(2.4e-3),
            _ => (0.05 * t as f32 / 20.0, 0.5),
        };
        let across = 20.0 * Vec3::new(phase.sin(), phase.cos(), 0.0);
        let top = 0.65 * (SKULL * SKULL - across.x.powi(2) - (across.y / 0.95).powi(2)).sqrt();
        let tool = ToolState::at(Pose::from_translation(
            across + Vec3::Z * (top + (radius_mm + if t == 0 { 2.0 } else { -pressed })),
        ));
        let start = Instant::now();
        contact.step(bone, &tool, task != "touch", 1.0, &mut out);
        times.push(start.elapsed().as_secs_f64() * 1e6);
        let force = 2.0 * out.manifold.depth_mm * out.manifold.normal;
        worst = if t > 5 { worst.max(force.distance(last)) } else { worst };
        (last, removed) = (force, removed + out.removed_mm3);
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
    let (p50, p99, max) = (at(0.5), at(0.99), at(1.0));
    println!("{:<18} {task:<6} {p50:>8.1} {p99:>8.1} {max:>8.1} {worst:>10.3} {removed:>8.2}", method.name());
}
