//! Film of a session: taken while it runs, or made again by a replay at full speed; played forwards
//! and backwards by the window.
//!
//! # Theory
//! Stages run forwards only, but their changes can be undone. A [`Shot`] is taken thirty times per
//! second of session time, and at each new notice or change of warnings. It holds what the picture
//! needs: the tick's view, the positions of the brain's nodes, and each voxel of the CT and node of
//! the cut that changed since the last shot, with its value before and after. Playing forwards
//! writes the new values, backwards the old ones, so that the skull is exact at every shot.
//!
//! ```text
//!  live      loops carve the skull ──┐ thread of the film ──> scene file beside the recording
//!  replay    a copy is carved again ─┤ thread of the replay ──> channel ──> window
//!  seek      scene file, or channel ──> window: writes changes into the visible skull
//! ```
//!
//! # Practice
//! A live session's film is taken by a thread of its own, some 0.1 ms a shot, and is at most a
//! tick or two ahead of the tick that it names. Memory holds the bricks of the skull that changed,
//! at the last shot, and the nodes of some shots, 6 bytes each. Without a scene file a minute of
//! craniotomy is made again in a second; with the brain, in about the time of the solver.

use crate::View;
use crate::stop::Stop;
use glam::IVec3;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;
use trepan_link::cell::Reader;
use trepan_link::{NODE_STEP_MM, SceneChange, SceneRecord, SceneWriter};
use trepan_mesh::Split;
use trepan_stages::collision_step::SoftFrame;
use trepan_stages::notice::Notice;

/// Session time between two shots, ms.
pub const SHOT_MS: f64 = 1000.0 / 30.0;
/// Largest number of shots that hold the brain's nodes, where the length is known.
const BRAINS: f64 = 3600.0;
/// Session time between two shots of a live session that hold the brain's nodes, ms.
const BRAIN_MS: f64 = 100.0;
/// Time between two looks at a live session.
const LOOK: Duration = Duration::from_millis(4);
/// Edge of a brick, voxels.
const BRICK: usize = 8;

/// One moment of a film.
pub struct Shot {
    /// View of the tick.
    pub view: View,
    /// Voxels of the CT that changed since the last shot.
    pub voxels: Vec<SceneChange>,
    /// Nodes of the cut that changed since the last shot.
    pub cuts: Vec<SceneChange>,
    /// Displacements of the brain's nodes from rest, in steps of [`NODE_STEP_MM`], in some of the
    /// shots.
    pub nodes: Option<Vec<[i16; 3]>>,
    /// Tetrahedra of the brain that were resected since the last shot.
    pub gone: Vec<u32>,
    /// Splits of its nodes since the last shot, the first to a new node; then it holds the nodes.
    pub splits: Vec<Split>,
}

/// Displacements of nodes as a film holds them.
pub fn displacements(positions: &[Vec3], rest: &[Vec3]) -> Vec<[i16; 3]> {
    let steps = |(now, rest): (&Vec3, &Vec3)| ((*now - *rest) / NODE_STEP_MM).round().to_array().map(|mm| mm as i16);
    positions.iter().zip(rest).map(steps).collect()
}

/// Adds the rest position of each node that splits copied.
pub fn split_rest(rest: &mut Vec<Vec3>, splits: &[Split]) {
    for Split { from, node, .. } in splits {
        if *node as usize == rest.len() {
            rest.extend(rest.get(*from as usize).copied());
        }
    }
}

/// Position of a node that a film holds, mm.
pub fn position(rest: Vec3, [x, y, z]: [i16; 3]) -> Vec3 {
    rest + NODE_STEP_MM * Vec3::new(x.into(), y.into(), z.into())
}

impl Shot {
    /// As a scene file holds it.
    fn record(&self) -> SceneRecord {
        let View { time_ms, warnings, bone_open: open, removed_mm3, spindle, .. } = self.view;
        let (voxels, cuts, nodes, gone) =
            (self.voxels.clone(), self.cuts.clone(), self.nodes.clone(), self.gone.clone());
        let splits = self.splits.iter().map(|split| [split.corner, split.from, split.node]).collect();
        let tick = self.view.sample.tick;
        SceneRecord { tick, time_ms, warnings, open, removed_mm3, spindle, voxels, cuts, nodes, gone, splits }
    }

    /// From a scene file, on top of the view of its tick.
    pub fn of(record: SceneRecord, view: View) -> Self {
        let SceneRecord { time_ms, warnings, open: bone_open, removed_mm3, spindle, .. } = record;
        let SceneRecord { voxels, cuts, nodes, gone, splits, .. } = record;
        let splits = splits.into_iter().map(|[corner, from, node]| Split { corner, from, node }).collect();
        let view = View { time_ms, warnings, bone_open, removed_mm3, spindle, ..view };
        Self { view, voxels, cuts, nodes, gone, splits }
    }

    /// Writes the changes since the last shot into a skull, or takes them back; returns their
    /// number.
    pub fn write(&self, bone: &BoneVolume, forwards: bool) -> usize {
        let value = |change: &SceneChange| if forwards { change.after } else { change.before };
        let place = |change: &SceneChange| IVec3::from(change.at.map(i32::from));
        self.voxels.iter().for_each(|change| bone.set_hu(place(change), value(change)));
        let mut writer = bone.cut_writer();
        self.cuts.iter().for_each(|change| _ = writer.set(place(change), value(change)));
        self.voxels.len() + self.cuts.len()
    }
}

/// Takes the shots of a session.
pub struct Filming {
    skull: Option<Carved>,
    rest: Vec<Vec3>,
    /// Which tetrahedra were gone at the last shot.
    gone: Vec<bool>,
    /// How many splits the last shot had.
    splits: usize,
    next_ms: f64,
    brain_every_ms: f64,
    next_brain_ms: f64,
    /// Warnings and newest notice of the last tick.
    last_notices: (u32, Option<Notice>),
}

impl Filming {
    /// Makes a film of a session that carves a skull, with a brain whose nodes are at `rest`. A
    /// length of `None` is not known yet.
    pub fn new(skull: Option<Arc<BoneVolume>>, rest: Vec<Vec3>, length_ms: Option<f64>) -> Self {
        let brain_every_ms = length_ms.map_or(BRAIN_MS, |length_ms| (length_ms / BRAINS).max(SHOT_MS));
        let (skull, last_notices) = (skull.map(Carved::of), (0, None));
        let (gone, splits) = (Vec::new(), 0);
        Self { skull, rest, gone, splits, next_ms: 0.0, brain_every_ms, next_brain_ms: 0.0, last_notices }
    }

    /// Takes a shot of a tick if one is due, if there is a new notice, or if it is the last tick.
    /// `brain` gives the positions of the brain's nodes, mm, what is left of its tetrahedra, and
    /// all splits so far.
    pub fn tick<'a>(
        &mut self,
        view: View,
        last: bool,
        brain: impl FnOnce() -> Option<(&'a [Vec3], &'a [u16], &'a [Split])>,
    ) -> Option<Shot> {
        let time_ms = view.time_ms;
        let notices = (view.warnings, view.news);
        let new = std::mem::replace(&mut self.last_notices, notices) != notices;
        if time_ms < self.next_ms && !last && !new {
            return None;
        }
        self.next_ms = time_ms + SHOT_MS;
        let moved = time_ms >= self.next_brain_ms || last;
        if moved {
            self.next_brain_ms = time_ms + self.brain_every_ms;
        }
        let brain = moved.then(brain).flatten();
        let (fills, all) = brain.map_or((&[][..], &[][..]), |(_, fills, splits)| (fills, splits));
        let splits = all.get(self.splits..).unwrap_or_default().to_vec();
        self.splits += splits.len();
        split_rest(&mut self.rest, &splits);
        let nodes = brain.map(|(positions, ..)| displacements(positions, &self.rest));
        let gone = self.newly_gone(fills);
        let (voxels, cuts) = self.skull.as_mut().map(Carved::changes).unwrap_or_default();
        Some(Shot { view, voxels, cuts, nodes, gone, splits })
    }

    fn newly_gone(&mut self, fills: &[u16]) -> Vec<u32> {
        self.gone.resize(self.gone.len().max(fills.len()), false);
        let new = |(tet, (gone, fill)): (usize, (&mut bool, &u16))| {
            (*fill == 0 && !std::mem::replace(gone, *fill == 0)).then_some(tet as u32)
        };
        self.gone.iter_mut().zip(fills).enumerate().filter_map(new).collect()
    }

    /// Films a live session into its scene file until it is over; returns why the film ended early.
    pub fn live(
        mut self,
        mut writer: SceneWriter,
        mut view: Reader<View>,
        mut brain: Option<Reader<SoftFrame>>,
        stop: &Stop,
    ) -> Option<String> {
        let mut fault = None;
        loop {
            let (now, over) = (*view.latest().0, stop.asked());
            let last = over || now.finished;
            let brain = brain.as_mut().map(|brain| brain.latest().0);
            let shot =
                self.tick(now, last, || brain.map(|brain| (&brain.positions[..], &brain.fills[..], &brain.splits[..])));
            if let (None, Some(shot)) = (&fault, &shot) {
                fault = writer.write(&shot.record()).err();
            }
            if last {
                break;
            }
            std::thread::sleep(LOOK);
        }
        fault = fault.or(writer.finish().err());
        fault.map(|fault| format!("the film for a replay ended early: {fault}"))
    }
}

/// Voxels and nodes of the cut that are not as they were scanned.
pub(crate) fn all_changes(bone: &Arc<BoneVolume>) -> (Vec<SceneChange>, Vec<SceneChange>) {
    let mut carved = Carved::of(Arc::clone(bone));
    carved.versions.fill(0);
    carved.changes()
}

/// A skull that is carved, and its state at the last shot.
struct Carved {
    bone: Arc<BoneVolume>,
    versions: Vec<u32>,
    /// The CT at the last shot in the bricks of voxels that changed, z slowest.
    last: HashMap<[usize; 3], Vec<i16>>,
    /// The cut at the last shot in the bricks of voxels where there was some.
    last_cut: HashMap<[usize; 3], Vec<i16>>,
}

impl Carved {
    fn of(bone: Arc<BoneVolume>) -> Self {
        Self { versions: bone.seen(), last: HashMap::new(), last_cut: HashMap::new(), bone }
    }

    /// Voxels of the CT and nodes of the cut that changed since the last call.
    fn changes(&mut self) -> (Vec<SceneChange>, Vec<SceneChange>) {
        let Self { bone, versions, last, last_cut } = self;
        let [nx, ny, nz] = bone.dims();
        let edge = BRICK as i32 * bone.cut_nodes();
        let mut now = vec![0; edge.pow(3) as usize];
        let (mut changes, mut cuts) = (Vec::new(), Vec::new());
        bone.changed(versions, usize::MAX, |brick| {
            let [x, y, z] = brick.map(|b| b * BRICK);
            let voxels = || places([z, y, x], [nz, ny, nx]);
            let at_start =
                || voxels().map(|(k, j, i)| bone.scanned(IVec3::from([i, j, k].map(|n| n as i32)))).collect();
            let last = last.entry(brick).or_insert_with(at_start);
            for ((k, j, i), was) in voxels().zip(last) {
                let at = IVec3::new(i as i32, j as i32, k as i32);
                let after = bone.ct(at);
                if *was != after {
                    let before = std::mem::replace(was, after);
                    changes.push(SceneChange { at: at.to_array().map(|n| n as u16), before, after });
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
                let before = std::mem::replace(was, after);
                cuts.push(SceneChange { at: at.to_array().map(|n| n as u16), before, after });
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
mod tests {
    use super::*;
    use trepan_bone::CUT_SURFACE;
    use trepan_geometry::{Pose, ToolState};
    use trepan_stages::haptic_tick::ToolSample;
    use trepan_stages::program::Program;
    use trepan_volume::{AIR_HU, VoxelVolume};

    /// Returns the view of a tool at the origin.
    fn view(time_ms: f64) -> View {
        let tool = Program::Craniotomy.tray()[0];
        let sample = ToolSample {
            tick: 0,
            state: ToolState::at(Pose::IDENTITY),
            tool,
            slot: 0,
            drilling: false,
            second: None,
            idle: false,
        };
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
        let mut filming = Filming::new(Some(carved.clone()), vec![Vec3::ZERO], Some(1000.0));
        let mut shots = Vec::new();
        let mut random = fastrand::Rng::with_seed(7);
        let mut states = Vec::new();
        for ms in 0..1000 {
            let place = IVec3::new(random.i32(0..19), random.i32(0..17), random.i32(0..11));
            carved.set_hu(place, if ms % 3 == 0 { 700 } else { AIR_HU });
            assert!(carved.cut_writer().set(2 * place, random.i16(0..CUT_SURFACE)));
            let taken = filming.next_ms <= f64::from(ms);
            let brain = [Vec3::splat(0.1 * ms as f32); 2];
            let fills = [1000 - ms as u16, if ms < 500 { 7 } else { 0 }];
            let splits = [Split { corner: 2, from: 0, node: 1 }];
            let (brain, splits) = if ms < 700 { (&brain[..1], &splits[..0]) } else { (&brain[..], &splits[..]) };
            shots.extend(filming.tick(view(ms.into()), ms == 999, || Some((brain, &fills, splits))));
            if taken || ms == 999 {
                states.push(state(&carved));
            }
        }
        assert!(shots.len() == states.len() && (30..33).contains(&shots.len()), "{}", shots.len());
        for (shot, state) in shots.iter().zip(&states) {
            assert!(shot.write(&shown, true) > 0);
            assert!(self::state(&shown) == *state);
        }
        for shot in shots.iter().rev() {
            shot.write(&shown, false);
        }
        assert!(state(&shown) == state(&made(&volume)));
        let gone: Vec<_> =
            shots.iter().flat_map(|shot| shot.gone.iter().map(|tet| (*tet, shot.view.time_ms))).collect();
        assert!(matches!(gone[..], [(1, ms)] if (500.0..540.0).contains(&ms)), "once: {gone:?}");
        let cut: Vec<_> = shots.iter().filter(|shot| !shot.splits.is_empty()).collect();
        assert!(cut.len() == 1 && cut[0].nodes.as_ref().is_some_and(|nodes| nodes.len() == 2));
        let last = shots.last().and_then(|shot| shot.nodes.clone()).unwrap();
        assert!(position(Vec3::ZERO, last[0]).distance(Vec3::splat(99.9)) < NODE_STEP_MM);
    }

    #[test]
    fn a_warning_has_a_shot_of_its_own() {
        let mut filming = Filming::new(None, Vec::new(), Some(1000.0));
        let mut of = |ms: u32| {
            let warnings = u32::from((13..20).contains(&ms));
            filming.tick(View { warnings, ..view(ms.into()) }, false, || None)
        };
        let shots: Vec<_> = (0..30).filter_map(&mut of).map(|shot| (shot.view.time_ms, shot.view.warnings)).collect();
        assert_eq!(shots, [(0.0, 0), (13.0, 1), (20.0, 0)]);
    }

    #[test]
    fn long_films_hold_fewer_brains() {
        let mut filming = Filming::new(None, Vec::new(), Some(3.6e6));
        let shots = (0..10_000).filter_map(|ms| filming.tick(view(ms.into()), false, || Some((&[], &[], &[]))));
        let kept: Vec<bool> = shots.map(|shot| shot.nodes.is_some()).collect();
        assert!(kept.len() > 280 && kept.iter().filter(|kept| **kept).count() == 10, "{}", kept.len());
    }
}
