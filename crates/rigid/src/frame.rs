//! The frame of a method: what most do alike around their own part of a tick, for methods here and
//! in other crates.
//!
//! # Theory
//! A [`MethodCore`] with a proxy moves it itself. A penalty method ([`PenaltyProbe`]) remembers
//! nothing: it looks at the bone with the tool where the hand has it and answers with a normal and
//! a depth. The proxy is drawn that depth out along the normal.
//!
//! # When not to use it
//! Penalties against thin walls: past the middle of a wall the nearest way out leads to the far
//! side, and a fast tool is through between two ticks.

use crate::burr::{Burr, Cut};
use crate::nodes::Nodes;
use crate::removal::RemovalLaw;
use crate::{RigidContact, RigidStep};
use glam::IVec3;
use trepan_bone::BoneVolume;
use trepan_contact::Contact;
use trepan_geometry::{Pointshell, Pose, Spread, Tool, ToolState, Vec3};

pub use crate::burr::WornVoxel;
pub use crate::eight::Vec3x8;
pub use crate::rows::{GridBall, each, rows};
pub use crate::shaft::Shaft;
pub use crate::surface::NEIGHBOURS;
pub use crate::window::wide;

/// Penetration of a flat wall at which every method answers with the caller's spring, mm: 1 N at
/// 2 N/mm. A method whose force is not in proportion to the depth is softer above, stiffer below
/// it, or the other way round.
pub const REFERENCE_MM: f32 = 0.5;

/// A method's own part.
pub trait MethodCore: Send {
    /// Most voxels that a burr bites at once.
    const MAX_BITES: usize = 16384;

    /// Finds the contact of a tool whose pose is finite, moves the proxy in `held` and cuts.
    fn tick(&mut self, bone: &BoneVolume, tool: &ToolState, held: &mut HeldTool, out: &mut RigidStep);

    /// Forgets all history; the tool is at `pose`.
    fn reset(&mut self, _pose: Pose) {}
}

/// The tool with its proxy and its burr.
pub struct HeldTool {
    /// The tool.
    pub tool: Tool,
    /// Pose of the proxy.
    pub proxy: Pose,
    burr: Burr,
    nodes: Nodes,
    /// The bone that the nodes show.
    bone: u64,
    /// Whether the burr cuts in this tick.
    cuts: bool,
    dt_ms: f32,
}

impl HeldTool {
    /// Where the burr cuts in this tick, takes bone away between `device` and `proxy`, pressed
    /// `depth_mm` deep.
    pub fn cut(&mut self, bone: &BoneVolume, device: Vec3, proxy: Vec3, depth_mm: f32, out: &mut RigidStep) {
        if self.cuts {
            let (radius_mm, dt_ms) = (self.tool.tip_radius_mm, self.dt_ms);
            let axis = self.proxy.rotation * Vec3::Z;
            let side = 0.5 * self.tool.cutting_mm * axis;
            let cut = Cut { device, proxy, radius_mm, side, axis, depth_mm, dt_ms };
            if self.bone != bone.id() {
                self.bone = bone.id();
                self.nodes.forget();
            }
            self.nodes.renew(bone);
            self.burr.cut(bone, &cut, &mut self.nodes, out);
        }
    }

    /// Where the burr cuts in this tick, wears these voxels by the per-tick law.
    pub fn wear(&mut self, bone: &BoneVolume, voxels: impl Iterator<Item = IVec3>, out: &mut RigidStep) {
        if self.cuts {
            self.burr.wear(bone, voxels, out);
        }
    }

    /// Where the burr cuts in this tick, wears these voxels with what its load earns, `depth_mm`
    /// deep along `normal`.
    pub fn erode(&mut self, bone: &BoneVolume, worn: &[WornVoxel], normal: Vec3, depth_mm: f32, out: &mut RigidStep) {
        if self.cuts && depth_mm.is_finite() && self.dt_ms.is_finite() && self.dt_ms > 0.0 {
            let proxy = self.proxy.translation;
            let (radius_mm, dt_ms) = (self.tool.tip_radius_mm, self.dt_ms);
            let (device, axis) = (proxy - depth_mm * normal, self.proxy.rotation * Vec3::Z);
            let cut = Cut { device, proxy, radius_mm, side: Vec3::ZERO, axis, depth_mm, dt_ms };
            self.burr.erode(bone, &cut, worn, out);
        }
    }

    /// Time since the last tick, ms; nothing where that is no time.
    #[inline]
    pub fn tick_ms(&self) -> Option<f32> {
        (self.dt_ms.is_finite() && self.dt_ms > 0.0).then_some(self.dt_ms)
    }

    /// Fills the manifold for a ball that touches under the proxy, if normal and depth are
    /// something.
    #[inline]
    pub fn report(&self, normal: Vec3, depth_mm: f32, out: &mut RigidStep) {
        if normal != Vec3::ZERO && depth_mm > 0.0 {
            (out.manifold.normal, out.manifold.depth_mm) = (normal, depth_mm);
            out.manifold.point = self.proxy.translation - self.tool.tip_radius_mm * normal;
        }
    }
}

struct Framed<R> {
    rival: R,
    held: HeldTool,
    /// Whether the proxy has been put anywhere yet.
    placed: bool,
}

/// A tool handled by a rival. Until [`reset`](RigidContact::reset) puts it somewhere it starts at
/// the first tool pose.
pub fn framed<R: MethodCore + 'static>(tool: &Tool, removal: RemovalLaw, rival: R) -> Box<dyn RigidContact> {
    let burr = Burr::new(removal, R::MAX_BITES);
    let nodes = Nodes::new(tool.tip_radius_mm);
    let held = HeldTool { tool: *tool, proxy: Pose::IDENTITY, burr, nodes, bone: u64::MAX, cuts: false, dt_ms: 0.0 };
    Box::new(Framed { rival, held, placed: false })
}

impl<R: MethodCore> RigidContact for Framed<R> {
    fn step(&mut self, bone: &BoneVolume, tool: &ToolState, drilling: bool, dt_ms: f32, out: &mut RigidStep) {
        out.clear();
        if !tool.is_finite() {
            out.fallbacks = 1;
            return;
        }
        if !self.placed {
            self.reset(tool.world_from_tool);
        }
        (self.held.cuts, self.held.dt_ms) = (drilling && self.held.tool.kind.cuts(), dt_ms);
        if !self.held.cuts {
            self.held.burr.pause();
        }
        self.rival.tick(bone, tool, &mut self.held, out);
    }

    fn proxy(&self) -> Pose {
        self.held.proxy
    }

    fn reset(&mut self, pose: Pose) {
        self.held.proxy = pose;
        self.held.burr.reset();
        self.placed = pose.translation.is_finite();
        self.rival.reset(pose);
    }

    fn cut_by(&mut self, law: RemovalLaw) {
        self.held.burr.cut_by(law);
    }
}

/// What a penalty method knows to answer.
pub trait PenaltyProbe: Send {
    /// What the tool at `pose` feels; `None` without contact. Fills contacts and counts of `out`.
    fn feel(&mut self, bone: &BoneVolume, tool: &Tool, pose: &Pose, out: &mut RigidStep) -> Option<WholeContact>;

    /// The voxels that a burr wears which feels this; `None` for one that cuts by its shape.
    fn wears(&mut self, _bone: &BoneVolume, _tool: &Tool, _pose: &Pose, _felt: &WholeContact) -> Option<&[WornVoxel]> {
        None
    }
}

/// A contact as a whole.
pub struct WholeContact {
    /// Unit vector out of the bone.
    pub normal: Vec3,
    /// Depth along it, mm.
    pub depth_mm: f32,
    /// What the burr alone is pushed, mm: what it cuts with.
    pub burr: Vec3,
}

impl<P: PenaltyProbe> MethodCore for P {
    fn tick(&mut self, bone: &BoneVolume, tool: &ToolState, held: &mut HeldTool, out: &mut RigidStep) {
        held.proxy = tool.world_from_tool;
        let felt = self.feel(bone, &held.tool, &tool.world_from_tool, out);
        let Some(felt) = felt else { return };
        let WholeContact { normal, depth_mm, burr } = felt;
        held.proxy.translation += depth_mm * normal;
        held.report(normal, depth_mm, out);
        if !held.cuts {
            return;
        }
        if let Some(worn) = self.wears(bone, &held.tool, &tool.world_from_tool, &felt) {
            held.erode(bone, worn, normal, depth_mm, out);
        } else if burr != Vec3::ZERO {
            held.cut(bone, tool.tip(), tool.tip() + burr, burr.length(), out);
        }
    }
}

/// The direction of `push` and `depth`, if both are something.
#[inline]
pub fn answer(push: Vec3, depth_mm: f32, out: &mut RigidStep) -> Option<WholeContact> {
    let normal = push.normalize_or_zero();
    if normal == Vec3::ZERO {
        // Opposed contacts cancel: there is no way to push.
        out.fallbacks += u32::from(out.points_in_contact > 0);
        return None;
    }
    (depth_mm > 0.0 && depth_mm.is_finite()).then_some(WholeContact { normal, depth_mm, burr: depth_mm * normal })
}

/// What the points of a shell push.
pub struct Pushes(Vec<Contact>);

impl Pushes {
    /// Room for all points of a shell.
    pub fn room(shell: &Pointshell) -> Self {
        Self(Vec::with_capacity(shell.points.len()))
    }

    /// Forgets all.
    #[inline]
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Adds a point's push, also to the contacts of `out`.
    #[inline]
    pub fn push(&mut self, contact: Contact, out: &mut RigidStep) {
        out.points_in_contact += 1;
        out.manifold.push(contact);
        if self.0.len() < self.0.capacity() {
            self.0.push(contact);
        }
    }

    /// The direction of all pushes together, and the depth of the deepest along it.
    #[inline]
    pub fn deepest(&self, out: &mut RigidStep) -> Option<WholeContact> {
        out.voxels_in_contact = out.points_in_contact;
        let push: Vec3 = self.0.iter().map(|c| c.depth_mm * c.normal).sum();
        let normal = push.normalize_or_zero();
        let depth = self.0.iter().map(|c| c.depth_mm * c.normal.dot(normal)).fold(0.0, f32::max);
        answer(push, depth, out)
    }
}

/// So many points on the ball at a tool's tip.
pub fn ball_shell(tool: &Tool, points: usize) -> Pointshell {
    Pointshell::sphere(tool.tip_radius_mm, points.clamp(8, 20_000), Spread::Fibonacci)
}
