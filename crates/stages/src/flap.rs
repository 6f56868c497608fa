//! The bone flap: detects when it is cut free, lifts it and puts it back.
//!
//! # Practice
//! After each stroke of a cutting tool a flood fill starts in the middle of the planned flap. It
//! visits a few hundred voxels per tick while nothing cuts ([`FlapSearch`]). Where no flap is
//! planned it starts below the tool when asked to lift, and a free piece is lifted. Lifting and
//! putting back write a fixed number of voxels per tick. Everything depends on the ticks alone, so
//! a replay lifts the same voxels. Bone under the isovalue at the flap's rim is not lifted. What
//! the CT shows in the cut beside the flap goes with it: else the density between the two would
//! leave a thin wall.

use crate::notice::{Hindrance, What};
use glam::IVec3;
use trepan_bone::{BoneVolume, FlapSearch, FlapState};
use trepan_geometry::{Buttons, Vec3};
use trepan_volume::AIR_HU;

/// Voxels visited by the flood fill in a tick: some 15 us.
const FLOODED: usize = 300;
/// Voxels written in a tick.
const WRITTEN: usize = 256;

/// State of the flap.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    /// Attached to the skull.
    Skull,
    /// The flood fill runs.
    Searched,
    /// Cut free, in its place.
    Cut,
    /// Being lifted; the number of removed voxels.
    Lifting(usize),
    /// Lifted.
    Away,
    /// Being put back; the number of restored voxels.
    Returning(usize),
}

/// Where the flap is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FlapPlace {
    /// Attached to the skull, or not known to be free.
    #[default]
    Attached,
    /// Cut free, in its place or moving.
    Free,
    /// Lifted.
    Away,
}

/// A voxel that went with the flap.
#[derive(Clone, Copy, Debug)]
struct Lifted {
    voxel: IVec3,
    hu: i16,
}

/// The flap of an operation.
#[derive(Clone, Debug)]
pub struct Flap {
    search: FlapSearch,
    planned: bool,
    at: State,
    lifted: Vec<Lifted>,
    stroke: bool,
    was_requested: bool,
    reported: bool,
}

impl Flap {
    /// Makes a flap attached to the skull, `planned` or to be chosen by the tool; allocates all
    /// memory.
    pub fn new(search: FlapSearch, planned: bool) -> Self {
        Self {
            search,
            planned,
            at: State::Skull,
            lifted: Vec::with_capacity(1 << 20),
            stroke: false,
            was_requested: false,
            reported: false,
        }
    }

    /// Whether it is lifted.
    pub fn is_away(&self) -> bool {
        self.at == State::Away
    }

    /// Where it is.
    pub fn place(&self) -> FlapPlace {
        match self.at {
            State::Skull | State::Searched => FlapPlace::Attached,
            State::Cut | State::Lifting(_) | State::Returning(_) => FlapPlace::Free,
            State::Away => FlapPlace::Away,
        }
    }

    /// Whether it is being lifted or put back: no stroke can be undone meanwhile.
    pub fn moves(&self) -> bool {
        matches!(self.at, State::Lifting(_) | State::Returning(_))
    }

    /// Starts a new search after bone was restored: the flap may be attached again.
    pub fn bone_came_back(&mut self) {
        self.stroke = true;
        if matches!(self.at, State::Searched | State::Cut) {
            self.at = State::Skull;
        }
    }

    /// Takes over a flap of the same bone that was lifted elsewhere: takes these voxels away, with
    /// what was there, HU. Without any it looks whether it is free. Not for a tick.
    pub fn restore(&mut self, bone: &BoneVolume, lifted: &[(IVec3, i16)]) {
        self.stroke = true;
        if lifted.is_empty() {
            return;
        }
        self.search.restart();
        self.search.step(bone, usize::MAX);
        for &(voxel, hu) in lifted.iter().take(self.lifted.capacity()) {
            self.lifted.push(Lifted { voxel, hu: bone.ct(voxel) });
            bone.set_hu(voxel, hu);
        }
        (self.at, self.reported) = (State::Away, true);
    }

    /// Runs a tick, after the contact with bone; returns a notice. `cut`: bone was removed in this
    /// tick, `hinders`: why the flap cannot be moved now, `below`: ends of the line below the tool.
    pub fn tick(
        &mut self,
        bone: &BoneVolume,
        buttons: Buttons,
        (drilling, cut): (bool, bool),
        hinders: Option<Hindrance>,
        below: [Vec3; 2],
    ) -> Option<What> {
        let pressed = buttons.has(Buttons::FLAP);
        let before = std::mem::replace(&mut self.was_requested, pressed);
        let hinders = hinders.or(self.moves().then_some(Hindrance::FlapMoves));
        let refused = hinders.filter(|_| pressed && !before).map(What::FlapWaits);
        let requested = pressed && !before && hinders.is_none();
        if requested && !self.planned && matches!(self.at, State::Skull | State::Searched | State::Cut) {
            self.search.seed(bone, below[0], below[1]);
            self.at = State::Searched;
            return None;
        }
        self.advance(bone, (drilling, cut), requested).or(refused)
    }

    fn advance(&mut self, bone: &BoneVolume, (drilling, cut): (bool, bool), requested: bool) -> Option<What> {
        self.stroke |= cut;
        match self.at {
            State::Skull | State::Searched | State::Cut if drilling => {
                self.at = if self.at == State::Cut && !cut { State::Cut } else { State::Skull };
                None
            }
            State::Skull if self.stroke && self.planned => {
                self.stroke = false;
                self.search.restart();
                self.at = State::Searched;
                None
            }
            State::Skull => requested.then_some(What::FlapHangs),
            State::Searched => self.look(bone, requested),
            State::Cut if requested => {
                self.lifted.clear();
                self.at = State::Lifting(0);
                None
            }
            State::Cut => None,
            State::Lifting(done) => self.lift(bone, done),
            State::Away => {
                self.at = if requested { State::Returning(0) } else { State::Away };
                None
            }
            State::Returning(done) => self.put_back(bone, done),
        }
    }

    fn mm3(&self, bone: &BoneVolume) -> f32 {
        self.search.voxels() as f32 * bone.voxel_mm3()
    }

    fn look(&mut self, bone: &BoneVolume, requested: bool) -> Option<What> {
        match self.search.step(bone, FLOODED) {
            FlapState::NotYet => None,
            FlapState::Hanging => {
                (self.at, self.reported) = (State::Skull, false);
                if self.planned { requested.then_some(What::FlapHangs) } else { Some(What::PieceHangs) }
            }
            FlapState::Free if !self.planned => {
                self.lifted.clear();
                self.at = State::Lifting(0);
                None
            }
            FlapState::Free => {
                self.at = State::Cut;
                (!std::mem::replace(&mut self.reported, true)).then(|| What::FlapFree(self.mm3(bone)))
            }
        }
    }

    fn lift(&mut self, bone: &BoneVolume, done: usize) -> Option<What> {
        let all = self.search.voxels();
        let end = (done + WRITTEN).min(all);
        for at in done..end {
            let voxel = self.search.voxel(at);
            self.take(bone, voxel);
            for beside in (0..27).map(|n| voxel + IVec3::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)) {
                if bone.ct(beside) >= bone.isovalue() && !bone.is_bone(beside) {
                    self.take(bone, beside);
                }
            }
        }
        let whole = end == all || self.lifted.len() == self.lifted.capacity();
        self.at = if whole { State::Away } else { State::Lifting(end) };
        whole.then(|| What::FlapLifted(self.mm3(bone)))
    }

    fn take(&mut self, bone: &BoneVolume, voxel: IVec3) {
        if self.lifted.len() < self.lifted.capacity() {
            self.lifted.push(Lifted { voxel, hu: bone.ct(voxel) });
            bone.set_hu(voxel, AIR_HU);
        }
    }

    fn put_back(&mut self, bone: &BoneVolume, done: usize) -> Option<What> {
        let end = (done + WRITTEN).min(self.lifted.len());
        self.lifted[done..end].iter().for_each(|lifted| bone.set_hu(lifted.voxel, lifted.hu));
        bone.came_back();
        let whole = end == self.lifted.len();
        self.at = if whole { State::Cut } else { State::Returning(end) };
        whole.then_some(What::FlapReturned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_volume::VoxelVolume;

    #[test]
    fn without_a_plan_the_free_piece_below_the_tool_is_lifted() {
        let mut ct = VoxelVolume::isotropic([60, 60, 8], Vec3::ZERO, 1.0, AIR_HU);
        ct.data[60 * 60 * 2..60 * 60 * 6].fill(900);
        for at in (0..ct.data.len()).filter(|at| (at % 60).abs_diff(40).max((at / 60 % 60).abs_diff(30)) == 5) {
            ct.data[at] = AIR_HU;
        }
        let bone = BoneVolume::new(&ct, 400).unwrap();
        let above = |x: f32| Vec3::new(x, 30.0, 9.0);
        let [from, to] = [above(30.0), above(30.0) - 9.0 * Vec3::Z];
        let mut flap = Flap::new(FlapSearch::new(&bone, above(30.0), 25.0, from, to), false);
        let mut asks = |x: f32| {
            let below = [above(x), above(x) - 9.0 * Vec3::Z];
            let mut tick = |buttons| flap.tick(&bone, buttons, (false, false), None, below);
            let first = tick(Buttons::FLAP);
            let later: Vec<What> = first.into_iter().chain((0..200).filter_map(|_| tick(Buttons(0)))).collect();
            later
        };
        assert_eq!(asks(30.0), [What::PieceHangs]);
        assert_eq!(asks(40.0), [What::FlapLifted((9 * 9 * 4) as f32)]);
        assert!(!bone.is_bone(IVec3::new(40, 30, 4)) && bone.is_bone(IVec3::new(30, 30, 4)));
        assert_eq!(asks(30.0), [What::FlapReturned]);
        assert!(bone.is_bone(IVec3::new(40, 30, 4)));
    }

    #[test]
    fn a_flap_is_found_lifted_and_put_back_voxel_by_voxel() {
        let mut ct = VoxelVolume::isotropic([60, 60, 8], Vec3::ZERO, 1.0, AIR_HU);
        ct.data[60 * 60 * 2..60 * 60 * 6].iter_mut().enumerate().for_each(|(at, hu)| *hu = 900 + (at % 77) as i16);
        let bone = BoneVolume::new(&ct, 400).unwrap();
        let middle = Vec3::new(30.0, 30.0, 4.0);
        let search = FlapSearch::new(&bone, middle, 25.0, middle + 6.0 * Vec3::Z, middle - 6.0 * Vec3::Z);
        let mut flap = Flap::new(search, true);
        let run = |flap: &mut Flap, ticks: usize, buttons, drilling: bool, cut| {
            (0..ticks)
                .filter_map(|_| {
                    let hinders = drilling.then_some(Hindrance::Pedal);
                    flap.tick(&bone, buttons, (drilling, cut), hinders, [middle; 2])
                })
                .collect::<Vec<_>>()
        };
        let none = Buttons(0);
        assert_eq!(run(&mut flap, 5, Buttons::FLAP, false, false), [What::FlapHangs]);
        for (x, y) in (0..60).flat_map(|x| (0..60).map(move |y| (x, y))) {
            let far = (x - 30i32).abs().max((y - 30i32).abs());
            if far == 12 {
                (2..6).for_each(|z| bone.set_hu(IVec3::new(x, y, z), AIR_HU));
            }
        }
        assert_eq!(run(&mut flap, 3, Buttons::PEDAL, true, true), []);
        let mm3 = (23 * 23 * 4) as f32;
        assert_eq!(flap.place(), FlapPlace::Attached);
        assert_eq!(run(&mut flap, 40, none, false, false), [What::FlapFree(mm3)]);
        assert_eq!(flap.place(), FlapPlace::Free);
        let cut = bone.snapshot();
        assert_eq!(run(&mut flap, 20, Buttons::FLAP, false, false), [What::FlapLifted(mm3)]);
        assert_eq!(bone.undo_stroke(), trepan_bone::Undone::Nothing, "the flap is no stroke");
        assert!(flap.place() == FlapPlace::Away && flap.is_away());
        assert!(!bone.is_bone(IVec3::new(30, 30, 4)) && bone.is_bone(IVec3::new(10, 30, 4)));
        run(&mut flap, 1, none, false, false);
        assert_eq!(run(&mut flap, 20, Buttons::FLAP, false, false), [What::FlapReturned]);
        assert_eq!(bone.undo_stroke(), trepan_bone::Undone::Nothing);
        assert_eq!(bone.snapshot(), cut);
        assert!(bone.undone() > 0, "who feels the bone must look anew");
        assert_eq!(run(&mut flap, 50, Buttons::PEDAL, true, true), [], "reported once");
        assert_eq!(run(&mut flap, 50, none, false, false), []);
    }
}
