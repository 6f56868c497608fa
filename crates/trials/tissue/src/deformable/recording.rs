//! The three recorded paths over a brain (thesis, Table 4.3): how they are read, and how they are
//! made.
//!
//! # Practice
//! A simulated Touch in a firm simulated hand that means to follow one of [`PATHS`] over the
//! built-in brain, held back by the guarded force of the recommended method; what the device reads
//! is kept, a tick a millisecond. `cargo run -p trepan-trials --example record_paths` makes them
//! anew.

use super::scene::{PATHS, RADIUS_MM, Scene};
use std::path::{Path, PathBuf};
use trepan_contact::{ForceGuard, ForceModel, GuardConfig, Viscoelastic};
use trepan_deformable::{Config, TissueCollision, TissueStep};
use trepan_geometry::{Buttons, Pose, Tool, ToolState, Vec3};
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::{self, HandModel, Simulated};
use trepan_link::wire::{SessionHeader, TickRecord};
use trepan_link::{Recorder, Recording};

/// Tetrahedra of the brain under the paths: the thesis's Brain3.
pub const TETS: usize = 22_076;
/// Ticks of a path, as in the thesis.
const TICKS: usize = 3000;
/// The files, in the order of [`PATHS`].
pub const NAMES: [&str; 3] = ["brain-light", "brain-random", "brain-repeated"];

/// Where the tip was at each tick of a recorded path.
pub fn tips(name: &str) -> Vec<Vec3> {
    path(name).iter().map(ToolState::tip).collect()
}

/// The tool at each tick of a recorded path.
pub fn path(name: &str) -> Vec<ToolState> {
    let recording = Recording::open(&trepan_fixtures::recorded_path(name)).expect("the fixture is a recording");
    let state = |tick: &TickRecord| ToolState {
        world_from_tool: tick.device,
        twist: tick.twist,
        buttons: Buttons(tick.buttons),
        time_ms: tick.time_ms,
    };
    recording.ticks.iter().map(state).collect()
}

/// Records all three paths into a folder.
pub fn record_all(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let scene = Scene::brain_at_rest(TETS);
    let record = |(path, name): (&super::scene::Path, &&str)| {
        let file = folder.join(format!("{name}.mcap"));
        record(&scene, &scene.tips(path, TICKS), name, &file)?;
        Ok(file)
    };
    PATHS.iter().zip(&NAMES).map(record).collect()
}

fn record(scene: &Scene, meant: &[Vec3], name: &str, file: &Path) -> anyhow::Result<()> {
    let state =
        |(tick, tip): (usize, &Vec3)| ToolState { time_ms: tick as f64, ..ToolState::at(Pose::from_translation(*tip)) };
    let intent = Replay::new(meant.iter().enumerate().map(state).collect());
    let mut device = Simulated::new(simulated::Config::default(), HandModel::FIRM, Box::new(intent));
    let limits = device.capabilities().guard_config();
    let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, ..limits });
    let (mut collision, mut model) =
        (TissueCollision::new(&scene.mesh, &Tool::probe(RADIUS_MM), &Config::default())?, Viscoelastic::BRAIN);
    let header = SessionHeader {
        app: "trepan-trials record_paths".into(),
        version: env!("CARGO_PKG_VERSION").into(),
        case: "case-head".into(),
        config: [("path".to_string(), name.to_string())].into(),
        ..SessionHeader::default()
    };
    let mut recorder = Recorder::create(file, &header)?;
    let (mut out, still) = (TissueStep::default(), vec![Vec3::ZERO; scene.mesh.positions.len()]);
    for tick in 0..meant.len() {
        let tool = device.read(tick as f64).tool;
        collision.step(&scene.mesh.positions, &still, &tool, &mut out);
        let given = guard.guard(model.wrench(&tool, &out.manifold, 1.0), &tool, 1.0);
        device.apply(given);
        recorder.tick(&TickRecord {
            tick: tick as u64,
            time_ms: tool.time_ms,
            device: tool.world_from_tool,
            twist: tool.twist,
            proxy: tool.world_from_tool,
            wrench: given.wrench(),
            contact_normal: out.manifold.normal,
            tissue_depth_mm: out.manifold.depth_mm,
            ..TickRecord::default()
        })?;
    }
    recorder.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_recorded_paths_are_whole_and_press_as_a_hand_does() {
        for name in NAMES {
            let recording = Recording::open(&trepan_fixtures::recorded_path(name)).unwrap();
            assert_eq!((recording.ticks.len(), recording.losses()), (TICKS, None));
            let depths: Vec<f32> = recording.ticks.iter().map(|tick| tick.tissue_depth_mm).collect();
            let (deepest, touching) =
                (depths.iter().copied().fold(0.0, f32::max), depths.iter().filter(|d| **d > 0.0).count());
            assert!((0.3..4.0).contains(&deepest) && touching > TICKS / 3, "{name}: {deepest} mm, {touching}");
            assert!(tips(name).iter().all(|p| p.is_finite()));
        }
    }
}
