//! A guarded wrench for device tests.

use trepan_contact::{ForceGuard, GuardConfig, GuardedWrench};
use trepan_geometry::{Pose, ToolState, Vec3, Wrench};

/// Passes a wrench, N and N mm, through a guard that limits neither its growth nor its start.
pub fn guarded(force: Vec3, torque: Vec3) -> GuardedWrench {
    let mut guard = ForceGuard::new(GuardConfig {
        ramp_in_ms: 0.0,
        slew_n_per_ms: 10.0,
        torque_slew_nmm_per_ms: 500.0,
        ..GuardConfig::default()
    });
    guard.guard(Wrench { force, torque }, &ToolState::at(Pose::IDENTITY), 1.0)
}
