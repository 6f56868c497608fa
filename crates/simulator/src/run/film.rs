//! Film of a replay: made once at full speed on the replay's thread, played forwards and backwards
//! by the window.
//!
//! # Theory
//! Stages run forwards only, but their changes can be undone. A [`Shot`] is taken thirty times per
//! second of session time, and at each new notice or change of warnings. It holds what the picture
//! needs: the tick's view, the positions of the brain's nodes, and each voxel of the CT and node of
//! the cut that changed since the last shot, with its value before and after. Playing forwards
//! writes the new values, backwards the old ones, so that the skull is exact at every shot.
//!
//! ```text
//!  stages ── carve a copy of the skull ───┐
//!      every 1/30 s: view, brain, changes └──> channel ──> window: writes into the visible skull
//! ```
//!
//! # Practice
//! The stages run on a copy of the skull, so memory holds three skulls (the visible one, the copy
//! and the state at the last shot, each with its cut) and the nodes of at most [`BRAINS`] shots, 12
//! bytes each. A minute of craniotomy is made in a second; with the brain, in about the time of the
//! solver.
//!
//! # When not to use it
//! Headless: there is no time bar.

use crate::run::View;
use crate::stages::notice::Notice;
use glam::IVec3;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use trepan_geometry::Vec3;
use trepan_volume::BoneVolume;

/// Session time between two shots, ms.
pub(crate) const SHOT_MS: f64 = 1000.0 / 30.0;
/// Largest number of shots that hold the brain's node positions.
const BRAINS: f64 = 3600.0;
/// Edge of a brick, voxels.
const BRICK: usize = 8;

/// One moment of a film.
pub(crate) struct Shot {
    /// View of the tick.
    pub view: View,
    /// Voxels of the CT that changed since the last shot.
    pub changes: Vec<Change>,
    /// Nodes of the cut that changed since the last shot.
    pub cuts: Vec<Change>,
    /// Positions of the brain's nodes, mm, in some of the shots.
    pub positions: Option<Vec<Vec3>>,
}

/// A voxel whose density changed, or a node whose depth in the cut did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Change {
    /// Index of the voxel or node.
    pub at: IVec3,
    /// Density, HU, or the cut's value before.
    pub before: i16,
    /// The same after.
    pub after: i16,
}

impl Shot {
    /// Writes the changes since the last shot into a skull, or takes them back; returns their
    /// number.
    pub fn write(&self, bone: &BoneVolume, forwards: bool) -> usize {
        let value = |change: &Change| if forwards { change.after } else { change.before };
        self.changes.iter().for_each(|change| bone.set_hu(change.at, value(change)));
        let mut writer = bone.cut_writer();
        self.cuts.iter().for_each(|change| _ = writer.set(change.at, value(change)));
        self.changes.len() + self.cuts.len()
    }
}

/// Takes the shots of a replay.
pub(crate) struct Filming {
    shots: Sender<Shot>,
    skull: Option<Carved>,
    next_ms: f64,
    brain_every_ms: f64,
    next_brain_ms: f64,
    /// Warnings and newest notice of the last tick.
    last_notices: (u32, Option<Notice>),
}

impl Filming {
    /// Makes a film of a session of `length_ms` that carves `bone`, and the receiver of its shots.
    pub fn new(bone: Option<Arc<BoneVolume>>, length_ms: f64) -> (Self, Receiver<Shot>) {
        let (shots, coming) = channel();
        let brain_every_ms = (length_ms / BRAINS).max(SHOT_MS);
        let (skull, last_notices) = (bone.map(Carved::of), (0, None));
        (Self { shots, skull, next_ms: 0.0, brain_every_ms, next_brain_ms: 0.0, last_notices }, coming)
    }

    /// Takes a shot of a tick if one is due, if there is a new notice, or if it is the last tick.
    /// `brain` copies the positions of the brain's nodes. Returns false once the receiver is gone.
    pub fn tick(&mut self, view: View, last: bool, brain: impl FnOnce() -> Option<Vec<Vec3>>) -> bool {
        let time_ms = view.time_ms;
        let notices = (view.warnings, view.news);
        let new = std::mem::replace(&mut self.last_notices, notices) != notices;
        if time_ms < self.next_ms && !last && !new {
            return true;
        }
        self.next_ms = time_ms + SHOT_MS;
        let moved = time_ms >= self.next_brain_ms || last;
        if moved {
            self.next_brain_ms = time_ms + self.brain_every_ms;
        }
        let positions = moved.then(brain).flatten();
        let (changes, cuts) = self.skull.as_mut().map(Carved::changes).unwrap_or_default();
        self.shots.send(Shot { view, changes, cuts, positions }).is_ok()
    }
}

/// A skull that is carved, and its state at the last shot.
struct Carved {
    bone: Arc<BoneVolume>,
    versions: Vec<u32>,
    last: Vec<i16>,
    /// The cut at the last shot in the bricks of voxels where there was some.
    last_cut: HashMap<[usize; 3], Vec<i16>>,
}

impl Carved {
    fn of(bone: Arc<BoneVolume>) -> Self {
        let [nx, ny, nz] = bone.dims().map(|n| n as i32);
        let voxels = (0..nx * ny * nz).map(|n| IVec3::new(n % nx, n / nx % ny, n / (nx * ny)));
        let last = voxels.map(|voxel| bone.ct(voxel)).collect();
        Self { versions: bone.seen(), last, last_cut: HashMap::new(), bone }
    }

    /// Voxels of the CT and nodes of the cut that changed since the last call.
    fn changes(&mut self) -> (Vec<Change>, Vec<Change>) {
        let Self { bone, versions, last, last_cut } = self;
        let [nx, ny, nz] = bone.dims();
        let edge = BRICK as i32 * bone.cut_nodes();
        let mut now = vec![0; edge.pow(3) as usize];
        let (mut changes, mut cuts) = (Vec::new(), Vec::new());
        bone.changed(versions, usize::MAX, |brick| {
            let [x, y, z] = brick.map(|b| b * BRICK);
            for (k, j, i) in places([z, y, x], [nz, ny, nx]) {
                let at = IVec3::new(i as i32, j as i32, k as i32);
                let (was, after) = (&mut last[i + nx * (j + ny * k)], bone.ct(at));
                if *was != after {
                    changes.push(Change { at, before: std::mem::replace(was, after), after });
                }
            }
            let low = edge * IVec3::from(brick.map(|b| b as i32));
            if !bone.is_cut_near(low, low + edge - 1) {
                return;
            }
            bone.read_cut(low, IVec3::splat(edge), &mut now);
            let before = last_cut.entry(brick).or_insert_with(|| vec![0; now.len()]);
            for (n, (was, &after)) in
                before.iter_mut().zip(&now).enumerate().filter(|(_, (was, after))| **was != **after)
            {
                let n = n as i32;
                let at = low + IVec3::new(n % edge, n / edge % edge, n / (edge * edge));
                cuts.push(Change { at, before: std::mem::replace(was, after), after });
            }
        });
        (changes, cuts)
    }
}

/// Returns the voxels of a brick that lie inside the grid.
fn places(low: [usize; 3], dims: [usize; 3]) -> impl Iterator<Item = (usize, usize, usize)> {
    let range = move |axis: usize| low[axis]..(low[axis] + BRICK).min(dims[axis]);
    range(0).flat_map(move |a| range(1).flat_map(move |b| range(2).map(move |c| (a, b, c))))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::program::Program;
    use crate::stages::haptic_tick::ToolSample;
    use trepan_geometry::{Pose, ToolState};
    use trepan_volume::{AIR_HU, CUT_SURFACE, VoxelVolume};

    /// Returns the view of a tool at the origin.
    pub(crate) fn view(time_ms: f64) -> View {
        let tool = Program::Craniotomy.tray()[0];
        let sample = ToolSample { tick: 0, state: ToolState::at(Pose::IDENTITY), tool, slot: 0, drilling: false };
        View { time_ms, ..View::at(sample, 1.0) }
    }

    /// The CT of every voxel and the cut of every node.
    fn state(bone: &BoneVolume) -> (Vec<i16>, Vec<i16>) {
        let [nx, ny, nz] = bone.dims().map(|n| n as i32);
        let voxels = (0..nx * ny * nz).map(|n| bone.ct(IVec3::new(n % nx, n / nx % ny, n / (nx * ny))));
        let size = bone.cut_nodes() * IVec3::new(nx, ny, nz);
        let mut cut = vec![0; size.element_product() as usize];
        bone.read_cut(IVec3::ZERO, size, &mut cut);
        (voxels.collect(), cut)
    }

    #[test]
    fn a_film_holds_every_change_once_forwards_and_backwards() {
        let volume = VoxelVolume::isotropic([19, 17, 11], Vec3::ZERO, 1.0, 900i16);
        let made = |volume: &VoxelVolume<i16>| Arc::new(BoneVolume::new(volume, 400).unwrap());
        let (carved, shown) = (made(&volume), made(&volume));
        let (mut filming, receiver) = Filming::new(Some(carved.clone()), 1000.0);
        let mut random = fastrand::Rng::with_seed(7);
        let mut states = Vec::new();
        for ms in 0..1000 {
            let place = IVec3::new(random.i32(0..19), random.i32(0..17), random.i32(0..11));
            carved.set_hu(place, if ms % 3 == 0 { 700 } else { AIR_HU });
            assert!(carved.cut_writer().set(2 * place, random.i16(0..CUT_SURFACE)));
            let taken = filming.next_ms <= f64::from(ms);
            assert!(filming.tick(view(ms.into()), ms == 999, || Some(vec![Vec3::splat(ms as f32)])));
            if taken || ms == 999 {
                states.push(state(&carved));
            }
        }
        let shots: Vec<Shot> = receiver.try_iter().collect();
        assert!(shots.len() == states.len() && (30..33).contains(&shots.len()), "{}", shots.len());
        for (shot, state) in shots.iter().zip(&states) {
            assert!(shot.write(&shown, true) > 0);
            assert!(self::state(&shown) == *state);
        }
        for shot in shots.iter().rev() {
            shot.write(&shown, false);
        }
        assert!(state(&shown) == state(&made(&volume)));
        assert_eq!(shots.last().unwrap().positions, Some(vec![Vec3::splat(999.0)]));
    }

    #[test]
    fn a_warning_has_a_shot_of_its_own() {
        let (mut filming, receiver) = Filming::new(None, 1000.0);
        for ms in 0..30 {
            let warnings = u32::from((13..20).contains(&ms));
            assert!(filming.tick(View { warnings, ..view(ms.into()) }, false, || None));
        }
        let shots: Vec<_> = receiver.try_iter().map(|shot| (shot.view.time_ms, shot.view.warnings)).collect();
        assert_eq!(shots, [(0.0, 0), (13.0, 1), (20.0, 0)]);
    }

    #[test]
    fn long_films_hold_fewer_brains_and_a_dropped_receiver_ends_them() {
        let (mut filming, receiver) = Filming::new(None, 3.6e6);
        for ms in 0..10_000 {
            filming.tick(view(ms.into()), false, || Some(Vec::new()));
        }
        let kept: Vec<bool> = receiver.try_iter().map(|shot| shot.positions.is_some()).collect();
        assert!(kept.len() > 280 && kept.iter().filter(|kept| **kept).count() == 10, "{}", kept.len());
        drop(receiver);
        assert!(!filming.tick(view(1e5), false, || None));
    }
}
