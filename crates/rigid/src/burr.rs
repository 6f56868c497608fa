//! The cutting side of a tool: what it reaches, and what it takes by a law of removal.

use crate::RigidStep;
use crate::cut_ball::{BAND, CrossedDistances, PayableNodes, RemovedBone, Side, Sweep, covered, depths, lanes};
use crate::nodes::{Nodes, clearance};
use crate::removal::{Pressed, RemovalLaw};
use crate::rows::{GridBall, rows};
use glam::IVec3;
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;
use trepan_volume::AIR_HU;
use wide::{f32x8, i16x8};

/// A numerical parameter: fall of the ramp down to which the per-tick law cuts at the burr's
/// surface, HU per voxel.
const RAMP_HU: f32 = 1000.0;
/// A numerical parameter: span of density around the isovalue in which a voxel counts as partly
/// bone, HU.
const PARTIAL_HU: f32 = 750.0;
/// How far in front of the proxy the per-tick law bites, voxels.
const BITE_VOXELS: f32 = 1.5;
/// Furthest that a burr cuts in one tick, nodes.
const STRIDE: f32 = 1.0;
/// How many times the last way a cut is first sought.
const AS_BEFORE: f32 = 3.0;
/// Least way that counts as the last, nodes.
const LEAST_WAY: f32 = 1e-3;
/// Least step of the cut, nodes: 5 um. Times the stiffness it is a change of force, and between two
/// steps the surface stands still, so that nothing needs to be looked for anew.
const STEP: f32 = 0.01;
/// Ticks whose earnings a burr keeps that does not come to cut.
const KEPT_TICKS: f32 = 20.0;
/// Ticks without the pedal after which a cut begins anew: a pedal may flicker.
const PAUSE: u32 = 20;
/// Most nodes that are listed as opened: more than a burr opens in a tick.
pub(crate) const MOST_OPENED: usize = 1024;
/// How near the proxy stands to where the burr has cut to, mm.
const STANDS_MM: f32 = 0.01;
/// Free way ahead that tells the far side of a bone from a hollow in it, mm.
const BEYOND_MM: f32 = trepan_measurements::drilling::FREE_WAY_BEYOND.f32();

/// Where and how hard a burr cuts in one tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cut {
    /// Centre of the burr as the hand holds it, world mm.
    pub device: Vec3,
    /// Centre of the burr as the bone lets it be, world mm.
    pub proxy: Vec3,
    /// Radius of the burr, mm.
    pub radius_mm: f32,
    /// From the middle of its cutting side to the end of it, world mm; nothing for a ball.
    pub side: Vec3,
    /// The tool's axis, a unit vector.
    pub axis: Vec3,
    /// How deep the burr is pressed in, mm: what makes the load.
    pub depth_mm: f32,
    /// Tick, ms.
    pub dt_ms: f32,
}

impl Cut {
    /// How the burr is pressed, for the law.
    fn pressed(&self) -> Pressed {
        let &Self { radius_mm, depth_mm, dt_ms, .. } = self;
        let cosine = (self.device - self.proxy).normalize_or_zero().dot(self.axis);
        Pressed { radius_mm, depth_mm, cosine, dt_ms }
    }
}

/// Where a burr stops.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stop {
    /// It has not earned the first of it.
    Before,
    /// After so many nodes; less than nothing is less than it overlaps with bone at its start.
    At(f32),
    /// It could go on.
    Beyond,
}

/// One voxel that loses density.
#[derive(Clone, Copy, Debug, Default)]
struct Bite {
    voxel: IVec3,
    /// The density that it may not pass.
    floor_hu: f32,
    /// What it loses, HU.
    loss_hu: f32,
}

/// A voxel that is worn by density.
#[derive(Clone, Copy, Debug)]
pub struct WornVoxel {
    /// The voxel.
    pub voxel: IVec3,
    /// Its share of the wear, in any unit.
    pub share: f32,
    /// The density that it keeps, HU.
    pub floor_hu: f32,
}

/// The cutting side of one tool.
pub(crate) struct Burr {
    law: RemovalLaw,
    paid: PayableNodes,
    bites: Vec<Bite>,
    limit: usize,
    /// Bone of the reference density that the load has earned and the burr has not cut, mm³.
    earned_mm3: f32,
    /// What is enough for a step, node³; from the last one.
    enough: f32,
    /// How far the last cut went, nodes.
    way: f32,
    /// Where the ball of the last cut is, world mm.
    at: Option<Vec3>,
    /// Whether the last cut changed anything.
    changed: bool,
    /// Whether the last cut opened a node or a voxel.
    has_opened: bool,
    /// The nodes that it opened.
    opened: Vec<IVec3>,
    /// Ticks since it worked.
    paused: u32,
    /// Whether the spindle has stalled.
    stalled: bool,
    /// Direction of the last cut.
    forward: Vec3,
}

impl Burr {
    /// A burr that takes bone of at most `limit` nodes or voxels a tick.
    pub fn new(law: RemovalLaw, limit: usize) -> Self {
        Self {
            law,
            paid: PayableNodes::with_capacity(limit),
            bites: Vec::with_capacity(limit),
            limit,
            earned_mm3: 0.0,
            enough: 0.0,
            way: 0.0,
            at: None,
            changed: false,
            has_opened: false,
            opened: Vec::with_capacity(MOST_OPENED + 1),
            paused: 0,
            stalled: false,
            forward: Vec3::ZERO,
        }
    }

    /// Cuts by another law from now on.
    pub fn cut_by(&mut self, law: RemovalLaw) {
        self.law = law;
    }

    /// Starts a stalled spindle anew.
    pub fn reset(&mut self) {
        self.stalled = false;
        self.rest();
    }

    /// The burr does not work for a tick. After some of them what it has earned is lost.
    pub fn pause(&mut self) {
        self.paused = self.paused.saturating_add(1);
        if self.paused > PAUSE {
            self.rest();
        }
    }

    fn rest(&mut self) {
        (self.earned_mm3, self.enough, self.way, self.at) = (0.0, 0.0, 0.0, None);
    }

    /// Whether the last cut changed what the nodes show.
    pub fn changed(&self) -> bool {
        self.changed
    }

    /// Whether a node or voxel was bone before the last cut and is not any more.
    pub fn has_opened(&self) -> bool {
        self.has_opened
    }

    /// The nodes that were bone before the last cut and are not any more.
    pub fn opened(&self) -> &[IVec3] {
        &self.opened
    }

    /// How far from the centre of a burr nodes are read, nodes; its side is `side_mm` long.
    pub fn reach(bone: &BoneVolume, radius_mm: f32, side_mm: f32) -> i32 {
        // What a disc of the surface reads is up to three voxels off.
        let beyond = (BAND + STRIDE + 4.0).max(2.0 + 3.0 * bone.cut_nodes() as f32);
        ((radius_mm + 0.5 * side_mm) / bone.node_mm() + beyond).ceil() as i32
    }

    /// Takes bone away and says in `out` how much, how fast the spindle turned and whether it broke
    /// through. `nodes` may show any place, but nothing old.
    pub fn cut(&mut self, bone: &BoneVolume, cut: &Cut, nodes: &mut Nodes, out: &mut RigidStep) {
        self.bites.clear();
        self.paused = 0;
        self.opened.clear();
        (self.changed, self.has_opened, self.forward) = (false, false, (cut.device - cut.proxy).normalize_or_zero());
        let sound = cut.depth_mm.is_finite() && cut.dt_ms.is_finite();
        if !sound || cut.depth_mm <= 0.0 || cut.dt_ms <= 0.0 {
            self.rest();
            return;
        }
        if let RemovalLaw::PerTick { decrement_hu } = self.law {
            self.find_bites(bone, cut, decrement_hu);
            self.take(bone, out);
            return;
        }
        let (earned, rpm) = self.law.turned(&cut.pressed(), &mut self.stalled);
        out.spindle_rpm = rpm;
        // The ball goes on from where it has cut to, as long as the proxy stands in that: what the
        // contact is uncertain by does not get into the cut.
        let clearance_mm = bone.node_mm() * clearance(bone.node_mm(), cut.radius_mm);
        let stands = |at: &Vec3| at.distance(cut.proxy) < STANDS_MM + clearance_mm;
        let start = self.at.filter(stands).unwrap_or(cut.proxy - clearance_mm * self.forward);
        self.forward = (cut.device - start).normalize_or_zero();
        self.at = Some(start);
        let centre = bone.cut_nodes() as f32 * bone.grid_of(start);
        let side = Side::of(cut.side / bone.node_mm());
        let covered = nodes.cover(
            bone,
            centre.round().as_ivec3(),
            Self::reach(bone, cut.radius_mm, 2.0 * side.half * bone.node_mm()),
        );
        if rpm <= 0.0 || covered.is_none() {
            out.fallbacks += u32::from(covered.is_none());
            self.rest();
            return;
        }
        let node_mm3 = bone.node_mm().powi(3);
        self.earned_mm3 = (self.earned_mm3 + earned).min((KEPT_TICKS * earned).max(2.0 * self.enough * node_mm3));
        if self.earned_mm3 < self.enough * node_mm3 {
            return;
        }
        let radius = cut.radius_mm / bone.node_mm();
        let sweep = Sweep { centre, side, forward: self.forward, radius };
        let longest = (cut.device.distance(start) / bone.node_mm()).min(STRIDE);
        // As far as the last few cuts together, or else as far as it may go.
        let (mut hollow, mut most) = (radius - BAND, longest.min(AS_BEFORE * self.way));
        let (stop, way) = loop {
            out.fallbacks += u32::from(self.find_paid(&sweep, (hollow, most), nodes));
            let stop = self.stop(radius, (hollow - radius, most), self.earned_mm3 / node_mm3);
            match stop {
                Stop::Beyond if most < longest => most = longest,
                Stop::At(way) if way < 0.0 && hollow > 0.0 => hollow = 0.0,
                Stop::Before if hollow > 0.0 => hollow = 0.0,
                Stop::Before => return,
                Stop::At(way) => break (stop, way),
                Stop::Beyond => break (stop, most),
            }
        };
        let RemovedBone { cost: spent, volume } = self.paid.taken(radius, way);
        self.open(bone, &sweep, (hollow, way), nodes, out);
        (self.changed, self.has_opened) = (true, !self.opened.is_empty());
        if stop == Stop::At(way) && way > 0.0 {
            self.enough = spent * (STEP / way).min(1.0);
        }
        self.way = way.max(LEAST_WAY);
        self.at = Some(start + way.max(0.0) * bone.node_mm() * self.forward);
        self.earned_mm3 -= spent * node_mm3;
        if stop == Stop::Beyond {
            // All within reach is not worth what was earned: the burr idles.
            self.rest();
        }
        out.removed_mm3 = volume * node_mm3;
    }

    /// Takes density from `voxels` by the per-tick law, wherever they are.
    pub fn wear(&mut self, bone: &BoneVolume, voxels: impl Iterator<Item = IVec3>, out: &mut RigidStep) {
        let RemovalLaw::PerTick { decrement_hu } = self.law else { return };
        self.forward = Vec3::ZERO;
        self.bites.clear();
        for voxel in voxels.take(self.limit) {
            self.bites.push(Bite { voxel, floor_hu: f32::from(AIR_HU), loss_hu: decrement_hu });
        }
        self.take(bone, out);
    }

    /// Takes the density that the load of `cut` earns from voxels, in proportion to their shares.
    /// What is too little for a whole HU stays earned.
    pub fn erode(&mut self, bone: &BoneVolume, cut: &Cut, worn: &[WornVoxel], out: &mut RigidStep) {
        self.bites.clear();
        (self.paused, self.forward) = (0, (cut.device - cut.proxy).normalize_or_zero());
        let (earned, rpm) = self.law.turned(&cut.pressed(), &mut self.stalled);
        out.spindle_rpm = rpm;
        let shares: f32 = worn.iter().map(|worn| worn.share).sum();
        if earned <= 0.0 || shares <= 0.0 {
            return;
        }
        self.earned_mm3 += earned;
        // A voxel ends being bone at the isovalue: to there it has cost what whole bone costs, and
        // what is left falls off.
        let least = f32::from(bone.isovalue());
        let whole = bone.voxel_mm3() / (1.0 - self.law.price(least)).max(0.01);
        let price = |hu: f32| self.law.price(hu.max(least));
        let cost_mm3 = |from: f32, loss: f32| whole * (price(from) - price(from - loss));
        let mut spent_mm3 = 0.0;
        for &WornVoxel { voxel, share, floor_hu } in worn.iter().take(self.limit) {
            let hu = f32::from(bone.ct(voxel));
            let loss_hu = (self.earned_mm3 * share / (shares * cost_mm3(hu, 1.0).max(1e-9))).floor();
            let loss_hu = loss_hu.min((hu - floor_hu).floor());
            if loss_hu >= 1.0 {
                spent_mm3 += cost_mm3(hu, loss_hu);
                self.bites.push(Bite { voxel, floor_hu, loss_hu });
            }
        }
        // Bone that is used up earns nothing for later.
        self.earned_mm3 = (self.earned_mm3 - spent_mm3).clamp(0.0, KEPT_TICKS * earned);
        // Voxels are gone as a whole, whatever density they had.
        out.removed_mm3 = self.take(bone, out) as f32 * bone.voxel_mm3();
    }

    /// Lists the bone that the burr may take some of when it goes `most`, nodes, but none nearer
    /// than `hollow`. Returns whether there was more than fits.
    fn find_paid(&mut self, sweep: &Sweep, (hollow, most): (f32, f32), nodes: &Nodes) -> bool {
        let (cut, density, mut over) = (nodes.cut(), nodes.density(), false);
        let Self { paid, law, limit, .. } = self;
        paid.clear();
        sweep.eights(hollow, 0.5 + most, |node, place| {
            let before = depths(cut.eight(node));
            let taken = sweep.takes(&place, before, most);
            if taken == 0 {
                return;
            }
            // How much of each is bone where the density falls so steeply.
            let over_border = density.overs(node);
            let rise = density.rise(node);
            let steepness = rise.length().fast_max(f32x8::ONE);
            let dense = 0.5 + over_border / steepness;
            let share = dense.fast_max(f32x8::ZERO).fast_min(f32x8::ONE);
            let taken = taken & share.simd_gt(f32x8::ZERO).to_bitmask();
            if taken == 0 {
                return;
            }
            let cosine = sweep.cosine(node, rise, (place.apart.sqrt(), steepness));
            let crossed = CrossedDistances { share, cosine };
            let gone = crossed.taken(covered(before, sweep.radius));
            for lane in lanes(taken) {
                over |= paid.len() == *limit;
                if paid.len() < *limit {
                    let price = law.price(over_border.as_array()[lane] + f32::from(density.border()));
                    paid.push(lane, &place, &crossed, gone, price);
                }
            }
        });
        paid.fill_up();
        over
    }

    /// Where the ball stops that has `earned` so many node³ of reference bone. It may go from the
    /// first to the second of `between`.
    fn stop(&self, radius: f32, between: (f32, f32), earned: f32) -> Stop {
        let cost = |way: f32| self.paid.taken(radius, way).cost;
        let zero = cost(0.0) - earned;
        let ends = if zero < 0.0 { (0.0, between.1) } else { (between.0, 0.0) };
        let of = |way: f32| if way == 0.0 { zero } else { cost(way) - earned };
        let ((mut low, mut under), (mut high, mut over)) = ((ends.0, of(ends.0)), (ends.1, of(ends.1)));
        if over <= 0.0 {
            return Stop::Beyond;
        }
        if under >= 0.0 {
            return Stop::Before;
        }
        // The regula falsi of Illinois: an end that stays counts half.
        let (mut way, mut side) = (0.0, 0.0);
        for _ in 0..24 {
            way = low - under * (high - low) / (over - under);
            let off = cost(way) - earned;
            if off.abs() < 0.02 * earned || high - low < 1e-5 {
                break;
            }
            if off < 0.0 {
                (low, under) = (way, off);
                over *= if side < 0.0 { 0.5 } else { 1.0 };
            } else {
                (high, over) = (way, off);
                under *= if side > 0.0 { 0.5 } else { 1.0 };
            }
            side = off;
        }
        Stop::At(way)
    }

    /// Adds the burr that has gone `way` to the cut, but nothing nearer than `hollow` to its start.
    fn open(
        &mut self,
        bone: &BoneVolume,
        sweep: &Sweep,
        (hollow, way): (f32, f32),
        nodes: &mut Nodes,
        out: &mut RigidStep,
    ) {
        let (mut writer, (cut, density)) = (bone.cut_writer(), nodes.split());
        // Bone ends where the contact says so.
        let border = i16x8::splat(cut.border());
        sweep.eights(hollow, BAND + way.max(0.0), |node, place| {
            let (whole, cells) = (cut.holds_eight(node), cut.eight_mut(node));
            let was = i16x8::new(*cells);
            let (is, rises) = sweep.cut(&place, was, way);
            let changed = rises.to_bitmask();
            if changed == 0 {
                return;
            }
            let is_bone = |lane: &usize| density.eight(node)[*lane] >= density.border();
            let now = rises.select(is, was).to_array();
            // Those that have not changed are known where the window holds all of them.
            if !writer.set_eight(node, now, if whole { 0xFF } else { changed }) {
                // Beyond the grid there is no bone.
                out.fallbacks += lanes(changed).filter(is_bone).count() as u32;
                return;
            }
            *cells = now;
            let opens = (rises & was.simd_lt(border) & is.simd_ge(border)).to_bitmask();
            for lane in lanes(opens).filter(is_bone) {
                let at = node + lane as i32 * IVec3::X;
                // One more than that says that there are more.
                if self.opened.len() <= MOST_OPENED {
                    self.opened.push(at);
                }
                let voxel = at / bone.cut_nodes();
                out.broke_through |= !out.broke_through && is_free(bone, voxel, self.forward);
            }
        });
        drop(writer);
        cut.see_all(bone);
    }

    /// Lists the voxels in front of the proxy inside the ball swept from the proxy to the device,
    /// or on its surface.
    fn find_bites(&mut self, bone: &BoneVolume, cut: &Cut, loss_hu: f32) {
        let (device, proxy) = (bone.grid_of(cut.device), bone.grid_of(cut.proxy));
        let radius = cut.radius_mm / bone.spacing_mm();
        let way = device - proxy;
        let (forward, length) = (way.normalize_or_zero(), way.length());
        let iso = f32::from(bone.isovalue());
        let ball = GridBall { centre: proxy, radius: radius + BITE_VOXELS };
        let Self { bites, limit, .. } = self;
        rows(ball, GridBall::NONE, |start, to| {
            for voxel in (start.x..=to).map(|x| start.with_x(x)) {
                let (off, hu) = (voxel.as_vec3() - proxy, bone.ct(voxel));
                let along = off.dot(forward);
                let from_way = (off - along.clamp(0.0, length) * forward).length();
                let floor_hu = (iso + RAMP_HU * (from_way - radius)).max(f32::from(AIR_HU));
                if along >= -1.0 && from_way < radius + 1.0 && f32::from(hu) > floor_hu && bites.len() < *limit {
                    bites.push(Bite { voxel, floor_hu, loss_hu });
                }
            }
        });
    }

    /// Lowers each bite's density by whole HU, not below its floor. Returns how many voxels stop
    /// being bone.
    fn take(&mut self, bone: &BoneVolume, out: &mut RigidStep) -> u32 {
        let iso = f32::from(bone.isovalue());
        let fraction = |hu: f32| (0.5 + (hu - iso) / PARTIAL_HU).clamp(0.0, 1.0);
        let (mut removed, mut opened) = (0.0, 0);
        self.has_opened = false;
        for bite in &self.bites {
            let from = f32::from(bone.ct(bite.voxel));
            let whole = bite.loss_hu.round().clamp(0.0, (from - bite.floor_hu).floor());
            if whole >= 1.0 {
                bone.set_hu(bite.voxel, (from - whole) as i16);
                removed += fraction(from) - fraction(from - whole);
                if from >= iso && from - whole < iso {
                    self.has_opened = true;
                    opened += 1;
                    out.broke_through |= self.forward != Vec3::ZERO && is_free(bone, bite.voxel, self.forward);
                }
            }
        }
        out.removed_mm3 = removed * bone.voxel_mm3();
        opened
    }
}

/// Whether there is no bone for some way from `voxel` along `forward`.
fn is_free(bone: &BoneVolume, voxel: IVec3, forward: Vec3) -> bool {
    let steps = (BEYOND_MM / bone.spacing_mm()).ceil().clamp(1.0, 64.0) as u32;
    (1..=steps).all(|step| !bone.is_bone((voxel.as_vec3() + step as f32 * forward).round().as_ivec3()))
}
