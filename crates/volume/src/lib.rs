//! Voxel volumes with patient orientation: files in, resampling, masks, distance fields, carving
