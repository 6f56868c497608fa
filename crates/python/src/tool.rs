//! Surgical tools.

use crate::arrays::within;
use pyo3::prelude::*;

/// A round tip on a straight shaft along +z of the tool's frame.
#[pyclass(frozen, module = "trepan._trepan")]
pub struct Tool {
    pub tool: trepan_geometry::Tool,
}

#[pymethods]
impl Tool {
    /// A round burr on a shank of 2.4 mm, which cuts bone.
    #[staticmethod]
    fn burr(tip_radius_mm: f32) -> PyResult<Self> {
        Ok(Self { tool: trepan_geometry::Tool::burr(within(tip_radius_mm, "tip_radius_mm", [0.02, 50.0])?) })
    }

    /// A blunt ball probe, which never cuts.
    #[staticmethod]
    fn probe(tip_radius_mm: f32) -> PyResult<Self> {
        Ok(Self { tool: trepan_geometry::Tool::probe(within(tip_radius_mm, "tip_radius_mm", [0.02, 50.0])?) })
    }

    /// A cranial perforator of 11 mm.
    #[staticmethod]
    fn perforator() -> Self {
        Self { tool: trepan_geometry::Tool::perforator() }
    }

    /// A craniotome of 2.4 mm, which cuts with its side.
    #[staticmethod]
    fn craniotome() -> Self {
        Self { tool: trepan_geometry::Tool::craniotome() }
    }

    #[getter]
    fn kind(&self) -> &'static str {
        self.tool.kind.name()
    }

    #[getter]
    fn tip_radius_mm(&self) -> f32 {
        self.tool.tip_radius_mm
    }
}
