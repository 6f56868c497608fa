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
    assert!(guard.is_heat_limited() && guard.counters().heated > 50_000 && guard.counters().clamped == 0);
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
