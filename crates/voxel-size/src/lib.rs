//! The optimal voxel size: cost function, calibration, prediction
