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
//! For force feedback on a hand: [`god_object_sphere`](crate::god_object_sphere) is smoother and
//! nearer to the surface. It is here for comparison.

use crate::method::{Descriptor, Extent};
use crate::removal::{Burr, Cut, RemovalLaw};
use crate::rows::EVERYWHERE;
use crate::sweep::{Ball, Stop, Sweep};
use crate::{RigidContact, RigidStep};
use glam::IVec3;
use trepan_contact::{Contact, GodObject, Plane};
use trepan_geometry::{Aabb, Pointshell, Pose, Spread, Tool, ToolState, Vec3};
use trepan_volume::BoneVolume;

/// Most voxels that the rate law bites at once.
const MAX_BITES: usize = 16384;

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
pub struct Thesis {
    config: Config,
    tool: Tool,
    shell: Pointshell,
    proxy: Pose,
    placed: bool,
    touched: Vec<Touched>,
    /// Open hash table: index into `touched` plus one, 0 for none.
    table: Vec<u16>,
    burr: Burr,
}

impl Thesis {
    /// A shell on the tool's tip. Until [`reset`](RigidContact::reset) puts it somewhere it starts
    /// at the first tool pose.
    pub fn new(tool: &Tool, config: Config) -> Self {
        let config = Config { points: config.points.clamp(8, 20_000), ..config };
        let tool = Tool { tip_radius_mm: tool.tip_radius_mm.clamp(1e-3, 100.0), ..*tool };
        let shell = Pointshell::sphere(tool.tip_radius_mm, config.points, config.spread);
        let points = shell.points.len();
        Self {
            config,
            tool,
            proxy: Pose::IDENTITY,
            placed: false,
            touched: Vec::with_capacity(points),
            table: vec![0; (2 * points).next_power_of_two()],
            burr: Burr::new(config.removal, MAX_BITES),
            shell,
        }
    }

    fn sweep(&self, bone: &BoneVolume, from: Vec3, to: Vec3, out: &mut RigidStep) -> Stop {
        let ball = Ball { radius_mm: self.tool.tip_radius_mm, shell: &self.shell.points };
        ball.sweep(bone, self.config.sweep, from, to, &mut out.voxels_swept)
    }

    /// Step 3: the voxels of bone that hold points, within the colliding box.
    fn touch(&mut self, bone: &BoneVolume, colliding: Aabb) {
        self.touched.clear();
        self.table.fill(0);
        for (point, inward) in self.shell.points.iter().zip(&self.shell.inward_normals) {
            let point = self.proxy.translation + *point;
            if !colliding.contains(point) {
                continue;
            }
            let voxel = bone.voxel_of(point);
            if bone.is_bone(voxel) {
                let depth = (bone.centre_of(voxel) - point).dot(*inward).max(0.0);
                let touched = slot(&mut self.touched, &mut self.table, voxel);
                touched.normals += *inward;
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
    fn sweep_decides(&mut self, bone: &BoneVolume, device: Vec3, out: &mut RigidStep) {
        let from = self.proxy.translation;
        let stop = self.sweep(bone, from, device, out);
        self.proxy.translation = stop.centre;
        if stop.hit {
            let normal = (from - device).normalize_or_zero();
            self.report(normal, self.config.preset_depth_mm, out);
        }
    }

    /// Step 6: the god-object on the plane of the contact.
    fn rectify(&mut self, bone: &BoneVolume, device: Vec3, normal: Vec3, depth: f32, out: &mut RigidStep) {
        let from = self.proxy.translation;
        let mut god = GodObject::new(from);
        let goal = god.follow(device, &[Plane { point: from + depth * normal, normal }]);
        self.proxy.translation = self.sweep(bone, from, goal, out).centre;
        let gap = device.distance(self.proxy.translation);
        self.report(normal, if gap > 0.0 { gap } else { depth }, out);
    }

    fn report(&self, normal: Vec3, depth_mm: f32, out: &mut RigidStep) {
        if normal != Vec3::ZERO && depth_mm > 0.0 {
            out.manifold.normal = normal;
            out.manifold.depth_mm = depth_mm;
            out.manifold.point = self.proxy.translation - self.tool.tip_radius_mm * normal;
        }
    }

    /// Step 4.
    fn drill(&mut self, bone: &BoneVolume, device: Vec3, dt_ms: f32, out: &mut RigidStep) {
        match self.config.removal {
            RemovalLaw::PerTick { .. } => self.burr.wear(bone, self.touched.iter().map(|t| t.voxel), out),
            RemovalLaw::Rate { .. } => {
                let (proxy, radius_mm) = (self.proxy.translation, self.tool.tip_radius_mm);
                let depth_mm = device.distance(proxy);
                let cut = Cut { device, proxy, radius_mm, depth_mm, dt_ms, within: EVERYWHERE };
                self.burr.cut(bone, &cut, |voxel| move |x| bone.hu(voxel.with_x(x)), out);
            }
        }
    }
}

impl RigidContact for Thesis {
    fn step(&mut self, bone: &BoneVolume, tool: &ToolState, drilling: bool, dt_ms: f32, out: &mut RigidStep) {
        out.clear();
        if !tool.is_finite() {
            out.fallbacks = 1;
            return;
        }
        if !self.placed {
            self.reset(tool.world_from_tool);
        }
        let device = tool.tip();
        self.proxy.rotation = tool.world_from_tool.rotation;
        self.proxy.translation = self.sweep(bone, self.proxy.translation, device, out).centre;
        let box_of_tool = Aabb::of_sphere(self.proxy.translation, self.tool.tip_radius_mm);
        let colliding = box_of_tool.intersection(bone.bounds());
        if colliding.is_empty() {
            self.touched.clear();
        } else {
            self.touch(bone, colliding);
        }
        if self.touched.is_empty() {
            self.sweep_decides(bone, device, out);
            return;
        }
        if drilling && self.tool.kind.cuts() {
            self.drill(bone, device, dt_ms, out);
        }
        let (mut normal, depth) = self.respond(out, bone);
        if normal == Vec3::ZERO {
            // Opposed contacts: the way back to the proxy is the only direction left.
            normal = (self.proxy.translation - device).normalize_or_zero();
            out.fallbacks += 1;
        }
        self.rectify(bone, device, normal, depth, out);
    }

    fn proxy(&self) -> Pose {
        self.proxy
    }

    fn reset(&mut self, pose: Pose) {
        self.proxy = pose;
        self.placed = pose.translation.is_finite();
        self.touched.clear();
        self.burr.reset();
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
    name: "thesis",
    former_names: &[],
    source: "the thesis, chapter 3, its errors put right",
    extent: Extent::Ball,
    has_proxy: true,
    is_oracle: false,
    points: Pointshell::RIGID_COUNT,
    removal: RemovalLaw::RATE,
    build: |tool, points| Box::new(Thesis::new(tool, Config { points, ..Config::default() })),
};

/// The thesis's method as printed.
pub const AS_PRINTED: Descriptor = Descriptor {
    name: "thesis-printed",
    former_names: &[],
    source: "the thesis, chapter 3",
    extent: Extent::Ball,
    has_proxy: true,
    is_oracle: false,
    points: Pointshell::RIGID_COUNT,
    removal: RemovalLaw::PER_TICK,
    build: |tool, points| Box::new(Thesis::new(tool, Config { points, ..Config::PRINTED })),
};
