//! The voxmap point shell: every point of the tool in a bone voxel pushes by its depth under that
//! voxel's tangent plane.
//!
//! # Theory
//! The tangent plane of a point passes through the centre of its voxel, with the point's own inward
//! normal:
//! ```text
//! dᵢ = (centre - pᵢ)·nᵢ ,  dᵢ > 0 only
//! sum      d n = Σ dᵢ nᵢ · min(1, 10/N)      McNeely et al. 1999: reduced over ten points
//! average  d n = Σ dᵢ nᵢ / N                 Renz et al. 2001
//! ```
//!
//! # Practice
//! 466 points, 3 us. World mm.
//!
//! # Sources
//! W. McNeely, K. Puterbaugh, J. Troy, *Six degree-of-freedom haptic rendering using voxel
//! sampling*, SIGGRAPH 1999; M. Renz et al., *Stable haptic interaction with virtual environments
//! using an adapted voxmap-pointshell algorithm*, Eurohaptics 2001.
//!
//! # When not to use it
//! Deeper than a voxel: the depth of a point starts anew in each voxel, so that the force stays as
//! small as at the surface.

use super::frame::{Felt, PenaltyProbe, answer, ball_shell, framed};
use crate::method::Descriptor;
use crate::removal::RemovalLaw;
use crate::{RigidContact, RigidStep};
use trepan_contact::Contact;
use trepan_geometry::{Pointshell, Pose, Tool, Vec3};
use trepan_volume::BoneVolume;

/// Points up to which the sum is not reduced.
const FULL_SUM: f32 = 10.0;

/// How the points' pushes become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Combine {
    /// McNeely's sum.
    Sum,
    /// Renz's average.
    #[default]
    Average,
}

/// How the method is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// How their pushes become one.
    pub combine: Combine,
    /// What a burr takes away.
    pub removal: RemovalLaw,
}

impl Config {
    /// McNeely's sum.
    pub const SUM: Self = Self { combine: Combine::Sum, removal: RemovalLaw::RATE };
}

impl Default for Config {
    fn default() -> Self {
        Self { combine: Combine::Average, ..Self::SUM }
    }
}

/// The method for a tool of any shape, whose surface is `shell` (see
/// [`mesh_shell`](super::mesh_shell)). A burr cuts with the ball at its tip.
pub fn with_shell(tool: &Tool, shell: Pointshell, config: &Config) -> Box<dyn RigidContact> {
    framed(tool, config.removal, Shell { shell, combine: config.combine })
}

struct Shell {
    shell: Pointshell,
    combine: Combine,
}

impl PenaltyProbe for Shell {
    fn feel(&mut self, bone: &BoneVolume, _: &Tool, pose: &Pose, out: &mut RigidStep) -> Option<Felt> {
        let (mut push, mut moment) = (Vec3::ZERO, Vec3::ZERO);
        for (point, inward) in self.shell.iter() {
            let (arm, inward) = (pose.rotation * point, pose.rotation * inward);
            let point = pose.translation + arm;
            let voxel = bone.voxel_of(point);
            if bone.is_bone(voxel) {
                let depth_mm = (bone.centre_of(voxel) - point).dot(inward).max(0.0);
                push += depth_mm * inward;
                moment += arm.cross(depth_mm * inward);
                out.points_in_contact += 1;
                out.manifold.push(Contact { point, normal: inward, depth_mm });
            }
        }
        out.voxels_swept = self.shell.points.len() as u32;
        out.voxels_in_contact = out.points_in_contact;
        let touching = out.points_in_contact as f32;
        let share = match self.combine {
            Combine::Sum => (FULL_SUM / touching).min(1.0),
            Combine::Average => touching.recip(),
        };
        let felt = answer(push, push.length() * share, out)?;
        out.manifold.couple_mm = moment / push.length();
        Some(felt)
    }
}

/// The mean of the points' pushes.
pub const AVERAGE: Descriptor = Descriptor {
    points: Pointshell::RIGID_COUNT,
    ..Descriptor::of("pointshell-average", "Renz et al. 2001", |tool, points| {
        with_shell(tool, ball_shell(tool, points), &Config::default())
    })
};

/// The sum of the points' pushes.
pub const SUM: Descriptor = Descriptor {
    points: Pointshell::RIGID_COUNT,
    ..Descriptor::of("pointshell-sum", "McNeely et al. 1999", |tool, points| {
        with_shell(tool, ball_shell(tool, points), &Config::SUM)
    })
};
