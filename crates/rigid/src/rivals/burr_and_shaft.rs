//! Burr and shaft by their distance from voxels, with torque: a ball and a cylinder against voxel
//! centres.
//!
//! # Theory
//! A voxel of bone touches the burr when its centre is nearer to the burr's centre than the radius,
//! and the shaft when it is nearer to the shaft's axis than the shaft's radius. For each of the two
//! ```text
//! n = Σ dᵢ nᵢ / |Σ dᵢ nᵢ| ,   d = max dᵢ ,   x = Σ dᵢ xᵢ / Σ dᵢ
//! dᵢ = radius - distance,   nᵢ from the voxel to centre or axis
//! F = k (d n)₁ + k (d n)₂ ,   τ = (x₂ - tip) × k (d n)₂
//! ```
//! Their spring has a damper and friction beside it, which here are the force model's part.
//!
//! # Practice
//! Bricks that have never held bone take the place of their tree of boxes. World mm; 5 to 20 us.
//! The shaft does not cut.
//!
//! # Sources
//! X. He, Y. Chen, *Bone drilling simulation based on six degree-of-freedom haptic rendering*,
//! EuroHaptics 2006. How the voxels' distances become one force is our reading.
//!
//! # When not to use it
//! For a steady force: depth is counted from voxel centres, so that it steps by fractions of a
//! voxel. Against thin walls: it has no proxy.

use super::frame::{Felt, PenaltyProbe, answer, framed};
use crate::RigidStep;
use crate::method::{Descriptor, Extent};
use crate::removal::RemovalLaw;
use crate::rows::{GridBall, rows};
use crate::shaft::Shaft;
use trepan_contact::Contact;
use trepan_geometry::{Pose, Tool, Vec3};
use trepan_volume::BoneVolume;

struct BurrAndShaft;

/// What the voxels near one part of the tool do together; grid units.
#[derive(Default)]
struct Press {
    push: Vec3,
    deepest: f32,
    weight: f32,
    places: Vec3,
    voxels: u32,
}

impl Press {
    /// Takes in a voxel at `place`; `apart` is the way from it to the part's centre or axis.
    fn add(&mut self, place: Vec3, apart: Vec3, radius: f32) {
        let distance = apart.length();
        let depth = radius - distance;
        if depth > 0.0 {
            self.push += apart * (depth / distance.max(1e-6));
            self.deepest = self.deepest.max(depth);
            self.weight += depth;
            self.places += depth * place;
            self.voxels += 1;
        }
    }

    /// The contact, world mm.
    fn contact(&self, bone: &BoneVolume) -> Contact {
        let point = bone.origin() + bone.spacing_mm() * self.places / self.weight.max(1e-12);
        Contact { point, normal: self.push.normalize_or_zero(), depth_mm: self.deepest * bone.spacing_mm() }
    }
}

fn burr(bone: &BoneVolume, tool: &Tool, centre: Vec3, visited: &mut u32) -> Press {
    let (mut press, radius) = (Press::default(), tool.tip_radius_mm / bone.spacing_mm());
    rows(GridBall { centre, radius }, GridBall::NONE, |start, to| {
        *visited += (to - start.x + 1).max(0) as u32;
        for voxel in (start.x..=to).map(|x| start.with_x(x)).filter(|&voxel| bone.is_bone(voxel)) {
            press.add(voxel.as_vec3(), centre - voxel.as_vec3(), radius);
        }
    });
    press
}

fn shaft(bone: &BoneVolume, tool: &Tool, pose: &Pose, visited: &mut u32) -> Press {
    let mut press = Press::default();
    let shaft = Shaft::of(tool, bone.spacing_mm(), bone.grid_of(pose.translation), pose.rotation * Vec3::Z);
    *visited += shaft.around(bone, shaft.radius, |voxel| {
        let place = voxel.as_vec3();
        press.add(place, shaft.at(shaft.along(place)) - place, shaft.radius);
    });
    press
}

impl PenaltyProbe for BurrAndShaft {
    fn feel(&mut self, bone: &BoneVolume, tool: &Tool, pose: &Pose, out: &mut RigidStep) -> Option<Felt> {
        let burr = burr(bone, tool, bone.grid_of(pose.translation), &mut out.voxels_swept);
        let shaft = shaft(bone, tool, pose, &mut out.voxels_swept);
        out.voxels_in_contact = burr.voxels + shaft.voxels;
        out.points_in_contact = out.voxels_in_contact;
        let (mut push, mut moment) = (Vec3::ZERO, Vec3::ZERO);
        for part in [&burr, &shaft].into_iter().filter(|part| part.voxels > 0) {
            let contact = part.contact(bone);
            push += contact.depth_mm * contact.normal;
            out.manifold.push(contact);
        }
        if shaft.voxels > 0 {
            let contact = shaft.contact(bone);
            moment = (contact.point - pose.translation).cross(contact.depth_mm * contact.normal);
        }
        let (depth, burr) = (push.length(), burr.contact(bone));
        let felt = answer(push, depth, out)?;
        out.manifold.couple_mm = moment / depth;
        Some(Felt { burr: burr.depth_mm * burr.normal, ..felt })
    }
}

/// What the method says of itself.
pub const METHOD: Descriptor = Descriptor {
    extent: Extent::BallAndShaft,
    ..Descriptor::of("burr-and-shaft", "He and Chen 2006", |tool, _| framed(tool, RemovalLaw::RATE, BurrAndShaft))
};
