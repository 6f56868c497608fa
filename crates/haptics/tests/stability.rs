//! Tests that the simulated device becomes unstable where theory predicts.

use trepan_contact::{ForceGuard, GuardConfig};
use trepan_geometry::{Pose, ToolState, Vec3, Wrench};
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::{Config, HandModel, Simulated};

const TICK_MS: f32 = 1.0;

/// A guard without limits.
fn open_guard() -> ForceGuard {
    ForceGuard::new(GuardConfig {
        max_force_n: 1e6,
        slew_n_per_ms: 1e6,
        ramp_in_ms: 0.0,
        max_speed: 1e6,
        stale_ms: 1e6,
        passivity: None,
        ..GuardConfig::default()
    })
}

/// Mean amplitude in the last fifth over that in the first, with a spring and damper at the origin.
fn growth(config: Config, hand: HandModel, stiffness: f32, damping: f32) -> f32 {
    let still = Replay::new(vec![ToolState::at(Pose::IDENTITY)]);
    let mut device = Simulated::new(config, hand, Box::new(still));
    let mut guard = open_guard();
    device.read(0.0);
    device.push(Vec3::X * 0.01);
    let (mut first, mut last) = (0.0f32, 0.0f32);
    const TICKS: u32 = 3000;
    for tick in 1..=TICKS {
        let tool = device.read(f64::from(tick) * f64::from(TICK_MS)).tool;
        let force = -stiffness * tool.tip() - damping * tool.twist.linear;
        device.apply(guard.guard(Wrench { force, torque: Vec3::ZERO }, &tool, TICK_MS));
        if tick <= TICKS / 5 {
            first += device.position().length();
        } else if tick > TICKS * 4 / 5 {
            last += device.position().length();
        }
        if device.position().length().partial_cmp(&1e6) != Some(std::cmp::Ordering::Less) {
            return f32::INFINITY;
        }
    }
    last / first
}

/// Largest stiffness at which motion decays, N/mm.
fn stable_stiffness(config: Config, hand: HandModel, damping: f32) -> f32 {
    let (mut stable, mut unstable) = (0.001f32, 50.0f32);
    while unstable / stable > 1.01 {
        let middle = (stable * unstable).sqrt();
        if growth(config, hand, middle, damping) < 1.0 { stable = middle } else { unstable = middle }
    }
    stable
}

fn bare(delay_ticks: usize) -> Config {
    Config {
        friction_n: 0.0,
        quantum_mm: 0.0,
        velocity_filter_ms: 0.0,
        peak_force_n: 1e6,
        delay_ticks,
        ..Config::default()
    }
}

#[test]
fn without_a_hand_the_stability_boundary_is_gils() {
    // K < (b + B) / (T/2 + d), N/mm; at B = 1 the mass begins to limit it.
    for (delay_ticks, damping, tolerance) in
        [(0, 0.0, 0.05), (1, 0.0, 0.05), (2, 0.0, 0.05), (0, 1.0, 0.1), (2, 0.5, 0.1)]
    {
        let config = bare(delay_ticks);
        let expected = (config.damping + damping) / (TICK_MS / 2.0 + delay_ticks as f32 * TICK_MS);
        let found = stable_stiffness(config, HandModel::FREE, damping);
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{delay_ticks} ticks, B = {damping}: {found}, theory {expected}"
        );
    }
}

#[test]
fn a_hand_and_less_delay_extend_the_stability_boundary() {
    let light = [0, 1, 2].map(|delay_ticks| stable_stiffness(bare(delay_ticks), HandModel::LIGHT, 0.0));
    assert!(light[0] > light[1] && light[1] > light[2], "{light:?}");
    assert!(light[2] > 5.0 * stable_stiffness(bare(2), HandModel::FREE, 0.0), "{light:?}");
}

#[test]
fn friction_stabilises_an_unstable_loop() {
    let rubbing = Config { friction_n: 0.26, ..bare(1) };
    assert!(growth(bare(1), HandModel::FREE, 0.2, 0.0) > 100.0);
    // Friction stops the motion: it neither grows nor continues.
    assert!(growth(rubbing, HandModel::FREE, 0.2, 0.0) < 1.1);
}

#[test]
fn the_hand_yields_by_its_spring_stiffness() {
    let still = Replay::new(vec![ToolState::at(Pose::IDENTITY)]);
    let mut device = Simulated::new(Config { friction_n: 0.0, ..Config::default() }, HandModel::LIGHT, Box::new(still));
    let mut guard = ForceGuard::new(GuardConfig { passivity: None, ..GuardConfig::default() });
    let mut tool = device.read(0.0).tool;
    for tick in 1..2000 {
        device.apply(guard.guard(Wrench { force: Vec3::Y * 0.6, torque: Vec3::ZERO }, &tool, TICK_MS));
        tool = device.read(f64::from(tick)).tool;
    }
    assert!((device.position() - Vec3::Y * 0.6 / HandModel::LIGHT.stiffness).length() < 0.02, "{}", device.position());
    assert!((tool.tip() - device.position()).length() <= Config::default().quantum_mm);
}

#[test]
fn readings_are_rounded_to_encoder_steps() {
    let quantum_mm = 0.055;
    let moving =
        Replay::new((0..100).map(|i| ToolState::at(Pose::from_translation(Vec3::X * i as f32 * 0.1))).collect());
    let mut device = Simulated::new(Config { quantum_mm, ..Config::default() }, HandModel::FIRM, Box::new(moving));
    let positions: Vec<f32> = (0..100).map(|tick| device.read(f64::from(tick)).tool.tip().x / quantum_mm).collect();
    assert!(positions.iter().all(|x| (x - x.round()).abs() < 1e-3));
    assert!(*positions.last().unwrap() > 100.0);
}
