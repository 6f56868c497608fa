//! Configuration of the haptic tick of either hand.

use crate::alarms::Limits;
use crate::program::Program;
use trepan_contact::{ForceShading, Friction, GuardConfig, Vibration, Viscoelastic};
use trepan_measurements::{drilling, hands};
use trepan_rigid::{Method, removal::FORCE_SCALE};

/// Stiffness of the contact with bone, N/mm.
pub const BONE_STIFFNESS: f32 = drilling::CONTACT_STIFFNESS.f32();
/// Contact with bone of a hand that no device limits.
pub const BONE: Viscoelastic =
    Viscoelastic { stiffness: BONE_STIFFNESS, damping: drilling::CONTACT_DAMPING_UNLIMITED.f32() };
/// Contact with tissue of a hand that no device limits.
pub const TISSUE: Viscoelastic =
    Viscoelastic { stiffness: hands::TISSUE_STIFFNESS.f32(), damping: hands::TISSUE_DAMPING_UNLIMITED.f32() };

/// Configuration of a haptic stage.
#[derive(Clone, Debug)]
pub struct HapticConfig {
    /// Program: its phases and tools.
    pub program: Program,
    /// Method of contact with bone.
    pub rigid: Method,
    /// Newtons at the hand per newton of the task, on bone.
    pub force_scale: f32,
    /// Length of a tick, ms.
    pub dt_ms: f32,
    /// Force of bone: k in N/mm, b in N ms/mm, with friction, shading and the drill's vibration.
    pub bone_force: Vibration<ForceShading<Friction>>,
    /// Force of tissue: k in N/mm, b in N ms/mm.
    pub tissue_force: Viscoelastic,
    /// Configuration of the force guard.
    pub guard: GuardConfig,
    /// Thresholds of the warnings.
    pub limits: Limits,
    /// Whether tools for the brain require an open bone.
    pub opening_needed: bool,
    /// Whether the force stays off after a fault of the device until a deliberate action.
    pub force_waits: bool,
}

impl HapticConfig {
    /// Makes the usual configuration at 1 kHz, for a hand that no device limits.
    pub fn usual(program: Program) -> Self {
        Self {
            program,
            rigid: Method::RECOMMENDED,
            force_scale: FORCE_SCALE,
            dt_ms: 1.0,
            bone_force: BoneModels::default().on(BONE, 0.0),
            tissue_force: TISSUE,
            guard: GuardConfig::default(),
            limits: Limits::default(),
            opening_needed: true,
            force_waits: true,
        }
    }
}

/// What acts on the force of bone beside its spring and damper; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoneModels {
    /// Friction coefficient of a tool that does not cut, without unit.
    pub friction: f32,
    /// Force shading over one voxel.
    pub shading: bool,
    /// Vibration of the drill.
    pub vibration: bool,
}

impl BoneModels {
    /// Force of bone on voxels of an edge, mm, with these models on a spring and damper.
    pub fn on(&self, wall: Viscoelastic, voxel_mm: f32) -> Vibration<ForceShading<Friction>> {
        let friction = Friction::new(wall, wall.stiffness, self.friction, self.friction);
        let shaded = ForceShading::new(friction, if self.shading { voxel_mm } else { 0.0 });
        let drill = Vibration::drill(shaded);
        if self.vibration { drill } else { Vibration::new(shaded, 0.0, drill.frequency_hz) }
    }
}
