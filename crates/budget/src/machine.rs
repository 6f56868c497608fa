//! What the plan is given: a machine's measured times and a scene's tolerances.

use trepan_soft::{Material, MaterialError};

/// How fast the machine is, measured by the caller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Machine {
    /// One tetrahedron, one solver step, on one thread, ns.
    pub ns_per_tet_step: f64,
    /// One rigid tick of the reference row (466 points, 0.5 mm voxels), µs.
    pub us_per_rigid_tick: f64,
    /// Threads that may run at the same time.
    pub threads: u32,
}

/// What the scene asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scene {
    /// Largest error of the force on bone, N. A hand notices about 0.1 N.
    pub force_error_n: f64,
    /// Largest error of the tissue's displacement, mm.
    pub displacement_mm: f64,
    /// Stiffness of the contact with bone, N/mm: an error in depth becomes one in force.
    pub stiffness: f64,
    /// How far the tissue moves at most, mm: the error of its displacement is a share of it.
    pub tissue_motion_mm: f64,
    /// Rate of the haptic device, Hz.
    pub device_rate_hz: f64,
    /// Volume of the brain, mm³.
    pub brain_mm3: f64,
    /// What it is made of.
    pub material: Material,
    /// Wanted speed over real time, at least 1: what is left over absorbs other load.
    pub headroom: f64,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            force_error_n: 0.1,
            displacement_mm: 0.5,
            stiffness: 2.0,
            tissue_motion_mm: 5.0,
            device_rate_hz: 1000.0,
            brain_mm3: 1.2e6,
            material: Material::BRAIN,
            headroom: 1.5,
        }
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
}

/// Refuses numbers that make no sense, naming the field.
pub(crate) fn check(machine: &Machine, scene: &Scene) -> Result<(), PlanError> {
    scene.material.check()?;
    let positive = [
        ("machine.ns_per_tet_step", machine.ns_per_tet_step),
        ("machine.us_per_rigid_tick", machine.us_per_rigid_tick),
        ("machine.threads", machine.threads.into()),
        ("scene.force_error_n", scene.force_error_n),
        ("scene.displacement_mm", scene.displacement_mm),
        ("scene.stiffness", scene.stiffness),
        ("scene.tissue_motion_mm", scene.tissue_motion_mm),
        ("scene.device_rate_hz", scene.device_rate_hz),
        ("scene.brain_mm3", scene.brain_mm3),
    ];
    if let Some(&(field, value)) = positive.iter().find(|(_, v)| !(v.is_finite() && *v > 0.0)) {
        return Err(PlanError::Value { field, value, must: "finite and above 0" });
    }
    if !(scene.headroom.is_finite() && scene.headroom >= 1.0) {
        return Err(PlanError::Value { field: "scene.headroom", value: scene.headroom, must: "finite and 1 or more" });
    }
    Ok(())
}
