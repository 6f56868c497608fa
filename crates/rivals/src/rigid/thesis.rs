//! The thesis's method, whole: point shell against voxels, Algorithm 1, sweeps and a god-object on
//! the mean plane.
//!
//! # Theory
//! In one tick:
//! 1. sweep the proxy towards the device, stop in light touch with the first bone voxel;
//! 2. colliding box = box of the tool ∩ box of the skull; when it is empty, sweep once more: free
//!    way, no contact; else the normal is against the sweep, with a small preset depth;
//! 3. contact set: voxels of bone that hold points of the shell; none: as in 2;
//! 4. while drilling, each of these voxels loses density;
//! 5. normal = mean of the voxels' normals (Eq 3.4), depth = the largest of the voxels' mean depths
//!    (Algorithm 1), each point's depth being its distance under the tangent plane: through the
//!    voxel's centre, with the point's normal (McNeely et al. 1999);
//! 6. god-object on the plane of that normal, reached by one more sweep; if it is not where the
//!    device is, the depth is the distance between the two.
//!
//! What is printed and does not hold is an option: even or crowded points, the sweep's steps,
//! Algorithm 1's sum that is never set back to zero, removal per tick. [`Config::PRINTED`] has them
//! all as printed; the default has them put right.
//!
//! # Practice
//! 466 points; 5 to 15 us a tick. The depth steps by fractions of a voxel as points enter and leave
//! voxels: the force at 2 N/mm changes by tenths of a newton from tick to tick, as in the thesis's
//! own figures.
//!
//! # Sources
//! Chapter 3 of the thesis; W. McNeely, K. Puterbaugh, J. Troy, *Six degree-of-freedom haptic
//! rendering using voxel sampling*, SIGGRAPH 1999; M. Renz et al., *Stable haptic interaction with
//! virtual environments using an adapted voxmap-pointshell algorithm*, Eurohaptics 2001.
//!
//! # When not to use it
//! For force feedback on a hand: [`god_object_sphere`](trepan_rigid::god_object_sphere) is smoother
//! and nearer to the surface. It is here for comparison.

use super::sweep::{Ball, Sweep};
use glam::IVec3;
use trepan_bone::BoneVolume;
use trepan_contact::{Contact, GodObject, Plane};
use trepan_geometry::{Aabb, Pointshell, Spread, Tool, ToolState, Vec3};
use trepan_rigid::Descriptor;
use trepan_rigid::frame::{HeldTool, MethodCore, framed};
use trepan_rigid::removal::RemovalLaw;
use trepan_rigid::{RigidContact, RigidStep};

/// How the method is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Points of the shell. More find thinner spikes and cost in proportion.
    pub points: usize,
    /// How they are spread. `LatitudeLongitude` is Eq 3.1 as printed.
    pub spread: Spread,
    /// How the way of the proxy is searched.
    pub sweep: Sweep,
    /// Whether Algorithm 1 keeps its sum from voxel to voxel, as printed. Depths then depend on the
    /// order of the voxels.
    pub running_sum: bool,
    /// Depth when only the sweep has met bone, mm.
    pub preset_depth_mm: f32,
    /// What a burr takes away.
    pub removal: RemovalLaw,
}

impl Config {
    /// As printed, errors and all.
    pub const PRINTED: Self = Self {
        points: Pointshell::RIGID_COUNT,
        spread: Spread::LatitudeLongitude,
        sweep: Sweep::Steps,
        running_sum: true,
        preset_depth_mm: 0.1,
        removal: RemovalLaw::PER_TICK,
    };
}

impl Default for Config {
    /// With the errors put right.
    fn default() -> Self {
        Self {
            spread: Spread::Fibonacci,
            sweep: Sweep::Line,
            running_sum: false,
            removal: RemovalLaw::RATE,
            ..Self::PRINTED
        }
    }
}

/// A voxel of bone that holds points of the shell.
#[derive(Clone, Copy, Debug, Default)]
struct Touched {
    voxel: IVec3,
    /// Sum of its points' normals.
    normals: Vec3,
    /// Sum of its points' depths under their tangent planes, mm.
    depths_mm: f32,
    points: u32,
}

/// The shell of one tool.
struct Thesis {
    config: Config,
    shell: Pointshell,
    touched: Vec<Touched>,
    /// Open hash table: index into `touched` plus one, 0 for none.
    table: Vec<u16>,
}

/// The method with a shell on the tool's tip.
pub fn new(tool: &Tool, config: Config) -> Box<dyn RigidContact> {
    let tool = Tool { tip_radius_mm: tool.tip_radius_mm.clamp(1e-3, 100.0), ..*tool };
    let shell = Pointshell::sphere(tool.tip_radius_mm, config.points.clamp(8, 20_000), config.spread);
    let points = shell.points.len();
    let (touched, table) = (Vec::with_capacity(points), vec![0; (2 * points).next_power_of_two()]);
    framed(&tool, config.removal, Thesis { config, shell, touched, table })
}

impl Thesis {
    /// Moves the proxy towards `to`; returns whether bone stopped it.
    fn sweep(&self, bone: &BoneVolume, to: Vec3, held: &mut HeldTool, out: &mut RigidStep) -> bool {
        let ball = Ball { radius_mm: held.tool.tip_radius_mm, shell: &self.shell.points };
        let stop = ball.sweep(bone, self.config.sweep, held.proxy.translation, to, &mut out.voxels_swept);
        held.proxy.translation = stop.centre;
        stop.hit
    }

    /// Step 3: the voxels of bone that hold points, within the colliding box.
    fn touch(&mut self, bone: &BoneVolume, proxy: Vec3, colliding: Aabb) {
        self.table.fill(0);
        for (point, inward) in self.shell.iter() {
            let point = proxy + point;
            if !colliding.contains(point) {
                continue;
            }
            let voxel = bone.voxel_of(point);
            if bone.is_bone(voxel) {
                let depth = (bone.centre_of(voxel) - point).dot(inward).max(0.0);
                let touched = slot(&mut self.touched, &mut self.table, voxel);
                touched.normals += inward;
                touched.depths_mm += depth;
                touched.points += 1;
            }
        }
    }

    /// Step 5: Eq 3.4 and Algorithm 1.
    fn respond(&self, out: &mut RigidStep, bone: &BoneVolume) -> (Vec3, f32) {
        let (mut normals, mut depth, mut sum) = (Vec3::ZERO, 0.0f32, 0.0f32);
        for touched in &self.touched {
            let normal = touched.normals.normalize_or_zero();
            sum = touched.depths_mm + if self.config.running_sum { sum } else { 0.0 };
            sum /= touched.points as f32;
            depth = depth.max(sum);
            normals += normal;
            out.points_in_contact += touched.points;
            out.manifold.push(Contact {
                point: bone.centre_of(touched.voxel),
                normal,
                depth_mm: touched.depths_mm / touched.points as f32,
            });
        }
        out.voxels_in_contact = self.touched.len() as u32;
        (normals.normalize_or_zero(), depth)
    }

    /// Steps 2 and 3 without a contact set: one more sweep decides.
    fn sweep_decides(&self, bone: &BoneVolume, device: Vec3, held: &mut HeldTool, out: &mut RigidStep) {
        let from = held.proxy.translation;
        if self.sweep(bone, device, held, out) {
            held.report((from - device).normalize_or_zero(), self.config.preset_depth_mm, out);
        }
    }

    /// Step 6: the god-object on the plane of the contact.
    fn rectify(
        &self,
        bone: &BoneVolume,
        device: Vec3,
        (normal, depth): (Vec3, f32),
        held: &mut HeldTool,
        out: &mut RigidStep,
    ) {
        let from = held.proxy.translation;
        let goal = GodObject::new(from).follow(device, &[Plane { point: from + depth * normal, normal }]);
        self.sweep(bone, goal, held, out);
        let gap = device.distance(held.proxy.translation);
        held.report(normal, if gap > 0.0 { gap } else { depth }, out);
    }

    /// Step 4.
    fn drill(&self, bone: &BoneVolume, device: Vec3, held: &mut HeldTool, out: &mut RigidStep) {
        let proxy = held.proxy.translation;
        match self.config.removal {
            RemovalLaw::PerTick { .. } => held.wear(bone, self.touched.iter().map(|t| t.voxel), out),
            RemovalLaw::Rate { .. } => held.cut(bone, device, proxy, device.distance(proxy), out),
        }
    }
}

impl MethodCore for Thesis {
    fn tick(&mut self, bone: &BoneVolume, tool: &ToolState, held: &mut HeldTool, out: &mut RigidStep) {
        let device = tool.tip();
        held.proxy.rotation = tool.world_from_tool.rotation;
        self.sweep(bone, device, held, out);
        let proxy = held.proxy.translation;
        let colliding = Aabb::of_sphere(proxy, held.tool.tip_radius_mm).intersection(bone.bounds());
        self.touched.clear();
        if !colliding.is_empty() {
            self.touch(bone, proxy, colliding);
        }
        if self.touched.is_empty() {
            return self.sweep_decides(bone, device, held, out);
        }
        self.drill(bone, device, held, out);
        let (mut normal, depth) = self.respond(out, bone);
        if normal == Vec3::ZERO {
            // Opposed contacts: the way back to the proxy is the only direction left.
            normal = (proxy - device).normalize_or_zero();
            out.fallbacks += 1;
        }
        self.rectify(bone, device, (normal, depth), held, out);
    }
}

/// The entry of `voxel`, made when it is new. There are never more voxels than points, for which
/// there is room.
fn slot<'a>(touched: &'a mut Vec<Touched>, table: &mut [u16], voxel: IVec3) -> &'a mut Touched {
    let mask = table.len() - 1;
    let hash = voxel.x.wrapping_mul(73_856_093) ^ voxel.y.wrapping_mul(19_349_663) ^ voxel.z.wrapping_mul(83_492_791);
    let mut at = hash as usize & mask;
    while table[at] != 0 && touched[table[at] as usize - 1].voxel != voxel {
        at = (at + 1) & mask;
    }
    if table[at] == 0 {
        touched.push(Touched { voxel, ..Touched::default() });
        table[at] = touched.len() as u16;
    }
    &mut touched[table[at] as usize - 1]
}

/// The thesis's method with its errors put right.
pub const METHOD: Descriptor = Descriptor {
    has_proxy: true,
    points: Pointshell::RIGID_COUNT,
    ..Descriptor::of("thesis", "the thesis, chapter 3, its errors put right", |tool, points| {
        new(tool, Config { points, ..Config::default() })
    })
};

/// The thesis's method as printed.
pub const AS_PRINTED: Descriptor = Descriptor {
    name: "thesis-printed",
    source: "the thesis, chapter 3",
    removal: RemovalLaw::PER_TICK,
    build: |tool, points| new(tool, Config { points, ..Config::PRINTED }),
    ..METHOD
};
