//! Maps a device's workspace to the patient: position, orientation and scale.
//!
//! # Theory
//! Positions are scaled and rotated, `x_world = s R x_device + t`; rotations and angular velocities
//! are only rotated. Forces are only rotated too: scaling them would change the felt stiffness by
//! `s²` instead of `s`, and the force limit belongs to the hand. Torques act at the tip and are
//! rotated.
//!
//! # Practice
//! `s` is world mm per device mm. With s > 1 the loop gain at the hand is `s` times higher: lower
//! the coupling stiffness.

use trepan_geometry::{Pose, Quat, ToolState, Twist, Vec3, Wrench};

/// Maps device space to world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workspace {
    /// Pose of the device's frame in the world.
    pub world_from_device: Pose,
    /// World mm per device mm; more than 0.
    pub scale: f32,
}

impl Default for Workspace {
    /// Device space is world space.
    fn default() -> Self {
        Self { world_from_device: Pose::IDENTITY, scale: 1.0 }
    }
}

impl Workspace {
    /// A workspace with its origin at `centre`, oriented as force-feedback styluses are.
    /// Seen along `forward` with `up` upwards, x is right, y up and z towards the viewer.
    pub fn facing(centre: Vec3, forward: Vec3, up: Vec3, scale: f32) -> Self {
        let z = (-forward).normalize_or(Vec3::Z);
        let x = up.cross(z).normalize_or(z.any_orthonormal_vector());
        let rotation = Quat::from_mat3(&trepan_geometry::Mat3::from_cols(x, z.cross(x), z));
        Self { world_from_device: Pose::from_parts(centre, rotation), scale }
    }

    /// Converts a tool state from device to world space.
    pub fn world(&self, device: &ToolState) -> ToolState {
        let turn = self.world_from_device.rotation;
        let pose = device.world_from_tool;
        ToolState {
            world_from_tool: Pose::from_parts(
                self.world_from_device.translation + turn * (pose.translation * self.scale),
                (turn * pose.rotation).normalize(),
            ),
            twist: Twist { linear: turn * (device.twist.linear * self.scale), angular: turn * device.twist.angular },
            ..*device
        }
    }

    /// Rotates a world wrench to the device's axes.
    pub fn device_wrench(&self, world: Wrench) -> Wrench {
        let turn = self.world_from_device.rotation.inverse();
        Wrench { force: turn * world.force, torque: turn * world.torque }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit(v: [f32; 3]) -> Vec3 {
        Vec3::from(v).normalize_or(Vec3::X)
    }

    proptest! {
        #[test]
        fn velocity_is_the_derivative_of_position(axis in prop::array::uniform3(-1.0f32..1.0), angle in -3.0f32..3.0,
                                                  scale in 0.2f32..5.0, velocity in prop::array::uniform3(-1.0f32..1.0)) {
            let map = Workspace {
                world_from_device: Pose::from_parts(Vec3::new(10.0, -20.0, 30.0), Quat::from_axis_angle(unit(axis), angle)),
                scale,
            };
            let velocity = Vec3::from(velocity);
            let mut tool = ToolState::at(Pose::from_translation(Vec3::new(1.0, 2.0, 3.0)));
            tool.twist.linear = velocity;
            let before = map.world(&tool);
            tool.world_from_tool.translation += velocity;
            let after = map.world(&tool);
            prop_assert!((after.tip() - before.tip() - before.twist.linear).length() < 2e-4);
            prop_assert!(after.is_finite());
        }

        #[test]
        fn a_force_keeps_its_length_and_power_scales(axis in prop::array::uniform3(-1.0f32..1.0), angle in -3.0f32..3.0,
                                                     scale in 0.2f32..5.0, force in prop::array::uniform3(-3.0f32..3.0)) {
            let map = Workspace {
                world_from_device: Pose::from_parts(Vec3::ZERO, Quat::from_axis_angle(unit(axis), angle)),
                scale,
            };
            let mut tool = ToolState::at(Pose::IDENTITY);
            tool.twist.linear = Vec3::new(0.1, 0.2, -0.3);
            let world_force = Vec3::from(force);
            let device_force = map.device_wrench(Wrench { force: world_force, torque: Vec3::ZERO }).force;
            let world_power = world_force.dot(map.world(&tool).twist.linear);
            prop_assert!((world_power - scale * device_force.dot(tool.twist.linear)).abs() < 1e-4);
        }
    }

    #[test]
    fn facing_puts_right_up_and_towards_on_the_device_axes() {
        let map = Workspace::facing(Vec3::ZERO, Vec3::NEG_Y, Vec3::Z, 1.0);
        let seen = |v: Vec3| map.world(&ToolState::at(Pose::from_translation(v))).tip();
        assert!((seen(Vec3::X) - Vec3::NEG_X).length() < 1e-6);
        assert!((seen(Vec3::Y) - Vec3::Z).length() < 1e-6);
        assert!((seen(Vec3::Z) - Vec3::Y).length() < 1e-6);
    }
}
