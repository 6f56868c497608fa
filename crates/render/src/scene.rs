//! What every pass knows, in the form in which shaders read it (`scene.wgsl`).

use crate::bricks::Grid;
use crate::camera::View;
use crate::frame::Frame;
use glam::{Mat4, Quat, Vec3, Vec4};
use trepan_geometry::{Tool, ToolKind};

/// Twin of the shader's `Scene`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Scene {
    clip_from_world: Mat4,
    mri_from_world: Mat4,
    eye: Vec4,
    right: Vec4,
    up: Vec4,
    forward: Vec4,
    origin: Vec4,
    dims: Vec4,
    tip: Vec4,
    tail: Vec4,
    light: Vec4,
    spin: Vec4,
}

impl Scene {
    /// Gathers what a frame says. `mri_from_world` gives texture coordinates, if there is an MRI.
    pub fn of(frame: &Frame, view: &View, size: [u32; 2], grid: &Grid, mri_from_world: Option<Mat4>) -> Self {
        let [width, height] = size.map(|n| n as f32);
        let tool = frame.tool.unwrap_or(Tool {
            kind: ToolKind::Probe,
            tip_radius_mm: -1.0,
            shaft_radius_mm: 1.0,
            shaft_length_mm: 1.0,
        });
        let tip = frame.world_from_tool.translation;
        let tail = frame.world_from_tool * Vec3::new(0.0, 0.0, tool.shaft_length_mm);
        let across = frame.world_from_tool.rotation * (Quat::from_rotation_z(frame.turn_rad) * Vec3::X);
        let dims = Vec3::from(grid.dims.map(|n| n as f32));
        Self {
            clip_from_world: view.clip_from_world(),
            mri_from_world: mri_from_world.unwrap_or(Mat4::IDENTITY),
            eye: view.eye.extend(flag(mri_from_world.is_some())),
            right: (view.right * view.half.x).extend(width),
            up: (view.up * view.half.y).extend(height),
            forward: view.forward.extend(flag(frame.show_bone)),
            origin: grid.origin.extend(grid.spacing_mm),
            dims: dims.extend(grid.isovalue.into()),
            tip: tip.extend(tool.tip_radius_mm),
            tail: tail.extend(tool.shaft_radius_mm),
            light: towards_light(view).extend(flag(frame.drilling)),
            spin: across.extend(flag(tool.kind == ToolKind::Burr)),
        }
    }
}

/// The lamp stands above the viewer's left shoulder.
pub(crate) fn towards_light(view: &View) -> Vec3 {
    (0.75 * view.up - 0.55 * view.right - view.forward).normalize()
}

fn flag(yes: bool) -> f32 {
    f32::from(u8::from(yes))
}
