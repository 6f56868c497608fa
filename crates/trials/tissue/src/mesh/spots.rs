//! Distances between triangles and the faces of voxels, in voxels.

use trepan_geometry::Vec3;
use trepan_mesh::Csr;
use trepan_volume::VoxelVolume;

/// Samples of a mesh's surface for each face of a voxel.
const DENSITY: f32 = 6.0;
/// Distances are sought up to this many voxels.
const REACH: i32 = 12;

/// Points spread over triangles, in voxel indices, about [`DENSITY`] for each face of a voxel.
pub(super) fn samples<T>(grid: &VoxelVolume<T>, triangles: &[[u32; 3]], positions: &[Vec3]) -> Vec<(Vec3, usize)> {
    let voxel_from_world = grid.world_from_voxel.inverse();
    let mut points = Vec::new();
    for triangle in triangles {
        let [a, b, c] = triangle.map(|n| voxel_from_world.transform_point3(positions[n as usize].as_dvec3()).as_vec3());
        let (u, v) = (b - a, c - a);
        let parts = (0.5 * u.cross(v).length() * DENSITY).sqrt().ceil().max(1.0) as usize;
        let at = |i: usize, j: usize, third: f32| {
            (a + (u * (i as f32 + third) + v * (j as f32 + third)) / parts as f32, POINT)
        };
        for i in 0..parts {
            points.extend((0..parts - i).map(|j| at(i, j, 1.0 / 3.0)));
            points.extend((1..parts - i).map(|j| at(i, j - 1, 2.0 / 3.0)));
        }
    }
    points
}

/// The faces between voxels of a kind that `parted` tells apart, as (middle in voxel indices, axis
/// across).
pub(super) fn faces<T: Copy + Default>(volume: &VoxelVolume<T>, parted: impl Fn(T, T) -> bool) -> Vec<(Vec3, usize)> {
    let [nx, ny, nz] = volume.dims;
    let mut found = Vec::new();
    for (k, j, i) in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (k, j, i)))) {
        let own = volume.data[volume.index([i, j, k])];
        let middle = Vec3::new(i as f32, j as f32, k as f32);
        for (axis, next) in [[i + 1, j, k], [i, j + 1, k], [i, j, k + 1]].into_iter().enumerate() {
            if parted(own, volume.get(next).unwrap_or_default()) {
                found.push((middle + 0.5 * Vec3::AXES[axis], axis));
            }
        }
    }
    found
}

/// The third entry of a spot without extent.
const POINT: usize = 3;

/// Points and unit squares sorted into the voxels of a grid.
pub(super) struct Spots {
    pub(super) spots: Vec<(Vec3, usize)>,
    dims: [i32; 3],
    of_voxel: Csr,
}

impl Spots {
    pub(super) fn new<T>(grid: &VoxelVolume<T>, spots: Vec<(Vec3, usize)>) -> Self {
        let dims = grid.dims.map(|n| n as i32);
        let cell = |p: Vec3| index(dims, voxel(dims, p)) as u32;
        let of_voxel = Csr::of_pairs(grid.data.len(), spots.iter().enumerate().map(|(n, s)| (cell(s.0), n as u32)));
        Self { spots, dims, of_voxel }
    }

    /// Distance to the nearest, at most [`REACH`].
    pub(super) fn nearest(&self, p: Vec3) -> f32 {
        let middle = voxel(self.dims, p);
        let mut best = REACH as f32;
        for radius in 0..=REACH {
            if best <= radius as f32 - 1.5 {
                break;
            }
            self.each_in_shell(middle, radius, |(centre, axis)| best = best.min(apart(p - centre, axis)));
        }
        best
    }

    /// Visits what lies in the voxels exactly `radius` away.
    fn each_in_shell(&self, middle: [i32; 3], radius: i32, mut visit: impl FnMut((Vec3, usize))) {
        let range = |d: usize| (middle[d] - radius).max(0)..=(middle[d] + radius).min(self.dims[d] - 1);
        for k in range(2) {
            for j in range(1) {
                let rim = (k - middle[2]).abs() == radius || (j - middle[1]).abs() == radius;
                for i in range(0).filter(|i| rim || (i - middle[0]).abs() == radius) {
                    for &n in self.of_voxel.row(index(self.dims, [i, j, k])) {
                        visit(self.spots[n as usize]);
                    }
                }
            }
        }
    }
}

fn voxel(dims: [i32; 3], p: Vec3) -> [i32; 3] {
    let p = p.round().to_array();
    std::array::from_fn(|d| (p[d] as i32).clamp(0, dims[d] - 1))
}

fn index(dims: [i32; 3], [i, j, k]: [i32; 3]) -> usize {
    (i + dims[0] * (j + dims[1] * k)) as usize
}

/// Distance to a point, or to a unit square across an axis, from its middle.
fn apart(by: Vec3, axis: usize) -> f32 {
    let half = if axis == POINT { Vec3::ZERO } else { 0.5 * (Vec3::ONE - Vec3::AXES[axis]) };
    (by.abs() - half).max(Vec3::ZERO).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_face_is_as_far_as_its_nearest_point() {
        assert_eq!(apart(Vec3::new(0.4, -0.3, 2.0), 2), 2.0);
        assert_eq!(apart(Vec3::new(0.0, 3.5, 4.0), 2), 5.0);
        assert_eq!(apart(Vec3::new(0.0, 3.0, 4.0), POINT), 5.0);
    }

    #[test]
    fn the_nearest_is_found_as_by_brute_force() {
        let mask = super::super::scenes::voxels(|p| u16::from(p.distance(Vec3::new(3.0, 1.0, -2.0)) < 9.3));
        let spots = Spots::new(&mask, faces(&mask, |a, b| a != b));
        for n in 0..60 {
            let p =
                Vec3::splat(34.0) + 11.0 * Vec3::new((n as f32).sin(), (1.7 * n as f32).cos(), (2.9 * n as f32).sin());
            let brute = spots.spots.iter().map(|&(centre, axis)| apart(p - centre, axis)).fold(REACH as f32, f32::min);
            assert_eq!(spots.nearest(p), brute);
        }
    }
}
