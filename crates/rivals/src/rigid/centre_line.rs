//! The line approximation: a vertex in the burr's centre and some along the shaft's axis, each held
//! by what it met on its way.
//!
//! # Theory
//! A vertex that moves into bone from one tick to the next leaves its proxy where its way met the
//! bone. From there the proxy follows on the tangent plane of the density, as far as its way is
//! free; a spring joins the two:
//! ```text
//! F = k (proxy₀ - tip) + k (proxyₛ - xₛ) ,   τ = (xₛ - tip) × k (proxyₛ - xₛ)
//! s: the shaft's vertex whose proxy is furthest off
//! ```
//!
//! # Practice
//! World mm. A few looks per vertex and tick, since only its own way is searched.
//!
//! # Sources
//! N. Asenjo, *Multipoint collision detection algorithm for bone milling and drilling in a haptic
//! VR surgery simulator*, KTH 2008, "line approximation algorithm", as the thesis tells it (2.3.1).
//!
//! # When not to use it
//! For burrs that are seen: the line has no thickness, so that a burr sinks in to its centre before
//! it touches.

use super::ray_trace::over_iso;
use super::traverse::first_bone;
use trepan_bone::BoneVolume;
use trepan_contact::Contact;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_rigid::frame::{HeldTool, MethodCore, framed};
use trepan_rigid::removal::RemovalLaw;
use trepan_rigid::{Descriptor, Extent};
use trepan_rigid::{RigidContact, RigidStep};

/// Most vertices on a shaft.
const MAX_VERTICES: usize = 512;
/// How far before bone a proxy stops, voxels.
const BEFORE: f32 = 0.01;

/// How the method is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Way between two vertices on the axis, mm.
    pub step_mm: f32,
    /// What a burr takes away.
    pub removal: RemovalLaw,
}

impl Default for Config {
    fn default() -> Self {
        Self { step_mm: 2.0, removal: RemovalLaw::RATE }
    }
}

/// A point of the axis.
#[derive(Clone, Copy, Debug)]
struct Vertex {
    /// Height over the tip, mm.
    height_mm: f32,
    /// Where bone lets it be, world mm.
    proxy: Vec3,
}

impl Vertex {
    /// Follows its point of the tool, which is at `to` now.
    fn follow(&mut self, bone: &BoneVolume, to: Vec3, visited: &mut u32) {
        let stop = swept(bone, self.proxy, to, visited);
        self.proxy = stop;
        if stop != to {
            let normal = normal(bone, stop);
            let goal = to + normal * (stop - to).dot(normal).max(0.0);
            self.proxy = swept(bone, stop, goal, visited);
        }
    }
}

/// The line of one tool.
struct CentreLine {
    /// The first is the tip.
    vertices: Vec<Vertex>,
}

/// The method with a line of the tool's length.
pub fn new(tool: &Tool, config: Config) -> Box<dyn RigidContact> {
    let step_mm = config.step_mm.max(1e-2);
    let heights = (1..MAX_VERTICES).map(|at| tool.tip_radius_mm + at as f32 * step_mm);
    let on_shaft = heights.take_while(|&height| height <= tool.shaft_length_mm);
    let vertex = |height_mm| Vertex { height_mm, proxy: Vec3::ZERO };
    let vertices = core::iter::once(0.0).chain(on_shaft).map(vertex).collect();
    framed(tool, config.removal, CentreLine { vertices })
}

impl CentreLine {
    /// The springs of tip and shaft, and the shaft's arm, world mm.
    fn springs(&mut self, bone: &BoneVolume, pose: &Pose, out: &mut RigidStep) -> (Vec3, Vec3, Vec3) {
        let (mut tip, mut shaft, mut arm) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        for vertex in &mut self.vertices {
            let off = pose.rotation * Vec3::Z * vertex.height_mm;
            let at = pose.translation + off;
            vertex.follow(bone, at, &mut out.voxels_swept);
            let spring = vertex.proxy - at;
            let depth_mm = spring.length();
            if depth_mm == 0.0 {
                continue;
            }
            out.points_in_contact += 1;
            out.manifold.push(Contact { point: vertex.proxy, normal: spring / depth_mm, depth_mm });
            if vertex.height_mm == 0.0 {
                tip = spring;
            } else if depth_mm > shaft.length() {
                (shaft, arm) = (spring, off);
            }
        }
        out.voxels_in_contact = out.points_in_contact;
        (tip, shaft, arm)
    }
}

impl MethodCore for CentreLine {
    fn tick(&mut self, bone: &BoneVolume, tool: &ToolState, held: &mut HeldTool, out: &mut RigidStep) {
        let (tip, shaft, arm) = self.springs(bone, &tool.world_from_tool, out);
        held.proxy = tool.world_from_tool;
        held.proxy.translation += tip + shaft;
        let depth = (tip + shaft).length();
        if depth > 0.0 {
            out.manifold.normal = (tip + shaft) / depth;
            out.manifold.depth_mm = depth;
            out.manifold.point = tool.tip();
            out.manifold.couple_mm = arm.cross(shaft) / depth;
        }
        held.cut(bone, tool.tip(), tool.tip() + tip, tip.length(), out);
    }

    fn reset(&mut self, pose: Pose) {
        for vertex in &mut self.vertices {
            vertex.proxy = pose.translation + pose.rotation * Vec3::Z * vertex.height_mm;
        }
    }
}

/// Where a point on its way is stopped by bone.
fn swept(bone: &BoneVolume, from: Vec3, to: Vec3, visited: &mut u32) -> Vec3 {
    match first_bone(bone, from, to, visited) {
        Some(share) => {
            let back = BEFORE * bone.spacing_mm() / from.distance(to).max(1e-6);
            from.lerp(to, (share - back).max(0.0))
        }
        None => to,
    }
}

/// Unit normal of the density at `point`, out of the bone; zero where there is no slope.
fn normal(bone: &BoneVolume, point: Vec3) -> Vec3 {
    let at = bone.grid_of(point);
    let along = |axis: Vec3| over_iso(bone, at - 0.5 * axis) - over_iso(bone, at + 0.5 * axis);
    Vec3::new(along(Vec3::X), along(Vec3::Y), along(Vec3::Z)).normalize_or_zero()
}

/// What the method says of itself.
pub const METHOD: Descriptor = Descriptor {
    extent: Extent::Axis,
    has_proxy: true,
    ..Descriptor::of("centre-line", "Asenjo 2008, line approximation", |tool, _| new(tool, Config::default()))
};
