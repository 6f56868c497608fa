//! Tests the guard on the simulated device: a stable wall keeps its force, an unstable one is
//! damped, a lost one recovers.

use trepan_contact::{ForceGuard, GuardConfig, GuardCounters, PassivityConfig};
use trepan_geometry::{Pose, ToolState, Vec3, Wrench};
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::{Config, HandModel, Simulated};

const HANDS: [(&str, HandModel); 2] = [("light", HandModel::LIGHT), ("firm", HandModel::FIRM)];

/// A Touch without friction.
const SLIPPERY: Config = Config { friction_n: 0.0, ..TOUCH };
const TOUCH: Config = Config::TOUCH;

/// A hand that presses a wall with about 1 N for three seconds, and measurements of the last
/// second.
#[derive(Debug)]
struct Press {
    motion_mm: f32,
    /// Share of the requested force that was removed.
    lost: f32,
    counters: GuardCounters,
}

fn press(config: Config, hand: HandModel, stiffness: f32, passivity: Option<PassivityConfig>) -> Press {
    let inside = Pose::from_translation(Vec3::X * -(1.0 / hand.stiffness + 1.0 / stiffness));
    let outside = (0..100).map(|_| ToolState::at(Pose::from_translation(Vec3::X * 2.0)));
    let intent = Replay::new(outside.chain([ToolState::at(inside)]).collect());
    let mut device = Simulated::new(config, hand, Box::new(intent));
    let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, passivity, ..GuardConfig::default() });
    let (mut lowest, mut highest, mut wanted_n, mut given_n) = (f32::MAX, f32::MIN, 0.0, 0.0);
    for tick in 0..3000 {
        let tool = device.read(f64::from(tick)).tool;
        let force = Vec3::X * (-tool.tip().x * stiffness).max(0.0);
        let given = guard.guard(Wrench { force, torque: Vec3::ZERO }, &tool, 1.0);
        device.apply(given);
        if tick >= 2000 {
            lowest = lowest.min(device.position().x);
            highest = highest.max(device.position().x);
            wanted_n += force.x;
            given_n += given.force().x;
        }
    }
    Press { motion_mm: highest - lowest, lost: 1.0 - given_n / wanted_n, counters: guard.counters() }
}

#[test]
fn a_steady_press_keeps_its_force() {
    for (name, config) in [("slippery", SLIPPERY), ("Touch", TOUCH)] {
        for (grip, hand) in HANDS {
            for stiffness in [0.3, 0.8, 2.0] {
                for delay_ticks in [0, 1] {
                    let passivity = PassivityConfig { delay_ticks, ..PassivityConfig::default() };
                    let found = press(config, hand, stiffness, Some(passivity));
                    let row = format!("{name}, {grip} grip, {stiffness} N/mm, booked {delay_ticks}: {found:?}");
                    assert!(found.lost.abs() < 0.05 && found.counters.restarted == 0, "{row}");
                    assert!(found.motion_mm < 0.1, "{row}");
                }
            }
        }
    }
}

#[test]
fn an_unstable_wall_is_damped() {
    for (grip, hand, delay_ticks, stiffness) in [("light", HandModel::LIGHT, 1, 2.0), ("firm", HandModel::FIRM, 2, 2.0)]
    {
        let config = Config { quantum_mm: 0.0, delay_ticks, ..SLIPPERY };
        let passivity =
            PassivityConfig { delay_ticks: delay_ticks as u8, quantum_mm: 0.0, ..PassivityConfig::default() };
        let without = press(config, hand, stiffness, None);
        let with = press(config, hand, stiffness, Some(passivity));
        assert!(without.motion_mm > 0.4, "{grip}: {without:?}");
        assert!(with.motion_mm < 0.05 && with.lost.abs() < 0.05, "{grip}: {with:?}");
    }
}

/// For a second the scene feeds energy into the hand; then a wall of 0.8 N/mm pushes it out.
#[test]
fn a_wall_that_lost_its_force_gets_it_back() {
    let exact = Config { quantum_mm: 0.0, ..SLIPPERY };
    for (name, config) in [("exact", exact), ("slippery", SLIPPERY), ("Touch", TOUCH)] {
        for (grip, hand) in HANDS {
            let intent = ToolState::at(Pose::from_translation(Vec3::X * -(1.0 / hand.stiffness + 1.0 / 0.8)));
            let mut device = Simulated::new(config, hand, Box::new(Replay::new(vec![intent])));
            let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, ..device.capabilities().guard_config() });
            let (mut least, mut back_ms) = (f32::MAX, 0);
            for tick in 0..8000u32 {
                let tool = device.read(f64::from(tick)).tool;
                let wall_n = (-tool.tip().x * 0.8).max(0.0);
                let wanted_n = if tick < 1000 { 3.0 * f32::from(tick % 30 < 15) } else { wall_n };
                let wrench = Wrench { force: Vec3::X * wanted_n, torque: Vec3::ZERO };
                let given = guard.guard(wrench, &tool, 1.0);
                device.apply(given);
                let share = given.force().x / wall_n.min(3.3);
                least = if tick >= 1000 { least.min(share) } else { f32::MAX };
                back_ms = if tick >= 1000 && share < 0.95 { tick - 1000 } else { back_ms };
            }
            let row = format!("{name}, {grip} grip: least {least}, back after {back_ms} ms, {:?}", guard.counters());
            println!("{row}");
            assert!(least < 0.1, "the wall must have been lost: {row}");
            assert!(back_ms < 2000, "{row}");
        }
    }
}
