//! What can go wrong while a picture is made.

use trepan_gpu::GpuError;

/// Why there is no picture.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// The graphics device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// A picture of no pixels.
    #[error("a picture of {0}x{1} pixels has none; give at least 1x1")]
    Size(u32, u32),
    /// The moving brain is not the brain at rest.
    #[error("the brain has {wanted} nodes, but {given} positions were given")]
    Nodes {
        /// Nodes of the mesh.
        wanted: usize,
        /// Positions given.
        given: usize,
    },
    /// The MRI cannot be placed.
    #[error("the MRI's affine cannot be inverted; give one with three independent axes")]
    Mri,
    /// The tint is not one of this MRI.
    #[error("the MRI has {wanted} voxels, but {given} tints were given")]
    Tint {
        /// Voxels of the MRI.
        wanted: usize,
        /// Colours given.
        given: usize,
    },
}
