//! The surface approximation: vertices on burr and shaft, each pushed out of the bone that it is
//! in; the hand feels the sum.
//!
//! # Theory
//! Vertices lie on the ball and on the cylinder. One whose density is that of bone is pushed
//! inwards, to where the density falls to the isovalue; force and torque are sums over the vertices
//! that touch:
//! ```text
//! F = kᵥ Σ dᵢ nᵢ ,   τ = kᵥ Σ (xᵢ - tip) × dᵢ nᵢ
//! ```
//! A sum is as stiff as there are vertices. On a flat wall, M even vertices on a ball of radius r
//! that is pressed by δ have their depths along the wall's normal spread evenly over 0 to δ:
//! ```text
//! F = kᵥ M/(2r) ∫₀^δ s ds = kᵥ M δ² / (4r) ,   kᵥ = 4 r k / (M δ₀)   so that F(δ₀) = k δ₀
//! ```
//! with the caller's spring k and the reference depth δ₀ of 0.5 mm.
//!
//! # Practice
//! 466 vertices on the ball, rings of eight along the shaft; a group of eight costs nothing more
//! where its brick has never held bone. World mm.
//!
//! # Sources
//! N. Asenjo, *Multipoint collision detection algorithm for bone milling and drilling in a haptic
//! VR surgery simulator*, KTH 2008, "surface approximation algorithm", as the thesis tells it
//! (2.3.1): densities compared at the vertices, the sum of the forces of all that collide.
//! Liberties: the way out along the inward normal, kᵥ by the closed form above.
//!
//! # When not to use it
//! Where forces should grow in proportion to depth: they grow with its square, half as much at half
//! the depth, and stiffness at the reference depth is twice k. Against thin walls: it has no proxy.

use super::ray_trace::{over_iso, way_out};
use super::shell::Shell;
use core::f32::consts::TAU;
use trepan_bone::BoneVolume;
use trepan_contact::Contact;
use trepan_geometry::{Pointshell, Pose, Tool, Vec3};
use trepan_rigid::RigidStep;
use trepan_rigid::frame::{PenaltyProbe, REFERENCE_MM, WholeContact, answer, ball_shell, framed};
use trepan_rigid::removal::RemovalLaw;
use trepan_rigid::{Descriptor, Extent};

/// Most rings of vertices on a shaft.
const MAX_RINGS: usize = 512;
/// Vertices of a ring.
const RING: usize = 8;

/// Way between two rings of vertices on the shaft, mm.
const RING_MM: f32 = 1.0;

struct Vertices {
    ball: Shell,
    shaft: Shell,
    /// Stiffness kᵥ of a vertex over the caller's.
    gain: f32,
}

impl Vertices {
    fn new(tool: &Tool, points: usize) -> Self {
        let ball = ball_shell(tool, points);
        let rings = ((tool.shaft_length_mm - tool.tip_radius_mm) / RING_MM).clamp(0.0, MAX_RINGS as f32) as usize;
        let mut shaft = Pointshell { points: Vec::new(), inward_normals: Vec::new() };
        for at in 0..rings * RING {
            let (ring, angle) = (at / RING, TAU * (at % RING) as f32 / RING as f32);
            let out = Vec3::new(angle.cos(), angle.sin(), 0.0);
            let height = tool.tip_radius_mm + ring as f32 * RING_MM;
            shaft.points.push(tool.shaft_radius_mm * out + Vec3::Z * height);
            shaft.inward_normals.push(-out);
        }
        let gain = 4.0 * tool.tip_radius_mm / (ball.points.len() as f32 * REFERENCE_MM);
        Self { ball: Shell::new(&ball), shaft: Shell::new(&shaft), gain }
    }
}

impl PenaltyProbe for Vertices {
    fn feel(&mut self, bone: &BoneVolume, tool: &Tool, pose: &Pose, out: &mut RigidStep) -> Option<WholeContact> {
        let (mut moment, parts) = (Vec3::ZERO, [(&self.ball, tool.tip_radius_mm), (&self.shaft, tool.shaft_radius_mm)]);
        let [burr, shaft] = parts.map(|(shell, longest)| {
            let mut push = Vec3::ZERO;
            shell.near(bone, pose, (1, 0.0), |near| {
                out.voxels_swept += 1;
                let over = over_iso(bone, near.grid);
                if over > 0.0 {
                    let depth_mm = way_out(bone, (near.grid, near.inward), over, longest, &mut out.voxels_swept);
                    push += depth_mm * near.inward;
                    moment += (near.point - pose.translation).cross(depth_mm * near.inward);
                    out.points_in_contact += 1;
                    out.manifold.push(Contact { point: near.point, normal: near.inward, depth_mm });
                }
            });
            push
        });
        out.voxels_in_contact = out.points_in_contact;
        let push = burr + shaft;
        let felt = answer(push, self.gain * push.length(), out)?;
        out.manifold.couple_mm = moment / push.length();
        Some(WholeContact { burr: self.gain * burr, ..felt })
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
