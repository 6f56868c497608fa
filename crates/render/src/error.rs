//! Rendering errors.

use glam::Vec3;
use trepan_gpu::GpuError;

/// Why a picture could not be drawn.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// An error of the graphics device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The picture has no pixels.
    #[error("a picture of {0}x{1} pixels has none; give at least 1x1")]
    Size(u32, u32),
    /// The number of positions differs from the brain's nodes.
    #[error("the brain has {wanted} nodes, but {given} positions were given")]
    Nodes {
        /// Nodes of the mesh.
        wanted: usize,
        /// Positions given.
        given: usize,
    },
    /// The MRI's affine is singular.
    #[error("the MRI's affine cannot be inverted; give one with three independent axes")]
    Mri,
    /// A paint is invalid.
    #[error(
        "a paint of {dims:?} texels, {spacing_mm} mm apart, has {given} colours; give one a texel, at least one, and a spacing over 0"
    )]
    Paint {
        /// Texels along x, y, z.
        dims: [u32; 3],
        /// Their spacing, mm.
        spacing_mm: Vec3,
        /// Colours given.
        given: usize,
    },
    /// The tint does not match the MRI.
    #[error("the MRI has {wanted} voxels, but {given} tints were given")]
    Tint {
        /// Voxels of the MRI.
        wanted: usize,
        /// Colours given.
        given: usize,
    },
}
