//! The force guard: the last step before a hand, and the only maker of what devices accept.
//!
//! # Theory
//! ```text
//! wanted → finite? → input sound? → ramp-in → damping → clamp |F|, |τ| → slew → energy bound → GuardedWrench
//!                                                          ↑ peak, or less when the motors are warm
//! θ̇ = ((F/Fc)² - θ)/τ      F² ≤ Fc² + (Fp² - Fc²) min((1 - θ)/0.1, 1)
//! ```
//! Whatever comes in, what goes out is finite, no longer than the limit, and no further from the last wrench than the
//! slew limit lets it, but for one case: where a held force would give the hand energy that it never put in, the force falls faster. A force
//! that this holds short for long ramps in anew: a wall is never lost for good. Vectors are shortened, never clipped by axis: the direction of a force is kept.
//!
//! Heat goes with the square of a motor's current, and so of the force: θ = 1 is what the continuous force Fc heats to in the end. The
//! peak Fp is given until θ = 0.9, then the limit falls towards Fc, which it reaches as θ reaches 1, and never passes.
//!
//! # Practice
//! Every event is counted in [`GuardCounters`]. A wanted wrench that is not finite, a pose that is not, a tool faster than the
//! cut-out, a sample that does not age: each is treated as "no force wanted", which the slew limit turns into a fade.
//! After such a fault and at the start the force ramps in over `ramp_in_ms`. [`ForceGuard::release`] fades to zero and
//! stays there until [`ForceGuard::resume`]. Cost: about 0.1 us.
//!
//! The default slew of 0.5 N/ms lies within the thesis's largest measured change (0.4 to 0.6 N a tick), so that force
//! models which behave never feel it; 3.3 N is the peak of the Touch.
//!
//! # When not to use it
//! There is no such case: a device takes nothing else. To watch a model's own force, log the wrench before the guard.

use crate::passivity::{PassivityConfig, PassivityObserver};
use trepan_geometry::{ToolState, Vec3, Wrench};

/// Longest tick that the slew limit grants, ms: a late tick is not caught up with a jump.
const MAX_DT_MS: f32 = 5.0;

/// Share of the heat in which the limit falls from peak to continuous force.
const WARM: f32 = 0.1;

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

/// Limits of the guard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardConfig {
    /// Longest force, N. Set it to the device's peak; 3.3 is the Touch's.
    pub max_force_n: f32,
    /// Force that the motors bear for any time, N; as long as the peak or longer, there is no heat account. The Touch's is 0.88.
    pub continuous_force_n: f32,
    /// Time constant τ of the motors' heat, ms. From cold, the Touch's peak is given for 2 s, 2 N for 6 s.
    pub heat_ms: f32,
    /// Longest torque, N mm. 188 is the limit of the 6-DOF Premium.
    pub max_torque_nmm: f32,
    /// Largest change of force, N per ms.
    pub slew_n_per_ms: f32,
    /// Largest change of torque, N mm per ms.
    pub torque_slew_nmm_per_ms: f32,
    /// Time from no force to full force at the start and after a fault, ms.
    pub ramp_in_ms: f32,
    /// Tip speed over which the force is cut, mm/ms. 1 m/s is out of reach of a hand in contact: a fault or a flight.
    pub max_speed: f32,
    /// Age of the newest sample at which the force fades, ms. A tool whose `time_ms` stays 0 has no clock and is exempt.
    pub stale_ms: f32,
    /// The passivity controller; `None` switches it off.
    pub passivity: Option<PassivityConfig>,
}

impl Default for GuardConfig {
    fn default() -> Self {
        Self {
            max_force_n: 3.3,
            continuous_force_n: f32::INFINITY,
            heat_ms: 30_000.0,
            max_torque_nmm: 188.0,
            slew_n_per_ms: 0.5,
            torque_slew_nmm_per_ms: 20.0,
            ramp_in_ms: 300.0,
            max_speed: 1.0,
            stale_ms: 10.0,
            passivity: Some(PassivityConfig::default()),
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
    /// A force held short by the energy account began anew: its coupling is outside what the controller can hold.
    pub restarted: u64,
    /// The tool was faster than the cut-out, or jumped.
    pub too_fast: u64,
    /// The sample was older than the limit.
    pub stale: u64,
    /// The force was reduced by the ramp-in.
    pub ramped: u64,
}

/// The guard of one hand.
#[derive(Clone, Debug)]
pub struct ForceGuard {
    config: GuardConfig,
    counters: GuardCounters,
    observer: PassivityObserver,
    applied: Wrench,
    heat: f32,
    ramp_ms: f32,
    released: bool,
    last_tip: Option<Vec3>,
    last_time_ms: f64,
    age_ms: f32,
}

impl ForceGuard {
    /// A guard that starts at no force and ramps in. Limits that are negative or not numbers count as zero.
    pub fn new(config: GuardConfig) -> Self {
        // Under a micronewton rounding would pass the limit.
        let sound = |x: f32| if x > 1e-6 { x.min(1e6) } else { 0.0 };
        let config = GuardConfig {
            max_force_n: sound(config.max_force_n),
            continuous_force_n: sound(config.continuous_force_n),
            heat_ms: sound(config.heat_ms),
            max_torque_nmm: sound(config.max_torque_nmm),
            slew_n_per_ms: sound(config.slew_n_per_ms),
            torque_slew_nmm_per_ms: sound(config.torque_slew_nmm_per_ms),
            ramp_in_ms: sound(config.ramp_in_ms),
            max_speed: sound(config.max_speed),
            stale_ms: sound(config.stale_ms),
            passivity: config.passivity,
        };
        Self {
            config,
            counters: GuardCounters::default(),
            observer: PassivityObserver::default(),
            applied: Wrench::ZERO,
            heat: 0.0,
            ramp_ms: 0.0,
            released: false,
            last_tip: None,
            last_time_ms: 0.0,
            age_ms: 0.0,
        }
    }

    /// The wrench that the hand gets in this tick of `dt_ms`, when the scene wants `wanted`.
    pub fn guard(&mut self, wanted: Wrench, tool: &ToolState, dt_ms: f32) -> GuardedWrench {
        let dt_ms = self.tick_length(dt_ms);
        let sound = self.input_is_sound(&wanted, tool, dt_ms);
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

    /// Heat θ of the motors by their forces so far; 1 is what they bear for any time.
    pub fn heat(&self) -> f32 {
        self.heat
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

    /// Checks wrench, pose, speed and age, and counts the first fault.
    fn input_is_sound(&mut self, wanted: &Wrench, tool: &ToolState, dt_ms: f32) -> bool {
        if !wanted.is_finite() || !tool.is_finite() || !tool.time_ms.is_finite() {
            self.counters.non_finite += 1;
            return false;
        }
        self.age_ms = if tool.time_ms == self.last_time_ms { self.age_ms + dt_ms } else { 0.0 };
        self.last_time_ms = tool.time_ms;
        if tool.time_ms != 0.0 && self.age_ms > self.config.stale_ms {
            self.counters.stale += 1;
            return false;
        }
        let moved = self.last_tip.map_or(0.0, |last| last.distance(tool.tip()));
        // A sample that is late by a few ticks shows their motion at once; only a jump is a fault.
        let jumped = moved > self.config.max_speed * (dt_ms + self.config.stale_ms);
        if tool.twist.linear.length() > self.config.max_speed || jumped {
            self.counters.too_fast += 1;
            self.last_tip = None;
            return false;
        }
        true
    }

    /// Books the tick that has passed.
    fn book(&mut self, touching: bool, tool: &ToolState, dt_ms: f32) {
        let tip = tool.tip();
        if !tip.is_finite() || self.last_tip.is_none() {
            self.observer.lose_track();
        }
        self.last_tip = Some(tip).filter(|tip| tip.is_finite());
        if let (Some(tip), Some(config)) = (self.last_tip, &self.config.passivity) {
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
        if let Some(bearable_n) = self.bearable_n(dt_ms) {
            let (cooler, cut) = shortened(force, bearable_n);
            self.counters.heated += u64::from(cut);
            force = cooler;
        }
        Wrench { force, torque }
    }

    /// Books the heat of the force that was given, and says what the motors bear now; `None` where the peak is for any time.
    fn bearable_n(&mut self, dt_ms: f32) -> Option<f32> {
        let (peak, steady) = (self.config.max_force_n, self.config.continuous_force_n);
        if steady >= peak {
            return None;
        }
        let load = if steady > 0.0 { (self.applied.force.length() / steady).powi(2) } else { 1.0 };
        self.heat += (load - self.heat) * (dt_ms / self.config.heat_ms).clamp(0.0, 1.0);
        let spare = ((1.0 - self.heat) / WARM).clamp(0.0, 1.0);
        Some((steady * steady + (peak * peak - steady * steady) * spare).sqrt())
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

/// `v` shortened to `limit` (a hair less, so that rounding keeps it within), and whether it was longer.
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
mod tests {
    use super::*;
    use proptest::prelude::*;
    use trepan_geometry::{Pose, Quat, Twist};

    fn push(newtons: f32) -> Wrench {
        Wrench { force: Vec3::Z * newtons, torque: Vec3::ZERO }
    }

    fn still(time_ms: f64) -> ToolState {
        ToolState { time_ms, ..ToolState::at(Pose::IDENTITY) }
    }

    fn ready(config: GuardConfig) -> ForceGuard {
        ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, ..config })
    }

    #[test]
    fn a_jump_is_slewed_and_a_great_force_is_shortened() {
        let mut guard = ready(GuardConfig::default());
        let forces: Vec<f32> = (1..12).map(|t| guard.guard(push(100.0), &still(t.into()), 1.0).force().z).collect();
        assert!((forces[0] - 0.5).abs() < 1e-5 && (forces[3] - 2.0).abs() < 1e-5, "{forces:?}");
        assert!(forces[10] <= 3.3 && forces[10] > 3.2999, "{forces:?}");
        assert_eq!(guard.counters().clamped, 11);
        assert_eq!(guard.counters().slewed, 6);
    }

    #[test]
    fn a_small_steady_force_passes_unchanged() {
        let mut guard = ready(GuardConfig::default());
        assert_eq!(guard.guard(push(0.3), &still(1.0), 1.0).force(), Vec3::Z * 0.3);
        assert_eq!(guard.counters(), GuardCounters::default());
    }

    #[test]
    fn force_ramps_in_at_the_start_and_after_a_fault() {
        let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 100.0, ..GuardConfig::default() });
        let run = |guard: &mut ForceGuard, from: u32, ticks: u32| {
            (from..from + ticks).map(|t| guard.guard(push(1.0), &still(t.into()), 1.0).force().z).last().unwrap_or(0.0)
        };
        assert!((run(&mut guard, 1, 50) - 0.5).abs() < 1e-5);
        assert_eq!(run(&mut guard, 51, 60), 1.0);
        let mut fast = still(111.0);
        fast.twist.linear = Vec3::X * 1.5;
        assert!((guard.guard(push(1.0), &fast, 1.0).force().z - 0.5).abs() < 1e-5, "fades at the slew limit");
        assert!((run(&mut guard, 112, 50) - 0.5).abs() < 1e-5);
        assert_eq!(guard.counters().too_fast, 1);
    }

    #[test]
    fn release_ends_at_zero_and_resume_ramps_in() {
        let mut guard = ready(GuardConfig::default());
        for t in 1..10 {
            guard.guard(push(3.0), &still(t.into()), 1.0);
        }
        guard.release();
        let forces: Vec<f32> = (10..17).map(|t| guard.guard(push(3.0), &still(t.into()), 1.0).force().z).collect();
        assert!(forces.windows(2).all(|f| f[1] <= f[0]) && forces[6] == 0.0, "{forces:?}");
        assert!(guard.is_at_rest());
        guard.resume();
        assert!(guard.guard(push(3.0), &still(20.0), 1.0).force().z > 0.0);
    }

    #[test]
    fn a_sample_that_does_not_age_fades_the_force() {
        let mut guard = ready(GuardConfig::default());
        let force = (0..40).map(|_| guard.guard(push(1.0), &still(5.0), 1.0).force().z).last();
        assert_eq!((force, guard.counters().stale), (Some(0.0), 29));
        let mut without_clock = ready(GuardConfig::default());
        assert_eq!((0..40).map(|_| without_clock.guard(push(1.0), &still(0.0), 1.0).force().z).last(), Some(1.0));
    }

    /// Forces of a Touch from which 3 N are wanted without end, second by second.
    fn wanted_without_end(seconds: u32) -> (Vec<f32>, ForceGuard) {
        let mut guard = ready(GuardConfig { continuous_force_n: 0.88, ..GuardConfig::default() });
        let mut second = |s: u32| {
            let forces = (1..=1000).map(|t| guard.guard(push(3.0), &still((1000 * s + t).into()), 1.0).force().z);
            forces.last().unwrap_or(0.0)
        };
        ((0..seconds).map(&mut second).collect(), guard)
    }

    #[test]
    fn peak_force_lasts_for_a_time_then_falls_to_the_continuous_one() {
        let (forces, guard) = wanted_without_end(60);
        // From cold, θ = (F/Fc)² (1 - exp(-t/τ)) is 0.9 after 2.4 s.
        assert_eq!(forces[1], 3.0, "two seconds are free");
        assert!(forces.windows(2).all(|f| f[1] <= f[0]) && forces[4] < 2.0, "{forces:?}");
        assert!((forces[59] - 0.88).abs() < 0.01 && guard.heat() <= 1.0, "{} {}", forces[59], guard.heat());
        assert!(guard.counters().heated > 50_000 && guard.counters().clamped == 0);
    }

    #[test]
    fn motors_cool_at_rest_and_bear_the_peak_again() {
        let (_, mut guard) = wanted_without_end(10);
        let mut force = |n: f32, s: u32| {
            (1..=60_000u32).map(|t| guard.guard(push(n), &still((1000 * s + t).into()), 1.0).force().z).last()
        };
        force(0.0, 10);
        assert!((guard.heat() - (-2.0f32).exp()).abs() < 0.01, "{}", guard.heat());
        assert_eq!(guard.guard(push(0.4), &still(80_000.0), 1.0).force().z, 0.4);
    }

    #[test]
    fn a_faded_wrench_is_never_more() {
        let mut guard = ready(GuardConfig::default());
        let whole = guard.guard(push(0.4), &still(1.0), 1.0);
        for (share, force) in [(0.5, 0.2), (1.0, 0.4), (7.0, 0.4), (-1.0, 0.0), (f32::NAN, 0.0)] {
            assert_eq!(whole.faded(share).force().z, force);
        }
    }

    #[test]
    fn a_jump_of_the_tip_is_a_fault_and_is_not_booked_as_work() {
        let mut guard = ready(GuardConfig::default());
        for t in 1..4 {
            guard.guard(push(1.0), &still(t.into()), 1.0);
        }
        let far = ToolState { time_ms: 4.0, ..ToolState::at(Pose::from_translation(Vec3::Z * 100.0)) };
        assert!((guard.guard(push(1.0), &far, 1.0).force().z - 0.5).abs() < 1e-5);
        assert_eq!(guard.counters().too_fast, 1);
        assert_eq!(guard.passivity_observer().energy_nmm(), 0.0);
    }

    #[test]
    fn an_active_wall_is_damped() {
        let mut guard = ready(GuardConfig::default());
        let mut worst = 0.0f32;
        for t in 1..400 {
            // A wall that pushes out harder than it let in, as one with a tick of delay does.
            let phase = t as f32 * 0.3;
            let tip = Vec3::Z * 0.2 * phase.sin();
            let tool = ToolState { time_ms: t.into(), ..ToolState::at(Pose::from_translation(tip)) };
            let out = guard.guard(push(1.0 + 0.5 * (phase - 1.0).cos()), &tool, 1.0);
            worst = worst.max(out.force().length());
        }
        assert!(guard.counters().passivity > 0 && worst <= 3.3);
    }

    /// Any float, and often one of the hard ones.
    fn any_f32() -> impl Strategy<Value = f32> {
        prop_oneof![
            4 => -5.0f32..5.0,
            2 => any::<f32>(),
            1 => prop::sample::select(vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE, 0.0]),
        ]
    }

    fn any_tool() -> impl Strategy<Value = ToolState> {
        prop::collection::vec(any_f32(), 13).prop_map(|x| ToolState {
            world_from_tool: Pose::from_parts(
                Vec3::new(x[0], x[1], x[2]),
                if x[3] > 0.0 { Quat::IDENTITY } else { Quat::from_xyzw(x[4], x[5], x[6], x[3]) },
            ),
            twist: Twist { linear: Vec3::new(x[7], x[8], x[9]) * 0.1, angular: Vec3::new(x[10], x[11], x[12]) },
            time_ms: f64::from(x[3]),
            ..ToolState::at(Pose::IDENTITY)
        })
    }

    proptest! {
        #[test]
        fn whatever_comes_in_what_goes_out_is_within_limits(
            ticks in prop::collection::vec((any_tool(), prop::collection::vec(any_f32(), 7), any::<bool>()), 1..60),
            limits in prop::collection::vec(any_f32(), 8),
        ) {
            let config = GuardConfig {
                max_force_n: limits[0].abs(), max_torque_nmm: limits[1].abs(), slew_n_per_ms: limits[2].abs(),
                torque_slew_nmm_per_ms: limits[3].abs(), ramp_in_ms: limits[4], max_speed: limits[5],
                continuous_force_n: limits[6], heat_ms: limits[7], ..GuardConfig::default()
            };
            let mut guard = ForceGuard::new(config);
            let limit = *guard.config();
            let (mut last, mut bounded) = (Wrench::ZERO, 0);
            for (tool, x, release) in ticks {
                if release { guard.release() } else { guard.resume() }
                let wanted = Wrench { force: Vec3::new(x[0], x[1], x[2]), torque: Vec3::new(x[3], x[4], x[5]) };
                let out = guard.guard(wanted, &tool, x[6]).wrench();
                let dt = if x[6].is_finite() && x[6] > 0.0 { x[6].min(5.0) } else { 1.0 };
                prop_assert!(out.is_finite());
                prop_assert!(out.force.length() <= limit.max_force_n && out.torque.length() <= limit.max_torque_nmm);
                let slack = 1.0 + 1e-5;
                let bound = guard.counters().bounded;
                let step = out.force.distance(last.force);
                prop_assert!(step <= limit.slew_n_per_ms * dt * slack + limit.max_force_n * 1e-6 || bound > bounded);
                bounded = bound;
                prop_assert!(out.torque.distance(last.torque) <= limit.torque_slew_nmm_per_ms * dt * slack + limit.max_torque_nmm * 1e-6);
                last = out;
            }
        }
    }
}
