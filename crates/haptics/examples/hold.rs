//! Finds the wall stiffness at which a simulated Touch in a light hand becomes unstable, for delays
//! of 0 to 3 ticks.
//!
//! `cargo run -p trepan-haptics --example hold`

use trepan_contact::{ForceGuard, GuardConfig};
use trepan_geometry::{Pose, ToolState, Vec3, Wrench};
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::{Config, HandModel, Simulated};

fn main() {
    println!("without a passivity controller, a wall pressed with 1 N: peak-to-peak motion in the third second, mm");
    println!("{:>7} | {:>8} {:>8} {:>8} {:>8}", "K N/mm", "0 ticks", "1 tick", "2 ticks", "3 ticks");
    for stiffness in [0.3, 0.8, 1.2, 2.0, 3.0] {
        let motion = [0, 1, 2, 3].map(|delay_ticks| peak_to_peak(stiffness, delay_ticks));
        print!("{stiffness:>7} |");
        motion.iter().for_each(|m| print!(" {m:>8.3}"));
        println!();
    }
}

/// Peak-to-peak motion, mm; the hand's intent lies so far inside the wall (x < 0) that it presses
/// with 1 N.
fn peak_to_peak(stiffness: f32, delay_ticks: usize) -> f32 {
    let hand = HandModel::LIGHT;
    let inside = Pose::from_translation(Vec3::X * -(1.0 / hand.stiffness + 1.0 / stiffness));
    let config = Config { friction_n: 0.0, velocity_filter_ms: 0.0, delay_ticks, ..Config::default() };
    let outside = (0..100).map(|_| ToolState::at(Pose::from_translation(Vec3::X * 2.0)));
    let states = outside.chain([ToolState::at(inside)]).collect();
    let mut device = Simulated::new(config, hand, Box::new(Replay::new(states)));
    let limits =
        GuardConfig { slew_n_per_ms: 10.0, ramp_in_ms: 0.0, passivity: None, ..device.capabilities().guard_config() };
    let mut guard = ForceGuard::new(limits);
    let (mut least, mut most) = (f32::MAX, f32::MIN);
    for tick in 0..3000 {
        let tool = device.read(f64::from(tick)).tool;
        let force = Vec3::X * (-tool.tip().x * stiffness).max(0.0);
        device.apply(guard.guard(Wrench { force, torque: Vec3::ZERO }, &tool, 1.0));
        if tick >= 2000 {
            least = least.min(device.position().x);
            most = most.max(device.position().x);
        }
    }
    device.close();
    most - least
}
