//! Contact of a tool with tissue that moves.

use crate::arrays::{Any, pose, tet_mesh, vector};
use crate::errors::{compute, value};
use crate::tool::Tool;
use glam::Vec3;
use pyo3::prelude::*;
use std::sync::{Mutex, PoisonError};
use trepan_deformable::Config;
use trepan_geometry::{ToolState, Twist};

/// What one collision step found.
#[pyclass(frozen, module = "trepan._trepan")]
pub struct TissueStep {
    pub step: trepan_deformable::TissueStep,
}

#[pymethods]
impl TissueStep {
    #[getter]
    fn depth_mm(&self) -> f32 {
        self.step.manifold.depth_mm
    }

    #[getter]
    fn normal(&self) -> (f32, f32, f32) {
        self.step.manifold.normal.into()
    }

    /// Force on the tool, N.
    #[getter]
    fn force_n(&self) -> (f32, f32, f32) {
        (self.step.patch.force_n * self.step.patch.normal).into()
    }

    #[getter]
    fn points_in_contact(&self) -> u32 {
        self.step.points_in_contact
    }
}

/// A ball-tipped tool against a tetrahedral mesh that moves (``trepan-deformable``).
#[pyclass(frozen, module = "trepan._trepan")]
pub struct TissueCollision {
    collision: Mutex<trepan_deformable::TissueCollision>,
    nodes: usize,
}

#[pymethods]
impl TissueCollision {
    #[new]
    #[pyo3(signature = (mesh, tool, *, stiffness_per_mm2=None, damping=None, friction=0.0, shaft=false))]
    fn new(
        py: Python<'_>,
        mesh: &Any<'_>,
        tool: &Tool,
        stiffness_per_mm2: Option<f32>,
        damping: Option<f32>,
        friction: f32,
        shaft: bool,
    ) -> PyResult<Self> {
        let mesh = tet_mesh(mesh)?;
        let usual = Config::default();
        let config = Config {
            stiffness_per_mm2: stiffness_per_mm2.unwrap_or(usual.stiffness_per_mm2),
            damping: damping.unwrap_or(usual.damping),
            friction,
            shaft,
            ..usual
        };
        let make = || trepan_deformable::TissueCollision::new(&mesh, &tool.tool, &config);
        let collision = compute(py, make)?.map_err(value)?;
        Ok(Self { collision: Mutex::new(collision), nodes: mesh.positions.len() })
    }

    /// Test the tool at ``position``, mm, against the nodes' positions (n, 3), mm.
    ///
    /// ``velocities`` (n, 3) and ``velocity`` are in mm/ms. Give the result to ``Loads.touch``.
    #[pyo3(signature = (positions, position, *, velocities=None, quaternion=None, velocity=None))]
    fn step(
        &self,
        py: Python<'_>,
        positions: &Any<'_>,
        position: &Any<'_>,
        velocities: Option<&Any<'_>>,
        quaternion: Option<&Any<'_>>,
        velocity: Option<&Any<'_>>,
    ) -> PyResult<TissueStep> {
        let now = self.of_nodes(positions, "positions")?;
        let moving = match velocities {
            Some(velocities) => self.of_nodes(velocities, "velocities")?,
            None => vec![Vec3::ZERO; self.nodes],
        };
        let linear = velocity.map_or(Ok(Vec3::ZERO), |velocity| vector(velocity, "velocity"))?;
        let twist = Twist { linear, angular: Vec3::ZERO };
        let tool = ToolState { twist, ..ToolState::at(pose(position, quaternion)?) };
        let step = compute(py, || {
            let mut out = trepan_deformable::TissueStep::default();
            self.collision.lock().unwrap_or_else(PoisonError::into_inner).step(&now, &moving, &tool, &mut out);
            out
        })?;
        Ok(TissueStep { step })
    }
}

impl TissueCollision {
    fn of_nodes(&self, any: &Any<'_>, name: &str) -> PyResult<Vec<Vec3>> {
        let rows = crate::arrays::points(any, name)?;
        match rows.len() == self.nodes {
            true => Ok(rows),
            false => Err(value(format!("{name} has {} rows: the mesh has {} nodes", rows.len(), self.nodes))),
        }
    }
}
