//! The window's pointer as a device: poses arrive at frame rate and are smoothed to the haptic
//! rate.
//!
//! # Theory
//! Each axis follows the pointer's pose through a critically damped second-order filter,
//! `ẍ = ω²(u - x) - 2ω ẋ`, solved exactly over each tick. The pose u is constant between window
//! events. With e = x - u and `c = ẋ + ω e`, `e(t) = (e + c t) exp(-ω t)`,
//! `ẋ(t) = (ẋ - ω c t) exp(-ω t)`. It cannot oscillate or overshoot a step, for any tick length.
//! Its velocity is continuous, as force models require. Rotation follows first-order, `exp(-ω t)`,
//! along the shortest arc.
//!
//! # Practice
//! The default ω = 0.08 / ms lags by 25 ms: two frames. Handle and device exchange values through
//! triple buffers: neither side ever waits.
//!
//! # When not to use it
//! To judge forces: the pointer does not render them. [`MouseHandle::wrench`] is for display.

use crate::{Capabilities, HapticDevice, Reading, Status};
use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, Pose, Quat, ToolState, Twist, Vec3, Wrench};
use triple_buffer::{Input, Output, triple_buffer};

/// Natural frequency of the smoothing, 1/ms.
const OMEGA_PER_MS: f64 = 0.08;
/// Longest tick that the smoothing follows, ms.
const MAX_DT_MS: f64 = 100.0;

/// The window's end of the pair.
pub struct MouseHandle {
    wanted: Input<(Pose, Buttons)>,
    felt: Output<Wrench>,
}

/// The haptic loop's end of the pair.
pub struct Mouse {
    wanted: Output<(Pose, Buttons)>,
    felt: Input<Wrench>,
    pose: Pose,
    velocity: Vec3,
    last_ms: Option<f64>,
    closed: bool,
}

/// Creates a handle for the window and the device that follows it, both at `start`.
pub fn pair(start: Pose) -> (MouseHandle, Mouse) {
    let (wanted_in, wanted_out) = triple_buffer(&(start, Buttons::default()));
    let (felt_in, felt_out) = triple_buffer(&Wrench::ZERO);
    let mouse =
        Mouse { wanted: wanted_out, felt: felt_in, pose: start, velocity: Vec3::ZERO, last_ms: None, closed: false };
    (MouseHandle { wanted: wanted_in, felt: felt_out }, mouse)
}

impl MouseHandle {
    /// Sets the target pose `world_from_tool` and the pressed buttons; ignores a non-finite pose.
    pub fn set(&mut self, pose: Pose, buttons: Buttons) {
        if pose.translation.is_finite() && pose.rotation.is_finite() {
            self.wanted.write((pose, buttons));
        }
    }

    /// Returns the wrench last applied.
    pub fn wrench(&mut self) -> Wrench {
        *self.felt.read()
    }
}

impl Mouse {
    fn advance(&mut self, target: Pose, dt_ms: f64) -> Vec3 {
        let decay = (-OMEGA_PER_MS * dt_ms).exp() as f32;
        let (omega, dt) = (OMEGA_PER_MS as f32, dt_ms as f32);
        let error = self.pose.translation - target.translation;
        let c = self.velocity + error * omega;
        self.pose.translation = target.translation + (error + c * dt) * decay;
        self.velocity = (self.velocity - c * (omega * dt)) * decay;

        let before = self.pose.rotation;
        let after = before.slerp(target.rotation, 1.0 - decay).normalize();
        self.pose.rotation = after;
        if dt > 0.0 { rotation_vector(after * before.inverse()) / dt } else { Vec3::ZERO }
    }
}

/// Rotation vector (axis times angle, rad) of the shorter rotation.
pub(crate) fn rotation_vector(q: Quat) -> Vec3 {
    let q = if q.w < 0.0 { -q } else { q };
    q.to_scaled_axis()
}

impl HapticDevice for Mouse {
    fn read(&mut self, time_ms: f64) -> Reading {
        let dt_ms = (time_ms - self.last_ms.unwrap_or(time_ms)).clamp(0.0, MAX_DT_MS);
        self.last_ms = Some(time_ms);
        let (target, buttons) = *self.wanted.read();
        let angular = self.advance(target, dt_ms);
        let twist = Twist { linear: self.velocity, angular };
        let tool = ToolState { world_from_tool: self.pose, twist, buttons, time_ms };
        Reading { tool, status: Status::Fresh }
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        if !self.closed {
            self.felt.write(wrench.wrench());
        }
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { position_resolution_mm: 0.1, ..Capabilities::passive("mouse") }
    }

    fn close(&mut self) {
        self.felt.write(Wrench::ZERO);
        self.closed = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn it_reaches_the_pointer_without_overshoot() {
        let (mut handle, mut mouse) = pair(Pose::IDENTITY);
        let target = Pose::from_parts(Vec3::new(10.0, 0.0, 0.0), Quat::from_rotation_y(1.0));
        handle.set(target, Buttons::PEDAL);
        let mut last = 0.0;
        for tick in 0..400 {
            let tool = mouse.read(f64::from(tick)).tool;
            assert!(tool.tip().x >= last - 1e-5 && tool.tip().x <= 10.0 + 1e-4);
            last = tool.tip().x;
        }
        let tool = mouse.read(400.0).tool;
        assert!((tool.tip() - target.translation).length() < 1e-3 && tool.buttons.has(Buttons::PEDAL));
        assert!(tool.world_from_tool.rotation.angle_between(target.rotation) < 1e-2);
    }

    #[test]
    fn a_nan_pose_is_ignored_and_close_leaves_no_force() {
        let (mut handle, mut mouse) = pair(Pose::from_translation(Vec3::ONE));
        handle.set(Pose::from_translation(Vec3::NAN), Buttons::PEDAL);
        assert_eq!(mouse.read(0.0).tool.tip(), Vec3::ONE);
        mouse.apply(GuardedWrench::ZERO);
        mouse.close();
        assert_eq!(handle.wrench(), Wrench::ZERO);
    }

    proptest! {
        #[test]
        fn ticks_of_any_length_end_at_the_same_place(steps in prop::collection::vec(0.1f64..40.0, 1..40)) {
            let (mut many_handle, mut many) = pair(Pose::IDENTITY);
            let (mut one_handle, mut one) = pair(Pose::IDENTITY);
            let target = Pose::from_translation(Vec3::new(5.0, -3.0, 1.0));
            many_handle.set(target, Buttons::default());
            one_handle.set(target, Buttons::default());
            let total: f64 = steps.iter().sum::<f64>().min(MAX_DT_MS);
            many.read(0.0);
            one.read(0.0);
            let mut time = 0.0;
            for step in steps {
                time = (time + step).min(total);
                many.read(time);
            }
            let (a, b) = (many.read(total).tool, one.read(total).tool);
            prop_assert!((a.tip() - b.tip()).length() < 1e-3, "{} {}", a.tip(), b.tip());
            prop_assert!((a.twist.linear - b.twist.linear).length() < 1e-4);
        }
    }
}
