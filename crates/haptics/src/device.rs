//! The trait that all devices implement.

use std::f32::consts::PI;
use trepan_contact::{GuardConfig, GuardedWrench, PassivityConfig, Viscoelastic};
use trepan_geometry::{ToolState, Vec3};

/// Damping of a light grip, N ms/mm.
const LIGHT_GRIP: f32 = trepan_measurements::grip::LIGHT_GRIP_DAMPING.f32();

/// A haptic device, or something that behaves like one.
pub trait HapticDevice: Send {
    /// Reads the tool. `time_ms` is the session time of this tick; it never decreases.
    fn read(&mut self, time_ms: f64) -> Reading;

    /// Applies a wrench until the next call.
    fn apply(&mut self, wrench: GuardedWrench);

    /// The device's properties and limits.
    fn capabilities(&self) -> Capabilities;

    /// Sets zero force and releases the device. May be called more than once; later calls to
    /// `apply` do nothing.
    fn close(&mut self);
}

/// The result of one read.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// The tool in world space.
    pub tool: ToolState,
    /// Whether it is current.
    pub status: Status,
}

/// Whether a reading is current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Measured for this tick.
    Fresh,
    /// The device had no new data: the last pose is repeated.
    Stale,
    /// A script or a replay has ended; the pose stays.
    Finished,
    /// The device is disconnected or faulty; the pose is the last one known. Apply no force.
    Lost,
}

/// Properties and limits of a device; a virtual device states those that it emulates.
#[derive(Clone, Debug, PartialEq)]
pub struct Capabilities {
    /// Display name.
    pub name: String,
    /// Largest short-term force, N; 0 for a device without motors.
    pub peak_force_n: f32,
    /// Largest continuous force, N; 0 if unknown.
    pub continuous_force_n: f32,
    /// Highest read rate, Hz. Sessions run at 1 kHz unless configured otherwise.
    pub rate_hz: f32,
    /// Size of the box that the tip can reach, mm.
    pub workspace_mm: Vec3,
    /// Driven axes: 0, 3 or 6.
    pub axes_driven: u8,
    /// Position resolution, mm.
    pub position_resolution_mm: f32,
    /// Delay from `apply` to the motors, ticks.
    pub delay_ticks: u8,
    /// Moving mass at the tip, g; 0 if unknown.
    pub moving_mass_g: f32,
    /// The device's viscous damping, N ms/mm; 0 if unknown.
    pub damping: f32,
}

impl Capabilities {
    /// A device without motors or limits, read at 1 kHz.
    pub const PASSIVE: Self = Self {
        name: String::new(),
        peak_force_n: 0.0,
        continuous_force_n: 0.0,
        rate_hz: 1000.0, // numerical
        workspace_mm: Vec3::INFINITY,
        axes_driven: 0,
        position_resolution_mm: 0.0,
        delay_ticks: 0,
        moving_mass_g: 0.0,
        damping: 0.0,
    };

    /// [`Capabilities::PASSIVE`] with a name.
    pub fn passive(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::PASSIVE }
    }

    /// Limits the wall `wanted` to what stays stable on this device in a light grip, read every
    /// `tick_ms`. A device without motors returns `wanted` unchanged.
    ///
    /// ```text
    /// K ≤ (b + b_h + B)/(T/2 + d)           Gil, Hulin: d the delay, b_h = 2 N ms/mm a light grip
    /// B ≤ 0.8 · 2 sin(π/(4n + 2)) m/T       a sampled damper on the mass m alone, n ticks late
    /// ```
    pub fn coupled(&self, wanted: Viscoelastic, tick_ms: f32) -> Viscoelastic {
        if self.axes_driven == 0 {
            return wanted;
        }
        let late_ticks = f32::from(self.delay_ticks);
        let sampled = 1.6 * (PI / (4.0 * late_ticks + 2.0)).sin() * self.moving_mass_g / tick_ms;
        let damping = if self.moving_mass_g > 0.0 { wanted.damping.min(sampled) } else { wanted.damping };
        let passive = (self.damping + LIGHT_GRIP + damping) / (tick_ms * (0.5 + late_ticks));
        Viscoelastic { stiffness: wanted.stiffness.min(passive), damping }
    }

    /// The guard's recommended limits, lowered to this device's peak and continuous force, with its
    /// delay and encoder step for the energy observer. A device without motors keeps the
    /// recommended peak, since its forces are still shown and recorded.
    pub fn guard_config(&self) -> GuardConfig {
        let recommended = GuardConfig::default();
        let peak_n = if self.peak_force_n > 0.0 { self.peak_force_n } else { recommended.max_force_n };
        let passivity = PassivityConfig {
            delay_ticks: self.delay_ticks,
            quantum_mm: self.position_resolution_mm,
            ..PassivityConfig::default()
        };
        GuardConfig {
            max_force_n: peak_n.min(recommended.max_force_n),
            continuous_force_n: if self.continuous_force_n > 0.0 { self.continuous_force_n } else { f32::INFINITY },
            passivity: Some(passivity),
            ..recommended
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coupling_is_limited_by_delay_mass_and_grip() {
        let touch = |delay_ticks| Capabilities {
            axes_driven: 3,
            moving_mass_g: 45.0,
            damping: 0.1,
            delay_ticks,
            ..Capabilities::passive("Touch")
        };
        let hard = Viscoelastic { stiffness: 10.0, damping: 1000.0 };
        // A pure damper on 45 g is stable to 89, 37 and 24 N ms/mm, 0, 1 and 2 ticks late; a spring
        // of B = 1 in a light grip to 6.2, 2.1, 1.2.
        for (delay_ticks, damper, spring) in [(0, 89.0, 6.2), (1, 37.0, 2.1), (2, 24.0, 1.3)] {
            let damping = touch(delay_ticks).coupled(hard, 1.0).damping;
            assert!(damping <= damper && damping > 0.75 * damper, "{delay_ticks}: {damping}");
            let stiffness = touch(delay_ticks).coupled(Viscoelastic { damping: 1.0, ..hard }, 1.0).stiffness;
            assert!(stiffness <= spring && stiffness > 0.8 * spring, "{delay_ticks}: {stiffness}");
        }
        let soft = Viscoelastic { stiffness: 0.3, damping: 0.3 };
        assert_eq!(touch(2).coupled(soft, 1.0), soft);
        assert_eq!(Capabilities::passive("mouse").coupled(hard, 1.0), hard);
    }

    #[test]
    fn the_guard_knows_the_devices_limits() {
        let weak = Capabilities { peak_force_n: 2.0, delay_ticks: 2, ..Capabilities::passive("weak") };
        assert_eq!(weak.guard_config().max_force_n, 2.0);
        let passivity = weak.guard_config().passivity.unwrap();
        assert_eq!((passivity.delay_ticks, passivity.quantum_mm), (2, 0.0));
        let strong = Capabilities { peak_force_n: 20.0, position_resolution_mm: 0.01, ..weak };
        assert_eq!(strong.guard_config().max_force_n, GuardConfig::default().max_force_n);
        assert_eq!(strong.guard_config().passivity.unwrap().quantum_mm, 0.01);
        let warm = Capabilities { continuous_force_n: 0.9, ..strong };
        assert_eq!(warm.guard_config().continuous_force_n, 0.9);
        assert_eq!(Capabilities::passive("mouse").guard_config().max_force_n, GuardConfig::default().max_force_n);
    }
}
