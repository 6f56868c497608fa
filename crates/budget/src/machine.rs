//! How fast the machine is, and why there may be no plan.

use crate::Scene;
use trepan_soft::MaterialError;

/// How fast the machine is, measured by the caller; all times are those of one thread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Machine {
    /// One tetrahedron, one step of TLED, ns.
    pub ns_per_tet_step: f64,
    /// One rigid tick of `god-object-sphere` with a burr of 3 mm on 0.5 mm voxels, µs.
    pub us_per_rigid_tick: f64,
    /// One pixel of the 3-D view by the processor with every ray, its light included, ns.
    pub ns_per_ray: f64,
    /// Threads that may run at the same time.
    pub threads: u32,
    /// Whether a graphics device draws, not the processor.
    pub device_draws: bool,
}

impl Default for Machine {
    /// Two threads of a server processor of 2023, without a graphics device.
    fn default() -> Self {
        Self { ns_per_tet_step: 13.0, us_per_rigid_tick: 6.0, ns_per_ray: 450.0, threads: 2, device_draws: false }
    }
}

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// A number that makes no sense.
    #[error("{field} is {value}; it must be {must}")]
    Value {
        /// Field of [`Machine`] or [`Scene`].
        field: &'static str,
        /// What it is.
        value: f64,
        /// What would be right.
        must: &'static str,
    },
    /// A material that does not exist.
    #[error("scene.material: {0}")]
    Material(#[from] MaterialError),
    /// There are no rows to choose from.
    #[error("rows.{0} is empty; give at least one measured row")]
    NoRows(&'static str),
    /// A table of rows that cannot be read.
    #[error("{table}, line {line}: {fault}")]
    Table {
        /// Which table.
        table: &'static str,
        /// Line, from 1.
        line: usize,
        /// What is wrong and what would be right.
        fault: String,
    },
}

/// Refuses numbers that make no sense, naming the field.
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
    if scene.press_mm > scene.tool_radius_mm {
        return Err(PlanError::Value {
            field: "scene.press_mm",
            value: scene.press_mm,
            must: "at most scene.tool_radius_mm",
        });
    }
    if scene.tissue_motion_mm > scene.probe_radius_mm {
        let (field, value) = ("scene.tissue_motion_mm", scene.tissue_motion_mm);
        return Err(PlanError::Value { field, value, must: "at most scene.probe_radius_mm" });
    }
    if scene.headroom < 1.0 {
        return Err(PlanError::Value { field: "scene.headroom", value: scene.headroom, must: "finite and 1 or more" });
    }
    Ok(())
}
