//! What a burr takes away: the thesis's law of one density unit per tick, and a law in mm³ per ms.
//!
//! # Theory
//! ```text
//! per tick:  hu ← hu - 1                                           for every voxel in contact
//! rate:      V̇ = μ F ω(F) r / u               mm³/ms of bone at the reference density
//! ```
//! Rate is Archard's and Preston's law of abrasive wear, volume in proportion to load F times
//! sliding speed ω r, written with a cutting ratio μ (tangential over normal force) and the
//! specific energy u of the material. The [`Spindle`] loses speed under the torque μ F r and
//! stalls; a stalled burr takes nothing. Over dt the volume is V̇ dt, whatever the tick rate.
//!
//! The energy to take a voxel from one density to another is `∫ u m(hu) dhu`: m is 1 in cortical
//! bone, less in cancellous bone, linear between the borders of the dental classes D3 (350 HU) and
//! D1 (1250 HU). It depends on densities only, so that no voxel needs to remember what it was.
//!
//! The burr's ball, swept from the proxy to the device, bounds the removal. With s the distance of
//! a voxel from its surface, in voxels, positive outside, no voxel falls below `iso + 1000 s`: its
//! centre leaves the bone only once it is inside the ball, and the crossing between voxels ends on
//! the ball itself. So the cut surface is smooth below the size of a voxel.
//!
//! ```text
//! hu ┤ • • •╲            the ramp that the burr can cut to: slope 1000 HU a voxel
//!    │       ╲• iso      through iso at the ball's surface
//!    └────────╲•──•── s
//! ```
//!
//! # Practice
//! F = stiffness · depth, N, up to `max_load_n`. Volume counts by fraction, `½ + (hu - iso)/750`
//! cut to 0..1, so that it is smooth in time and the same as geometry's after the cut. Densities
//! are whole HU: a fixed dither of voxel and tick rounds them, so that a loss of less than one HU a
//! tick counts in full over time and the same path gives the same bytes.
//!
//! # Sources
//! J. F. Archard, *Contact and rubbing of flat surfaces*, J. Appl. Phys. 24 (1953). Specific energy
//! per volume constant per bone: M. Arbabtafti et al., *Physics-based haptic simulation of bone
//! machining*, IEEE Trans. Haptics 4 (2011). Classes D1 to D4 by CT number: C. E. Misch,
//! *Contemporary implant dentistry*, 1999. **The numbers in [`RemovalLaw::RATE`] are
//! uncalibrated**: they are set so that 1 to 2 N open a 7 mm skull with a 3 mm burr in 5 to 10 s.
//!
//! # When not to use it
//! `per-tick` for anything but comparison: it removes twice as much at twice the tick rate, and
//! nothing physical drives it.

use crate::RigidStep;
use crate::rows::{GridBall, rows_within};
use crate::spindle::{Spindle, per_ms};
use glam::{IVec3, Vec3Swizzles};
use trepan_geometry::Vec3;
use trepan_volume::{AIR_HU, BoneVolume};

/// Fall of the ramp at the burr's surface, HU per voxel.
const RAMP_HU: f32 = 1000.0;
/// Span of density around the isovalue in which a voxel counts as partly bone, HU. A span as wide
/// as the ramp would count curved cuts too large, a narrower one surfaces along the grid: of 40
/// strokes in as many orientations the worst was 1.2 % off, 1.9 % with either.
const PARTIAL_HU: f32 = 750.0;
/// How far in front of the proxy the burr bites, voxels: the first layer, not what lies behind it.
const BITE_VOXELS: f32 = 1.5;
/// Density at which the specific energy is given, HU: dense cortical bone.
const REFERENCE_HU: f32 = 1500.0;
/// Density up to which bone is as light as cancellous bone gets: border of D4 to D3.
const CANCELLOUS_HU: f32 = 350.0;
/// Density from which bone is dense cortical bone: border of D2 to D1.
const CORTICAL_HU: f32 = 1250.0;
/// Free way ahead that tells the far side of a bone from a hollow in it, mm.
const BEYOND_MM: f32 = 3.0;

/// How much bone goes in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RemovalLaw {
    /// The thesis: every voxel in contact loses a fixed density each tick.
    PerTick {
        /// Loss, HU per tick. The thesis takes 1.
        decrement_hu: f32,
    },
    /// Volume at a rate from load, speed and specific energy.
    Rate {
        /// The motor.
        spindle: Spindle,
        /// Cutting ratio μ: tangential over normal force.
        cutting_ratio: f32,
        /// Specific energy u at 1500 HU, N/mm² (= J/cm³). Higher is slower.
        specific_energy_mpa: f32,
        /// What the energy to lower the density of cancellous bone is of that for cortical bone. 1
        /// makes no difference between them.
        cancellous_share: f32,
        /// Stiffness that turns depth into load, N/mm: that of the force model.
        stiffness: f32,
        /// Load beyond which pressing harder does not count, N.
        max_load_n: f32,
    },
}

impl RemovalLaw {
    /// The thesis's law: 1 HU a tick.
    pub const PER_TICK: Self = Self::PerTick { decrement_hu: 1.0 };

    /// The default. Uncalibrated.
    pub const RATE: Self = Self::Rate {
        spindle: Spindle::DRILL,
        cutting_ratio: 0.3,
        specific_energy_mpa: 300.0,
        cancellous_share: 0.5,
        stiffness: 2.0,
        max_load_n: 20.0,
    };

    /// The motor; the per-tick law knows none.
    pub fn spindle(&self) -> Option<Spindle> {
        match *self {
            Self::PerTick { .. } => None,
            Self::Rate { spindle, .. } => Some(spindle),
        }
    }

    /// Bone of the reference density that a burr of `radius_mm`, pressed `depth_mm` deep, takes in
    /// `dt_ms`, mm³; 0 for `PerTick`.
    pub fn volume_mm3(&self, radius_mm: f32, depth_mm: f32, dt_ms: f32) -> f32 {
        self.turned(radius_mm, depth_mm, dt_ms, &mut false).0
    }

    /// The volume of [`volume_mm3`](Self::volume_mm3), and the speed of the spindle, 1/min, which
    /// may be `stalled` before or after.
    fn turned(&self, radius_mm: f32, depth_mm: f32, dt_ms: f32, stalled: &mut bool) -> (f32, f32) {
        let &Self::Rate { spindle, cutting_ratio, specific_energy_mpa, stiffness, max_load_n, .. } = self else {
            return (0.0, 0.0);
        };
        let torque = cutting_ratio * (stiffness * depth_mm).min(max_load_n) * radius_mm;
        let rpm = spindle.turn(torque, stalled);
        let volume = torque * per_ms(rpm) / specific_energy_mpa * dt_ms;
        (if volume.is_finite() { volume.max(0.0) } else { 0.0 }, rpm)
    }

    /// How hard bone of `hu` is to wear for each HU, where bone of the reference density all the
    /// way down to air is 1.
    fn hardness(&self, hu: f32) -> f32 {
        let Self::Rate { cancellous_share, .. } = *self else { return 1.0 };
        let cancellous = cancellous_share.clamp(0.01, 1.0);
        let air = f32::from(AIR_HU);
        let whole = cancellous * (CANCELLOUS_HU - air)
            + 0.5 * (1.0 + cancellous) * (CORTICAL_HU - CANCELLOUS_HU)
            + (REFERENCE_HU - CORTICAL_HU);
        let cortical = ((hu - CANCELLOUS_HU) / (CORTICAL_HU - CANCELLOUS_HU)).clamp(0.0, 1.0);
        (cancellous + (1.0 - cancellous) * cortical) * (REFERENCE_HU - air) / whole
    }
}

impl Default for RemovalLaw {
    fn default() -> Self {
        Self::RATE
    }
}

/// Where and how hard a burr cuts in one tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cut {
    /// Centre of the burr as the hand holds it, world mm.
    pub device: Vec3,
    /// Centre of the burr as the bone lets it be, world mm.
    pub proxy: Vec3,
    /// Radius of the burr, mm.
    pub radius_mm: f32,
    /// How deep the burr is pressed in, mm: what makes the load.
    pub depth_mm: f32,
    /// Tick, ms.
    pub dt_ms: f32,
    /// Lowest and highest voxel between which the bone in reach is known to be.
    pub within: (IVec3, IVec3),
}

/// One voxel that the burr reaches.
#[derive(Clone, Copy, Debug, Default)]
struct Bite {
    voxel: IVec3,
    hu: i16,
    /// What the burr could take at most, HU, weighted by how near it is.
    reach_hu: f32,
    /// The density that it may not pass.
    floor_hu: f32,
}

/// The cutting side of one tool.
#[derive(Default)]
pub(crate) struct Burr {
    law: RemovalLaw,
    bites: Vec<Bite>,
    limit: usize,
    /// Cuts so far, for the dither.
    tick: u32,
    /// Whether the last cut took a voxel under the isovalue.
    opened: bool,
    /// Whether the spindle has stalled.
    stalled: bool,
    /// Direction of the last cut.
    forward: Vec3,
}

impl Burr {
    /// A burr that reaches at most `limit` voxels a tick.
    pub fn new(law: RemovalLaw, limit: usize) -> Self {
        Self { law, bites: Vec::with_capacity(limit), limit, ..Self::default() }
    }

    /// Starts the dither and a stalled spindle anew.
    pub fn reset(&mut self) {
        (self.tick, self.stalled) = (0, false);
    }

    /// Whether a voxel was bone before the last cut and is not any more.
    pub fn opened(&self) -> bool {
        self.opened
    }

    /// The voxels that the last cut may have changed.
    pub fn bitten(&self) -> impl Iterator<Item = IVec3> + '_ {
        self.bites.iter().map(|bite| bite.voxel)
    }

    /// Takes bone away and says in `out` how much, how fast the spindle turned and whether it broke
    /// through.
    ///
    /// `read` gives the densities of the row along x through a voxel: the bone's, or those of a
    /// copy of it.
    pub fn cut<R: Fn(i32) -> i16>(
        &mut self,
        bone: &BoneVolume,
        cut: &Cut,
        read: impl Fn(IVec3) -> R,
        out: &mut RigidStep,
    ) {
        (self.opened, self.forward) = (false, (cut.device - cut.proxy).normalize_or_zero());
        let sound = cut.depth_mm.is_finite() && cut.dt_ms.is_finite();
        if !sound || cut.depth_mm <= 0.0 || cut.dt_ms <= 0.0 {
            return;
        }
        self.find_bites(bone, cut, read);
        if let RemovalLaw::PerTick { decrement_hu } = self.law {
            self.take(bone, |bite| decrement_hu * f32::from(bite.reach_hu > 0.0), out);
            return;
        }
        let law = self.law;
        let (volume, rpm) = law.turned(cut.radius_mm, cut.depth_mm, cut.dt_ms, &mut self.stalled);
        let wanted = volume / bone.voxel_mm3() * (REFERENCE_HU - f32::from(AIR_HU));
        let within_reach: f32 = self.bites.iter().map(|b| b.reach_hu * law.hardness(f32::from(b.hu))).sum();
        let fraction = if within_reach > wanted { wanted / within_reach } else { 1.0 };
        out.spindle_rpm = rpm;
        if fraction > 0.0 && rpm > 0.0 {
            self.take(bone, |bite| fraction * bite.reach_hu, out);
        }
    }

    /// Takes density from `voxels` by the per-tick law, wherever they are.
    pub fn wear(&mut self, bone: &BoneVolume, voxels: impl Iterator<Item = IVec3>, out: &mut RigidStep) {
        let RemovalLaw::PerTick { decrement_hu } = self.law else { return };
        self.forward = Vec3::ZERO;
        self.bites.clear();
        for voxel in voxels.take(self.limit) {
            let (hu, floor_hu) = (bone.hu(voxel), f32::from(AIR_HU));
            self.bites.push(Bite { voxel, hu, reach_hu: f32::from(hu) - floor_hu, floor_hu });
        }
        self.take(bone, |_| decrement_hu, out);
    }

    /// Lists the voxels in front of the proxy inside the ball swept from the proxy to the device,
    /// or on its surface.
    ///
    /// The ball of the device alone would miss the flanks that hold a proxy far behind: the burr
    /// would stall.
    fn find_bites<R: Fn(i32) -> i16>(&mut self, bone: &BoneVolume, cut: &Cut, read: impl Fn(IVec3) -> R) {
        self.bites.clear();
        let (device, proxy) = (bone.grid_of(cut.device), bone.grid_of(cut.proxy));
        let radius = cut.radius_mm / bone.spacing_mm();
        let way = device - proxy;
        let (forward, length) = (way.normalize_or_zero(), way.length());
        let iso = f32::from(bone.isovalue());
        // Within the proxy there is air, but for the foot of the ramp.
        let ball = GridBall { centre: proxy, radius: radius + BITE_VOXELS };
        let hole = GridBall { centre: proxy, radius: radius - 2.0 };
        let outer = (radius + 1.0).powi(2);
        let Self { bites, limit, .. } = self;
        rows_within(ball, hole, cut.within, |start, to| {
            let first = start.as_vec3() - proxy;
            let (across, rest) = (first.yz().length_squared(), first.yz().dot(forward.yz()));
            let row = read(start);
            for x in start.x..=to {
                let dx = first.x + (x - start.x) as f32;
                let along = rest + dx * forward.x;
                let hu = if along < -1.0 { AIR_HU } else { row(x) };
                let (apart, passed) = (across + dx * dx, along.clamp(0.0, length));
                let from_way = apart + passed * (passed - 2.0 * along);
                if hu == AIR_HU || from_way >= outer {
                    continue;
                }
                let outside = from_way.max(0.0).sqrt() - radius;
                let floor_hu = (iso + RAMP_HU * outside).max(f32::from(AIR_HU));
                if f32::from(hu) > floor_hu && bites.len() < *limit {
                    let near = (1.0 - (apart.sqrt() - radius) / BITE_VOXELS).clamp(0.0, 1.0);
                    let reach_hu = near * (f32::from(hu) - floor_hu);
                    bites.push(Bite { voxel: start.with_x(x), hu, reach_hu, floor_hu });
                }
            }
        });
    }

    /// Lowers each bite's density by `loss` HU, not below its floor.
    fn take(&mut self, bone: &BoneVolume, loss: impl Fn(&Bite) -> f32, out: &mut RigidStep) {
        let iso = f32::from(bone.isovalue());
        let fraction = |hu: f32| (0.5 + (hu - iso) / PARTIAL_HU).clamp(0.0, 1.0);
        let mut removed = 0.0;
        self.tick = self.tick.wrapping_add(1);
        self.opened = false;
        for bite in &self.bites {
            let from = f32::from(bite.hu);
            let whole = (loss(bite) + dither(bite.voxel, self.tick)).floor().clamp(0.0, (from - bite.floor_hu).floor());
            if whole >= 1.0 {
                bone.set_hu(bite.voxel, (from - whole) as i16);
                removed += fraction(from) - fraction(from - whole);
                if from >= iso && from - whole < iso {
                    self.opened = true;
                    out.broke_through |= self.forward != Vec3::ZERO && is_free(bone, bite.voxel, self.forward);
                }
            }
        }
        out.removed_mm3 = removed * bone.voxel_mm3();
    }
}

/// Whether there is no bone for some way from `voxel` along `forward`.
fn is_free(bone: &BoneVolume, voxel: IVec3, forward: Vec3) -> bool {
    let steps = (BEYOND_MM / bone.spacing_mm()).ceil().clamp(1.0, 64.0) as u32;
    (1..=steps).all(|step| !bone.is_bone((voxel.as_vec3() + step as f32 * forward).round().as_ivec3()))
}

/// A number in 0..1 that is spread evenly over voxels and ticks, and always the same.
fn dither(voxel: IVec3, tick: u32) -> f32 {
    let [x, y, z] = voxel.as_uvec3().to_array();
    let mut h = x.wrapping_mul(0x9E37_79B1)
        ^ y.wrapping_mul(0x85EB_CA77)
        ^ z.wrapping_mul(0xC2B2_AE3D)
        ^ tick.wrapping_mul(0x27D4_EB2F);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    ((h ^ (h >> 15)) >> 8) as f32 / (1 << 24) as f32
}
