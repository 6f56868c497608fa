//! The surface approximation: vertices on burr and shaft, each pushed out of the bone that it is
//! in.
//!
//! # Theory
//! Vertices lie on the ball and on the cylinder. One whose density is that of bone is pushed
//! inwards, to where the density falls to the isovalue; force and torque are the mean over the
//! vertices that touch:
//! ```text
//! d n = Σ dᵢ nᵢ / N ,   τ = k Σ (xᵢ - tip) × dᵢ nᵢ / N
//! ```
//!
//! # Practice
//! 466 vertices on the ball, rings of eight along the shaft. Vertices whose brick has never held
//! bone cost nothing more. World mm.
//!
//! # Sources
//! F. Asenjo, *Haptic and visual simulation of bone milling*, KTH 2008, "surface approximation
//! algorithm", as the thesis tells it (2.3.1). The way out along the inward normal and the mean
//! instead of the sum, whose stiffness would depend on the number of vertices, are ours.
//!
//! # When not to use it
//! Where depth is wanted: a mean over a cap is half of what its deepest vertex has. Against thin
//! walls: it has no proxy.

use super::frame::{Felt, PenaltyProbe, answer, ball_shell, framed};
use super::ray_trace::{over_iso, way_out};
use crate::RigidStep;
use crate::method::{Descriptor, Extent};
use crate::removal::RemovalLaw;
use core::f32::consts::TAU;
use trepan_contact::Contact;
use trepan_geometry::{Pointshell, Pose, Tool, Vec3};
use trepan_volume::BoneVolume;

/// Most rings of vertices on a shaft.
const MAX_RINGS: usize = 512;
/// Vertices of a ring.
const RING: usize = 8;

/// Way between two rings of vertices on the shaft, mm.
const RING_MM: f32 = 1.0;

struct Vertices {
    shell: Pointshell,
    /// Vertices before this one are on the ball, the others on the shaft.
    on_ball: usize,
}

impl Vertices {
    fn new(tool: &Tool, points: usize) -> Self {
        let mut shell = ball_shell(tool, points);
        let on_ball = shell.points.len();
        let rings = ((tool.shaft_length_mm - tool.tip_radius_mm) / RING_MM).clamp(0.0, MAX_RINGS as f32) as usize;
        for at in 0..rings * RING {
            let (ring, angle) = (at / RING, TAU * (at % RING) as f32 / RING as f32);
            let out = Vec3::new(angle.cos(), angle.sin(), 0.0);
            let height = tool.tip_radius_mm + ring as f32 * RING_MM;
            shell.points.push(tool.shaft_radius_mm * out + Vec3::Z * height);
            shell.inward_normals.push(-out);
        }
        Self { shell, on_ball }
    }
}

impl PenaltyProbe for Vertices {
    fn feel(&mut self, bone: &BoneVolume, tool: &Tool, pose: &Pose, out: &mut RigidStep) -> Option<Felt> {
        let (mut push, mut moment, mut burr) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        for (at, (point, inward)) in self.shell.iter().enumerate() {
            let arm = pose.rotation * point;
            let point = pose.translation + arm;
            let voxel = bone.voxel_of(point);
            let over = if bone.may_hold_bone(voxel - 1, voxel + 1) { over_iso(bone, point) } else { -1.0 };
            out.voxels_swept += 1;
            if over > 0.0 {
                let on_ball = at < self.on_ball;
                let longest = if on_ball { tool.tip_radius_mm } else { tool.shaft_radius_mm };
                let normal = pose.rotation * inward;
                let depth_mm = way_out(bone, point, normal, over, longest, &mut out.voxels_swept);
                push += depth_mm * normal;
                burr += if on_ball { depth_mm * normal } else { Vec3::ZERO };
                moment += arm.cross(depth_mm * normal);
                out.points_in_contact += 1;
                out.manifold.push(Contact { point, normal, depth_mm });
            }
        }
        out.voxels_in_contact = out.points_in_contact;
        let (length, share) = (push.length(), 1.0 / out.points_in_contact.max(1) as f32);
        let felt = answer(push, length * share, out)?;
        out.manifold.couple_mm = moment / length;
        Some(Felt { burr: share * burr, ..felt })
    }
}

/// What the method says of itself.
pub const METHOD: Descriptor = Descriptor {
    extent: Extent::BallAndShaft,
    points: Pointshell::RIGID_COUNT,
    ..Descriptor::of("surface-vertices", "Asenjo 2008, surface approximation", |tool, points| {
        framed(tool, RemovalLaw::RATE, Vertices::new(tool, points))
    })
};
