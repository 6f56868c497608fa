//! Tangent planes by exposed faces: the modified voxmap point shell of the Intracranial Hematoma
//! Craniotomy simulator.
//!
//! # Theory
//! A point of the tool in a bone voxel is followed along its inward normal, a voxel's edge at a
//! time, to a voxel at the surface: one with faces that no bone covers. Those faces eᵢ (unit
//! vectors to the bare neighbours) make the voxel's tangent plane:
//! ```text
//! n = Σ eᵢ / |Σ eᵢ| ,   plane through  centre + ½ · mean eᵢ ,   d = (plane - p)·n
//! ```
//! One bare face is the plane of that face, two cut the edge between them, three the corner.
//!
//! # Practice
//! The normal of the contact is the mean of the points' pushes, its depth that of the deepest point
//! along it. 466 points, six looks at each voxel at the surface. World mm.
//!
//! # Sources
//! E. Acosta, A. Liu, *Real-time volumetric haptic and visual burrhole simulation*, IEEE VR 2007;
//! E. Acosta et al., Stud. Health Technol. Inform. 125 (2007). How the faces give normal and depth
//! is our reading.
//!
//! # When not to use it
//! On oblique bone: a voxel knows 26 normals, so that force turns and jumps at voxel borders.
//! Against thin walls: it has no proxy.

use super::frame::{Felt, PenaltyProbe, ball_shell, deepest, framed};
use crate::RigidStep;
use crate::method::Descriptor;
use crate::removal::RemovalLaw;
use crate::surface::NEIGHBOURS;
use glam::IVec3;
use trepan_contact::Contact;
use trepan_geometry::{Pointshell, Pose, Tool, Vec3};
use trepan_volume::BoneVolume;

struct Faces(Pointshell);

/// The depth of `point`, mm, and its normal, found within `reach_mm` along `inward`; `None` when
/// there is bone so far.
fn plane(bone: &BoneVolume, reach_mm: f32, point: Vec3, inward: Vec3, visited: &mut u32) -> Option<(f32, Vec3)> {
    let steps = (reach_mm / bone.spacing_mm()).floor().clamp(0.0, 256.0) as u32;
    (0..=steps).find_map(|step| {
        let voxel = bone.voxel_of(point + step as f32 * bone.spacing_mm() * inward);
        if !bone.is_bone(voxel) {
            return None;
        }
        *visited += NEIGHBOURS.len() as u32;
        let bare = NEIGHBOURS.into_iter().filter(|&face| !bone.is_bone(voxel + face));
        let (count, sum) = bare.fold((0, IVec3::ZERO), |(count, sum), face| (count + 1, sum + face));
        let through = bone.centre_of(voxel) + sum.as_vec3() * (0.5 * bone.spacing_mm() / count.max(1) as f32);
        // Faces that cancel, of a wall or a pillar one voxel thick, say nothing.
        let normal = if sum == IVec3::ZERO { inward } else { sum.as_vec3().normalize() };
        (count > 0).then(|| ((through - point).dot(normal), normal))
    })
}

impl PenaltyProbe for Faces {
    fn feel(&mut self, bone: &BoneVolume, tool: &Tool, pose: &Pose, out: &mut RigidStep) -> Option<Felt> {
        let mut push = Vec3::ZERO;
        for (point, inward) in self.0.iter() {
            let point = pose.translation + point;
            out.voxels_swept += 1;
            if !bone.is_bone(bone.voxel_of(point)) {
                continue;
            }
            out.points_in_contact += 1;
            if let Some((depth_mm, normal)) = plane(bone, tool.tip_radius_mm, point, inward, &mut out.voxels_swept)
                && depth_mm > 0.0
            {
                push += depth_mm * normal;
                out.manifold.push(Contact { point, normal, depth_mm });
            }
        }
        deepest(push, out)
    }
}

/// What the method says of itself.
pub const METHOD: Descriptor = Descriptor {
    points: Pointshell::RIGID_COUNT,
    ..Descriptor::of("exposed-faces", "Acosta and Liu 2007", |tool, points| {
        framed(tool, RemovalLaw::RATE, Faces(ball_shell(tool, points)))
    })
};
