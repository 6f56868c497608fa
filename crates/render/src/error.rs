//! What can go wrong while a picture is made.

use glam::Vec3;
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
    /// A paint is not a box of colours.
    #[error(
        "a paint of {dims:?} texels, {spacing_mm} mm apart, has {given} colours; give one a texel, at least one, and a spacing over 0"
    )]
    Paint {
        /// Texels along x, y, z.
        dims: [u32; 3],
        /// Their distances, mm.
        spacing_mm: Vec3,
        /// Colours given.
        given: usize,
    },
    /// The tint is not one of this MRI.
    #[error("the MRI has {wanted} voxels, but {given} tints were given")]
    Tint {
        /// Voxels of the MRI.
        wanted: usize,
        /// Colours given.
        given: usize,
    },
}
