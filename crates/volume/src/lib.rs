//! Voxel volumes with patient orientation.

mod bone;
mod volume;

pub use bone::{AIR_HU, BRICK, BoneError, BoneVolume};
pub use volume::VoxelVolume;
