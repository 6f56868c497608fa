//! Contact from the bone inside the ball: its volume gives the depth, its centre of mass the
//! direction.
//!
//! # Theory
//! The ball overlaps bone of volume V with centre of mass m. Were the bone flat, V would be a
//! spherical cap of height h:
//! ```text
//! V = π h² (r - h/3) ,   n = (c - m)/|c - m|
//! ```
//! so h is the depth. This is the contact of Agus et al., who sum voxels as small spheres and put h
//! into Hertz's law; here the force model is the caller's.
//!
//! # Practice
//! Voxels count by fraction, ½ + (hu - iso)/1000. One load per voxel in the ball: 2 to 5 us for a
//! ball of 12 voxels. Smooth, since it is a sum.
//!
//! # Sources
//! M. Agus et al., *Real-time haptic and visual simulation of bone dissection*, Presence 12 (2003).
//!
//! # When not to use it
//! Against edges and thin walls, where there is less bone than a cap has: the depth reads too
//! small.

use super::frame::{Felt, PenaltyProbe, answer, framed};
use crate::RigidStep;
use crate::method::Descriptor;
use crate::removal::RemovalLaw;
use crate::rows::{GridBall, rows};
use core::f32::consts::PI;
use trepan_contact::Contact;
use trepan_geometry::{Pose, Tool, Vec3};
use trepan_volume::BoneVolume;

struct Sum;

impl PenaltyProbe for Sum {
    fn feel(&mut self, bone: &BoneVolume, tool: &Tool, pose: &Pose, out: &mut RigidStep) -> Option<Felt> {
        let tip = pose.translation;
        let centre = bone.grid_of(tip);
        let radius = tool.tip_radius_mm / bone.spacing_mm();
        let (mut volume, mut moment) = (0.0f32, Vec3::ZERO);
        rows(GridBall { centre, radius: radius + 0.5 }, GridBall::NONE, |start, to| {
            for x in start.x..=to {
                let voxel = start.with_x(x);
                let bone_share =
                    (0.5 + (f32::from(bone.hu(voxel)) - f32::from(bone.isovalue())) * 1e-3).clamp(0.0, 1.0);
                out.voxels_swept += 1;
                if bone_share > 0.0 {
                    let from_centre = voxel.as_vec3() - centre;
                    let within = (radius + 0.5 - from_centre.length()).clamp(0.0, 1.0) * bone_share;
                    volume += within;
                    moment += within * from_centre;
                    out.voxels_in_contact += u32::from(within > 0.5);
                }
            }
        });
        out.points_in_contact = out.voxels_in_contact;
        let depth = cap_height(volume, radius) * bone.spacing_mm();
        let found = answer(-moment, depth, out);
        if let Some(Felt { normal, depth_mm, .. }) = found {
            out.manifold.push(Contact { point: tip - tool.tip_radius_mm * normal, normal, depth_mm });
        }
        found
    }
}

/// Height of the cap of a ball of `radius` that holds `volume`; at most the diameter.
fn cap_height(volume: f32, radius: f32) -> f32 {
    let (mut low, mut high) = (0.0, 2.0 * radius);
    for _ in 0..24 {
        let h = 0.5 * (low + high);
        if PI * h * h * (radius - h / 3.0) < volume { low = h } else { high = h }
    }
    low
}

/// What the method says of itself.
pub const METHOD: Descriptor =
    Descriptor::of("voxel-sum", "Agus et al. 2003", |tool, _| framed(tool, RemovalLaw::RATE, Sum));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cap_of_half_a_ball_is_its_radius() {
        assert!((cap_height(2.0 / 3.0 * PI * 8.0, 2.0) - 2.0).abs() < 1e-3);
        assert_eq!(cap_height(0.0, 2.0), 0.0);
    }
}
