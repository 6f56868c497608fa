//! What a burr takes away: the thesis's law of one density unit per tick, and a law in mm³ per ms.
//!
//! # Theory
//! ```text
//! per tick:  hu ← hu - 1                                           for every voxel in contact
//! rate:      u(h) = u∞ (1 + e/h)               J/cm³ in chips h thick, with edges e "blunt"
//!            μ F = u L h ,   V̇ = L h v         so   V̇ = v (μ F - u∞ e L)₊ / u∞   mm³/ms
//!            v = ω r √(sin²θ + p² cos²θ)        θ between the axis and the way that it is pressed
//! ```
//! A tooth bears a force of its edge, which rubs and ploughs whatever the chip, and one in
//! proportion to the chip: energy per volume falls as chips thicken. L is the length of edge that
//! cuts at once, μ the tangential over the normal force F. Under `u∞ e L / μ` a cutter only rubs;
//! above, volume goes with load times speed (Archard, Preston). A ball turns fastest at its
//! equator and not at all at its pole: pressed along its axis its mean speed is p ω r, p = 2/3.
//! The [`Spindle`] loses speed under the torque and stalls; a stalled cutter takes nothing. Over dt
//! the volume is V̇ dt, whatever the tick rate.
//!
//! Bone of less density costs less: its price is `∫ m(hu) dhu` from air to its density, 1 at the
//! reference density; m is 1 in cortical bone, less in cancellous bone, linear between the borders
//! of the dental classes D3 (350 HU) and D1 (1250 HU).
//!
//! The burr moves its ball from the proxy towards the device, by the s at which the bone that
//! opens costs what the load has earned, and the ball's swept volume joins the cut
//! ([`cut_at`](trepan_bone::BoneVolume::cut_at)). So the cut is the burr's own shape, whatever
//! the voxels.
//! ```text
//! Σ price (taken after s - taken before) node³ = earned        covered: ½ + d, cut to 0..1
//! ```
//! A ball at whose surface a node lies d deep covers as much of it; where the CT ends the bone a
//! part of that is taken. A density so far under the isovalue, over its slope, as a node is deep
//! counts the same: a ramp of any width is bone up to the isovalue, and no further.
//! What is earned and not yet cut stays for the next tick: a tick moves the cut by a micrometre,
//! less than the proxy may stand before it, and a burr that forgot would never move. The ball goes
//! on from where it has cut to, not from the proxy, so that what the contact is uncertain by does
//! not get into the cut.
//!
//! # Practice
//! F = stiffness · depth, newtons of the task, up to `max_load_n`. A device gives a share of that:
//! the stiffness of the task is that of the hand over the [force scale](RemovalLaw::with_hand). The
//! same path gives the same bytes. A burr cuts in steps of 5 um; a step costs about 10 ns for each
//! node within two of its front half. Contact with what was cut begins 4 um behind its surface, or
//! a burr would lock in its own bore.
//!
//! # Sources
//! J. F. Archard, *Contact and rubbing of flat surfaces*, J. Appl. Phys. 24 (1953). Edge and chip
//! forces: Y. Altintas, *Manufacturing automation*, 2012, measured on bone by a saw tooth in Med
//! Eng Phys 35:1638. Classes D1 to D4 by CT number: C. E. Misch, *Contemporary implant dentistry*,
//! 1999. Numbers: tables `drilling`, `skull` and `hands` of `trepan-measurements`, each with its
//! source or as uncalibrated. The burr's own energy and edge are **fitted to forces and times of
//! hands**, not measured on a burr.
//!
//! # When not to use it
//! `per-tick` for anything but comparison: it removes twice as much at twice the tick rate, and
//! nothing physical drives it. For the force of a light touch: the length of edge that cuts does
//! not fall with the area of the contact.

use crate::spindle::{Spindle, per_ms};
use trepan_geometry::{Tool, ToolKind};
use trepan_measurements::{devices, drilling, hands, skull};
use trepan_volume::AIR_HU;

/// Density at which the specific energy is given, HU: dense cortical bone.
const REFERENCE_HU: f32 = skull::DENSITY_OF_REFERENCE.f32();
/// Density up to which bone is as light as cancellous bone gets: border of D4 to D3.
const CANCELLOUS_HU: f32 = skull::DENSITY_CANCELLOUS.f32();
/// Density from which bone is dense cortical bone: border of D2 to D1.
const CORTICAL_HU: f32 = skull::DENSITY_CORTICAL.f32();
/// Micrometres in a millimetre.
const UM: f32 = 1e-3;

/// Newtons at the hand per newton of the task, of a hand that no device limits.
///
/// The greatest published force on a drill becomes the Touch's peak.
pub const FORCE_SCALE: f32 = devices::TOUCH_PEAK_FORCE.f32() / hands::DRILLING_PEAK_GREATEST.f32();

/// A cutter and its motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutter {
    /// The motor.
    pub spindle: Spindle,
    /// Cutting ratio μ: tangential over normal force.
    pub cutting_ratio: f32,
    /// Specific energy u∞ of thick chips at 1500 HU, N/mm² (= J/cm³). Higher is slower.
    pub chip_energy_mpa: f32,
    /// Bluntness e: chip thickness at which the edge bears as much force as the chip, mm.
    pub edge_mm: f32,
    /// Length L of edge that cuts at once, radii.
    pub edges: f32,
    /// Mean speed p of a cutter pressed along its axis over that of its equator.
    pub pole_share: f32,
}

impl Cutter {
    /// A high-speed burr.
    pub const BURR: Self = Self {
        spindle: Spindle::DRILL,
        cutting_ratio: drilling::BURR_CUTTING_RATIO.f32(),
        chip_energy_mpa: drilling::BURR_ENERGY.f32(),
        edge_mm: UM * drilling::BURR_EDGE.f32(),
        edges: drilling::BURR_EDGES.f32(),
        pole_share: drilling::BURR_POLE_SHARE.f32(),
    };

    /// A cranial perforator: slow, with two lips that cut thick chips.
    pub const PERFORATOR: Self = Self {
        spindle: Spindle::PERFORATOR,
        cutting_ratio: drilling::PERFORATOR_CUTTING_RATIO.f32(),
        chip_energy_mpa: drilling::PERFORATOR_ENERGY.f32(),
        edge_mm: UM * drilling::PERFORATOR_EDGE.f32(),
        edges: drilling::PERFORATOR_EDGES.f32(),
        pole_share: drilling::BURR_POLE_SHARE.f32(),
    };

    /// A cutter of constant specific energy, as versions before 0.3 had it. For their recordings
    /// its uncalibrated constants are numerical parameters.
    pub const CONSTANT: Self = Self {
        spindle: Spindle { power_w: 30.0, ..Spindle::DRILL },
        cutting_ratio: 0.3,
        chip_energy_mpa: 300.0,
        edge_mm: 0.0,
        edges: 0.0,
        pole_share: 1.0,
    };

    /// Energy per volume of chips `chip_mm` thick, N/mm²: u∞ (1 + e/h).
    pub fn energy_mpa(&self, chip_mm: f32) -> f32 {
        self.chip_energy_mpa * (1.0 + self.edge_mm / chip_mm)
    }

    /// Force on a tooth with chips of the first thickness over that with chips of the second.
    pub fn force_ratio(&self, chip_mm: f32, other_mm: f32) -> f32 {
        self.energy_mpa(chip_mm) * chip_mm / (self.energy_mpa(other_mm) * other_mm)
    }

    /// Normal force under which a cutter of `radius_mm` only rubs, N.
    pub fn rubbing_n(&self, radius_mm: f32) -> f32 {
        self.edge_n(radius_mm) / self.cutting_ratio
    }

    /// Tangential force of the edges, N.
    fn edge_n(&self, radius_mm: f32) -> f32 {
        self.chip_energy_mpa * self.edge_mm * (self.edges * radius_mm)
    }

    /// Mean distance of the cut from the axis over the radius.
    fn arm(&self, cosine: f32) -> f32 {
        (1.0 - (1.0 - self.pole_share * self.pole_share) * cosine * cosine).sqrt()
    }
}

/// How a cutter is pressed in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pressed {
    /// Radius of the cutter, mm.
    pub radius_mm: f32,
    /// Depth that makes the load, mm.
    pub depth_mm: f32,
    /// Cosine between the tool's axis and the way that it is pressed; its sign does not matter.
    pub cosine: f32,
    /// Tick, ms.
    pub dt_ms: f32,
}

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
        /// What burrs and craniotomes cut with.
        cutter: Cutter,
        /// What perforators cut with.
        perforator: Cutter,
        /// What the energy to lower the density of cancellous bone is of that for cortical bone. 1
        /// makes no difference between them.
        cancellous_share: f32,
        /// Stiffness that turns depth into load, newtons of the task per mm.
        stiffness: f32,
        /// Load beyond which pressing harder cuts no faster, newtons of the task; it still slows
        /// the spindle.
        max_load_n: f32,
    },
}

impl RemovalLaw {
    /// The thesis's law: 1 HU a tick.
    pub const PER_TICK: Self = Self::PerTick { decrement_hu: 1.0 };

    /// The default, for a hand that no device limits.
    pub const RATE: Self = Self::Rate {
        cutter: Cutter::BURR,
        perforator: Cutter::PERFORATOR,
        cancellous_share: skull::CUTTING_SHARE_OF_CANCELLOUS.f32(),
        stiffness: drilling::CONTACT_STIFFNESS.f32() / FORCE_SCALE,
        max_load_n: drilling::BURR_GREATEST_LOAD.f32(),
    };

    /// The law that tests and trials compare with.
    ///
    /// Constant specific energy, and the hand's newtons as those of the task. Its constants are
    /// numerical parameters.
    pub const CONSTANT_ENERGY: Self = Self::Rate {
        cutter: Cutter::CONSTANT,
        perforator: Cutter::CONSTANT,
        cancellous_share: 0.5,
        stiffness: 2.0,
        max_load_n: 20.0,
    };

    /// This law at a hand whose contact has a stiffness, N/mm, and that gets `scale` newtons for
    /// one of the task.
    pub fn with_hand(self, hand_stiffness: f32, scale: f32) -> Self {
        match self {
            Self::Rate { cutter, perforator, cancellous_share, max_load_n, .. } => {
                let stiffness = hand_stiffness / scale.max(1e-3);
                Self::Rate { cutter, perforator, cancellous_share, stiffness, max_load_n }
            }
            Self::PerTick { .. } => self,
        }
    }

    /// This law for a tool: with what that cuts.
    pub fn for_tool(self, tool: &Tool) -> Self {
        match self {
            Self::Rate { perforator, cancellous_share, stiffness, max_load_n, .. }
                if tool.kind == ToolKind::Perforator =>
            {
                Self::Rate { cutter: perforator, perforator, cancellous_share, stiffness, max_load_n }
            }
            _ => self,
        }
    }

    /// The motor; the per-tick law knows none.
    pub fn spindle(&self) -> Option<Spindle> {
        match *self {
            Self::PerTick { .. } => None,
            Self::Rate { cutter, .. } => Some(cutter.spindle),
        }
    }

    /// Bone of the reference density that a cutter takes in a tick, mm³; 0 for `PerTick`.
    pub fn volume_mm3(&self, pressed: &Pressed) -> f32 {
        self.turned(pressed, &mut false).0
    }

    /// The volume of [`volume_mm3`](Self::volume_mm3), and the speed of the spindle, 1/min, which
    /// may be `stalled` before or after.
    pub(crate) fn turned(&self, pressed: &Pressed, stalled: &mut bool) -> (f32, f32) {
        let &Self::Rate { cutter, stiffness, max_load_n, .. } = self else {
            return (0.0, 0.0);
        };
        let &Pressed { radius_mm, depth_mm, cosine, dt_ms } = pressed;
        let load_n = stiffness * depth_mm;
        let tangential_n = cutter.cutting_ratio * load_n.min(max_load_n);
        let arm_mm = radius_mm * cutter.arm(cosine);
        let rpm = cutter.spindle.turn(cutter.cutting_ratio * load_n * arm_mm, stalled);
        let cuts_n = (tangential_n - cutter.edge_n(radius_mm)).max(0.0);
        let volume = cuts_n * arm_mm * per_ms(rpm) / cutter.chip_energy_mpa * dt_ms;
        (if volume.is_finite() { volume.max(0.0) } else { 0.0 }, rpm)
    }

    /// What a volume of bone of `hu` costs, where bone of the reference density costs 1.
    pub(crate) fn price(&self, hu: f32) -> f32 {
        let Self::Rate { cancellous_share, .. } = *self else { return 1.0 };
        let least = cancellous_share.clamp(0.01, 1.0);
        let energy = |hu: f32| {
            let cortical = (hu.min(CORTICAL_HU) - CANCELLOUS_HU).max(0.0);
            least * (hu.min(CANCELLOUS_HU) - f32::from(AIR_HU))
                + cortical * (least + 0.5 * (1.0 - least) * cortical / (CORTICAL_HU - CANCELLOUS_HU))
                + (hu - CORTICAL_HU).max(0.0)
        };
        energy(hu.max(AIR_HU.into())) / energy(REFERENCE_HU)
    }
}

impl Default for RemovalLaw {
    fn default() -> Self {
        Self::RATE
    }
}
