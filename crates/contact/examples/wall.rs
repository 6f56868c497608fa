//! A hand presses a virtual wall through the guard: prints force, energy and what the guard had to
//! do.

use trepan_contact::{Contact, ContactManifold, ForceGuard, ForceModel, GuardConfig, Viscoelastic};
use trepan_geometry::{Pose, ToolState, Twist, Vec3};

fn main() {
    let mut model = Viscoelastic::default();
    let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, ..GuardConfig::default() });
    println!("{:>8} {:>9} {:>9} {:>12}", "time ms", "depth mm", "force N", "energy N mm");
    for tick in 0..1000 {
        let phase = tick as f32 * 0.01;
        let (height, velocity) = (0.5 * phase.cos(), -0.005 * phase.sin());
        let tool = ToolState {
            time_ms: f64::from(tick),
            twist: Twist { linear: Vec3::Z * velocity, angular: Vec3::ZERO },
            ..ToolState::at(Pose::from_translation(Vec3::Z * height))
        };
        let mut touch = ContactManifold::default();
        if height < 0.0 {
            touch.set_single(Contact { point: Vec3::ZERO, normal: Vec3::Z, depth_mm: -height });
        }
        let out = guard.guard(model.wrench(&tool, &touch, 1.0), &tool, 1.0);
        if tick % 100 == 0 {
            let energy = guard.passivity_observer().energy_nmm();
            println!("{tick:>8} {:>9.3} {:>9.3} {energy:>12.4}", touch.depth_mm, out.force().length());
        }
    }
    println!("{:?}", guard.counters());
}
