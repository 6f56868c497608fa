//! Tangent planes of exposed voxels and erosion points: the modified voxmap pointshell of the
//! Intracranial Hematoma Craniotomy simulator.
//!
//! # Theory
//! A point of the tool in a bone voxel is followed along its inward normal, a voxel's edge at a
//! time, to a voxel at the surface: one with faces that no bone covers. The voxel's tangent plane
//! goes through its exposed faces eᵢ (unit vectors to the bare neighbours), with the density's
//! gradient, by central differences, as its normal:
//! ```text
//! n = -∇ρ / |∇ρ| ,   plane through  centre + ½ · mean eᵢ ,   d = (plane - p)·n
//! ```
//! One bare face is the plane of that face, two cut the edge between them, three the corner. A
//! burr's points are its erosion points: the voxels that hold any lose density, each in proportion
//! to the points in it and to what each may cut. All of a round burr's points cut alike.
//!
//! # Practice
//! The normal of the contact is the mean of the points' pushes, its depth that of the deepest point
//! along it (Hooke's law is the caller's). 466 points, six looks at each voxel at the surface.
//! World mm. On a flat wall the depth is the wall's, so that no gain is needed.
//!
//! # Sources
//! E. Acosta, A. Liu, *Real-time volumetric haptic and visual burrhole simulation*, IEEE VR 2007:
//! abstract read (modified voxmap pointshell, surface boundary detection, erosion for the
//! capabilities of tools, forces outside of the haptic loop and interpolated); E. Acosta et al.,
//! Stud. Health Technol. Inform. 125 (2007). Steps along the normal, voxels with density, gradient
//! and colour, planes by exposed facets, erosion points, Hooke's law: as the thesis tells it
//! (2.3.1). Liberties: a voxel is at the surface where a face is bare, since the gradient of a CT
//! is zero nowhere; how faces and gradient become one plane; volume eroded by this crate's
//! [`RemovalLaw`], that burrs of all methods earn alike; forces in every tick, not interpolated.
//!
//! # When not to use it
//! Where depth is wanted below half a voxel: planes stand on the voxels' faces. Against thin walls:
//! it has no proxy.

use super::shell::Shell;
use glam::IVec3;
use trepan_bone::BoneVolume;
use trepan_contact::Contact;
use trepan_geometry::{Pointshell, Pose, Tool, Vec3};
use trepan_rigid::Descriptor;
use trepan_rigid::RigidStep;
use trepan_rigid::frame::NEIGHBOURS;
use trepan_rigid::frame::WornVoxel;
use trepan_rigid::frame::{PenaltyProbe, Pushes, WholeContact, ball_shell, framed};
use trepan_rigid::removal::RemovalLaw;
use trepan_volume::AIR_HU;

struct Faces {
    shell: Shell,
    pushes: Pushes,
    /// The voxels that hold erosion points.
    worn: Vec<WornVoxel>,
}

impl Faces {
    fn new(shell: &Pointshell) -> Self {
        let worn = Vec::with_capacity(shell.points.len());
        Self { shell: Shell::new(shell), pushes: Pushes::room(shell), worn }
    }
}

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
        let (mut count, mut faces, mut fall) = (0, IVec3::ZERO, Vec3::ZERO);
        for face in NEIGHBOURS {
            let hu = bone.hu(voxel + face);
            fall -= f32::from(hu) * face.as_vec3();
            if hu < bone.isovalue() {
                (count, faces) = (count + 1, faces + face);
            }
        }
        let through = bone.centre_of(voxel) + faces.as_vec3() * (0.5 * bone.spacing_mm() / count.max(1) as f32);
        let normal = fall.try_normalize().unwrap_or(inward);
        (count > 0).then(|| ((through - point).dot(normal), normal))
    })
}

impl PenaltyProbe for Faces {
    fn feel(&mut self, bone: &BoneVolume, tool: &Tool, pose: &Pose, out: &mut RigidStep) -> Option<WholeContact> {
        self.pushes.clear();
        self.worn.clear();
        let still = Pose::from_translation(pose.translation);
        self.shell.near(bone, &still, (0, 0.0), |near| {
            out.voxels_swept += 1;
            if !bone.is_bone(near.voxel) {
                return;
            }
            self.worn.push(WornVoxel { voxel: near.voxel, share: 1.0, floor_hu: AIR_HU.into() });
            let found = plane(bone, tool.tip_radius_mm, near.point, near.inward, &mut out.voxels_swept);
            if let Some((depth_mm, normal)) = found.filter(|&(depth_mm, _)| depth_mm > 0.0) {
                self.pushes.push(Contact { point: near.point, normal, depth_mm }, out);
            }
        });
        self.pushes.deepest(out)
    }

    fn wears(&mut self, _: &BoneVolume, _: &Tool, _: &Pose, _: &WholeContact) -> Option<&[WornVoxel]> {
        Some(&self.worn)
    }
}

/// What the method says of itself.
pub const METHOD: Descriptor = Descriptor {
    points: Pointshell::RIGID_COUNT,
    ..Descriptor::of("exposed-faces", "Acosta and Liu 2007", |tool, points| {
        framed(tool, RemovalLaw::RATE, Faces::new(&ball_shell(tool, points)))
    })
};
