//! The force guard: the last step before a hand, and the only maker of what devices accept.
//!
//! # Theory
//! ```text
//! wanted → finite? → input valid? → ramp-in → damping → clamp |F|, |τ| → slew → energy bound
//!        → GuardedWrench
//!                                               ↑ peak, or less when the motors are warm
//! ```
//! Whatever comes in, what goes out is finite, no longer than the limit, and no further from the
//! last wrench than the slew limit lets it, but for one case: where a held force would give the
//! hand energy that it never put in, the force falls faster. A force that this holds short for long
//! ramps in anew: a wall is never lost for good. Vectors are shortened, never clipped by axis: the
//! direction of a force is kept.
//!
//! # Practice
//! Every event is counted in [`GuardCounters`]. A wanted wrench that is not finite, a pose that is
//! not, a tool faster than the cut-out, a sample that does not age: each is treated as "no force
//! wanted", which the slew limit turns into a fade. After such a fault and at the start the force
//! ramps in over `ramp_in_ms`. [`ForceGuard::release`] fades to zero and stays there until
//! [`ForceGuard::resume`]. Cost: about 0.1 us.
//!
//! The default slew of 0.5 N/ms lies within the thesis's largest measured change (0.4 to 0.6 N a
//! tick), so that force models which behave never feel it; 3.3 N is the peak of the Touch.
//!
//! # When not to use it
//! There is no such case: a device takes nothing else. To watch a model's own force, log the wrench
//! before the guard.

mod config;
mod heat;
mod input;

pub use config::{GuardConfig, GuardCounters};

use crate::passivity::PassivityObserver;
use heat::Heat;
use input::Input;
use trepan_geometry::{ToolState, Vec3, Wrench};

/// Longest tick that the slew limit grants, ms: a late tick is not caught up with a jump.
const MAX_DT_MS: f32 = 5.0;

/// The guard of one hand.
#[derive(Clone, Debug)]
pub struct ForceGuard {
    config: GuardConfig,
    counters: GuardCounters,
    observer: PassivityObserver,
    applied: Wrench,
    heat: Heat,
    /// Whether the last force was shortened to spare the motors.
    heat_limited: bool,
    input: Input,
    ramp_ms: f32,
    released: bool,
}

impl ForceGuard {
    /// A guard that starts at no force and ramps in. Limits that are negative or not numbers count
    /// as zero.
    pub fn new(config: GuardConfig) -> Self {
        Self {
            config: config.sanitized(),
            counters: GuardCounters::default(),
            observer: PassivityObserver::default(),
            applied: Wrench::ZERO,
            heat: Heat::default(),
            heat_limited: false,
            input: Input::default(),
            ramp_ms: 0.0,
            released: false,
        }
    }

    /// The wrench that the hand gets in this tick of `dt_ms`, when the scene wants `wanted`.
    pub fn guard(&mut self, wanted: Wrench, tool: &ToolState, dt_ms: f32) -> GuardedWrench {
        let dt_ms = self.tick_length(dt_ms);
        let sound = self.input.is_sound(&wanted, tool, dt_ms, &self.config, &mut self.counters);
        self.book(sound && !self.released && wanted.force != Vec3::ZERO, tool, dt_ms);
        let mut goal = Wrench::ZERO;
        if !sound {
            self.ramp_ms = 0.0;
        } else if !self.released {
            goal = self.ramped(wanted, dt_ms);
            goal.force = self.damped(goal.force, dt_ms);
        }
        let goal = self.clamped(goal, dt_ms);
        let slewed = self.slewed(goal, dt_ms);
        self.applied = self.bounded(slewed);
        self.restart(goal.force, dt_ms);
        GuardedWrench(self.applied)
    }

    /// Fades the force to zero within the coming ticks and keeps it there.
    pub fn release(&mut self) {
        self.released = true;
    }

    /// Lets force through again after [`release`](Self::release), ramping in from none.
    pub fn resume(&mut self) {
        if self.released {
            self.released = false;
            self.ramp_ms = 0.0;
            self.observer.reset();
        }
    }

    /// Whether the guard is released and has reached no force.
    pub fn is_at_rest(&self) -> bool {
        self.released && self.applied == Wrench::ZERO
    }

    /// What the guard had to do so far.
    pub fn counters(&self) -> GuardCounters {
        self.counters
    }

    /// The energy account.
    pub fn passivity_observer(&self) -> &PassivityObserver {
        &self.observer
    }

    /// Whether the last wrench's force was shortened to spare the motors.
    pub fn is_heat_limited(&self) -> bool {
        self.heat_limited
    }

    /// Heat θ of the motors by their forces so far; 1 is what they bear for any time.
    pub fn heat(&self) -> f32 {
        self.heat.0
    }

    /// The limits in force.
    pub fn config(&self) -> &GuardConfig {
        &self.config
    }

    fn tick_length(&mut self, dt_ms: f32) -> f32 {
        if dt_ms.is_finite() && dt_ms > 0.0 {
            return dt_ms.min(MAX_DT_MS);
        }
        self.counters.non_finite += 1;
        1.0
    }

    /// Books the tick that has passed.
    fn book(&mut self, touching: bool, tool: &ToolState, dt_ms: f32) {
        let tip = tool.tip();
        if !tip.is_finite() || self.input.tip.is_none() {
            self.observer.lose_track();
        }
        self.input.tip = Some(tip).filter(|tip| tip.is_finite());
        if let (Some(tip), Some(config)) = (self.input.tip, &self.config.passivity) {
            self.observer.book(tip, touching, dt_ms, config);
        }
    }

    /// The force with the damping that the controller asks for.
    fn damped(&mut self, force: Vec3, dt_ms: f32) -> Vec3 {
        let Some(config) = &self.config.passivity else { return force };
        let damped = self.observer.damped(force, dt_ms, config);
        self.counters.passivity += u64::from(damped != force);
        damped
    }

    /// Ramps the force in anew where it has been held short for long.
    fn restart(&mut self, goal: Vec3, dt_ms: f32) {
        let Some(config) = &self.config.passivity else { return };
        if self.observer.restarts(goal, self.applied.force, dt_ms, config) {
            self.ramp_ms = 0.0;
            self.counters.restarted += 1;
        }
    }

    fn ramped(&mut self, wanted: Wrench, dt_ms: f32) -> Wrench {
        if self.ramp_ms >= self.config.ramp_in_ms {
            return wanted;
        }
        self.ramp_ms += dt_ms;
        let share = (self.ramp_ms / self.config.ramp_in_ms).min(1.0);
        self.counters.ramped += u64::from(share < 1.0 && wanted != Wrench::ZERO);
        Wrench { force: wanted.force * share, torque: wanted.torque * share }
    }

    fn clamped(&mut self, goal: Wrench, dt_ms: f32) -> Wrench {
        let (mut force, cut_force) = shortened(goal.force, self.config.max_force_n);
        let (torque, cut_torque) = shortened(goal.torque, self.config.max_torque_nmm);
        self.counters.clamped += u64::from(cut_force || cut_torque);
        self.heat_limited = false;
        if let Some(bearable_n) = self.heat.bearable_n(self.applied.force.length(), dt_ms, &self.config) {
            (force, self.heat_limited) = shortened(force, bearable_n);
            self.counters.heated += u64::from(self.heat_limited);
        }
        Wrench { force, torque }
    }

    fn slewed(&mut self, goal: Wrench, dt_ms: f32) -> Wrench {
        let last = self.applied;
        let (force, cut_force) = shortened(goal.force - last.force, self.config.slew_n_per_ms * dt_ms);
        let (torque, cut_torque) = shortened(goal.torque - last.torque, self.config.torque_slew_nmm_per_ms * dt_ms);
        self.counters.slewed += u64::from(cut_force || cut_torque);
        Wrench {
            force: if cut_force { shortened(last.force + force, self.config.max_force_n).0 } else { goal.force },
            torque: if cut_torque {
                shortened(last.torque + torque, self.config.max_torque_nmm).0
            } else {
                goal.torque
            },
        }
    }

    /// Shortens the force to what the energy account can pay for.
    fn bounded(&mut self, wrench: Wrench) -> Wrench {
        let Some(config) = &self.config.passivity else { return wrench };
        let share = self.observer.affordable(wrench.force, config);
        self.counters.bounded += u64::from(share < 1.0);
        let force = wrench.force * share;
        self.observer.send(force);
        Wrench { force, torque: wrench.torque }
    }
}

/// A wrench that a device may apply. Only [`ForceGuard`] makes one that is not zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GuardedWrench(Wrench);

impl GuardedWrench {
    /// No force, no torque.
    pub const ZERO: Self = Self(Wrench::ZERO);

    /// Force, N, world axes.
    pub fn force(&self) -> Vec3 {
        self.0.force
    }

    /// Torque, N mm, world axes, at the tool's tip.
    pub fn torque(&self) -> Vec3 {
        self.0.torque
    }

    /// Both.
    pub fn wrench(&self) -> Wrench {
        self.0
    }

    /// Less of it: `share` is taken as 0 to 1, and as 0 if it is not a number.
    pub fn faded(&self, share: f32) -> Self {
        let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
        Self(Wrench { force: self.0.force * share, torque: self.0.torque * share })
    }
}

/// `v` shortened to `limit` (a hair less, so that rounding keeps it within), and whether it was
/// longer.
fn shortened(v: Vec3, limit: f32) -> (Vec3, bool) {
    let largest = v.abs().max_element();
    if largest == 0.0 || v.length() <= limit {
        return (v, false);
    }
    // Scaled by its largest part first: the square of a huge force would overflow.
    let direction = (v / largest).normalize_or_zero();
    (direction * (limit * (1.0 - 4.0 * f32::EPSILON)), true)
}

#[cfg(test)]
mod tests;
