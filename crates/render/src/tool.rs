//! A tool's shape as the passes read it.

use glam::{Vec3, Vec4};
use trepan_geometry::{Pose, Tool};

/// Centre of the ball and far end of the shaft, with their radii.
pub(crate) fn ends(tool: &Tool, world_from_tool: &Pose) -> [Vec4; 2] {
    let tail = *world_from_tool * Vec3::new(0.0, 0.0, tool.shaft_length_mm);
    [world_from_tool.translation.extend(tool.tip_radius_mm), tail.extend(tool.shaft_radius_mm)]
}
