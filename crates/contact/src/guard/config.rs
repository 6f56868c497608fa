//! Limits of the guard, and what it counts.

use crate::passivity::PassivityConfig;
use trepan_measurements::devices;

/// Limits of the guard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardConfig {
    /// Longest force, N. Set it to the device's peak; 3.3 is the Touch's.
    pub max_force_n: f32,
    /// Force that the motors bear for any time, N; as long as the peak or longer, there is no heat
    /// account. The Touch's is 0.88.
    pub continuous_force_n: f32,
    /// Time constant τ of the motors' heat, ms. From cold, the Touch's peak is given for 2 s, 2 N
    /// for 6 s.
    pub heat_ms: f32,
    /// Longest torque, N mm. 188 is the limit of the 6-DOF Premium.
    pub max_torque_nmm: f32,
    /// Largest change of force, N per ms.
    pub slew_n_per_ms: f32,
    /// Largest change of torque, N mm per ms.
    pub torque_slew_nmm_per_ms: f32,
    /// Time from no force to full force at the start and after a fault, ms.
    pub ramp_in_ms: f32,
    /// Tip speed over which the force is cut, mm/ms. 1 m/s is out of reach of a hand in contact: a
    /// fault or a flight.
    pub max_speed: f32,
    /// Age of the newest sample at which the force fades, ms. A tool whose `time_ms` stays 0 has no
    /// clock and is exempt.
    pub stale_ms: f32,
    /// The passivity controller; `None` switches it off.
    pub passivity: Option<PassivityConfig>,
}

impl Default for GuardConfig {
    fn default() -> Self {
        Self {
            max_force_n: devices::TOUCH_PEAK_FORCE.f32(),
            continuous_force_n: f32::INFINITY,
            heat_ms: 30_000.0,
            max_torque_nmm: devices::TOUCH_TORQUE.f32(),
            slew_n_per_ms: 0.5,
            torque_slew_nmm_per_ms: 20.0,
            ramp_in_ms: 300.0,
            max_speed: 1.0,
            stale_ms: 10.0,
            passivity: Some(PassivityConfig::default()),
        }
    }
}

impl GuardConfig {
    /// With limits that are negative or not numbers as zero.
    pub(super) fn sanitized(self) -> Self {
        // Under a micronewton rounding would pass the limit.
        let sound = |x: f32| if x > 1e-6 { x.min(1e6) } else { 0.0 };
        Self {
            max_force_n: sound(self.max_force_n),
            continuous_force_n: sound(self.continuous_force_n),
            heat_ms: sound(self.heat_ms),
            max_torque_nmm: sound(self.max_torque_nmm),
            slew_n_per_ms: sound(self.slew_n_per_ms),
            torque_slew_nmm_per_ms: sound(self.torque_slew_nmm_per_ms),
            ramp_in_ms: sound(self.ramp_in_ms),
            max_speed: sound(self.max_speed),
            stale_ms: sound(self.stale_ms),
            passivity: self.passivity,
        }
    }
}

/// What the guard had to do, in ticks since it was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GuardCounters {
    /// Force or torque was longer than its limit.
    pub clamped: u64,
    /// The force was shortened to what warm motors bear.
    pub heated: u64,
    /// Force or torque changed faster than its limit.
    pub slewed: u64,
    /// The wanted wrench, the tool or the tick length was not a usable number.
    pub non_finite: u64,
    /// The passivity controller damped the force.
    pub passivity: u64,
    /// The force was shortened to what the energy account could pay for.
    pub bounded: u64,
    /// A force held short by the energy account began anew: its coupling is outside what the
    /// controller can hold.
    pub restarted: u64,
    /// The tool was faster than the cut-out, or jumped.
    pub too_fast: u64,
    /// The sample was older than the limit.
    pub stale: u64,
    /// The force was reduced by the ramp-in.
    pub ramped: u64,
}
