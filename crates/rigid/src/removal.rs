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
//! Bone of less density costs less: its price is `∫ m(hu) dhu` from air to its density, 1 at the
//! reference density; m is 1 in cortical bone, less in cancellous bone, linear between the borders
//! of the dental classes D3 (350 HU) and D1 (1250 HU).
//!
//! The burr moves its ball from the proxy towards the device, by the s at which the bone that
//! opens costs what the load has earned, and the ball's swept volume joins the cut
//! ([`cut_at`](trepan_volume::BoneVolume::cut_at)). So the cut is the burr's own shape, whatever
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
//! F = stiffness · depth, N, up to `max_load_n`. The same path gives the same bytes. A burr cuts in
//! steps of 5 um; a step costs about 10 ns for each node within two of its front half. Contact with
//! what was cut begins 4 um behind its surface, or a burr would lock in its own bore.
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

use crate::spindle::{Spindle, per_ms};
use trepan_volume::AIR_HU;

/// Density at which the specific energy is given, HU: dense cortical bone.
const REFERENCE_HU: f32 = 1500.0;
/// Density up to which bone is as light as cancellous bone gets: border of D4 to D3.
const CANCELLOUS_HU: f32 = 350.0;
/// Density from which bone is dense cortical bone: border of D2 to D1.
const CORTICAL_HU: f32 = 1250.0;

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
    pub(crate) fn turned(&self, radius_mm: f32, depth_mm: f32, dt_ms: f32, stalled: &mut bool) -> (f32, f32) {
        let &Self::Rate { spindle, cutting_ratio, specific_energy_mpa, stiffness, max_load_n, .. } = self else {
            return (0.0, 0.0);
        };
        let torque = cutting_ratio * (stiffness * depth_mm).min(max_load_n) * radius_mm;
        let rpm = spindle.turn(torque, stalled);
        let volume = torque * per_ms(rpm) / specific_energy_mpa * dt_ms;
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
