//! A point shell against voxel bone, with drilling
