//! Burr and shaft by their distance from voxels that a tree of boxes finds, with damping, friction
//! and torque.
//!
//! # Theory
//! A voxel of bone of edge s touches the burr when it is nearer to the burr's centre than the
//! radius, and the shaft when it is nearer to the shaft's axis than the shaft's radius. For each of
//! the two
//! ```text
//! n = Σ dᵢ nᵢ / |Σ dᵢ nᵢ| ,   d = max dᵢ ,   x = Σ dᵢ xᵢ / Σ dᵢ
//! dᵢ = radius + ⅜ s - distance,   nᵢ from the voxel's centre to centre or axis
//! Fₙ = k (d n)₁ + k (d n)₂ ,   τ = (x₂ - tip) × k (d n)₂
//! F = max(0, |Fₙ| - b v·n) n - μ |Fₙ| vₜ / max(|vₜ|, v₀)      v: velocity of the tip
//! ```
//! with damping b, friction μ, and v₀ under which friction is a damper.
//!
//! # Practice
//! World mm. The shaft does not cut. Bone of the scenes is smooth and undamped, so that [`METHOD`]
//! has μ = 0 and b = 0, as their truth has; [`new`] takes others. On a flat wall the depth is the
//! wall's, but for the voxels' steps, so that no gain is needed.
//!
//! # Sources
//! X. He, Y. Chen, *Bone drilling simulation based on six degree-of-freedom haptic rendering*,
//! EuroHaptics 2006: not read. Ball and cylinder, distances of voxels, the OBB tree of the
//! volumetric model, elastic and frictional forces with springs and dampers, torque: as the thesis
//! tells it (1.2 and 2.3.1). Liberties: how the voxels' distances become one force; voxels as balls
//! of ⅜ of an edge, without which bone begins as much later; leaves of the tree are bricks of
//! 8³ voxels; b and μ, which the thesis does not give.
//!
//! # When not to use it
//! For a steady force: depth is counted from voxel centres, so that it steps by fractions of a
//! voxel. Against thin walls: it has no proxy.

use super::obb_tree::ObbTree;
use glam::IVec3;
use trepan_bone::{BRICK, BoneVolume};
use trepan_contact::Contact;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_rigid::frame::Shaft;
use trepan_rigid::frame::wide;
use trepan_rigid::frame::{HeldTool, MethodCore, framed};
use trepan_rigid::removal::RemovalLaw;
use trepan_rigid::{Descriptor, Extent};
use trepan_rigid::{RigidContact, RigidStep};
use wide::{f32x8, i16x8};

/// Stiffness k that damping is measured against, N/mm: the caller's.
const STIFFNESS: f32 = 2.0;
/// Speed v₀ under which friction is a damper, mm/ms.
const SLOW: f32 = 0.02;

/// How far the deepest voxel's centre is under a flat wall, as a mean over its directions and
/// places, voxels.
const VOXEL: f32 = 0.375;

/// What the force has beside its springs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Config {
    /// Damping b along the normal, N ms/mm.
    pub damping: f32,
    /// Coefficient μ of friction.
    pub friction: f32,
}

/// A part of the tool: a straight piece of axis with a radius; grid units.
#[derive(Clone, Copy)]
struct Rod {
    start: Vec3,
    axis: Vec3,
    span: (f32, f32),
    radius: f32,
}

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
    /// Takes in the voxels of a brick that are within a rod.
    #[inline]
    fn add(&mut self, bone: &BoneVolume, brick: IVec3, rod: &Rod, visited: &mut u32) {
        let lanes = f32x8::from([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        let (border, zero) = (i16x8::splat(bone.isovalue()), f32x8::ZERO);
        let (radius, a) = (f32x8::splat(rod.radius), rod.axis);
        let beyond = rod.radius + 1.0;
        let ends = [rod.span.0, rod.span.1].map(|s| rod.start + s * rod.axis);
        let low = (ends[0].min(ends[1]) - rod.radius).as_ivec3().max(brick);
        let high = (ends[0].max(ends[1]) + rod.radius).as_ivec3().min(brick + BRICK as i32 - 1);
        for (j, k) in (low.z..=high.z).flat_map(|k| (low.y..=high.y).map(move |j| (j, k))) {
            let start = IVec3::new(brick.x, j, k);
            let from = start.as_vec3() - rod.start;
            // The whole row is further off than the radius.
            let middle = from + 3.5 * Vec3::X;
            let s = middle.dot(a).clamp(rod.span.0, rod.span.1);
            if (middle - s * a).length_squared() > (beyond + 3.5) * (beyond + 3.5) {
                continue;
            }
            *visited += BRICK as u32;
            let x = lanes + from.x;
            let along = x * a.x + (from.y * a.y + from.z * a.z);
            let (first, last) = (f32x8::splat(rod.span.0), f32x8::splat(rod.span.1));
            let s = along.fast_max(first).fast_min(last);
            let [ax, ay, az] = [s * a.x - x, s * a.y - from.y, s * a.z - from.z];
            let distance = (ax * ax + ay * ay + az * az).sqrt().fast_max(f32x8::splat(1e-6));
            let depth = (radius - distance).fast_max(zero);
            if depth.simd_gt(zero).to_bitmask() == 0 {
                continue;
            }
            let mut hu = [0; BRICK];
            bone.read_row(start, &mut hu);
            let is_bone = wide_mask(i16x8::new(hu), border);
            let depth = is_bone.select(depth, zero);
            let touches = depth.simd_gt(zero).to_bitmask();
            if touches == 0 {
                continue;
            }
            let (share, weight) = (depth / distance, depth.reduce_add());
            self.push += Vec3::new((ax * share).reduce_add(), (ay * share).reduce_add(), (az * share).reduce_add());
            self.deepest = depth.as_array().iter().fold(self.deepest, |most, &depth| most.max(depth));
            self.weight += weight;
            let on_row = start.as_vec3();
            self.places += Vec3::new((depth * lanes).reduce_add(), 0.0, 0.0) + weight * on_row;
            self.voxels += touches.count_ones();
        }
    }

    /// The contact, world mm.
    fn contact(&self, bone: &BoneVolume) -> Contact {
        let point = bone.origin() + bone.spacing_mm() * self.places / self.weight.max(1e-12);
        Contact { point, normal: self.push.normalize_or_zero(), depth_mm: self.deepest * bone.spacing_mm() }
    }
}

/// Lanes in which a value reaches the border.
#[inline]
fn wide_mask(values: i16x8, border: i16x8) -> f32x8 {
    let reached = values.simd_ge(border).to_array();
    wide(&reached).simd_lt(f32x8::ZERO)
}

struct BurrAndShaft {
    config: Config,
    tree: ObbTree,
    /// Where the tip was, world mm; `None` before the first tick.
    last: Option<Vec3>,
}

/// The method with damping and friction.
pub fn new(tool: &Tool, config: Config) -> Box<dyn RigidContact> {
    framed(tool, RemovalLaw::RATE, BurrAndShaft { config, tree: ObbTree::default(), last: None })
}

impl BurrAndShaft {
    fn press(&self, bone: &BoneVolume, rod: &Rod, out: &mut RigidStep) -> Press {
        let mut press = Press::default();
        let ends = [rod.span.0, rod.span.1].map(|s| rod.start + s * rod.axis);
        let mut visited = 0;
        self.tree.near((ends[0], ends[1]), rod.radius, |brick| press.add(bone, brick, rod, &mut visited));
        out.voxels_swept += visited;
        press
    }

    /// Burr and shaft.
    fn parts(&self, bone: &BoneVolume, tool: &Tool, pose: &Pose, out: &mut RigidStep) -> [Press; 2] {
        let start = bone.grid_of(pose.translation);
        let Shaft { axis, span, radius, .. } = Shaft::of(tool, bone.spacing_mm(), start, pose.rotation * Vec3::Z);
        let grown = tool.tip_radius_mm / bone.spacing_mm() + VOXEL;
        let burr = Rod { start, axis, span: (0.0, 0.0), radius: grown };
        [burr, Rod { span, radius: radius + VOXEL, ..burr }].map(|rod| self.press(bone, &rod, out))
    }
}

impl MethodCore for BurrAndShaft {
    fn tick(&mut self, bone: &BoneVolume, tool: &ToolState, held: &mut HeldTool, out: &mut RigidStep) {
        self.tree.renew(bone);
        let pose = tool.world_from_tool;
        held.proxy = pose;
        let way = pose.translation - self.last.replace(pose.translation).unwrap_or(pose.translation);
        let parts = self.parts(bone, &held.tool, &pose, out);
        out.voxels_in_contact = parts.iter().map(|part| part.voxels).sum();
        out.points_in_contact = out.voxels_in_contact;
        let (mut pushes, mut moment) = ([Vec3::ZERO; 2], Vec3::ZERO);
        for (at, part) in parts.iter().enumerate().filter(|(_, part)| part.voxels > 0) {
            let contact = part.contact(bone);
            pushes[at] = contact.depth_mm * contact.normal;
            if at == 1 {
                moment = (contact.point - pose.translation).cross(pushes[at]);
            }
            out.manifold.push(contact);
        }
        let push = pushes[0] + pushes[1];
        let (normal, depth_mm) = (push.normalize_or_zero(), push.length());
        if normal == Vec3::ZERO {
            // Opposed contacts cancel: there is no way to push.
            out.fallbacks += u32::from(out.points_in_contact > 0);
            return;
        }
        let speed = held.tick_ms().map_or(Vec3::ZERO, |dt_ms| way / dt_ms);
        let damped = (depth_mm - self.config.damping / STIFFNESS * speed.dot(normal)).max(0.0);
        let aside = speed.reject_from_normalized(normal);
        let felt = damped * normal - self.config.friction * depth_mm / aside.length().max(SLOW) * aside;
        held.proxy.translation += push;
        held.report(felt.normalize_or_zero(), felt.length(), out);
        out.manifold.couple_mm = moment / depth_mm;
        if pushes[0] != Vec3::ZERO {
            held.cut(bone, tool.tip(), tool.tip() + pushes[0], pushes[0].length(), out);
        }
    }

    fn reset(&mut self, pose: Pose) {
        self.last = Some(pose.translation);
    }
}

/// What the method says of itself.
pub const METHOD: Descriptor = Descriptor {
    extent: Extent::BallAndShaft,
    ..Descriptor::of("burr-and-shaft", "He and Chen 2006", |tool, _| new(tool, Config::default()))
};

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_volume::VoxelVolume;

    /// The force over k of a ball of 2 mm that goes `way` mm in a ms and is then 0.6 mm in flat
    /// bone.
    fn felt(config: Config, way: Vec3) -> Vec3 {
        let mut ct = VoxelVolume::isotropic([24; 3], Vec3::splat(-5.75), 0.5, 0i16);
        let place = |at: usize| -5.75 + 0.5 * (at / 576) as f32;
        (0..ct.data.len()).for_each(|at| ct.data[at] = (400.0 - 2000.0 * place(at)).clamp(-600.0, 1400.0) as i16);
        let bone = BoneVolume::new(&ct, 400).expect("there is bone");
        let (mut contact, mut out) = (new(&Tool::burr(2.0), config), RigidStep::default());
        let end = Pose::from_translation(Vec3::Z * 1.4);
        contact.reset(Pose { translation: end.translation - way, ..end });
        contact.step(&bone, &ToolState::at(end), false, 1.0, &mut out);
        out.manifold.depth_mm * out.manifold.normal
    }

    #[test]
    fn damping_opposes_the_press_and_friction_the_slide() {
        let config = Config { damping: 1.0, friction: 0.2 };
        let (still, spring) = (felt(config, Vec3::ZERO), felt(Config::default(), Vec3::new(0.1, 0.0, -0.1)));
        assert!((still - spring).length() < 1e-6 && still.z > 0.4, "{still} {spring}");
        let pressed = felt(config, Vec3::Z * -0.1);
        assert!((pressed - still - Vec3::Z * 0.05).length() < 1e-5, "b v / k: {pressed}");
        let slid = felt(config, Vec3::X * 0.1);
        assert!((slid - still + Vec3::X * 0.2 * still.z).length() < 1e-5, "μ F: {slid}");
        let slow = felt(config, Vec3::X * 0.5 * SLOW);
        assert!((slow - still + Vec3::X * 0.1 * still.z).length() < 1e-5, "half of it: {slow}");
        assert_eq!(felt(config, Vec3::Z * 2.0).z, 0.0, "never pulls");
    }
}
