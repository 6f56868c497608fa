//! A tool that cuts with its side: balls along the shaft, each a tool of its own for whatever
//! method is used.
//!
//! # Theory
//! Station i stands `sᵢ` above the tip on the shaft and has its own proxy, which lies `oᵢ` from
//! where the hand holds it. The hand feels
//! ```text
//! o = Σ |oᵢ| oᵢ / Σ |oᵢ|         |o| ≤ max |oᵢ|, continuous where a station begins to touch
//! ```
//! so that a chain is no stiffer than its balls. The lowest station is blunt: it holds the tool
//! back where the bone is not open below it. The others cut with the load of their own depth, each
//! with the part of the shaft half way to the next: a flat slot.
//!
//! ```text
//!  ║(·)║  cutting_mm above the tip
//!  ║(·)║     1.4 radii apart
//!  ║(·)║
//!   (·)   tip: blunt
//! ```
//!
//! # Practice
//! Costs as many ticks of the method as stations lie in bone; those in the air cost next to
//! nothing. The picture's proxy is moved, not turned.
//!
//! # When not to use it
//! For torque: a chain turns freely.

use crate::removal::RemovalLaw;
use crate::{RigidContact, RigidStep};
use trepan_bone::BoneVolume;
use trepan_contact::Contact;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};

/// Distance between stations, radii.
const APART: f32 = 1.4;
/// Most stations.
const MOST: usize = 32;

/// Balls along a shaft.
pub(crate) struct Chain {
    /// Height above the tip, mm, and what touches there; the lowest first.
    stations: Vec<(f32, Box<dyn RigidContact>)>,
    proxy: Pose,
    each: RigidStep,
}

impl Chain {
    /// The stations of a tool that cuts along its shaft, each made for its ball by `build`.
    pub fn new(tool: &Tool, build: impl Fn(&Tool) -> Box<dyn RigidContact>) -> Self {
        let count = ((tool.cutting_mm / (APART * tool.tip_radius_mm.max(1e-3))) as usize + 1).clamp(2, MOST);
        let height = |at: usize| tool.cutting_mm * at as f32 / (count - 1) as f32;
        // Each cuts the part of the shaft half way to the next.
        let ball = Tool { cutting_mm: height(1) - height(0), ..*tool };
        let stations = (0..count).map(|at| (height(at), build(&ball))).collect();
        Self { stations, proxy: Pose::IDENTITY, each: RigidStep::default() }
    }
}

/// A pose moved along its own shaft.
fn raised(pose: Pose, height_mm: f32) -> Pose {
    Pose { translation: pose.translation + pose.rotation * (height_mm * Vec3::Z), ..pose }
}

impl RigidContact for Chain {
    fn step(&mut self, bone: &BoneVolume, tool: &ToolState, drilling: bool, dt_ms: f32, out: &mut RigidStep) {
        out.clear();
        out.spindle_rpm = f32::INFINITY;
        let (mut offset, mut weight, mut foremost) = (Vec3::ZERO, 0.0, (0.0, Vec3::ZERO));
        for (at, (height_mm, contact)) in self.stations.iter_mut().enumerate() {
            let held = ToolState { world_from_tool: raised(tool.world_from_tool, *height_mm), ..*tool };
            let each = &mut self.each;
            contact.step(bone, &held, drilling && at > 0, dt_ms, each);
            out.removed_mm3 += each.removed_mm3;
            out.broke_through |= each.broke_through;
            out.points_in_contact += each.points_in_contact;
            out.voxels_in_contact += each.voxels_in_contact;
            out.voxels_swept += each.voxels_swept;
            out.fallbacks += each.fallbacks;
            let depth_mm = each.manifold.depth_mm;
            if depth_mm > 0.0 {
                offset += depth_mm * depth_mm * each.manifold.normal;
                weight += depth_mm;
                foremost = if depth_mm > foremost.0 { (depth_mm, each.manifold.point) } else { foremost };
                out.spindle_rpm = if at > 0 { out.spindle_rpm.min(each.spindle_rpm) } else { out.spindle_rpm };
            }
        }
        if !out.spindle_rpm.is_finite() {
            out.spindle_rpm = 0.0;
        }
        let offset = if weight > 0.0 { offset / weight } else { Vec3::ZERO };
        if let Some(normal) = offset.try_normalize() {
            out.manifold.set_single(Contact { point: foremost.1, normal, depth_mm: offset.length() });
        }
        if tool.is_finite() {
            let translation = tool.world_from_tool.translation + offset;
            self.proxy = Pose { translation, ..tool.world_from_tool };
        }
    }

    fn proxy(&self) -> Pose {
        self.proxy
    }

    fn reset(&mut self, pose: Pose) {
        self.proxy = pose;
        self.stations.iter_mut().for_each(|(height_mm, contact)| contact.reset(raised(pose, *height_mm)));
    }

    fn cut_by(&mut self, law: RemovalLaw) {
        self.stations.iter_mut().for_each(|(_, contact)| contact.cut_by(law));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Method;
    use glam::IVec3;
    use trepan_volume::VoxelVolume;

    /// Bone 6 mm thick below z = 0, open where x < -4.
    fn plate() -> BoneVolume {
        let n = 64;
        let mut ct = VoxelVolume::isotropic([n; 3], Vec3::splat(-15.75), 0.5, -1000i16);
        for at in 0..ct.data.len() {
            let place = [at % n, at / n % n, at / (n * n)].map(|i| -15.75 + 0.5 * i as f32);
            let depth = (-place[2]).min(place[2] + 6.0).min(place[0] + 4.0);
            ct.data[at] = (400.0 + 2000.0 * depth).clamp(-1000.0, 1400.0) as i16;
        }
        BoneVolume::new(&ct, 400).expect("there is bone")
    }

    fn at(x: f32) -> ToolState {
        ToolState::at(Pose::from_translation(Vec3::new(x, 0.0, -7.5)))
    }

    #[test]
    fn a_craniotome_mills_a_slot_of_its_width_and_is_held_back_when_it_rests() {
        let bone = plate();
        let tool = Tool::craniotome();
        let mut chain = Method::RECOMMENDED.build(&tool);
        chain.reset(at(-8.0).world_from_tool);
        let mut out = RigidStep::default();
        for step in 0..200 {
            chain.step(&bone, &at(-8.0 + 0.0225 * step as f32), false, 1.0, &mut out);
        }
        // Held back at x = -5.2, one radius before the bone; the hand is at -3.5.
        assert!((chain.proxy().translation.x + 5.2).abs() < 0.15, "{:?}", chain.proxy());
        assert!((out.manifold.depth_mm - 1.7).abs() < 0.2 && out.manifold.normal.x < -0.95, "{}", out.manifold.normal);
        let mut removed = 0.0;
        for step in 0..12_000 {
            chain.step(&bone, &at(-3.5 + 0.0005 * step as f32), true, 1.0, &mut out);
            removed += out.removed_mm3;
        }
        let reached = chain.proxy().translation.x;
        assert!(reached > 0.5, "{reached}");
        // A slot from x = -4 to the round end, 2.4 wide, 6 deep.
        let area = 2.4 * (reached + 4.0) + 0.5 * std::f32::consts::PI * 1.44;
        assert!((removed / (6.0 * area) - 1.0).abs() < 0.12, "{removed} of {}", 6.0 * area);
        for z in [-5, -3, -1] {
            let voxel = |y: f32| bone.voxel_of(Vec3::new(-1.0, y, z as f32));
            assert!(!bone.is_bone(voxel(0.0)) && bone.is_bone(voxel(2.0)) && bone.is_bone(voxel(-2.0)));
        }
    }

    #[test]
    fn its_blunt_tip_does_not_drill() {
        let bone = plate();
        let before = bone.snapshot();
        let mut chain = Method::RECOMMENDED.build(&Tool::craniotome());
        let over = |z: f32| ToolState::at(Pose::from_translation(Vec3::new(5.0, 0.0, z)));
        chain.reset(over(3.0).world_from_tool);
        let mut out = RigidStep::default();
        (0..600).for_each(|step| chain.step(&bone, &over(3.0 - 0.005 * step as f32), true, 1.0, &mut out));
        assert!((chain.proxy().translation.z - 1.2).abs() < 0.1, "{:?}", chain.proxy());
        assert_eq!(bone.snapshot(), before);
        assert!(!bone.is_bone(IVec3::splat(-9)));
    }
}
