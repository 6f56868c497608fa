//! A craniotomy on a synthetic head without threads, clock or window: the haptic stage alone, at
//! full speed.
//!
//! `cargo run --release -p trepan-stages --example dry_run`

use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_contact::SurfacePatch;
use trepan_geometry::Vec3;
use trepan_haptics::HapticDevice;
use trepan_haptics::script::{Script, Site};
use trepan_stages::{HapticConfig, HapticStage, Program, TickInput};
use trepan_volume::{DistanceField, VoxelVolume};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (bone, brain) = head()?;
    let site = Site { entry: Vec3::Z * 66.0, inward: Vec3::NEG_Z, bone_mm: 6.0, brain_mm: 8.0 };
    let mut device = Script::named("craniotomy", &site, 10_000.0)?;
    let config = HapticConfig::usual(Program::Craniotomy);
    let mut stage = HapticStage::new(config, Some(Arc::new(bone)), Some(Arc::new(brain)), device.at(0.0));
    for tick in 1..=10_000u64 {
        let reading = device.read(tick as f64);
        let input =
            TickInput { tick, reading, patch: &SurfacePatch::default(), patch_seq: 0, second: None, second_n: 0.0 };
        let done = stage.tick(&input, &mut |notice| println!("{:6.3} s  {}", notice.time_ms * 1e-3, notice.words().1));
        device.apply(done.wrench);
        if tick % 1000 == 0 {
            let record = &done.record;
            println!(
                "{:6.3} s  force {:.2} N, {:.2} mm deep in bone, burr to brain {:5.2} mm",
                record.time_ms * 1e-3,
                record.wrench.force.length(),
                record.depth_mm,
                record.brain_distance_mm
            );
        }
    }
    let scores = stage.scores();
    println!(
        "{:.0} mm3 of bone removed, force on the hand up to {:.2} N",
        scores.bone_removed_mm3, scores.hand_peak_force_n
    );
    Ok(())
}

/// Makes bone from 60 to 66 mm around the origin and brain within 58 mm.
fn head() -> Result<(BoneVolume, DistanceField), trepan_bone::BoneError> {
    let n = 140;
    let mut ct = VoxelVolume::isotropic([n, n, n], Vec3::splat(-69.5), 1.0, -1000i16);
    let mut mask = ct.map(|_| 0u8);
    for at in 0..ct.data.len() {
        let r = ct.centre_of([at % n, at / n % n, at / (n * n)]).length();
        ct.data[at] = (400.0 + 1000.0 * (3.0 - (r - 63.0).abs())).clamp(-1000.0, 1500.0) as i16;
        mask.data[at] = u8::from(r < 58.0);
    }
    Ok((BoneVolume::new(&ct, 400)?, DistanceField::of_mask(&mask)))
}
