//! The planned bone flap: found free after the stroke that frees it, lifted away and put back.
//!
//! # Practice
//! After each stroke of a cutting tool the bone in the middle of the flap is flooded, a few hundred
//! voxels a tick, while nothing cuts ([`FlapSearch`]). Lifting and putting back write as many
//! voxels a tick as fit beside the rest of it. All of it is a function of the ticks: a replay lifts
//! the same voxels. Bone of less than the isovalue at the flap's rim stays where it is.

use crate::stages::notice::What;
use trepan_geometry::Buttons;
use trepan_volume::{AIR_HU, BoneVolume, FlapSearch, FlapState};

/// Voxels flooded in a tick: some 15 us.
const FLOODED: usize = 300;
/// Voxels written in a tick.
const WRITTEN: usize = 256;

/// Where the flap is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum At {
    /// On the skull.
    Skull,
    /// Being looked at.
    Searched,
    /// Cut free, in its place.
    Cut,
    /// On its way out; so many voxels are gone.
    Lifting(usize),
    /// Away.
    Away,
    /// On its way back; so many voxels are back.
    Returning(usize),
}

/// The flap of one operation.
#[derive(Clone, Debug)]
pub(crate) struct Flap {
    search: FlapSearch,
    at: At,
    densities: Vec<i16>,
    stroke: bool,
    asked: bool,
    told: bool,
}

impl Flap {
    /// A flap that hangs on the skull. Takes all memory.
    pub fn new(search: FlapSearch) -> Self {
        Self { search, at: At::Skull, densities: Vec::with_capacity(1 << 20), stroke: false, asked: false, told: false }
    }

    /// Whether it is away.
    pub fn is_away(&self) -> bool {
        self.at == At::Away
    }

    /// Whether it is on its way: no stroke may come back then.
    pub fn moves(&self) -> bool {
        matches!(self.at, At::Lifting(_) | At::Returning(_))
    }

    /// Takes note of bone that came back: the flap may hang on the skull again.
    pub fn bone_came_back(&mut self) {
        self.stroke = true;
        if matches!(self.at, At::Searched | At::Cut) {
            self.at = At::Skull;
        }
    }

    /// One tick, after the bone was touched; `cut`: whether bone was removed in it, `free`: whether
    /// the tool touches nothing. Says what happened.
    pub fn tick(&mut self, bone: &BoneVolume, buttons: Buttons, drilling: bool, cut: bool, free: bool) -> Option<What> {
        let asks = buttons.has(Buttons::FLAP);
        let before = std::mem::replace(&mut self.asked, asks);
        let asked = asks && !before && free && !drilling;
        self.stroke |= cut;
        match self.at {
            At::Skull | At::Searched | At::Cut if drilling => {
                self.at = if self.at == At::Cut && !cut { At::Cut } else { At::Skull };
                None
            }
            At::Skull if self.stroke => {
                self.stroke = false;
                self.search.restart();
                self.at = At::Searched;
                None
            }
            At::Skull => asked.then_some(What::FlapHangs),
            At::Searched => self.look(bone, asked),
            At::Cut if asked => {
                self.densities.clear();
                self.at = At::Lifting(0);
                None
            }
            At::Cut => None,
            At::Lifting(done) => self.lift(bone, done),
            At::Away => {
                self.at = if asked { At::Returning(0) } else { At::Away };
                None
            }
            At::Returning(done) => self.put_back(bone, done),
        }
    }

    fn mm3(&self, bone: &BoneVolume) -> f32 {
        self.search.voxels() as f32 * bone.voxel_mm3()
    }

    fn look(&mut self, bone: &BoneVolume, asked: bool) -> Option<What> {
        match self.search.step(bone, FLOODED) {
            FlapState::NotYet => None,
            FlapState::Hanging => {
                (self.at, self.told) = (At::Skull, false);
                asked.then_some(What::FlapHangs)
            }
            FlapState::Free => {
                self.at = At::Cut;
                (!std::mem::replace(&mut self.told, true)).then(|| What::FlapFree(self.mm3(bone)))
            }
        }
    }

    fn lift(&mut self, bone: &BoneVolume, done: usize) -> Option<What> {
        let end = (done + WRITTEN).min(self.search.voxels()).min(self.densities.capacity());
        for at in done..end {
            let voxel = self.search.voxel(at);
            self.densities.push(bone.hu(voxel));
            bone.set_hu(voxel, AIR_HU);
        }
        let whole = end == self.search.voxels().min(self.densities.capacity());
        self.at = if whole { At::Away } else { At::Lifting(end) };
        whole.then(|| What::FlapLifted(self.mm3(bone)))
    }

    fn put_back(&mut self, bone: &BoneVolume, done: usize) -> Option<What> {
        let end = (done + WRITTEN).min(self.densities.len());
        (done..end).for_each(|at| bone.set_hu(self.search.voxel(at), self.densities[at]));
        bone.came_back();
        let whole = end == self.densities.len();
        self.at = if whole { At::Cut } else { At::Returning(end) };
        whole.then_some(What::FlapReturned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::IVec3;
    use trepan_geometry::Vec3;
    use trepan_volume::VoxelVolume;

    #[test]
    fn a_flap_is_found_lifted_and_put_back_voxel_by_voxel() {
        let mut ct = VoxelVolume::isotropic([60, 60, 8], Vec3::ZERO, 1.0, AIR_HU);
        ct.data[60 * 60 * 2..60 * 60 * 6].iter_mut().enumerate().for_each(|(at, hu)| *hu = 900 + (at % 77) as i16);
        let bone = BoneVolume::new(&ct, 400).unwrap();
        let middle = Vec3::new(30.0, 30.0, 4.0);
        let search = FlapSearch::new(&bone, middle, 25.0, middle + 6.0 * Vec3::Z, middle - 6.0 * Vec3::Z);
        let mut flap = Flap::new(search);
        let run = |flap: &mut Flap, ticks: usize, buttons, drilling, cut| {
            (0..ticks).filter_map(|_| flap.tick(&bone, buttons, drilling, cut, true)).collect::<Vec<_>>()
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
        assert_eq!(run(&mut flap, 40, none, false, false), [What::FlapFree(mm3)]);
        let cut = bone.snapshot();
        assert_eq!(run(&mut flap, 20, Buttons::FLAP, false, false), [What::FlapLifted(mm3)]);
        assert_eq!(bone.undo_stroke(), trepan_volume::Undone::Nothing, "the flap is no stroke");
        assert!(flap.is_away() && !bone.is_bone(IVec3::new(30, 30, 4)) && bone.is_bone(IVec3::new(10, 30, 4)));
        run(&mut flap, 1, none, false, false);
        assert_eq!(run(&mut flap, 20, Buttons::FLAP, false, false), [What::FlapReturned]);
        assert_eq!(bone.undo_stroke(), trepan_volume::Undone::Nothing);
        assert_eq!(bone.snapshot(), cut);
        assert!(bone.undone() > 0, "who feels the bone must look anew");
        assert_eq!(run(&mut flap, 50, Buttons::PEDAL, true, true), [], "told once");
        assert_eq!(run(&mut flap, 50, none, false, false), []);
    }
}
