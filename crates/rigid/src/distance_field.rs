//! The recommended method: a ball that slides on the bone's surface without ever entering it.
//!
//! # Theory
//! The centre of a ball of radius r may be where the distance to the bone is at least r. The proxy is the nearest such
//! place to the device that it can slide to: Zilles and Salisbury's god-object in the space of centres. The surface
//! is a set of small discs on the crossings of the density with the isovalue; discs yᵢ, at distance dᵢ in direction gᵢ, give half-spaces
//! ```text
//! gᵢ·c ≥ gᵢ·yᵢ + r        safe: a half-space that leaves the convex disc out keeps the ball out of it
//! ```
//! and the proxy moves to the nearest point to the device that satisfies all of them, again and again until it rests. Every step stays
//! within the region for which all discs are known, so there is no speed at which it tunnels.
//!
//! ```text
//!        ○ proxy, r above every disc
//!   ─────┴─────  discs
//!        ◌ device      depth = |device - proxy|,  n = (proxy - device) / depth
//! ```
//!
//! Projection on a convex set never lengthens a motion, so on flat or convex bone the force changes by no more than k times
//! the hand's motion. Discs move continuously with the density, also while it is drilled away.
//!
//! # Practice
//! World mm, f32. For a 3 mm ball in 0.5 mm voxels about 5 us a tick of touch, 40 when the discs are gathered anew, which drilling needs in
//! each tick. Allocates in `new` only. Where constraints contradict (a slot
//! narrower than the ball, a start inside bone) the proxy keeps the clearance that it has and gains more at `recover_mm_per_ms`.
//! Steps past `max_moves` are left for the next tick. Both are counted as fallbacks.
//!
//! # Sources
//! C. B. Zilles, J. K. Salisbury, IROS 1995; D. Ruspini, K. Kolarov, O. Khatib, *The haptic display of complex graphical environments*,
//! SIGGRAPH 1997 (a ball as proxy); H. Xu, J. Barbič, *6-DoF haptic rendering using continuous collision detection between points and signed
//! distance fields*, IEEE Trans. Haptics 10 (2017), for continuous motion.
//!
//! # When not to use it
//! For tools that are not balls. Where edges sharper than a voxel matter: discs stand out over them by up to
//! `disc_voxels`.

use crate::half_spaces::{HalfSpace, nearest};
use crate::removal::{Burr, Cut, Law};
use crate::surface::{Disc, Discs};
use crate::window::Window;
use crate::{RigidContact, RigidStep};
use trepan_contact::Contact;
use trepan_geometry::{Aabb, Pose, Tool, ToolKind, ToolState, Vec3};
use trepan_volume::BoneVolume;

/// Most discs in reach; past it the rest is counted as a fallback.
const MAX_DISCS: usize = 8192;
/// Most voxels that a burr bites at once.
const MAX_BITES: usize = 16384;
/// Proxy moves within one gathering.
const MAX_SLIDES: usize = 12;
/// A slide shorter than this many voxels is rest.
const REST: f32 = 2e-4;
/// Discs this close count as touched, voxels.
const TOUCH: f32 = 0.05;

/// How the method is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Radius of a disc, voxels. Under 0.71 discs on a plane leave gaps, over which a ball bobs; more fattens sharp edges.
    pub disc_voxels: f32,
    /// Longest move with one set of discs, voxels. More weighs more discs at each move, less takes more moves at speed.
    pub move_voxels: f32,
    /// How far the tool may go before discs are gathered anew, voxels. More gathers less often, and more discs each time.
    pub ahead_voxels: f32,
    /// Most moves in one tick. What is left of the way is gone in the next tick.
    pub max_moves: u32,
    /// How deep a burr at work sits in the bone that it cuts, voxels. Its bore is then a little wider than what touches, so that it does not
    /// lock there. Must be less than `slop_voxels`.
    pub bite_voxels: f32,
    /// Overlap that a jammed ball may have, voxels: in a bore of its own width the unevenness of opposite walls would lock it.
    pub slop_voxels: f32,
    /// How fast a ball that overlaps bone is let out, mm/ms.
    pub recover_mm_per_ms: f32,
    /// What a burr takes away.
    pub removal: Law,
}

impl Config {
    /// The charted choice.
    pub const RECOMMENDED: Self = Self {
        disc_voxels: 0.8,
        move_voxels: 0.25,
        ahead_voxels: 0.5,
        max_moves: 1024,
        bite_voxels: 0.15,
        slop_voxels: 0.2,
        recover_mm_per_ms: 0.05,
        removal: Law::RATE,
    };
}

impl Default for Config {
    fn default() -> Self {
        Self::RECOMMENDED
    }
}

/// The ball of one tool.
pub struct DistanceField {
    config: Config,
    tool: Tool,
    proxy: Pose,
    /// Whether the proxy has been put anywhere yet.
    placed: bool,
    /// Whether the burr cuts in this tick.
    works: bool,
    /// How deep the burr sits in the bone now, mm.
    bite_mm: f32,
    window: Window,
    known: Known,
    discs: Discs,
    near: Vec<Disc>,
    spaces: Vec<HalfSpace>,
    burr: Burr,
}

/// What the discs at hand are good for.
#[derive(Clone, Copy, Debug, Default)]
struct Known {
    /// Whether they are of the bone as it is now.
    fresh: bool,
    /// Grid point around which they were gathered.
    centre: Vec3,
    /// How far from there they are good for, voxels.
    ahead: f32,
    /// Whether the ball was clear of bone there, so that nothing needs to be looked for inside it.
    clear: bool,
}

impl DistanceField {
    /// A ball of the tool's tip. Until [`reset`](RigidContact::reset) puts it somewhere it starts at the first tool pose.
    pub fn new(tool: &Tool, config: Config) -> Self {
        let tool = Tool { tip_radius_mm: tool.tip_radius_mm.clamp(1e-3, 100.0), ..*tool };
        Self {
            config,
            tool,
            proxy: Pose::IDENTITY,
            placed: false,
            works: false,
            bite_mm: 0.0,
            window: Window::new(),
            known: Known::default(),
            discs: Discs::new(MAX_DISCS, config.disc_voxels),
            near: Vec::with_capacity(MAX_DISCS),
            spaces: Vec::with_capacity(MAX_DISCS),
            burr: Burr::new(config.removal, MAX_BITES),
        }
    }

    /// Radius of the ball that touches, mm.
    fn radius_mm(&self) -> f32 {
        self.tool.tip_radius_mm - self.bite_mm
    }

    /// Lets the burr sink in while it works, at a rate that a hand does not feel as a jump. It grows back in free space only: in
    /// its bore there is no room.
    fn bite(&mut self, bone: &BoneVolume, dt_ms: f32) {
        if self.works {
            let depth = (self.config.bite_voxels * bone.spacing_mm()).min(0.5 * self.tool.tip_radius_mm);
            let change = self.config.recover_mm_per_ms * dt_ms;
            self.bite_mm += (depth - self.bite_mm).clamp(-change, change);
        } else if self.near.is_empty() {
            self.bite_mm = 0.0;
        }
    }

    /// Moves the proxy as near to `device` as the bone lets it.
    fn follow(&mut self, bone: &BoneVolume, device: Vec3, dt_ms: f32, out: &mut RigidStep) {
        let margin = self.tool.tip_radius_mm + 2.0 * bone.spacing_mm();
        let way = Aabb::of_points(&[self.proxy.translation, device]).inflated(margin);
        if !way.overlaps(bone.bounds()) {
            self.proxy.translation = device;
            self.near.clear();
            self.discs.forget();
            self.known = Known { fresh: false, clear: true, ..self.known };
            return;
        }
        for _ in 0..self.config.max_moves {
            if self.advance(bone, device, dt_ms, out) {
                return;
            }
        }
        out.fallbacks += 1;
    }

    /// One move within what is known of the surface. Returns whether the proxy has come to rest.
    fn advance(&mut self, bone: &BoneVolume, device: Vec3, dt_ms: f32, out: &mut RigidStep) -> bool {
        let spacing = bone.spacing_mm();
        let start = bone.grid_of(self.proxy.translation);
        if !self.know(bone, start, out) {
            return true;
        }
        let base = self.discs.base.as_vec3();
        let (from, goal) = (start - base, bone.grid_of(device) - base);
        let ball = Ball {
            radius: self.radius_mm() / spacing,
            slop: self.config.slop_voxels,
            inside: bone.is_bone(bone.voxel_of(self.proxy.translation)),
        };
        let reach = self.config.move_voxels;
        let clearance = ball.select(self.discs.list(), from, reach, &mut self.near);
        self.known.clear = clearance > -0.5;
        let recover = self.config.recover_mm_per_ms * dt_ms / spacing;
        let slide = ball.slide(&self.near, &mut self.spaces, from, goal, reach, recover);
        out.fallbacks += u32::from(slide.contradiction);
        if slide.to == goal {
            self.proxy.translation = device;
        } else if slide.to != from {
            self.proxy.translation = bone.origin() + spacing * (slide.to + base);
        }
        slide.rests
    }

    /// Makes sure that all discs in reach of the ball at grid point `at` are known; false when the ball is too large for that.
    fn know(&mut self, bone: &BoneVolume, at: Vec3, out: &mut RigidStep) -> bool {
        let reach = self.config.move_voxels;
        if self.known.fresh && at.distance(self.known.centre) <= self.known.ahead {
            return true;
        }
        // While bone goes away the discs are out of date in the next tick, so none are gathered ahead.
        let ahead = if self.works { 0.0 } else { self.config.ahead_voxels };
        let radius = self.tool.tip_radius_mm / bone.spacing_mm();
        let far = radius + reach + ahead + self.config.disc_voxels;
        let Some(read) = self.window.cover(bone, at.round().as_ivec3(), far.ceil() as i32 + 3) else {
            out.fallbacks += 1;
            return false;
        };
        let hollow = if self.known.clear { radius - ahead - 1.0 } else { 0.0 };
        self.discs.gather(&self.window, at, hollow, far);
        self.known = Known { fresh: true, centre: at, ahead, clear: self.known.clear };
        out.voxels_swept += read + self.discs.visited;
        out.fallbacks += u32::from(self.discs.overflow > 0);
        true
    }

    /// Fills the manifold from where proxy and device are.
    fn report(&self, bone: &BoneVolume, device: Vec3, out: &mut RigidStep) {
        let lifted = self.proxy.translation - device;
        let depth = lifted.length();
        if depth == 0.0 {
            return;
        }
        let (spacing, radius) = (bone.spacing_mm(), self.radius_mm());
        let base = self.discs.base.as_vec3();
        let centre = bone.grid_of(self.proxy.translation) - base;
        let ball = Ball { radius: radius / spacing, slop: self.config.slop_voxels, inside: false };
        for disc in &self.near {
            let near = ball.nearest(disc, centre);
            if near.distance < ball.radius + TOUCH {
                let point = bone.origin() + spacing * (centre + base - near.direction * near.distance);
                let deep = radius - (device - point).dot(near.direction);
                out.points_in_contact += 1;
                out.manifold.push(Contact { point, normal: near.direction, depth_mm: deep.max(0.0) });
            }
        }
        out.voxels_in_contact = out.points_in_contact.min(self.discs.voxels);
        out.manifold.normal = lifted / depth;
        out.manifold.depth_mm = depth;
        out.manifold.point = self.proxy.translation - radius * out.manifold.normal;
    }
}

impl RigidContact for DistanceField {
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
        self.works = drilling && self.tool.kind == ToolKind::Burr;
        self.bite(bone, dt_ms);
        self.follow(bone, device, dt_ms, out);
        self.report(bone, device, out);
        if self.works {
            let (proxy, radius_mm) = (self.proxy.translation, self.tool.tip_radius_mm);
            let depth_mm = device.distance(proxy) + self.bite_mm;
            let cut = Cut { device, proxy, radius_mm, depth_mm, dt_ms };
            if self.discs.list().is_empty() {
                return;
            }
            out.removed_mm3 = self.burr.cut(bone, &cut, |voxel| self.window.hu(voxel));
            for voxel in self.burr.bitten() {
                self.window.set(voxel, bone.hu(voxel));
                self.known.fresh = false;
            }
        }
    }

    fn proxy(&self) -> Pose {
        self.proxy
    }

    fn reset(&mut self, pose: Pose) {
        self.proxy = pose;
        self.placed = pose.translation.is_finite();
        self.bite_mm = 0.0;
        self.known = Known::default();
        self.window.forget();
        self.discs.forget();
        self.near.clear();
        self.burr.reset();
    }
}

/// A ball among discs; all lengths in voxels, in the discs' frame.
struct Ball {
    radius: f32,
    slop: f32,
    /// Whether its centre is in bone: then a disc pushes along its own normal, which is the way out.
    inside: bool,
}

/// Where a ball sees a disc.
struct Near {
    /// Distance from the disc to the centre; negative behind it when the centre is in bone.
    distance: f32,
    /// Unit vector from the disc to the centre.
    direction: Vec3,
}

/// How a ball has moved.
struct Slide {
    to: Vec3,
    /// Whether it came to rest, not just to the end of what is known.
    rests: bool,
    /// Whether the constraints contradicted each other.
    contradiction: bool,
}

impl Ball {
    fn nearest(&self, disc: &Disc, centre: Vec3) -> Near {
        let from_disc = centre - disc.centre;
        let height = from_disc.dot(disc.normal);
        if self.inside {
            return Near { distance: height, direction: disc.normal };
        }
        let sideways = from_disc - height * disc.normal;
        let off = sideways.length();
        let rim = from_disc - sideways * (disc.radius / off.max(disc.radius));
        let distance = rim.length();
        let direction = if distance > 1e-6 { rim / distance } else { disc.normal };
        Near { distance, direction }
    }

    /// Copies those discs to `near` that are within `reach` of the ball at `centre`. Returns the smallest clearance.
    fn select(&self, discs: &[Disc], centre: Vec3, reach: f32, near: &mut Vec<Disc>) -> f32 {
        near.clear();
        let mut clearance = f32::MAX;
        for disc in discs {
            // Cheaper than the disc's own distance and never greater.
            if disc.centre.distance(centre) - disc.radius <= self.radius + reach {
                let clear = self.nearest(disc, centre).distance - self.radius;
                clearance = clearance.min(clear);
                if clear <= reach {
                    near.push(*disc);
                }
            }
        }
        clearance
    }

    /// The half-spaces that keep the ball at `centre` clear of the discs by `radius`. One that is not clear may stay as it is and must
    /// gain `recover`.
    fn constrain(&self, discs: &[Disc], centre: Vec3, radius: f32, recover: f32, spaces: &mut Vec<HalfSpace>) {
        spaces.clear();
        for disc in discs {
            let near = self.nearest(disc, centre);
            let clear = radius.min(near.distance + recover);
            spaces
                .push(HalfSpace { normal: near.direction, offset: near.direction.dot(centre) - near.distance + clear });
        }
    }

    /// Slides from `from` towards `goal`, no further than `reach`.
    fn slide(
        &self,
        discs: &[Disc],
        spaces: &mut Vec<HalfSpace>,
        from: Vec3,
        goal: Vec3,
        reach: f32,
        recover: f32,
    ) -> Slide {
        let mut slide = Slide { to: from, rests: false, contradiction: false };
        for _ in 0..MAX_SLIDES {
            let at = slide.to;
            self.constrain(discs, at, self.radius, recover, spaces);
            let target = nearest(goal, spaces).or_else(|| {
                slide.contradiction = true;
                self.constrain(discs, at, self.radius - self.slop, 0.0, spaces);
                nearest(goal, spaces)
            });
            let way = target.unwrap_or(at) - at;
            let share = share_within(at - from, way, reach);
            slide.to = if share == 1.0 { target.unwrap_or(at) } else { at + share * way };
            if share < 1.0 {
                return slide;
            }
            if way.length() < REST {
                break;
            }
        }
        slide.rests = true;
        slide
    }
}

/// The largest share t ≤ 1 of `way` with `|offset + t way| ≤ reach`.
fn share_within(offset: Vec3, way: Vec3, reach: f32) -> f32 {
    let (a, b, c) = (way.length_squared(), offset.dot(way), offset.length_squared() - reach * reach);
    if (offset + way).length_squared() <= reach * reach || a == 0.0 {
        return 1.0;
    }
    let root = (b * b - a * c).max(0.0).sqrt();
    ((root - b) / a).clamp(0.0, 1.0)
}
