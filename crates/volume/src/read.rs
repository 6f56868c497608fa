//! Any image file, its format found by content.

use crate::{Import, ReadError, VoxelVolume, nifti};
use std::path::Path;

/// Reads a volume in any format that is known here, whatever its name.
pub fn read(path: &Path) -> Result<VoxelVolume<f32>, ReadError> {
    import(path).map(|import| import.volume)
}

/// Reads a volume in any format, with what there is to say about the file.
pub fn import(path: &Path) -> Result<Import, ReadError> {
    nifti::import(path)
}
