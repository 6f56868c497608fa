//! Picks voxel size, mesh size and solver step for a scene's tolerance and a machine's time
