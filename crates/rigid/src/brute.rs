//! The oracle: a ball on the triangulated isosurface, moved in small steps, in f64.
//!
//! # Theory
//! The surface is that of marching cubes (`cell.rs`). The ball is moved towards the device by a
//! small step, then pushed off the nearest triangle until none is nearer than its radius; and
//! again, until it comes back to where it was. Its rest is the god-object of the space of centres
//! by definition: no step towards the device is allowed any more.
//!
//! # Practice
//! A millisecond to tenths of a second a tick. Nothing is cached from tick to tick but the ball's
//! place.
//!
//! # Sources
//! Distance to a triangle after C. Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5.
//!
//! # When not to use it
//! In a haptic tick.

use crate::cell;
use crate::frame::{HeldTool, MethodCore, framed};
use crate::method::Descriptor;
use crate::removal::RemovalLaw;
use crate::rows::each;
use crate::{RigidContact, RigidStep};
use glam::{DVec3, IVec3};
use trepan_bone::BoneVolume;
use trepan_contact::Contact;
use trepan_geometry::{Aabb, Pose, Tool, ToolState};

/// Most triangles in reach; the rest is counted as a fallback.
const MAX_TRIANGLES: usize = 1 << 16;
/// Most pushes off triangles after one step.
const MAX_PUSHES: usize = 64;
/// How far the ball may travel between two triangulations, voxels.
const REACH: f64 = 1.0;

/// How the method is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Longest step, voxels. Smaller is more faithful and slower.
    pub step_voxels: f64,
    /// Most steps in one tick.
    pub max_steps: u32,
    /// What a burr takes away.
    pub removal: RemovalLaw,
}

impl Default for Config {
    fn default() -> Self {
        Self { step_voxels: 0.1, max_steps: 20_000, removal: RemovalLaw::RATE }
    }
}

/// The ball of one tool.
struct Brute {
    config: Config,
    radius: f64,
    centre: DVec3,
    triangles: Vec<[DVec3; 3]>,
    overflow: bool,
}

/// The method with a ball of the tool's tip.
pub fn new(tool: &Tool, config: Config) -> Box<dyn RigidContact> {
    let (radius, triangles) = (tool.tip_radius_mm.into(), Vec::with_capacity(MAX_TRIANGLES));
    framed(tool, config.removal, Brute { config, radius, centre: DVec3::ZERO, triangles, overflow: false })
}

impl Brute {
    /// Triangles within `reach` mm of the centre.
    fn triangulate(&mut self, bone: &BoneVolume, reach: f64, out: &mut RigidStep) {
        self.triangles.clear();
        self.overflow = false;
        let spacing = f64::from(bone.spacing_mm());
        let low = bone.grid_of((self.centre - reach).as_vec3()).floor().as_ivec3() - 1;
        let high = bone.grid_of((self.centre + reach).as_vec3()).ceil().as_ivec3() + 1;
        each(low, high + 1, |cell| {
            let middle = bone.origin().as_dvec3() + (cell.as_dvec3() + 0.5) * spacing;
            out.voxels_swept += 1;
            if middle.distance(self.centre) < reach + spacing {
                self.cell(bone, cell);
            }
        });
        out.fallbacks += u32::from(self.overflow);
    }

    /// The triangles of the cell whose lowest corner is voxel `cell`.
    fn cell(&mut self, bone: &BoneVolume, cell: IVec3) {
        let corner = |c: i32| cell + IVec3::new(c & 1, c >> 1 & 1, c >> 2);
        let over = |c: usize| f64::from(bone.hu(corner(c as i32))) - f64::from(bone.isovalue());
        let (origin, spacing) = (bone.origin().as_dvec3(), f64::from(bone.spacing_mm()));
        cell::triangles(&core::array::from_fn(over), |triangle| {
            self.overflow |= self.triangles.len() == MAX_TRIANGLES;
            if !self.overflow {
                self.triangles.push(triangle.map(|p| origin + (cell.as_dvec3() + p) * spacing));
            }
        });
    }

    /// The nearest point of the surface and its distance.
    fn nearest(&self, centre: DVec3) -> Option<(DVec3, f64)> {
        let points = self.triangles.iter().map(|t| nearest_on_triangle(centre, t));
        points.map(|p| (p, p.distance(centre))).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Pushes a ball at `centre` off the surface; `None` when it does not come free.
    fn pushed_off(&self, mut centre: DVec3) -> Option<DVec3> {
        for _ in 0..MAX_PUSHES {
            match self.nearest(centre) {
                Some((point, distance)) if distance < self.radius - 1e-7 => {
                    centre += (centre - point) * ((self.radius - distance) / distance.max(1e-9));
                }
                _ => return Some(centre),
            }
        }
        None
    }

    fn follow(&mut self, bone: &BoneVolume, device: DVec3, out: &mut RigidStep) {
        let (radius, spacing) = (self.radius, f64::from(bone.spacing_mm()));
        let way = Aabb::of_points(&[self.centre.as_vec3(), device.as_vec3()]);
        if !way.inflated((radius + 2.0 * spacing) as f32).overlaps(bone.bounds()) {
            self.triangles.clear();
            self.centre = device;
            return;
        }
        let mut known = self.centre;
        self.triangulate(bone, radius + REACH * spacing, out);
        for _ in 0..self.config.max_steps {
            if self.centre.distance(known) > (REACH - 2.0 * self.config.step_voxels) * spacing {
                known = self.centre;
                self.triangulate(bone, radius + REACH * spacing, out);
            }
            let wanted = (device - self.centre).clamp_length_max(self.config.step_voxels * spacing);
            let Some(next) = self.pushed_off(self.centre + wanted) else {
                out.fallbacks += 1;
                return;
            };
            let moved = next.distance(self.centre);
            // A push that leads further from the device than before is a dead end, not a way round.
            if moved < 1e-6 * spacing || next.distance(device) > self.centre.distance(device) - 1e-9 {
                self.centre = if next.distance(device) < self.centre.distance(device) { next } else { self.centre };
                return;
            }
            self.centre = next;
        }
        out.fallbacks += 1;
    }

    fn report(&self, device: DVec3, out: &mut RigidStep) {
        let lifted = self.centre - device;
        let depth = lifted.length();
        if depth < 1e-9 {
            return;
        }
        if let Some((point, _)) = self.nearest(self.centre) {
            let normal = (self.centre - point).normalize_or_zero();
            let depth_mm = (self.radius - (device - point).dot(normal)).max(0.0) as f32;
            out.manifold.push(Contact { point: point.as_vec3(), normal: normal.as_vec3(), depth_mm });
        }
        (out.points_in_contact, out.voxels_in_contact) = (1, 1);
        let normal = lifted / depth;
        out.manifold.normal = normal.as_vec3();
        out.manifold.depth_mm = depth as f32;
        out.manifold.point = (self.centre - self.radius * normal).as_vec3();
    }
}

impl MethodCore for Brute {
    const MAX_BITES: usize = MAX_TRIANGLES;

    fn tick(&mut self, bone: &BoneVolume, tool: &ToolState, held: &mut HeldTool, out: &mut RigidStep) {
        let device = tool.tip();
        self.follow(bone, device.as_dvec3(), out);
        let proxy = self.centre.as_vec3();
        held.proxy = Pose::from_parts(proxy, tool.world_from_tool.rotation);
        self.report(device.as_dvec3(), out);
        held.cut(bone, device, proxy, device.distance(proxy), out);
    }

    fn reset(&mut self, pose: Pose) {
        self.centre = pose.translation.as_dvec3();
    }
}

/// The point of a triangle nearest to `p`.
fn nearest_on_triangle(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(p - a), ac.dot(p - a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let (d3, d4) = (ab.dot(p - b), ac.dot(p - b));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let (d5, d6) = (ab.dot(p - c), ac.dot(p - c));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let (vc, vb, va) = (d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    if sum > 0.0 { a + ab * (vb / sum) + ac * (vc / sum) } else { a }
}

/// What the method says of itself.
pub const METHOD: Descriptor = Descriptor {
    has_proxy: true,
    is_oracle: true,
    ..Descriptor::of("brute", "Zilles and Salisbury 1995, by small steps in f64", |tool, _| {
        new(tool, Config::default())
    })
};
