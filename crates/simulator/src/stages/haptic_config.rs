//! Configuration of the haptic tick of either hand.

use crate::program::Program;
use crate::stages::alarms::Limits;
use trepan_contact::{GuardConfig, Vibration, Viscoelastic};
use trepan_rigid::Method;

/// Stiffness of the contact with bone, N/mm.
pub(crate) const BONE_STIFFNESS: f32 = 2.0;

/// Configuration of a haptic stage.
#[derive(Clone, Debug)]
pub struct HapticConfig {
    /// Program: its phases and tools.
    pub program: Program,
    /// Method of contact with bone.
    pub rigid: Method,
    /// Length of a tick, ms.
    pub dt_ms: f32,
    /// Force of bone: k in N/mm, b in N ms/mm, with the vibration of the drill.
    pub bone_force: Vibration<Viscoelastic>,
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
            dt_ms: 1.0,
            bone_force: Vibration::drill(Viscoelastic { stiffness: BONE_STIFFNESS, damping: 0.5 }),
            tissue_force: Viscoelastic { stiffness: 0.3, damping: 0.3 },
            guard: GuardConfig::default(),
            limits: Limits::default(),
            opening_needed: true,
            force_waits: true,
        }
    }
}
