//! Input errors.

/// Why no voxel size can be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VoxelSizeError {
    /// No tetrahedron, or indices out of range.
    #[error("the mesh cannot be measured: {0}")]
    Mesh(#[from] trepan_mesh::MeshError),
    /// A number out of range.
    #[error("{field} is {got}; it must be {wanted}")]
    Field {
        /// The field.
        field: &'static str,
        /// Its value.
        got: f64,
        /// The valid range.
        wanted: &'static str,
    },
    /// A grid with too many cells.
    #[error(
        "cells of {cell_mm} mm would make {cells:e} of them; at most {limit:e} are built, so take at least {smallest_mm} mm"
    )]
    TooManyCells {
        /// The requested edge, mm.
        cell_mm: f64,
        /// Cells that it would need.
        cells: f64,
        /// The limit.
        limit: f64,
        /// The smallest edge that fits, mm, approximately.
        smallest_mm: f64,
    },
    /// Measurements that do not determine the costs.
    #[error("{got} measurements do not separate {wanted} prices; measure at more and at more different cell sizes")]
    Fit {
        /// Number of measurements.
        got: usize,
        /// Number of unknowns.
        wanted: usize,
    },
}

/// Returns the number if it is positive and finite, else an error.
pub(crate) fn positive(field: &'static str, got: f64) -> Result<f64, VoxelSizeError> {
    checked(field, got, got > 0.0 && got.is_finite(), "positive and finite")
}

/// Returns the number if `good`, else an error.
pub(crate) fn checked(field: &'static str, got: f64, good: bool, wanted: &'static str) -> Result<f64, VoxelSizeError> {
    if good { Ok(got) } else { Err(VoxelSizeError::Field { field, got, wanted }) }
}
