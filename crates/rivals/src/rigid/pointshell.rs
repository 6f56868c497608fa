//! The voxmap pointshell: tangent planes of bone voxels push a tool's points, and the hand holds
//! the tool by a virtual coupling.
//!
//! # Theory
//! The tangent plane of a point passes through the centre of its voxel, with the point's own inward
//! normal. The tool is a body of mass m at x, joined to the hand at p by spring and damper; what
//! the hand feels is the coupling:
//! ```text
//! dᵢ = (centre - pᵢ)·nᵢ ,  dᵢ > 0 only
//! sum      F = K Σ dᵢ nᵢ · min(1, 10/N)      McNeely et al. 1999: reduced over ten points
//! average  F = 10 K Σ dᵢ nᵢ / N              Renz et al. 2001
//! m dv/dt = F + k (p - x) + b (dp/dt - v) ,  force on the hand = k (x - p) + b (v - dp/dt)
//! ```
//! A tool that is near bone goes at most half a voxel a tick: the paper's braking before contact,
//! so that no point jumps over the layer of voxels that pushes.
//!
//! # Practice
//! 466 points. World mm, g, ms, N. A ball that is pressed by δ touches with the points of a cap,
//! evenly spread over its height, so that their mean depth is δ/2: the contact is 5 K stiff once
//! ten points touch. k is chosen so that both springs in a row are `STIFFNESS`. The numbers are
//! ours: mass and K are bounded by `10 K + k < 4 m / T²`, at which an explicit step of T = 1 ms
//! diverges.
//!
//! # Sources
//! W. McNeely, K. Puterbaugh, J. Troy, *Six degree-of-freedom haptic rendering using voxel
//! sampling*, SIGGRAPH 1999: abstract read (1000 Hz, short-range force field, dynamic simulation by
//! virtual coupling); tangent planes as the thesis tells it (3.4.3, Figure 3.9); sum reduced over
//! ten points, mass, coupling and braking from memory of sections 4 and 5, without their numbers.
//! M. Renz et al., *Stable haptic interaction with virtual environments using an adapted
//! voxmap-pointshell algorithm*, Eurohaptics 2001: abstract read (points exactly on the surface, a
//! force with less voxel noise, a virtual coupling); the average as the thesis tells it (3.4.3).
//!
//! Liberties, each in the method's favour: the orientation is the hand's, contacts turn nothing but
//! the hand; a tool in free space is where the hand is, so that its mass is not felt; braking
//! bounds the speed instead of adding a force for each point; every voxel of bone has a tangent
//! plane, not the surface's layer only; points stand out by half a voxel, since voxels whose centre
//! is bone begin half a voxel later than those that a surface passes through.
//!
//! # When not to use it
//! Against thin walls and strong hands: the layer that pushes is half a voxel deep.

use super::shell::Shell;
use trepan_bone::BoneVolume;
use trepan_contact::Contact;
use trepan_geometry::{Pointshell, Pose, Tool, ToolState, Vec3};
use trepan_rigid::Descriptor;
use trepan_rigid::frame::{HeldTool, MethodCore, ball_shell, framed};
use trepan_rigid::removal::RemovalLaw;
use trepan_rigid::{RigidContact, RigidStep};

/// Points up to which the sum is not reduced.
const FULL_SUM: f32 = 10.0;
/// Stiffness at the hand, N/mm: what the caller's spring is taken to have.
const STIFFNESS: f32 = 2.0;
/// Longest step of the tool's motion, ms.
const STEP_MS: f32 = 1.0;
/// Shortest step, ms. A tick that takes no time counts as one of [`STEP_MS`].
const LEAST_MS: f32 = 0.05;
/// Way of a hand in one tick after which the tool is put where the hand is, mm: 5 m/s at 1 kHz.
const JUMP_MM: f32 = 5.0;
/// Most steps in one tick.
const MAX_STEPS: f32 = 16.0;
/// Furthest that a tool near bone goes in a step, voxels.
const BRAKED_VOXELS: f32 = 0.5;
/// How far the points stand out, voxels.
const OUT_VOXELS: f32 = 0.5;

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
    /// Mass of the tool, g: about that of a device's handle.
    pub mass_g: f32,
    /// Stiffness K of one point, N/mm.
    pub point_stiffness: f32,
    /// Damping of the coupling as a share of the critical one.
    pub damping_share: f32,
    /// What a burr takes away.
    pub removal: RemovalLaw,
}

impl Config {
    /// McNeely's sum.
    pub const SUM: Self = Self {
        combine: Combine::Sum,
        mass_g: 20.0,
        point_stiffness: 2.0,
        damping_share: 0.2,
        removal: RemovalLaw::RATE,
    };

    /// Spring of the coupling, N/mm.
    fn spring(&self) -> f32 {
        let contact = (0.5 * FULL_SUM * self.point_stiffness).max(1.1 * STIFFNESS);
        STIFFNESS * contact / (contact - STIFFNESS)
    }

    /// Damper of the coupling, N ms/mm.
    fn damper(&self) -> f32 {
        2.0 * self.damping_share * (self.spring() * self.mass_g).sqrt()
    }
}

impl Default for Config {
    fn default() -> Self {
        Self { combine: Combine::Average, point_stiffness: 1.25, ..Self::SUM }
    }
}

/// The method for a tool of any shape, whose surface is `shell` (see
/// [`mesh_shell`](super::mesh_shell)). A burr cuts with the ball at its tip.
pub fn with_shell(tool: &Tool, shell: Pointshell, config: &Config) -> Box<dyn RigidContact> {
    let config = Config { mass_g: config.mass_g.max(1.0), ..*config };
    let coupled = Coupled { shell: Shell::new(&shell), config, hand: Vec3::ZERO, at: Vec3::ZERO, speed: Vec3::ZERO };
    framed(tool, config.removal, coupled)
}

/// What all points push together.
#[derive(Default)]
struct Push {
    /// Sum of depths along the points' normals, mm.
    depths: Vec3,
    /// The same as a moment about the tip, mm².
    moment: Vec3,
    /// Points that push.
    points: f32,
    /// Points in bone, pushing or not.
    touching: u32,
}

/// The tool on its coupling.
struct Coupled {
    shell: Shell,
    config: Config,
    /// Where the hand was, world mm.
    hand: Vec3,
    /// Where the tool is, world mm.
    at: Vec3,
    /// mm/ms.
    speed: Vec3,
}

impl Coupled {
    fn push(&self, bone: &BoneVolume, pose: &Pose, out: &mut RigidStep) -> Push {
        let mut push = Push::default();
        let out_mm = OUT_VOXELS * bone.spacing_mm();
        out.manifold.clear();
        self.shell.near(bone, pose, (0, out_mm), |near| {
            out.voxels_swept += 1;
            if bone.is_bone(near.voxel) {
                push.touching += 1;
                let depth_mm = (bone.centre_of(near.voxel) - near.point).dot(near.inward);
                if depth_mm > 0.0 {
                    push.depths += depth_mm * near.inward;
                    push.moment += (near.point - pose.translation).cross(depth_mm * near.inward);
                    push.points += 1.0;
                    out.manifold.push(Contact { point: near.point, normal: near.inward, depth_mm });
                }
            }
        });
        push
    }

    /// Whether there is no bone near the tool, the hand, or what lies between them.
    fn is_far(&self, bone: &BoneVolume, hand: Vec3) -> bool {
        let reach = self.shell.reach_mm() + bone.spacing_mm();
        let [low, high] = [self.at.min(hand) - reach, self.at.max(hand) + reach].map(|corner| bone.voxel_of(corner));
        !bone.may_hold_bone(low, high)
    }

    /// One step of the tool, whose hand is at `hand` and goes `way` in it.
    fn follow(&mut self, bone: &BoneVolume, pose: &Pose, way: Vec3, dt_ms: f32, out: &mut RigidStep) -> Push {
        let (hand, spacing) = (pose.translation, bone.spacing_mm());
        let hand_speed = way / dt_ms;
        let push = self.push(bone, &Pose { translation: self.at, ..*pose }, out);
        let is_near = self.at.distance(hand) <= BRAKED_VOXELS * spacing || self.is_far(bone, hand);
        if push.touching == 0 && is_near && self.push(bone, pose, out).touching == 0 {
            (self.at, self.speed) = (hand, hand_speed);
            return push;
        }
        let Config { combine, mass_g, point_stiffness, .. } = self.config;
        let share = match combine {
            Combine::Sum => (FULL_SUM / push.points.max(1.0)).min(1.0),
            Combine::Average => FULL_SUM / push.points.max(1.0),
        };
        let (spring, damper) = (self.config.spring(), self.config.damper());
        let force = point_stiffness * share * push.depths + spring * (hand - self.at) + damper * hand_speed;
        // The damper by the speed that comes: stable for any of it.
        let pushed = (self.speed + force * (dt_ms / mass_g)) / (1.0 + damper * dt_ms / mass_g);
        self.speed = pushed.clamp_length_max(BRAKED_VOXELS * spacing / dt_ms);
        self.at += self.speed * dt_ms;
        push
    }
}

impl MethodCore for Coupled {
    fn tick(&mut self, bone: &BoneVolume, tool: &ToolState, held: &mut HeldTool, out: &mut RigidStep) {
        let pose = tool.world_from_tool;
        if self.hand.distance(pose.translation) > JUMP_MM {
            self.reset(pose);
            out.fallbacks += 1;
        }
        let (from, hand) = (self.hand, pose.translation);
        let tick_ms = held.tick_ms().unwrap_or(STEP_MS).max(LEAST_MS);
        let steps = (tick_ms / STEP_MS).ceil().clamp(1.0, MAX_STEPS);
        let (dt_ms, way) = ((tick_ms / steps).min(STEP_MS), (hand - from) / steps);
        let mut push = Push::default();
        for step in 1..=steps as u32 {
            let there = Pose { translation: from + step as f32 * way, ..pose };
            push = self.follow(bone, &there, way, dt_ms, out);
        }
        (self.hand, held.proxy) = (hand, Pose { translation: self.at, ..pose });
        (out.points_in_contact, out.voxels_in_contact) = (push.points as u32, push.touching);
        let (spring, damper) = (self.config.spring(), self.config.damper());
        let force = spring * (self.at - hand) + damper * (self.speed - way / dt_ms);
        let depth_mm = force.length() / STIFFNESS;
        held.report(force.normalize_or_zero(), depth_mm, out);
        if push.points > 0.0 {
            out.manifold.couple_mm = push.moment / push.depths.length().max(1e-9);
            held.cut(bone, hand, self.at, depth_mm, out);
        }
    }

    fn reset(&mut self, pose: Pose) {
        (self.hand, self.at, self.speed) = (pose.translation, pose.translation, Vec3::ZERO);
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
