//! Rays from the tool's points inwards: how far each point must go back along its normal until it
//! is out of the bone.
//!
//! # Theory
//! A point of the shell in bone marches along its inward normal nᵢ to where the density, trilinear
//! between voxels, falls to the isovalue; the way is its depth dᵢ.
//! ```text
//! n = Σ dᵢ nᵢ / |Σ dᵢ nᵢ| ,   d = max dᵢ (nᵢ·n)
//! ```
//!
//! # Practice
//! Steps of half a voxel, the last one by linear interpolation; 10 to 30 us. Sees below the voxel,
//! as the isosurface of the picture does.
//!
//! # Sources
//! A. Petersik et al., *Haptic volume interaction with anatomic models at sub-voxel resolution*,
//! HAPTICS 2002; D. Morris et al., *Visuohaptic simulation of bone surgery for training and
//! evaluation*, IEEE CG&A 26 (2006).
//!
//! # When not to use it
//! For a tool that is wholly in bone: the rays end at its centre, and there is no way out.

use super::frame::{Felt, PenaltyProbe, ball_shell, deepest, framed};
use crate::RigidStep;
use crate::method::Descriptor;
use crate::removal::RemovalLaw;
use trepan_contact::Contact;
use trepan_geometry::{Pointshell, Pose, Tool, Vec3};
use trepan_volume::BoneVolume;

struct Rays(Pointshell);

impl PenaltyProbe for Rays {
    fn feel(&mut self, bone: &BoneVolume, tool: &Tool, pose: &Pose, out: &mut RigidStep) -> Option<Felt> {
        let mut push = Vec3::ZERO;
        for (point, inward) in self.0.iter() {
            let point = pose.translation + point;
            let over = over_iso(bone, point);
            if over > 0.0 {
                let depth_mm = way_out(bone, point, inward, over, tool.tip_radius_mm, &mut out.voxels_swept);
                push += depth_mm * inward;
                out.points_in_contact += 1;
                out.manifold.push(Contact { point, normal: inward, depth_mm });
            }
        }
        out.voxels_swept += self.0.points.len() as u32;
        deepest(push, out)
    }
}

/// The way from `point`, which is `over` HU in bone, along `inward` to the isovalue, at most
/// `longest`, mm.
pub(crate) fn way_out(bone: &BoneVolume, point: Vec3, inward: Vec3, over: f32, longest: f32, visited: &mut u32) -> f32 {
    let step = 0.5 * bone.spacing_mm();
    let (mut way, mut before) = (0.0, over);
    while way < longest {
        *visited += 1;
        let now = over_iso(bone, point + (way + step) * inward);
        if now <= 0.0 {
            return (way + step * before / (before - now)).min(longest);
        }
        (way, before) = (way + step, now);
    }
    longest
}

/// Trilinear density over the isovalue, HU; positive in bone.
pub(crate) fn over_iso(bone: &BoneVolume, point: Vec3) -> f32 {
    let at = bone.grid_of(point);
    let low = at.floor();
    let (f, g, corner) = (at - low, 1.0 - (at - low), low.as_ivec3());
    let hu = |x, y, z| f32::from(bone.hu(corner + glam::IVec3::new(x, y, z)));
    let along = |y, z| g.x * hu(0, y, z) + f.x * hu(1, y, z);
    g.z * (g.y * along(0, 0) + f.y * along(1, 0)) + f.z * (g.y * along(0, 1) + f.y * along(1, 1))
        - f32::from(bone.isovalue())
}

/// What the method says of itself.
pub const METHOD: Descriptor = Descriptor {
    points: Pointshell::RIGID_COUNT,
    ..Descriptor::of("ray-trace", "Petersik et al. 2002, Morris et al. 2006", |tool, points| {
        framed(tool, RemovalLaw::RATE, Rays(ball_shell(tool, points)))
    })
};
