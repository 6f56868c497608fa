//! The recommended method: a ball that slides on the bone's surface without ever entering it.
//!
//! # Theory
//! The centre of a ball of radius r may be where the distance to the bone is at least r. The proxy
//! is the nearest such place to the device that it can slide to: Zilles and Salisbury's god-object
//! in the space of centres. The surface is a set of small discs where the CT falls under the
//! isovalue or a tool has cut; discs yᵢ, at distance dᵢ in direction gᵢ, give half-spaces
//! ```text
//! gᵢ·c ≥ gᵢ·yᵢ + r        safe: a half-space without the convex disc keeps the ball out of it
//! ```
//! and the proxy moves to the nearest point to the device that satisfies all of them, again and
//! again until it rests. Every step stays within the region for which all discs are known, so there
//! is no speed at which it tunnels.
//!
//! ```text
//!        ○ proxy, r above every disc
//!   ─────┴─────  discs
//!        ◌ device      depth = |device - proxy|,  n = (proxy - device) / depth
//! ```
//!
//! Projection on a convex set never lengthens a motion, so on flat or convex bone the force changes
//! by no more than k times the hand's motion. Discs move continuously with the cut; where bone
//! gives way or an edge ends at once the proxy follows at `yield_mm_per_ms` over the hand's own
//! speed.
//!
//! The ball that touches is a little smaller than the tool where it is jammed: where its walls
//! push more against each other than against the pull of the hand. It grows back into free space at
//! once; where it must push itself off the bone for that, slowly, and only while growing by g moves
//! it by no more than 2.4 g, which is true on a surface and false in a bore.
//!
//! # Practice
//! World mm, f32. Discs stand on the nodes of the cut, at most half a millimetre apart
//! (`local_surface.rs`). With `shaft` the contact of the shaft adds its half-spaces (`lean.rs`), a
//! microsecond. Allocates in `new` only. A ball that starts in bone keeps the clearance that it has
//! and gains more at `recover_mm_per_ms`. Steps past `max_moves` are left for the next tick; that,
//! and constraints that contradict, count as fallbacks.
//!
//! # Sources
//! C. B. Zilles, J. K. Salisbury, IROS 1995; D. Ruspini, K. Kolarov, O. Khatib, *The haptic display
//! of complex graphical environments*, SIGGRAPH 1997 (a ball as proxy); H. Xu, J. Barbič, *6-DoF
//! haptic rendering using continuous collision detection between points and signed distance
//! fields*, IEEE Trans. Haptics 10 (2017), for continuous motion.
//!
//! # When not to use it
//! For tools that are not balls. Where edges of the CT sharper than a node matter: discs stand out
//! over them by up to `disc_nodes`.

use crate::ball::{Ball, InReach, Limits};
use crate::burr::{Burr, Cut};
use crate::half_spaces::{HalfSpace, HalfSpaces};
use crate::lean::Lean;
use crate::local_surface::LocalSurface;
use crate::method::{Descriptor, Extent, Method};
use crate::removal::RemovalLaw;
use crate::shaft::Shaft;
use crate::{RigidContact, RigidStep};
use trepan_bone::BoneVolume;
use trepan_contact::Contact;
use trepan_geometry::{Aabb, Pose, Tool, ToolState, Vec3};

/// Most discs in reach; past it the rest is counted as a fallback.
const MAX_DISCS: usize = 8192;
/// Most nodes or voxels that a burr reaches at once.
const MAX_REACHED: usize = 1 << 17;
/// Discs this close count as touched, nodes.
const TOUCH: f32 = 0.05;
/// Free space that a ball leaves around it when it grows, nodes: more than the unevenness of a
/// bore.
const MARGIN: f32 = 0.1;
/// What a ball may grow and be pushed off in a tick, nodes.
const ROOM: f32 = 0.25;
/// Jammed: the sum of the contact forces exceeds 1/JAM times the pull of the hand. 0.4 is reached
/// between walls less than 47 degrees apart.
const JAM: f32 = 0.4;
/// Largest move of a growing ball, times its growth.
const MAX_PUSH: f32 = 2.4;
/// A shaft this far in bone gives way, voxels.
const PRESSED: f32 = 1e-3;
/// Way beyond that of the hand that rounding may need, mm.
const ROUNDING_MM: f32 = 1e-4;

/// How the method is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Radius of a disc, nodes of the cut. Under 0.71 discs on a plane leave gaps, over which a
    /// ball bobs; more fattens sharp edges.
    pub disc_nodes: f32,
    /// Radius of a disc against the shaft, voxels.
    pub shaft_disc_voxels: f32,
    /// Longest move with one set of discs, nodes. More weighs more discs at each move, less takes
    /// more moves at speed.
    pub move_nodes: f32,
    /// Most moves in one tick. What is left of the way is gone in the next tick.
    pub max_moves: u32,
    /// Overlap that a jammed ball may have, voxels: in a bore of its own width the unevenness of
    /// opposite walls would lock it.
    pub slop_voxels: f32,
    /// How fast the ball grows back, mm/ms. Times the stiffness it is a change of force.
    pub fit_mm_per_ms: f32,
    /// How fast a ball that has its centre in bone is let out, mm/ms.
    pub recover_mm_per_ms: f32,
    /// Whether the shaft is felt too, with torque. The tool must then be held with its axis out of
    /// the bone.
    pub shaft: bool,
    /// How much faster than the hand the proxy comes after it where bone gives way, and how fast a
    /// jammed ball gives way, mm/ms. Times the stiffness it is a change of force.
    pub yield_mm_per_ms: f32,
    /// What a burr takes away.
    pub removal: RemovalLaw,
}

impl Config {
    /// The charted choice.
    pub const RECOMMENDED: Self = Self {
        disc_nodes: 0.8,
        shaft_disc_voxels: 0.8,
        move_nodes: 0.5,
        max_moves: 1024,
        slop_voxels: 0.3,
        fit_mm_per_ms: 0.01,
        recover_mm_per_ms: 0.05,
        yield_mm_per_ms: 0.03,
        shaft: false,
        removal: RemovalLaw::RATE,
    };

    /// With the shaft.
    pub const WITH_SHAFT: Self = Self { shaft: true, ..Self::RECOMMENDED };
}

impl Default for Config {
    fn default() -> Self {
        Self::RECOMMENDED
    }
}

/// The ball of one tool.
pub struct GodObjectSphere {
    config: Config,
    tool: Tool,
    proxy: Pose,
    /// Whether the proxy has been put anywhere yet.
    placed: bool,
    /// Whether the burr cuts in this tick.
    cuts: bool,
    /// Radius of the ball that touches: up to the tool's, mm.
    ball_mm: f32,
    /// Whether only walls along the pull of the hand hold the proxy.
    jammed: bool,
    /// Where the hand was in the last tick, world mm.
    hand: Vec3,
    /// How far the proxy may still go in this tick, mm.
    travel_mm: f32,
    /// Ball of verified free space, from the last selection of discs: centre, grid; radius, voxels.
    free_space: (Vec3, f32),
    /// Which bone the window shows.
    seen: Option<LastBone>,
    surface: LocalSurface,
    /// Whether the ball was outside of all bone, so that none is searched for inside it.
    is_outside: bool,
    lean: Lean,
    near: InReach,
    /// What the burr alone is pushed, mm: what it cuts with.
    pressed: Vec3,
    /// Of each touching disc, whether it is at the shaft, and the way from the tip to there, mm.
    arms: Vec<(bool, Vec3)>,
    spaces: HalfSpaces,
    /// Those of the discs that touch.
    touching: HalfSpaces,
    burr: Burr,
}

/// The bone of the last step.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LastBone {
    /// [`BoneVolume::id`].
    bone: u64,
    /// How often bone had been restored.
    undone: u32,
}

impl GodObjectSphere {
    /// A ball of the tool's tip. Until [`reset`](RigidContact::reset) puts it somewhere it starts
    /// at the first tool pose.
    pub fn new(tool: &Tool, config: Config) -> Self {
        let tool = Tool { tip_radius_mm: tool.tip_radius_mm.clamp(1e-3, 100.0), ..*tool };
        Self {
            config,
            tool,
            proxy: Pose::IDENTITY,
            placed: false,
            cuts: false,
            ball_mm: tool.tip_radius_mm,
            jammed: false,
            hand: Vec3::ZERO,
            travel_mm: 0.0,
            free_space: (Vec3::ZERO, 0.0),
            seen: None,
            surface: LocalSurface::new(tool.tip_radius_mm, MAX_DISCS, config.disc_nodes),
            is_outside: false,
            lean: Lean::new(if config.shaft { MAX_DISCS } else { 0 }, config.shaft_disc_voxels),
            near: InReach::with_capacity(3 * MAX_DISCS),
            pressed: Vec3::ZERO,
            arms: Vec::with_capacity(3 * MAX_DISCS),
            spaces: HalfSpaces::with_capacity(3 * MAX_DISCS),
            touching: HalfSpaces::with_capacity(3 * MAX_DISCS),
            burr: Burr::new(config.removal, MAX_REACHED),
        }
    }

    /// Forgets what was known of another bone, or of this one before it changed.
    fn track_changes(&mut self, bone: &BoneVolume) {
        let this = Some(LastBone { bone: bone.id(), undone: bone.undone() });
        if self.seen != this {
            self.seen = this;
            self.is_outside = false;
            self.surface.forget();
            self.lean.renew();
        }
        if self.surface.track_changes(bone) {
            self.lean.renew();
        }
    }

    /// The ball at the proxy.
    fn ball(&self, bone: &BoneVolume) -> Ball {
        let inside = bone.holds(self.proxy.translation);
        // Seen from the tip.
        let shaft = Shaft::of(&self.tool, bone.node_mm(), Vec3::ZERO, self.proxy.rotation * Vec3::Z);
        Ball { radius: self.ball_mm / bone.node_mm(), inside, shaft }
    }

    /// Lets the ball become smaller where it is jammed, at a rate that a hand does not feel as a
    /// jump.
    fn shrink(&mut self, bone: &BoneVolume, dt_ms: f32) {
        let radius = self.tool.tip_radius_mm;
        let least = (radius - self.config.slop_voxels * bone.spacing_mm()).max(0.5 * radius);
        // A burr at work cuts itself free.
        if self.jammed && !self.cuts && self.ball_mm > least {
            self.ball_mm = least.max(self.ball_mm - self.config.yield_mm_per_ms * dt_ms);
        }
    }

    /// Lets the ball that rests grow back into free space, or by pushing itself off a surface.
    fn grow(&mut self, bone: &BoneVolume, motion: Vec3, dt_ms: f32) {
        let (spacing, full) = (bone.node_mm(), self.tool.tip_radius_mm);
        let base = self.surface.base();
        let grid = bone.node_at(self.proxy.translation);
        let ball = self.ball(bone);
        if self.ball_mm >= full && !ball.inside {
            return;
        }
        let room =
            (self.free_space.1 - grid.distance(self.free_space.0)).min(ball.clearance(&mut self.near, grid - base));
        self.ball_mm = self.ball_mm.max(full.min(spacing * (room - MARGIN)));
        if self.jammed || self.proxy.translation == self.hand || self.ball_mm >= full && !ball.inside {
            return;
        }
        let rate = if ball.inside { self.config.recover_mm_per_ms } else { self.config.fit_mm_per_ms };
        let growth = rate * dt_ms / spacing;
        let grown = Ball { radius: (self.ball_mm / spacing + growth).min(full / spacing), ..ball };
        let (from, goal) = (grid - base, bone.node_at(self.hand) - base);
        let Some(to) = grown.settle(&mut self.near, &mut self.spaces, from, goal, (growth, 0.0)) else { return };
        let push = to - from;
        let most = (MAX_PUSH * growth).min(self.travel_mm / spacing);
        // A hand that draws the tool off is not overtaken.
        if push.length() <= most && push.dot(motion) <= 0.0 {
            self.ball_mm = grown.radius * spacing;
            self.proxy.translation = bone.origin() + spacing * (to + base);
        }
    }

    /// Moves the proxy as near to `device` as the bone lets it. Returns whether it got there within
    /// `max_moves`.
    fn follow(&mut self, bone: &BoneVolume, device: Vec3, dt_ms: f32, out: &mut RigidStep) -> bool {
        let margin = self.tool.tip_radius_mm + 2.0 * bone.spacing_mm();
        let end = self.proxy.rotation * Vec3::Z * if self.config.shaft { self.tool.shaft_length_mm } else { 0.0 };
        let (from, to) = (self.proxy.translation, device);
        let way = Aabb::of_points(&[from, to, from + end, to + end]).inflated(margin);
        if !way.overlaps(bone.bounds()) {
            self.proxy.translation = device;
            self.ball_mm = self.tool.tip_radius_mm;
            self.near.clear();
            self.surface.leave();
            self.free_space = (bone.node_at(device), f32::MAX);
            self.is_outside = true;
            return true;
        }
        self.recover_penetration(bone, dt_ms, out);
        for _ in 0..self.config.max_moves {
            if self.advance(bone, device, out) {
                return true;
            }
        }
        out.fallbacks += 1;
        false
    }

    /// One move within what is known of the surface. Returns whether the proxy has come to rest.
    fn advance(&mut self, bone: &BoneVolume, device: Vec3, out: &mut RigidStep) -> bool {
        let spacing = bone.node_mm();
        let start = bone.node_at(self.proxy.translation);
        if !self.gather_contacts(bone, start, out) {
            return true;
        }
        let base = self.surface.base();
        let (from, goal) = (start - base, bone.node_at(device) - base);
        let (ball, reach, full) = (self.ball(bone), self.reach(bone), self.tool.tip_radius_mm / spacing);
        let nearest = self.select(bone, &ball, from, out);
        self.free_space = (start, full + reach);
        self.is_outside = nearest > full - 0.5;
        let limits = Limits { reach, way: self.travel_mm / spacing };
        let slide = ball.slide(&mut self.near, &mut self.spaces, from, goal, limits);
        self.travel_mm = (self.travel_mm - slide.way * spacing).max(0.0);
        out.fallbacks += u32::from(slide.contradiction);
        if slide.to == goal {
            self.proxy.translation = device;
        } else if slide.to != from {
            self.proxy.translation = bone.origin() + spacing * (slide.to + base);
        }
        slide.rests
    }

    /// How far the ball may move with one set of discs, nodes: what is left of its way in this
    /// tick, and room to grow.
    fn reach(&self, bone: &BoneVolume) -> f32 {
        self.config.move_nodes.min(self.travel_mm / bone.node_mm() + ROOM)
    }

    /// The discs near the tool with its ball at `from`. Returns the distance of the nearest from
    /// the ball's centre.
    fn select(&mut self, bone: &BoneVolume, ball: &Ball, from: Vec3, out: &mut RigidStep) -> f32 {
        let (base, reach) = (self.surface.base(), self.reach(bone));
        let full = self.tool.tip_radius_mm / bone.node_mm();
        let nearest = ball.select(self.surface.shaped(from, full + reach), from, full, reach, &mut self.near);
        if self.config.shaft {
            self.lean.select(bone, (ball, from), reach, base, &mut self.near, out);
        }
        nearest
    }

    /// Moves the tip aside where the turning hand has pressed the shaft into bone.
    fn recover_penetration(&mut self, bone: &BoneVolume, dt_ms: f32, out: &mut RigidStep) {
        let (spacing, start) = (bone.node_mm(), bone.node_at(self.proxy.translation));
        if !self.config.shaft || !self.gather_contacts(bone, start, out) {
            return;
        }
        let base = self.surface.base();
        let (ball, from) = (self.ball(bone), start - base);
        self.select(bone, &ball, from, out);
        let most = ball.shaft.radius - PRESSED;
        if !self.near.seen_from(&ball, from).any(|(disc, near)| disc.shaft && near.distance < most) {
            return;
        }
        let most = self.config.recover_mm_per_ms * dt_ms / spacing;
        let Some(to) = ball.settle(&mut self.near, &mut self.spaces, from, from, (0.0, most)) else { return };
        if to.distance(from) <= MAX_PUSH * most {
            self.proxy.translation = bone.origin() + spacing * (to + base);
        }
    }

    /// Gathers all discs in reach of the ball at node `at`; false when the ball is too large for
    /// that.
    fn gather_contacts(&mut self, bone: &BoneVolume, at: Vec3, out: &mut RigidStep) -> bool {
        self.surface.gather(bone, &self.tool, at, (self.config.move_nodes, self.is_outside), out)
    }

    /// Fills the manifold from where proxy and device are.
    fn report(&mut self, bone: &BoneVolume, device: Vec3, out: &mut RigidStep) {
        (self.jammed, self.pressed) = (false, self.proxy.translation - device);
        let lifted = self.pressed;
        let depth = lifted.length();
        if depth == 0.0 {
            return;
        }
        let (spacing, radius) = (bone.node_mm(), self.ball_mm);
        let base = self.surface.base();
        let centre = bone.node_at(self.proxy.translation) - base;
        let ball = Ball { inside: false, ..self.ball(bone) };
        let mut leans = false;
        self.touching.clear();
        self.arms.clear();
        for (disc, near) in self.near.touching(&ball, centre, TOUCH) {
            let arm = ball.arm(disc, disc.centre - centre);
            let point = bone.origin() + spacing * (centre + arm + base - near.direction * near.distance);
            let deep = spacing * (ball.radius_at(disc) - near.distance) + lifted.dot(near.direction);
            leans |= disc.shaft;
            self.touching.push(HalfSpace { normal: near.direction, offset: near.direction.dot(lifted) });
            self.arms.push((disc.shaft, spacing * arm));
            out.points_in_contact += 1;
            out.manifold.push(Contact { point, normal: near.direction, depth_mm: deep.max(0.0) });
        }
        out.voxels_in_contact = out.points_in_contact.min(self.surface.owners());
        out.manifold.normal = lifted / depth;
        out.manifold.depth_mm = depth;
        out.manifold.point = self.proxy.translation - radius * out.manifold.normal;
        let (mut pinch, mut moment, mut pressed) = (0.0, Vec3::ZERO, Vec3::ZERO);
        for (at, size) in self.touching.supports(Vec3::ZERO).into_iter().flatten() {
            let (push, (shaft, arm)) = (size * self.touching.list()[at].normal, self.arms[at]);
            pinch += size;
            moment += arm.cross(push);
            pressed += if shaft { Vec3::ZERO } else { push };
        }
        self.jammed = pinch * JAM > depth;
        if leans {
            out.manifold.couple_mm = moment / depth;
            self.pressed = pressed;
        }
    }

    /// Takes away what the burr cuts, pressed as the report says.
    fn remove(&mut self, bone: &BoneVolume, dt_ms: f32, out: &mut RigidStep) {
        if !self.cuts {
            self.burr.pause();
            return;
        }
        let (proxy, radius_mm) = (self.proxy.translation, self.tool.tip_radius_mm);
        let axis = self.proxy.rotation * Vec3::Z;
        let side = 0.5 * self.tool.cutting_mm * axis;
        let depth_mm = self.pressed.length();
        let cut = Cut { device: proxy - self.pressed, proxy, radius_mm, side, axis, depth_mm, dt_ms };
        self.burr.cut(bone, &cut, &mut self.surface.nodes, out);
        if self.burr.changed() {
            self.surface.cut(self.burr.opened());
        }
        if self.config.shaft && self.burr.has_opened() {
            self.lean.opened(radius_mm / bone.spacing_mm() + 4.0);
        }
    }
}

impl RigidContact for GodObjectSphere {
    fn step(&mut self, bone: &BoneVolume, tool: &ToolState, drilling: bool, dt_ms: f32, out: &mut RigidStep) {
        out.clear();
        if !tool.is_finite() {
            out.fallbacks = 1;
            return;
        }
        let dt_ms = if dt_ms.is_finite() { dt_ms.clamp(0.0, 100.0) } else { 0.0 };
        let device = tool.tip();
        if !self.placed {
            self.reset(tool.world_from_tool);
        }
        self.proxy.rotation = tool.world_from_tool.rotation;
        self.cuts = drilling && self.tool.kind.cuts();
        self.travel_mm += device.distance(self.hand) + self.config.yield_mm_per_ms * dt_ms + ROUNDING_MM;
        let motion = device - self.hand;
        self.hand = device;
        self.track_changes(bone);
        self.shrink(bone, dt_ms);
        if self.follow(bone, device, dt_ms, out) {
            self.grow(bone, motion, dt_ms);
            self.travel_mm = 0.0;
        }
        self.report(bone, device, out);
        self.remove(bone, dt_ms, out);
    }

    fn proxy(&self) -> Pose {
        self.proxy
    }

    fn reset(&mut self, pose: Pose) {
        self.proxy = pose;
        self.placed = pose.translation.is_finite();
        (self.ball_mm, self.jammed) = (self.tool.tip_radius_mm, false);
        (self.hand, self.travel_mm) = (pose.translation, 0.0);
        self.is_outside = false;
        self.surface.forget();
        self.lean.renew();
        self.near.clear();
        self.burr.reset();
    }

    fn cut_by(&mut self, law: RemovalLaw) {
        self.burr.cut_by(law);
    }
}

/// The ball alone.
pub const METHOD: Descriptor = Descriptor {
    has_proxy: true,
    ..Descriptor::of("god-object-sphere", "Ruspini et al. 1997, Xu and Barbič 2017", |tool, _| {
        Box::new(GodObjectSphere::new(tool, Config::RECOMMENDED))
    })
};

/// The ball and the shaft.
pub const WITH_SHAFT: Descriptor = Descriptor {
    name: "god-object-sphere-shaft",
    extent: Extent::BallAndShaft,
    build: |tool, _| Box::new(GodObjectSphere::new(tool, Config::WITH_SHAFT)),
    ..METHOD
};

impl Method {
    /// What the simulators use.
    pub const RECOMMENDED: Self = Self::of(&METHOD);
}

impl Default for Method {
    fn default() -> Self {
        Self::RECOMMENDED
    }
}
