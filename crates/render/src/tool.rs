//! A tool's shape as the passes read it.

use glam::{Quat, Vec3, Vec4};
use trepan_geometry::{Pose, Tool, ToolKind};

/// A tool where it is; layout of the shader's `ToolShape`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct ToolShape {
    /// Centre of the ball; w: its radius, negative without a tool.
    pub tip: Vec4,
    /// Far end of the shaft; w: its radius.
    pub tail: Vec4,
    /// Unit, across the shaft; w: how far its flutes have turned, rad.
    pub across: Vec4,
    /// What it looks like; mm of the shaft that cut; farthest from the axis; length of the shaft.
    pub look: Vec4,
}

// Looks; 0 is a ball on a shaft.
pub(crate) const BURR: i32 = 1;
pub(crate) const PERFORATOR: i32 = 2;
pub(crate) const CRANIOTOME: i32 = 3;
pub(crate) const SPATULA: i32 = 4;
pub(crate) const TUBE: i32 = 5;
pub(crate) const TINES: i32 = 6;
pub(crate) const SCALPEL: i32 = 7;

impl ToolShape {
    /// No tool: nothing meets it.
    pub const NONE: Self =
        Self { tip: Vec4::NEG_W, tail: Vec4::new(0.0, 0.0, 1.0, 1.0), across: Vec4::X, look: Vec4::W };

    /// A tool at a pose, its flutes turned.
    pub fn of(tool: &Tool, world_from_tool: &Pose, turn_rad: f32) -> Self {
        let &Tool { kind, tip_radius_mm, shaft_radius_mm, shaft_length_mm, cutting_mm } = tool;
        let tail = *world_from_tool * Vec3::new(0.0, 0.0, shaft_length_mm);
        let round_mm = tip_radius_mm.max(shaft_radius_mm);
        let (look, far_mm) = match kind {
            ToolKind::Probe => (0, round_mm),
            ToolKind::Burr => (BURR, round_mm),
            ToolKind::Perforator => (PERFORATOR, round_mm),
            ToolKind::Craniotome => (CRANIOTOME, 3.0),
            ToolKind::Spatula => (SPATULA, round_mm),
            ToolKind::Aspirator => (TUBE, round_mm),
            ToolKind::Bipolar | ToolKind::Scissors => (TINES, 6.0),
            ToolKind::Scalpel => (SCALPEL, 2.8),
        };
        Self {
            tip: world_from_tool.translation.extend(tip_radius_mm),
            tail: tail.extend(shaft_radius_mm),
            across: (world_from_tool.rotation * Vec3::X).extend(turn_rad.rem_euclid(core::f32::consts::TAU)),
            look: Vec4::new(look as f32, cutting_mm, far_mm.max(round_mm), shaft_length_mm),
        }
    }

    /// A ball, as of a probe without a shaft.
    pub fn ball(at: Vec3, radius_mm: f32) -> Self {
        let ball = Tool { shaft_radius_mm: radius_mm, shaft_length_mm: 0.01, ..Tool::probe(radius_mm) };
        Self::of(&ball, &Pose::from_parts(at, Quat::IDENTITY), 0.0)
    }
}
