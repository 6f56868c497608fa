//! A simulated device held by a simulated hand: mass, friction, encoder steps and delay, driven by
//! the applied force.
//!
//! # Theory
//! ```text
//!   intent u ──[k_h, b_h]── x: mass m ──[b, f_c]── ground
//!
//!   m ẍ = F(t - d) + k_h(u - x) + b_h(u̇ - ẋ) - b ẋ - f_c ẋ/|ẋ|
//! ```
//! The hand is a spring and a damper between its intended position and the device's handle. The
//! handle has the device's apparent mass, viscous and Coulomb friction. The force is applied d
//! ticks late, and readings are rounded to encoder steps. These terms decide whether a haptic loop
//! is stable: without a hand, `K < (b + B)/(T/2 + d)` (Gil and others 2004); a passive wall needs
//! `b > K T/2 + B` (Colgate and Schenkel 1997).
//!
//! # Practice
//! Integrated by symplectic Euler in steps of at most 20 µs; Coulomb friction is a cap on the
//! momentum it may remove. Torque has no effect: rotation follows the intent. Deterministic: equal
//! calls give bit-identical results.
//!
//! # Sources
//! Gil et al. 2004, "Stability analysis of a 1 DOF haptic interface"; Colgate and Schenkel 1997, J.
//! Robotic Systems 14; preset numbers: maker's data sheet of the Touch, b assumed; hands within the
//! spans of Hajian and Howe 1997.
//!
//! # When not to use it
//! To measure a real device.

use crate::script;
use crate::scripted::operation_name;
use crate::{Capabilities, Descriptor, HapticDevice, Listed, Motion, OpenedDevice, Reading};
use trepan_contact::GuardedWrench;
use trepan_geometry::{ToolState, Vec3, Wrench};
use trepan_measurements::{devices, grip};

/// `simulated:NAME`: a Touch in a firm hand that follows a scripted operation.
pub static DEVICE: Descriptor = Descriptor {
    name: "simulated",
    usage: ":NAME",
    source: "Gil et al. 2004; Colgate and Schenkel 1997",
    motion: Motion::Script,
    argument: operation_name,
    id: |name| name,
    probe: || Ok(script::NAMES.map(|name| Listed::new(format!("simulated:{name}"), "ready")).into()),
    open: |operation, setting| {
        let intent = Box::new((setting.script)(operation)?);
        Ok(OpenedDevice::new(Simulated::new(Config::default(), HandModel::FIRM, intent)))
    },
};

/// Longest integration step, ms.
const STEP_MS: f64 = 0.02;
/// Longest time between two reads that is integrated, ms; the rest counts as a pause.
const MAX_DT_MS: f64 = 100.0;
/// Largest delay of a force, ticks.
pub const MAX_DELAY_TICKS: usize = 16;

/// The device's mechanics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Apparent mass at the tip, g.
    pub mass_g: f32,
    /// Viscous friction b, N ms/mm (= N·s/m).
    pub damping: f32,
    /// Coulomb friction f_c, N.
    pub friction_n: f32,
    /// Encoder step Δ, mm; 0 for none.
    pub quantum_mm: f32,
    /// Delay of a force in reads; at most [`MAX_DELAY_TICKS`].
    pub delay_ticks: usize,
    /// Largest motor force, N; larger forces are scaled down.
    pub peak_force_n: f32,
    /// Time constant of the velocity's low-pass filter, ms; 0 for the raw position difference.
    pub velocity_filter_ms: f32,
    /// Highest read rate, Hz.
    pub rate_hz: f32,
}

impl Config {
    /// A Touch, on a link that supports 4 kHz.
    pub const TOUCH: Self = Self {
        mass_g: devices::TOUCH_MASS.f32(),
        damping: devices::TOUCH_DAMPING.f32(),
        friction_n: devices::TOUCH_FRICTION.f32(),
        quantum_mm: 0.055,
        delay_ticks: 1,
        peak_force_n: devices::TOUCH_PEAK_FORCE.f32(),
        velocity_filter_ms: 5.0,
        rate_hz: 4000.0, // numerical
    };
}

impl Default for Config {
    fn default() -> Self {
        Self::TOUCH
    }
}

/// The hand that holds the device: a spring-damper model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandModel {
    /// Mass that moves with the device, g.
    pub mass_g: f32,
    /// Damping b_h between intent and handle, N ms/mm.
    pub damping: f32,
    /// Spring k_h between intent and handle, N/mm.
    pub stiffness: f32,
}

impl HandModel {
    /// No hand: the device moves freely.
    pub const FREE: Self = Self { mass_g: 0.0, damping: 0.0, stiffness: 0.0 };
    /// A light grip.
    pub const LIGHT: Self = Self {
        mass_g: grip::LIGHT_GRIP_MASS.f32(),
        damping: grip::LIGHT_GRIP_DAMPING.f32(),
        stiffness: grip::LIGHT_GRIP_STIFFNESS.f32(),
    };
    /// A firm grip.
    pub const FIRM: Self = Self {
        mass_g: grip::FIRM_GRIP_MASS.f32(),
        damping: grip::FIRM_GRIP_DAMPING.f32(),
        stiffness: grip::FIRM_GRIP_STIFFNESS.f32(),
    };
}

/// Force that a simulated device holds, as a share of its largest: that of a Touch.
const CONTINUOUS_SHARE: f32 = devices::TOUCH_CONTINUOUS_FORCE.f32() / devices::TOUCH_PEAK_FORCE.f32();

/// A simulated device whose hand follows the pose of another device.
pub struct Simulated {
    config: Config,
    hand: HandModel,
    intent: Box<dyn HapticDevice>,
    position: Vec3,
    velocity: Vec3,
    last: Option<Sample>,
    commanded: [Wrench; MAX_DELAY_TICKS + 1],
    closed: bool,
}

/// The state at the last read.
#[derive(Clone, Copy)]
struct Sample {
    time_ms: f64,
    intent: Vec3,
    sensed: Vec3,
    velocity: Vec3,
}

impl Simulated {
    /// Creates a device in a hand that follows `intent`, usually a [`crate::script::Script`].
    pub fn new(config: Config, hand: HandModel, intent: Box<dyn HapticDevice>) -> Self {
        Self {
            config: Config { delay_ticks: config.delay_ticks.min(MAX_DELAY_TICKS), ..config },
            hand,
            intent,
            position: Vec3::ZERO,
            velocity: Vec3::ZERO,
            last: None,
            commanded: [Wrench::ZERO; MAX_DELAY_TICKS + 1],
            closed: false,
        }
    }

    /// True position of the handle, mm; [`HapticDevice::read`] returns it rounded to encoder steps.
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// True velocity of the handle, mm/ms.
    pub fn velocity(&self) -> Vec3 {
        self.velocity
    }

    /// Adds a velocity to the handle, mm/ms: a disturbance for stability tests.
    pub fn push(&mut self, velocity: Vec3) {
        self.velocity += velocity;
    }

    /// The present motor force, N.
    pub fn motor_force(&self) -> Vec3 {
        self.commanded[self.config.delay_ticks].force.clamp_length_max(self.config.peak_force_n)
    }

    /// Advances the handle while the intent moves from `from` to `to`.
    fn advance(&mut self, from: Vec3, to: Vec3, dt_ms: f64) {
        let steps = (dt_ms / STEP_MS).ceil().max(1.0);
        let h = (dt_ms / steps) as f32;
        let intent_velocity = (to - from) / dt_ms as f32;
        let mass = (self.config.mass_g + self.hand.mass_g).max(1e-3);
        let motor = self.motor_force();
        for step in 1..=steps as u32 {
            let intent = from.lerp(to, step as f32 / steps as f32);
            let hand =
                (intent - self.position) * self.hand.stiffness + (intent_velocity - self.velocity) * self.hand.damping;
            let driven = self.velocity + (motor + hand - self.velocity * self.config.damping) * (h / mass);
            let braked = (driven.length() - self.config.friction_n * h / mass).max(0.0);
            self.velocity = driven.normalize_or_zero() * braked;
            self.position += self.velocity * h;
        }
    }

    /// The tool as the encoders measure it.
    fn sense(&mut self, intent: &ToolState, time_ms: f64) -> ToolState {
        let q = self.config.quantum_mm;
        let sensed = if q > 0.0 { (self.position / q).round() * q } else { self.position };
        let velocity = match self.last {
            Some(last) if time_ms > last.time_ms => {
                let dt_ms = (time_ms - last.time_ms) as f32;
                let keep = self.config.velocity_filter_ms / (self.config.velocity_filter_ms + dt_ms);
                last.velocity * keep + (sensed - last.sensed) / dt_ms * (1.0 - keep)
            }
            Some(last) => last.velocity,
            None => Vec3::ZERO,
        };
        self.last = Some(Sample { time_ms, intent: intent.tip(), sensed, velocity });
        let mut tool = ToolState { time_ms, ..*intent };
        tool.world_from_tool.translation = sensed;
        tool.twist.linear = velocity;
        tool
    }
}

impl HapticDevice for Simulated {
    fn read(&mut self, time_ms: f64) -> Reading {
        let Reading { tool: intent, status } = self.intent.read(time_ms);
        match self.last {
            None => self.position = intent.tip(),
            Some(last) if time_ms > last.time_ms => {
                self.advance(last.intent, intent.tip(), (time_ms - last.time_ms).min(MAX_DT_MS));
            }
            Some(_) => {}
        }
        Reading { tool: self.sense(&intent, time_ms), status }
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        self.commanded.copy_within(..MAX_DELAY_TICKS, 1);
        self.commanded[0] = if self.closed { Wrench::ZERO } else { wrench.wrench() };
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            name: format!("simulated, {:.0} g, delay of {} ticks", self.config.mass_g, self.config.delay_ticks),
            peak_force_n: self.config.peak_force_n,
            continuous_force_n: CONTINUOUS_SHARE * self.config.peak_force_n,
            rate_hz: self.config.rate_hz,
            workspace_mm: Vec3::new(160.0, 120.0, 70.0),
            axes_driven: 3,
            position_resolution_mm: self.config.quantum_mm,
            delay_ticks: self.config.delay_ticks as u8,
            moving_mass_g: self.config.mass_g,
            damping: self.config.damping,
        }
    }

    fn close(&mut self) {
        self.commanded = [Wrench::ZERO; MAX_DELAY_TICKS + 1];
        self.closed = true;
        self.intent.close();
    }
}
