//! The speed of the machine, and the errors of planning.

use crate::Scene;
use trepan_soft::MaterialError;

/// The speed of the machine, measured by the caller; all times are for one thread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Machine {
    /// One tetrahedron, one step of TLED, ns.
    pub ns_per_tet_step: f64,
    /// One rigid tick of `god-object-sphere` with a burr of 3 mm on 0.5 mm voxels, µs.
    pub us_per_rigid_tick: f64,
    /// One pixel of the 3-D view on the processor with every ray and its lighting, ns.
    pub ns_per_ray: f64,
    /// Threads that may run at the same time.
    pub threads: u32,
    /// Threads of the solver where they are given; else the plan takes as many as it needs.
    pub solver_threads: Option<u32>,
    /// Whether a graphics device renders instead of the processor.
    pub device_draws: bool,
}

impl Default for Machine {
    /// Two threads of a server processor of 2023, without a graphics device.
    fn default() -> Self {
        Self {
            ns_per_tet_step: 13.0,
            us_per_rigid_tick: 6.0,
            ns_per_ray: 450.0,
            threads: 2,
            solver_threads: None,
            device_draws: false,
        }
    }
}

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// A number out of range.
    #[error("{field} is {value}; it must be {must}")]
    Value {
        /// Field of [`Machine`] or [`Scene`].
        field: &'static str,
        /// Its value.
        value: f64,
        /// The valid range.
        must: &'static str,
    },
    /// An invalid material.
    #[error("scene.material: {0}")]
    Material(#[from] MaterialError),
    /// A table of rows is empty.
    #[error("rows.{0} is empty; give at least one measured row")]
    NoRows(&'static str),
    /// A table of rows cannot be parsed.
    #[error("{table}, line {line}: {fault}")]
    Table {
        /// Name of the table.
        table: &'static str,
        /// Line, from 1.
        line: usize,
        /// What is wrong and what is expected.
        fault: String,
    },
}

/// Rejects numbers out of range, naming the field.
pub(crate) fn check(machine: &Machine, scene: &Scene) -> Result<(), PlanError> {
    scene.material.check()?;
    let positive = [
        ("machine.ns_per_tet_step", machine.ns_per_tet_step),
        ("machine.us_per_rigid_tick", machine.us_per_rigid_tick),
        ("machine.ns_per_ray", machine.ns_per_ray),
        ("machine.threads", machine.threads.into()),
    ];
    if let Some(&(field, value)) = positive.iter().chain(&scene.numbers()).find(|(_, v)| !(v.is_finite() && *v > 0.0)) {
        return Err(PlanError::Value { field, value, must: "finite and above 0" });
    }
    let limit = |field, value, must, is_met: bool| match is_met {
        true => Ok(()),
        false => Err(PlanError::Value { field, value, must }),
    };
    let (press, motion) = (scene.press_mm, scene.tissue_motion_mm);
    limit("scene.press_mm", press, "at most scene.tool_radius_mm", press <= scene.tool_radius_mm)?;
    let deepest = 3.0 * scene.probe_radius_mm;
    limit("scene.tissue_motion_mm", motion, "at most 3 of scene.probe_radius_mm", motion <= deepest)?;
    limit("scene.headroom", scene.headroom, "finite and 1 or more", scene.headroom >= 1.0)
}
