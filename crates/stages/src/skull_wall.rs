//! The inside of the skull as a wall along which the brain slides.
//!
//! # Theory
//! The wall is the zero level of the signed distance to the bone before the operation, on a grid
//! around the brain. It is absent where the burr has opened the skull: where there was bone behind
//! the nearest point of the wall and it is now gone. Where the skull never had dense bone (thin
//! bone, foramina) the wall remains. Testing only the present bone there would change its answer
//! with every breathing motion of the brain. A node that the wall supports when its bone is
//! removed, or that slides past the rim of the opening, is released gradually: its contact plane
//! recedes, at most by 0.005 mm per collision step, until the node no longer follows.
//!
//! ```text
//! hollow  φ > 0     x  node     s  point of the wall     0.5, 1, 2 mm behind s: is bone gone?
//! ```
//!
//! # Practice
//! The bone is read only while a tool for the brain is used, when nothing is carved, so that a step
//! depends on its inputs alone. While a tool for bone is used again, the wall stays as last read:
//! the brain that lies on it must not sink in and be pushed out later. About 30 ns per border
//! node of the brain.

use glam::IVec3;
use rayon::prelude::*;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_contact::NodalContacts;
use trepan_deformable::{BorderNode, ConfigError, Hollow, SlidingWall};
use trepan_geometry::Vec3;
use trepan_mesh::TetMesh;
use trepan_volume::{DistanceField, VoxelVolume};

/// Spacing of the grid, mm.
const SPACING_MM: f32 = 1.5;
/// Margin of the grid around the brain, mm.
const MARGIN_MM: f32 = 8.0;
/// Distance from the wall beyond which a node cannot reach it before the next collision result, mm.
const NEAR_MM: f32 = 0.5;
/// Depths behind the wall at which bone is looked up, mm, the likeliest first.
const BEHIND_MM: [f32; 3] = [1.0, 2.0, 0.5];

/// Recession of the wall from a released node in the first collision step, mm.
const FIRST_MM: f32 = 1e-4;
/// Increase of the recession per collision step, as a share of the recession so far.
const GROWTH: f32 = 0.02;
/// Gap over which a node has detached from the receding wall, mm. One that the wall still supports
/// comes off it by thousandths for a step, where the wall is curved.
const DETACHED_MM: f32 = 0.05;
/// Largest recession in a collision step, mm.
const FASTEST_MM: f32 = 5e-3;

/// The wall and the bone behind it.
pub struct SkullWall {
    wall: SlidingWall,
    field: DistanceField,
    bone: Arc<BoneVolume>,
    /// The bone before the operation.
    before: BoneMask,
    /// Recession of the wall from each node when the bone was last read, mm; infinite where there
    /// is no wall.
    receded_mm: Vec<f32>,
}

/// Bone voxels of a volume at one time, a bit each.
struct BoneMask {
    dims: [usize; 3],
    bits: Vec<u64>,
}

impl BoneMask {
    fn of(bone: &BoneVolume) -> Self {
        let dims = bone.dims();
        let mut bits = vec![0u64; (dims[0] * dims[1] * dims[2]).div_ceil(64)];
        let [nx, ny, nz] = dims;
        let place = |at: usize| IVec3::from([at % nx, at / nx % ny, at / (nx * ny)].map(|n| n as i32));
        bits.par_iter_mut().enumerate().for_each(|(word, bits)| {
            let voxels = 64 * word..(64 * word + 64).min(nx * ny * nz);
            *bits = voxels.fold(0, |bits, at| bits | u64::from(bone.is_bone(place(at))) << (at % 64));
        });
        Self { dims, bits }
    }

    fn has(&self, voxel: IVec3) -> bool {
        let inside = voxel.to_array().into_iter().zip(self.dims).all(|(i, n)| (0..n as i32).contains(&i));
        let at = || voxel.x as usize + self.dims[0] * (voxel.y as usize + self.dims[1] * voxel.z as usize);
        inside && self.bits[at() / 64] >> (at() % 64) & 1 == 1
    }
}

impl SkullWall {
    /// Makes the wall around a brain at rest in an intact skull; `fixed` nodes do not move.
    pub fn new(bone: Arc<BoneVolume>, brain: &TetMesh, fixed: &[u32]) -> Result<Self, ConfigError> {
        let bounds = brain.bounds();
        let low = bounds.min - MARGIN_MM;
        let dims = (bounds.size() + 2.0 * MARGIN_MM).to_array().map(|mm| (mm / SPACING_MM) as usize + 1);
        let mut mask = VoxelVolume::isotropic(dims, low, SPACING_MM, 0u8);
        mask.data.par_iter_mut().enumerate().for_each(|(at, value)| {
            let voxel = [at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])];
            let world = low + SPACING_MM * Vec3::from_array(voxel.map(|i| i as f32));
            *value = u8::from(bone.is_bone(bone.voxel_of(world)));
        });
        let field = DistanceField::of_mask(&mask);
        let mut wall = SlidingWall::around(brain, fixed)?;
        wall.ahead_mm = NEAR_MM;
        wall.rest_in(&brain.positions, |p| (field.sample(p), Vec3::ZERO));
        Ok(Self { wall, field, before: BoneMask::of(&bone), bone, receded_mm: vec![0.0; brain.positions.len()] })
    }

    /// Distance of a place to the wall at rest, mm; negative in bone.
    pub fn gap_mm(&self, place: Vec3) -> f32 {
        self.field.sample(place)
    }

    /// The nodes that may meet the wall.
    pub fn border(&self) -> &[BorderNode] {
        self.wall.border()
    }

    /// Adds the contact planes of nodes near the wall. `reads_bone`: nothing is carved, so openings
    /// may be searched.
    pub fn press(&mut self, positions: &[Vec3], reads_bone: bool, out: &mut NodalContacts) {
        let Self { wall, field, bone, before, receded_mm } = self;
        wall.step(positions, Carved { field, bone, before, receded_mm, reads_bone }, out);
    }
}

/// The inside of the skull with its openings.
struct Carved<'a> {
    field: &'a DistanceField,
    bone: &'a BoneVolume,
    before: &'a BoneMask,
    receded_mm: &'a mut [f32],
    reads_bone: bool,
}

impl Hollow for Carved<'_> {
    fn distance(&mut self, place: Vec3) -> (f32, Vec3) {
        let phi = self.field.sample(place);
        (phi, if phi < NEAR_MM { self.field.gradient(place) } else { Vec3::ZERO })
    }

    fn recession_mm(&mut self, node: u32, depth_mm: f32, place: Vec3, outward: Vec3) -> Option<f32> {
        let back_mm = &mut self.receded_mm[node as usize];
        if self.reads_bone {
            let behind = BEHIND_MM.map(|mm| self.bone.voxel_of(place + mm * outward));
            let is_bone = behind.iter().any(|voxel| self.bone.is_bone(*voxel));
            let there = is_bone || !behind.iter().any(|voxel| self.before.has(*voxel));
            // A node that left through the opening is not caught by its rim.
            *back_mm = match there && (*back_mm == 0.0 || depth_mm <= 0.0) {
                true => 0.0,
                false if depth_mm > *back_mm - DETACHED_MM => *back_mm + (FIRST_MM + GROWTH * *back_mm).min(FASTEST_MM),
                false => f32::INFINITY,
            };
        }
        back_mm.is_finite().then_some(*back_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_soft::boxes;

    /// Makes a cube of brain of 20 mm, 1 mm from walls of bone 6 mm thick.
    fn boxed() -> (Arc<BoneVolume>, TetMesh) {
        let mut volume = VoxelVolume::isotropic([68; 3], Vec3::splat(-16.75), 0.5, 0i16);
        for at in 0..volume.data.len() {
            let place = [at % 68, at / 68 % 68, at / (68 * 68)].map(|i| (-16.75 + 0.5 * i as f32).abs());
            volume.data[at] = if place.iter().any(|x| *x > 11.0) { 1000 } else { 0 };
        }
        let mut brain = boxes::split_box([4; 3], Vec3::splat(20.0));
        brain.positions.iter_mut().for_each(|p| *p -= 10.0);
        (Arc::new(BoneVolume::new(&volume, 300).unwrap()), brain)
    }

    #[test]
    fn the_brain_is_supported_by_bone_and_not_by_the_opening() {
        let (bone, brain) = boxed();
        let mut wall = SkullWall::new(Arc::clone(&bone), &brain, &[]).unwrap();
        let mut pushed = |by: Vec3, reads_bone: bool| -> Vec3 {
            let at: Vec<Vec3> = brain.positions.iter().map(|p| *p + by).collect();
            let mut out = NodalContacts::none();
            wall.press(&at, reads_bone, &mut out);
            out.all().map(|c| -c.normal * c.pressure_n(c.mean(|n| at[n as usize]), Vec3::ZERO)).sum()
        };
        assert_eq!(pushed(Vec3::ZERO, true), Vec3::ZERO);
        let (up, down) = (pushed(Vec3::Z * 2.0, true), pushed(Vec3::Z * -2.0, true));
        assert!(up.z < -0.5 && up.truncate().length() < 0.05 * -up.z, "{up}");
        assert!(down.z > 0.5, "{down}");
        for (k, j, i) in (50..68).flat_map(|k| (0..68).flat_map(move |j| (0..68).map(move |i| (k, j, i)))) {
            bone.set_hu(IVec3::new(i, j, k), 0);
        }
        assert_eq!(pushed(Vec3::Z * 2.0, false), up, "the wall stands as it was read last");
        // The nodes are 0.75 mm deep and the wall recedes by at most 0.005 mm in a step: by 0.7% of
        // the force.
        let let_go: Vec<f32> = (0..500).map(|_| -pushed(Vec3::Z * 2.0, true).z).collect();
        assert_eq!(let_go[499], 0.0, "the opening holds nothing in the end");
        let steps = std::iter::once(-up.z).chain(let_go.iter().copied()).zip(&let_go);
        assert!(steps.into_iter().all(|(before, after)| *after <= before && before - after < -0.007 * up.z));
        assert_eq!(pushed(Vec3::Z * -2.0, true), down);
    }

    /// A node that comes off the receding wall for a step is not let go at once: the pressure
    /// behind it would throw it out.
    #[test]
    fn a_node_that_comes_off_the_receding_wall_for_a_step_is_still_supported() {
        let (bone, brain) = boxed();
        let mut wall = SkullWall::new(Arc::clone(&bone), &brain, &[]).unwrap();
        for (k, j, i) in (50..68).flat_map(|k| (0..68).flat_map(move |j| (0..68).map(move |i| (k, j, i)))) {
            bone.set_hu(IVec3::new(i, j, k), 0);
        }
        let middle = brain.positions.iter().position(|p| *p == 10.0 * Vec3::Z).unwrap();
        let mut pushed_n = |up_mm: f32| -> f32 {
            let at: Vec<Vec3> = brain.positions.iter().map(|p| *p + up_mm * Vec3::Z).collect();
            let mut out = NodalContacts::none();
            wall.press(&at, true, &mut out);
            let own = out.planes().iter().find(|plane| plane.node as usize == middle);
            own.map_or(0.0, |plane| plane.stiffness * plane.depth_mm(at[middle]).max(0.0))
        };
        // The wall is 1.25 mm above the middle of the brain's top.
        let before = (0..20).map(|_| pushed_n(1.3)).fold(f32::MAX, f32::min);
        assert!(before > 0.0 && pushed_n(1.249) == 0.0);
        let after = pushed_n(1.3);
        assert!(after > 0.9 * before, "{after} N after {before} N");
        assert_eq!((pushed_n(1.1), pushed_n(1.3)), (0.0, 0.0), "detached by more, it is free");
    }
}
