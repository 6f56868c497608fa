//! The uniform shared by all passes, in shader layout (`scene.wgsl`).

use crate::bricks::Grid;
use crate::camera::View;
use crate::cut::Cut;
use crate::frame::Frame;
use crate::paint::Paint;
use crate::tool::ToolShape;
use glam::{Mat4, Vec3, Vec4};

/// Layout of the shader's `Scene`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Scene {
    pub clip_from_world: Mat4,
    pub mri_from_world: Mat4,
    pub eye: Vec4,
    pub right: Vec4,
    pub up: Vec4,
    pub forward: Vec4,
    pub origin: Vec4,
    pub dims: Vec4,
    /// In the first and in the second hand.
    pub tools: [ToolShape; 2],
    pub light: Vec4,
    pub brain_cut: Vec4,
    pub bone_cut: Vec4,
    pub steps: Vec4,
    /// Signal shown as black; one over the range to white.
    pub mri_window: Vec4,
    pub bone_paint: [Vec4; 2],
    pub brain_paint: [Vec4; 2],
}

impl Scene {
    /// Collects a frame's data. `mri_from_world` maps to texture coordinates, if there is an MRI.
    pub fn of(frame: &Frame, view: &View, size: [u32; 2], grid: &Grid, mri_from_world: Option<Mat4>) -> Self {
        let [width, height] = size.map(|n| n as f32);
        let turned = frame.tool.map(|tool| ToolShape::of(&tool, &frame.world_from_tool, frame.turn_rad));
        let second = frame.second.map(|(tool, pose)| ToolShape::of(&tool, &pose, 0.0));
        let dims = Vec3::from(grid.dims.map(|n| n as f32));
        Self {
            clip_from_world: view.clip_from_world(),
            mri_from_world: mri_from_world.unwrap_or(Mat4::IDENTITY),
            eye: view.eye.extend(flag(mri_from_world.is_some())),
            right: (view.right * view.half.x).extend(width),
            up: (view.up * view.half.y).extend(height),
            forward: view.middle().extend(flag(frame.show_bone)),
            origin: grid.origin.extend(grid.spacing_mm),
            dims: dims.extend(grid.isovalue.into()),
            tools: [turned, second].map(|tool| tool.unwrap_or(ToolShape::NONE)),
            brain_cut: Cut::plane(frame.cut.as_ref()),
            bone_cut: Cut::plane(frame.cut.as_ref().filter(|cut| cut.bone)),
            steps: Vec4::new(grid.steps as f32, grid.smooth_step as f32, 0.0, 0.0),
            mri_window: frame.slices.mri_window(),
            bone_paint: Paint::placed(frame.bone_paint),
            brain_paint: Paint::placed(frame.brain_paint),
            light: towards_light(view).extend(flag(frame.drilling)),
        }
    }

    /// Unit direction of the ray through the centre of a pixel of the 3-D view.
    pub fn ray_of(&self, x: usize, y: usize) -> Vec3 {
        let x = 2.0 * (x as f32 + 0.5) / self.right.w - 1.0;
        let y = 1.0 - 2.0 * (y as f32 + 0.5) / self.up.w;
        (self.forward.truncate() + x * self.right.truncate() + y * self.up.truncate()).normalize()
    }

    /// Distance to the nearest tool as contact knows it, mm: a ball and a capsule each.
    pub fn tool_distance(&self, point: Vec3) -> f32 {
        let held = self.tools.iter().filter(|tool| tool.tip.w > 0.0);
        held.map(|tool| distance(point, tool.tip, tool.tail)).fold(f32::INFINITY, f32::min)
    }
}

fn distance(point: Vec3, tip: Vec4, tail: Vec4) -> f32 {
    let (centre, axis) = (tip.truncate(), (tail - tip).truncate());
    let along = ((point - centre).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
    let shaft = point.distance(centre + along * axis) - tail.w;
    shaft.min(point.distance(centre) - tip.w)
}

/// Direction of the lamp, above the viewer's left shoulder.
pub(crate) fn towards_light(view: &View) -> Vec3 {
    (0.75 * view.up - 0.55 * view.right - view.forward).normalize()
}

fn flag(yes: bool) -> f32 {
    f32::from(u8::from(yes))
}
