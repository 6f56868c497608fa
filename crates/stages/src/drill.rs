//! Strokes of the burr: their beginning and end, the remaining bone, and breakthrough.
//!
//! # Practice
//! A stroke begins when the pedal is pressed. Breakthrough is counted once per stroke, where the
//! burr opens the bone and no bone is left ahead: with bone ahead the hole is a pore. Undoing is in
//! `undo.rs`.

use crate::ahead::bone_ahead_mm;
use trepan_bone::BoneVolume;
use trepan_geometry::{Buttons, Pose, Tool, ToolState, Vec3};
use trepan_measurements::drilling;
use trepan_rigid::RigidStep;

/// Remaining bone under which a warning is raised, mm.
pub const THIN_MM: f32 = drilling::THIN_BONE.f32();
/// Remaining bone at which the burr is about to break through, mm.
pub const BREAK_MM: f32 = drilling::BREAK_THROUGH.f32();

/// The present stroke.
#[derive(Clone, Copy, Debug, Default)]
pub struct Drill {
    drilled: bool,
    /// Whether the burr has come through the bone in this stroke.
    through: bool,
}

impl Drill {
    /// Begins and ends strokes as drilling starts and stops; returns whether one began.
    pub fn stroke(&mut self, bone: &BoneVolume, tool: &ToolState, drilling: bool) -> bool {
        let begins = drilling && !self.drilled;
        if begins {
            bone.begin_stroke();
            self.through = false;
        } else if self.drilled && !drilling {
            bone.end_stroke();
        }
        self.through &= tool.buttons.has(Buttons::PEDAL);
        self.drilled = drilling;
        begins
    }

    /// Whether a perforator's clutch is disengaged: after breakthrough until the pedal is released.
    pub fn lets_go(&self) -> bool {
        self.through
    }

    /// Whether the burr comes through the bone in this step, for the first time in its stroke.
    pub fn came_through(&mut self, step: &RigidStep, ahead_mm: f32) -> bool {
        let first = step.broke_through && ahead_mm <= BREAK_MM && !self.through;
        self.through |= first;
        first
    }
}

/// Largest remaining bone that is measured, mm.
pub const REACH_MM: f32 = 2.0;

/// Returns the remaining bone ahead of a cutting burr, mm, at most [`REACH_MM`]: the smaller value
/// along its axis and along the direction of pressing.
pub fn remaining_thickness_mm(bone: &BoneVolume, world_from_tool: Pose, tool: &Tool, normal: Vec3) -> f32 {
    let ahead = |way: Vec3| {
        let front = world_from_tool.translation + tool.tip_radius_mm * way;
        bone_ahead_mm(bone, front, way, REACH_MM)
    };
    ahead(world_from_tool.rotation * Vec3::NEG_Z).min(ahead(-normal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::IVec3;
    use trepan_volume::{AIR_HU, VoxelVolume};

    fn slab() -> BoneVolume {
        BoneVolume::new(&VoxelVolume::isotropic([16; 3], Vec3::splat(-7.5), 1.0, 1200i16), 400).expect("all bone")
    }

    fn pressed(buttons: &[Buttons]) -> ToolState {
        let mut tool = ToolState::at(Pose::IDENTITY);
        buttons.iter().for_each(|b| tool.buttons.0 |= b.0);
        tool
    }

    #[test]
    fn a_stroke_is_from_the_pedals_press_to_its_release() {
        let (bone, mut drill) = (slab(), Drill::default());
        let pedal = pressed(&[Buttons::PEDAL]);
        assert!(drill.stroke(&bone, &pedal, true) && !drill.stroke(&bone, &pedal, true));
        bone.set_hu(IVec3::splat(8), AIR_HU);
        assert!(!drill.stroke(&bone, &pressed(&[]), false));
        bone.set_hu(IVec3::splat(7), AIR_HU);
        bone.undo_stroke();
        assert_eq!([7, 8].map(|v| bone.is_bone(IVec3::splat(v))), [false, true], "what came after it stays");
    }

    #[test]
    fn breakthrough_counts_once_per_stroke_and_not_into_a_pore() {
        let (bone, mut drill) = (slab(), Drill::default());
        let open = RigidStep { broke_through: true, ..RigidStep::default() };
        drill.stroke(&bone, &pressed(&[Buttons::PEDAL]), true);
        assert!(!drill.came_through(&open, 1.5) && drill.came_through(&open, 0.1) && !drill.came_through(&open, 0.0));
        drill.stroke(&bone, &pressed(&[]), false);
        drill.stroke(&bone, &pressed(&[Buttons::PEDAL]), true);
        assert!(drill.came_through(&open, 0.0));
    }
}
