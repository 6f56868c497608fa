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

use super::shell::Shell;
use glam::IVec3;
use trepan_bone::BoneVolume;
use trepan_contact::Contact;
use trepan_geometry::{Pointshell, Pose, Tool, Vec3};
use trepan_rigid::Descriptor;
use trepan_rigid::RigidStep;
use trepan_rigid::frame::{PenaltyProbe, Pushes, WholeContact, ball_shell, framed};
use trepan_rigid::removal::RemovalLaw;

struct Rays {
    shell: Shell,
    pushes: Pushes,
}

impl PenaltyProbe for Rays {
    fn feel(&mut self, bone: &BoneVolume, tool: &Tool, pose: &Pose, out: &mut RigidStep) -> Option<WholeContact> {
        self.pushes.clear();
        let still = Pose::from_translation(pose.translation);
        self.shell.near(bone, &still, (1, 0.0), |near| {
            out.voxels_swept += 1;
            let over = over_iso(bone, near.grid);
            if over > 0.0 {
                let ray = (near.grid, near.inward);
                let depth_mm = way_out(bone, ray, over, tool.tip_radius_mm, &mut out.voxels_swept);
                self.pushes.push(Contact { point: near.point, normal: near.inward, depth_mm }, out);
            }
        });
        self.pushes.deepest(out)
    }
}

/// The way from a place in voxels, which is `over` HU in bone, along a unit vector to the isovalue,
/// at most `longest`, mm.
#[inline]
pub(crate) fn way_out(
    bone: &BoneVolume,
    (from, inward): (Vec3, Vec3),
    over: f32,
    longest: f32,
    visited: &mut u32,
) -> f32 {
    const STEP: f32 = 0.5;
    let longest = longest / bone.spacing_mm();
    let (mut way, mut before) = (0.0, over);
    while way < longest {
        *visited += 1;
        let now = over_iso(bone, from + (way + STEP) * inward);
        if now <= 0.0 {
            way = (way + STEP * before / (before - now)).min(longest);
            break;
        }
        (way, before) = (way + STEP, now);
    }
    way.min(longest) * bone.spacing_mm()
}

/// Trilinear density at a place in voxels over the isovalue, HU; positive in bone.
#[inline]
pub(crate) fn over_iso(bone: &BoneVolume, at: Vec3) -> f32 {
    // Without SSE 4.1 the standard floor is a call.
    let cut = at.as_ivec3();
    let low = cut - IVec3::from(at.cmplt(cut.as_vec3()));
    let (f, hu) = (at - low.as_vec3(), bone.corners(low).map(f32::from));
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let face = |c: usize| mix(mix(hu[c], hu[c + 1], f.x), mix(hu[c + 2], hu[c + 3], f.x), f.y);
    mix(face(0), face(4), f.z) - f32::from(bone.isovalue())
}

/// What the method says of itself.
pub const METHOD: Descriptor = Descriptor {
    points: Pointshell::RIGID_COUNT,
    ..Descriptor::of("ray-trace", "Petersik et al. 2002, Morris et al. 2006", |tool, points| {
        let shell = ball_shell(tool, points);
        framed(tool, RemovalLaw::RATE, Rays { pushes: Pushes::room(&shell), shell: Shell::new(&shell) })
    })
};
