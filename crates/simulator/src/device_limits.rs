//! Limits of a hand's device: what its guard, walls and drilling depend on.

use serde::{Deserialize, Serialize};
use trepan_contact::{GuardConfig, Viscoelastic};
use trepan_haptics::Capabilities;
use trepan_rigid::removal::RemovalLaw;
use trepan_stages::force_scale::ForceScale;

/// Device properties that the force guard and the walls depend on; recorded, so that a replay gives
/// the same forces. Zeros are unknown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct DeviceLimits {
    /// Largest short-term force, N.
    pub peak_force_n: f32,
    /// Largest continuous force, N.
    pub continuous_force_n: f32,
    /// Delay from a force's command to the motors, ticks.
    pub delay_ticks: u8,
    /// Resolution of the encoders times the motion scale, mm.
    pub position_step_mm: f32,
    /// Driven axes: 0, 3 or 6.
    pub axes_driven: u8,
    /// Moving mass at the tip, g.
    pub moving_mass_g: f32,
    /// The device's viscous damping, N ms/mm.
    pub damping_n_ms_per_mm: f32,
    /// Motion scale, world mm per device mm.
    pub scale: f32,
    /// Newtons at the hand per newton of the task, on bone.
    pub force_scale: f32,
}

impl Default for DeviceLimits {
    fn default() -> Self {
        Self {
            peak_force_n: 0.0,
            continuous_force_n: 0.0,
            delay_ticks: 0,
            position_step_mm: 0.0,
            axes_driven: 0,
            moving_mass_g: 0.0,
            damping_n_ms_per_mm: 0.0,
            scale: 1.0,
            force_scale: 1.0,
        }
    }
}

impl DeviceLimits {
    /// Properties of an open device whose motion is multiplied by `scale`. The force scale is that
    /// of its greatest force unless one is given.
    pub fn of(device: &Capabilities, scale: f32, force_scale: Option<f32>) -> Self {
        Self {
            peak_force_n: device.peak_force_n,
            continuous_force_n: device.continuous_force_n,
            delay_ticks: device.delay_ticks,
            position_step_mm: scale * device.position_resolution_mm,
            axes_driven: device.axes_driven,
            moving_mass_g: device.moving_mass_g,
            damping_n_ms_per_mm: device.damping,
            scale,
            force_scale: force_scale.unwrap_or_else(|| ForceScale::of(device.guard_config().max_force_n).0),
        }
    }

    /// The device, with the encoder step multiplied by the motion scale.
    fn device(&self) -> Capabilities {
        Capabilities {
            peak_force_n: self.peak_force_n,
            continuous_force_n: self.continuous_force_n,
            delay_ticks: self.delay_ticks,
            position_resolution_mm: self.position_step_mm,
            axes_driven: self.axes_driven,
            moving_mass_g: self.moving_mass_g,
            damping: self.damping_n_ms_per_mm,
            ..Capabilities::PASSIVE
        }
    }

    /// Newtons at the hand per newton of the task, on bone.
    pub fn force_scale(&self) -> ForceScale {
        ForceScale(self.force_scale)
    }

    /// Law of removal where bone has a stiffness, N/mm, at the hand.
    pub fn removal(&self, hand_stiffness: f32) -> RemovalLaw {
        RemovalLaw::RATE.with_hand(hand_stiffness, self.force_scale)
    }

    /// Configuration of the force guard.
    pub fn guard(&self) -> GuardConfig {
        self.device().guard_config()
    }

    /// Divides a wall's stiffness and damping by a scale over 1, and limits them to what the device
    /// renders stably.
    pub fn coupled(&self, wall: Viscoelastic, tick_ms: f32) -> Viscoelastic {
        let scale = self.scale.max(1.0);
        let wall = Viscoelastic { stiffness: wall.stiffness / scale, damping: wall.damping / scale };
        self.device().coupled(wall, tick_ms)
    }
}
