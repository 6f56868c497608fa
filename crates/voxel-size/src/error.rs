//! What can be wrong with the input.

/// Why there is no voxel size.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VoxelSizeError {
    /// No tetrahedron, or indices out of range.
    #[error("the mesh cannot be measured: {0}")]
    Mesh(#[from] trepan_mesh::MeshError),
    /// A number that makes no sense.
    #[error("{field} is {got}; it must be {wanted}")]
    Field {
        /// Which one.
        field: &'static str,
        /// What it is.
        got: f64,
        /// What would be right.
        wanted: &'static str,
    },
    /// A grid that would not fit.
    #[error(
        "cells of {cell_mm} mm would make {cells:e} of them; at most {limit:e} are built, so take at least {smallest_mm} mm"
    )]
    TooManyCells {
        /// The edge asked for, mm.
        cell_mm: f64,
        /// Cells that it would need.
        cells: f64,
        /// How many there may be.
        limit: f64,
        /// The smallest edge that fits, mm, roughly.
        smallest_mm: f64,
    },
    /// Measurements that do not say what each part costs.
    #[error("{got} measurements do not separate {wanted} prices; measure at more and at more different cell sizes")]
    Fit {
        /// How many there are.
        got: usize,
        /// How many unknowns.
        wanted: usize,
    },
}

/// The number, if `good` says so.
pub(crate) fn checked(field: &'static str, got: f64, good: bool, wanted: &'static str) -> Result<f64, VoxelSizeError> {
    if good { Ok(got) } else { Err(VoxelSizeError::Field { field, got, wanted }) }
}
