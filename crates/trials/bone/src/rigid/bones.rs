//! The thesis's bones: its cubes (Table 3.1) and its skulls (Table 3.2), made from the built-in CT.

use glam::DVec3;
use trepan_geometry::Vec3;
use trepan_volume::{AIR_HU, Grid, Interpolation, VoxelVolume, bone_isovalue, hounsfield, read, resample, skull_only};

/// Table 3.2: dimensions and voxel edge, mm.
pub const SKULLS: [([usize; 3], f32); 5] = [
    ([143, 135, 95], 1.5),
    ([171, 162, 114], 1.25),
    ([213, 202, 142], 1.0),
    ([284, 269, 189], 0.75),
    ([425, 403, 283], 0.5),
];
/// Half of a cube's edge, mm.
pub(super) const HALF_MM: f64 = 100.0;
/// Density of the cubes: halfway between a voxel of it and one of air lies the isovalue.
const CUBE_HU: i16 = 1800;

/// A cube of Table 3.1 with so many voxels along an edge.
pub fn cube(voxels: usize) -> VoxelVolume<i16> {
    let spacing = (2.0 * HALF_MM / voxels as f64) as f32;
    VoxelVolume::isotropic([voxels; 3], Vec3::splat(0.5 * spacing - HALF_MM as f32), spacing, CUBE_HU)
}

/// The skull of the built-in case and its isovalue, HU, on the CT's own grid.
pub fn head() -> (VoxelVolume<i16>, i16) {
    let ct = read(&trepan_fixtures::case_head().ct).expect("the built-in CT is there");
    let mut ct = hounsfield(&ct).expect("the built-in CT is in HU");
    let isovalue = bone_isovalue(&ct);
    skull_only(&mut ct, isovalue);
    (ct, isovalue)
}

/// The top of a head on a grid of such dimensions and voxel edge; what is beyond the CT is air.
pub fn skull(head: &VoxelVolume<i16>, dims: [usize; 3], voxel_mm: f32) -> VoxelVolume<i16> {
    let (low, high) = head.world_corners();
    let size = f64::from(voxel_mm) * DVec3::from(dims.map(|n| n as f64));
    let corner = (0.5 * (low + high) - 0.5 * size).with_z(high.z - size.z);
    let origin = (corner + 0.5 * f64::from(voxel_mm)).as_vec3();
    let grid = Grid::of(&VoxelVolume::isotropic([0; 3], origin, voxel_mm, 0u8));
    resample(head, &Grid { dims, ..grid }, Interpolation::Cubic, AIR_HU)
}
