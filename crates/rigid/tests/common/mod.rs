//! Synthetic bone with known truth.
#![allow(dead_code, reason = "each test file uses its share")]

use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Quat, ToolState, Vec3};
use trepan_rigid::{RigidContact, RigidStep};
use trepan_volume::VoxelVolume;

pub const ISO: i16 = 400;

/// Bone from a signed distance in mm (negative inside). The density is linear within one voxel of
/// the surface.
pub fn bone(dims: [usize; 3], spacing_mm: f32, distance: impl Fn(Vec3) -> f32) -> BoneVolume {
    scanned(dims, spacing_mm, |p| distance(p) / spacing_mm, 1.0)
}

/// Bone of at most `hu` from a signed distance in mm (negative inside), with the same slope at its
/// surface.
pub fn dense(dims: [usize; 3], spacing_mm: f32, hu: f32, distance: impl Fn(Vec3) -> f32) -> BoneVolume {
    bone(dims, spacing_mm, |p| distance(p).max((f32::from(ISO) - hu) * 1e-3 * spacing_mm))
}

/// Bone from a signed distance in voxels (negative inside), blurred linearly over `blur` voxels
/// either side.
pub fn scanned(dims: [usize; 3], spacing_mm: f32, voxels_out: impl Fn(Vec3) -> f32, blur: f32) -> BoneVolume {
    let origin = -0.5 * spacing_mm * Vec3::new(dims[0] as f32 - 1.0, dims[1] as f32 - 1.0, dims[2] as f32 - 1.0);
    let mut ct = VoxelVolume::isotropic(dims, origin, spacing_mm, 0i16);
    for at in 0..ct.data.len() {
        let voxel =
            Vec3::new((at % dims[0]) as f32, (at / dims[0] % dims[1]) as f32, (at / (dims[0] * dims[1])) as f32);
        let out = voxels_out(origin + spacing_mm * voxel);
        ct.data[at] = (f32::from(ISO) - 1000.0 * (out / blur).clamp(-1.0, 1.0)) as i16;
    }
    BoneVolume::new(&ct, ISO).expect("the scene has bone")
}

pub fn at(p: Vec3) -> ToolState {
    ToolState::at(Pose::from_translation(p))
}

/// Centre at `p`, shaft along `axis`.
pub fn held(p: Vec3, axis: Vec3) -> Pose {
    Pose::from_parts(p, Quat::from_rotation_arc(Vec3::Z, axis))
}

/// Steps along a straight line at `mm_per_tick`, with the shaft as the proxy has it, and returns
/// the last step.
pub fn walk(contact: &mut dyn RigidContact, bone: &BoneVolume, from: Vec3, to: Vec3, mm_per_tick: f32) -> RigidStep {
    let mut out = RigidStep::default();
    let ticks = (from.distance(to) / mm_per_tick).ceil().max(1.0) as usize;
    for t in 0..=ticks {
        let pose = Pose::from_parts(from.lerp(to, t as f32 / ticks as f32), contact.proxy().rotation);
        contact.step(bone, &ToolState::at(pose), false, 1.0, &mut out);
    }
    out
}

/// `count` directions spread evenly over the sphere.
pub fn directions(count: usize) -> Vec<Vec3> {
    trepan_geometry::Pointshell::sphere(1.0, count, trepan_geometry::Spread::Fibonacci).points
}
