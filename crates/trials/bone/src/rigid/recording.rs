//! The recorded paths: how they are read, and how they are made.
//!
//! # Practice
//! A simulated Touch in a firm simulated hand, that means to stroke over the bone or to follow the
//! scripted craniotomy, is held back by the guarded force of the recommended method; what the
//! device reads is kept, a tick a millisecond. So the poses are such as a hand takes, pressed some
//! tenths of a millimetre deep. `cargo run -p trepan-trials --example record_paths` makes them
//! anew.

use super::bones::{self, HALF_MM, SKULLS};
use super::solid::{RADIUS_MM, held};
use std::path::{Path, PathBuf};
use trepan_bone::BoneVolume;
use trepan_contact::{ForceGuard, ForceModel, GuardConfig, Viscoelastic};
use trepan_geometry::{Buttons, Tool, ToolState, Vec3};
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::script::{Script, Site};
use trepan_haptics::simulated::{Config, HandModel, Simulated};
use trepan_link::wire::{SessionHeader, TickRecord};
use trepan_link::{Recorder, Recording};
use trepan_rigid::{Method, RigidStep};

/// Bone under the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A cube of Table 3.1: its upper face, near an edge.
    Cube,
    /// A skull of Table 3.2: its vault.
    Skull,
}

/// What the hand does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Strokes, pedal up.
    Touch,
    /// Drills a hole, pedal down.
    Drill,
}

impl Task {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Touch => "touch",
            Self::Drill => "drill",
        }
    }
}

impl Place {
    fn name(self) -> &'static str {
        match self {
            Self::Cube => "cube",
            Self::Skull => "skull",
        }
    }

    /// Ticks of its paths: the thesis's 2500, and 3000.
    pub fn ticks(self) -> usize {
        match self {
            Self::Cube => 2500,
            Self::Skull => 3000,
        }
    }
}

/// The recorded path.
pub fn path(place: Place, task: Task) -> Vec<ToolState> {
    let file = trepan_fixtures::recorded_path(&name(place, task));
    let recording = Recording::open(&file).expect("the fixture is a recording");
    let state = |tick: &TickRecord| ToolState {
        world_from_tool: tick.device,
        twist: tick.twist,
        buttons: Buttons(tick.buttons),
        time_ms: tick.time_ms,
    };
    recording.ticks.iter().map(state).collect()
}

fn name(place: Place, task: Task) -> String {
    format!("{}-{}", place.name(), task.name())
}

/// Records all four paths into a folder.
pub fn record_all(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let (head, isovalue) = bones::head();
    let (dims, voxel_mm) = SKULLS[4];
    let skull = bones::skull(&head, dims, voxel_mm);
    let cube = bones::cube(400);
    let mut files = Vec::new();
    for place in [Place::Cube, Place::Skull] {
        for task in [Task::Touch, Task::Drill] {
            let bone = match place {
                Place::Cube => BoneVolume::new(&cube, super::solid::ISO)?,
                Place::Skull => BoneVolume::new(&skull, isovalue)?,
            };
            let file = folder.join(name(place, task) + ".mcap");
            record(&bone, place, task, &file)?;
            files.push(file);
        }
    }
    Ok(files)
}

fn record(bone: &BoneVolume, place: Place, task: Task, file: &Path) -> anyhow::Result<()> {
    let middle = match place {
        Place::Cube => Vec3::new(HALF_MM as f32 - 10.0, 0.0, 0.0),
        Place::Skull => bone.bounds().centre(),
    };
    let intent: Box<dyn HapticDevice> = match task {
        Task::Touch => Box::new(Replay::new(strokes(bone, middle, place.ticks()))),
        Task::Drill => {
            let entry = middle.with_z(height(bone, middle));
            let site = Site { entry, inward: Vec3::NEG_Z, bone_mm: 6.0, brain_mm: 9.0 };
            Box::new(Script::named("craniotomy", &site, place.ticks() as f64)?)
        }
    };
    let mut device = Simulated::new(Config::default(), HandModel::FIRM, intent);
    let limits = device.capabilities().guard_config();
    let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, ..limits });
    let (mut contact, mut model) = (Method::RECOMMENDED.build(&Tool::burr(RADIUS_MM)), Viscoelastic::BONE);
    let config = [("place", place.name()), ("task", task.name())].map(|(k, v)| (k.to_string(), v.to_string()));
    let header = SessionHeader {
        app: "trepan-trials record_paths".into(),
        version: env!("CARGO_PKG_VERSION").into(),
        case: if place == Place::Skull { "case-head" } else { "cube" }.into(),
        config: config.into(),
        ..SessionHeader::default()
    };
    let mut recorder = Recorder::create(file, &header)?;
    let mut out = RigidStep::default();
    for tick in 0..place.ticks() {
        let tool = device.read(tick as f64).tool;
        contact.step(bone, &tool, tool.buttons.has(Buttons::PEDAL), 1.0, &mut out);
        let given = guard.guard(model.wrench(&tool, &out.manifold, 1.0), &tool, 1.0);
        device.apply(given);
        recorder.tick(&TickRecord {
            tick: tick as u64,
            time_ms: tool.time_ms,
            device: tool.world_from_tool,
            twist: tool.twist,
            buttons: tool.buttons.0,
            proxy: contact.proxy(),
            wrench: given.wrench(),
            contact_normal: out.manifold.normal,
            depth_mm: out.manifold.depth_mm,
            removed_mm3: out.removed_mm3,
            flags: if tool.buttons.has(Buttons::PEDAL) { TickRecord::DRILLING } else { 0 },
            ..TickRecord::default()
        })?;
    }
    recorder.finish()?;
    Ok(())
}

/// A figure of eight over the bone, pressed, lifted once for a while, at some 50 mm/s.
fn strokes(bone: &BoneVolume, middle: Vec3, ticks: usize) -> Vec<ToolState> {
    let smooth = |t: f32| t.clamp(0.0, 1.0).powi(3) * (10.0 + t.clamp(0.0, 1.0) * (6.0 * t.clamp(0.0, 1.0) - 15.0));
    (0..ticks)
        .map(|tick| {
            let u = tick as f32 / ticks as f32;
            let turn = core::f32::consts::TAU * u;
            let (x, y) = (middle.x + 14.0 * turn.sin(), middle.y + 8.0 * (2.0 * turn).sin());
            let come = 15.0 * (1.0 - smooth(u / 0.1));
            let lift = 8.0 * smooth((u - 0.42) / 0.06) * (1.0 - smooth((u - 0.54) / 0.06));
            let press = 2.0 + (3.0 * turn).sin();
            let z = height(bone, Vec3::new(x, y, 0.0)) + RADIUS_MM - press + come + lift;
            ToolState { time_ms: tick as f64, ..held(Vec3::new(x, y, z), Vec3::Z) }
        })
        .collect()
}

/// Height of the uppermost bone at (x, y), mm; of the whole bone's top where there is none.
fn height(bone: &BoneVolume, at: Vec3) -> f32 {
    let bounds = bone.bounds();
    let top = bounds.max.z;
    let found = (0..4000).map(|step| top - 0.05 * step as f32).find(|&z| bone.is_bone(bone.voxel_of(at.with_z(z))));
    found.unwrap_or(top)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_recorded_paths_are_whole_and_press_as_a_hand_does() {
        for place in [Place::Cube, Place::Skull] {
            for task in [Task::Touch, Task::Drill] {
                let file = trepan_fixtures::recorded_path(&name(place, task));
                let recording = Recording::open(&file).unwrap();
                assert_eq!((recording.ticks.len(), recording.losses()), (place.ticks(), None));
                let deepest = recording.ticks.iter().map(|tick| tick.depth_mm).fold(0.0, f32::max);
                assert!((0.2..1.65).contains(&deepest), "{place:?} {task:?}: {deepest} mm");
                let removed: f32 = recording.ticks.iter().map(|tick| tick.removed_mm3).sum();
                assert_eq!(removed > 1.0, task == Task::Drill, "{removed} mm³");
                assert!(path(place, task).iter().all(ToolState::is_finite));
            }
        }
    }
}
