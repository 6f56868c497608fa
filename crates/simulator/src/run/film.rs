//! A replay as a film: made once at full speed on the replay's thread, shown at any time, forwards
//! and backwards, by the window.
//!
//! # Theory
//! Stages run forwards only; what they change does not. A [`Shot`] is taken thirty times a second
//! of session time, and where a warning comes or goes or something else is told, and holds what the
//! picture needs: the tick's view, where the brain is, and each voxel that changed since the shot
//! before, with its density before and after. Played forwards the new densities are written,
//! backwards the old ones: at any shot the skull is, voxel by voxel, what it was then.
//!
//! ```text
//!  stages ── carve a skull of their own ──┐
//!      every 1/30 s: view, brain, changes └──> channel ──> window: writes them into the skull that is shown
//! ```
//!
//! # Practice
//! The stages run on a copy of the skull, so memory is that of three skulls (copy, and what the
//! last shot saw) and of a brain for each of at most [`BRAINS`] shots: 12 bytes a node. A minute of
//! craniotomy is made in a second; with the brain, in about the time that the solver needs.
//!
//! # When not to use it
//! Headless: nobody goes back and forth there.

use crate::run::View;
use crate::stages::notice::Notice;
use glam::IVec3;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use trepan_geometry::Vec3;
use trepan_volume::BoneVolume;

/// Session time between two shots, ms.
pub const SHOT_MS: f64 = 1000.0 / 30.0;
/// Shots with a brain of their own, at most.
const BRAINS: f64 = 3600.0;
/// Edge of a brick of voxels.
const BRICK: usize = 8;

/// One moment of a film.
pub struct Shot {
    /// The tick.
    pub view: View,
    /// Every voxel that changed since the shot before.
    pub changes: Vec<Change>,
    /// The brain, where it moved on since the last that was kept.
    pub positions: Option<Vec<Vec3>>,
}

/// A voxel that changed, HU before and after.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// Which.
    pub voxel: IVec3,
    /// Its density before.
    pub before: i16,
    /// Its density after.
    pub after: i16,
}

/// Takes the shots.
pub struct Filming {
    shots: Sender<Shot>,
    skull: Option<Carved>,
    next_ms: f64,
    brain_every_ms: f64,
    next_brain_ms: f64,
    /// What the last tick warned of and told.
    told: (u32, Option<Notice>),
}

impl Filming {
    /// Films a session of `length_ms` that carves `bone`, and what comes of it.
    pub fn new(bone: Option<Arc<BoneVolume>>, length_ms: f64) -> (Self, Receiver<Shot>) {
        let (shots, coming) = channel();
        let brain_every_ms = (length_ms / BRAINS).max(SHOT_MS);
        let (skull, told) = (bone.map(Carved::of), (0, None));
        (Self { shots, skull, next_ms: 0.0, brain_every_ms, next_brain_ms: 0.0, told }, coming)
    }

    /// Takes a shot of a tick if it is time for one, if something happened in it, or if it is the
    /// last; `brain` copies the positions of the brain's nodes. False when nobody looks any more.
    pub fn tick(&mut self, view: View, last: bool, brain: impl FnOnce() -> Option<Vec<Vec3>>) -> bool {
        let time_ms = view.time_ms;
        let told = (view.warnings, view.news);
        let new = std::mem::replace(&mut self.told, told) != told;
        if time_ms < self.next_ms && !last && !new {
            return true;
        }
        self.next_ms = time_ms + SHOT_MS;
        let moved = time_ms >= self.next_brain_ms || last;
        if moved {
            self.next_brain_ms = time_ms + self.brain_every_ms;
        }
        let positions = moved.then(brain).flatten();
        let changes = self.skull.as_mut().map_or_else(Vec::new, Carved::changes);
        self.shots.send(Shot { view, changes, positions }).is_ok()
    }
}

/// A skull that is carved, and what of it was seen last.
struct Carved {
    bone: Arc<BoneVolume>,
    versions: Vec<u32>,
    last: Vec<i16>,
}

impl Carved {
    fn of(bone: Arc<BoneVolume>) -> Self {
        Self { versions: bone.seen(), last: bone.snapshot().data, bone }
    }

    fn changes(&mut self) -> Vec<Change> {
        let Self { bone, versions, last } = self;
        let [nx, ny, nz] = bone.dims();
        let mut changes = Vec::new();
        bone.changed(versions, usize::MAX, |brick| {
            let [x, y, z] = brick.map(|b| b * BRICK);
            for (k, j, i) in places([z, y, x], [nz, ny, nx]) {
                let voxel = IVec3::new(i as i32, j as i32, k as i32);
                let (was, after) = (&mut last[i + nx * (j + ny * k)], bone.hu(voxel));
                if *was != after {
                    changes.push(Change { voxel, before: std::mem::replace(was, after), after });
                }
            }
        });
        changes
    }
}

/// The places of a brick that lie inside the grid.
fn places(low: [usize; 3], dims: [usize; 3]) -> impl Iterator<Item = (usize, usize, usize)> {
    let range = move |axis: usize| low[axis]..(low[axis] + BRICK).min(dims[axis]);
    range(0).flat_map(move |a| range(1).flat_map(move |b| range(2).map(move |c| (a, b, c))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::Program;
    use crate::stages::haptic_tick::ToolSample;
    use trepan_geometry::{Pose, ToolState};
    use trepan_volume::{AIR_HU, VoxelVolume};

    fn view(time_ms: f64) -> View {
        let tool = Program::Craniotomy.tray()[0];
        let sample = ToolSample { tick: 0, state: ToolState::at(Pose::IDENTITY), tool, slot: 0, drilling: false };
        View { time_ms, ..View::at(sample, 1.0) }
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
            let taken = filming.next_ms <= f64::from(ms);
            assert!(filming.tick(view(ms.into()), ms == 999, || Some(vec![Vec3::splat(ms as f32)])));
            if taken || ms == 999 {
                states.push(carved.snapshot());
            }
        }
        let shots: Vec<Shot> = receiver.try_iter().collect();
        assert!(shots.len() == states.len() && (30..33).contains(&shots.len()), "{}", shots.len());
        for (shot, state) in shots.iter().zip(&states) {
            shot.changes.iter().for_each(|change| shown.set_hu(change.voxel, change.after));
            assert_eq!(shown.snapshot(), *state);
        }
        for shot in shots.iter().rev() {
            shot.changes.iter().for_each(|change| shown.set_hu(change.voxel, change.before));
        }
        assert_eq!(shown.snapshot(), volume);
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
    fn long_films_keep_fewer_brains_and_nobody_looking_ends_it() {
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
