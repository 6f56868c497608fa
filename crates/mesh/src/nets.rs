//! Extracts the isosurface of a smooth volume as few, well-shaped triangles, such as a cortex.
//!
//! # Theory
//! Each cell of eight voxel centres that the surface crosses gets one vertex, the mean of where it
//! crosses the cell's edges. Each grid edge that it crosses gets a quadrilateral over the four
//! cells around it, split along its shorter diagonal (surface nets, Gibson 1998, without her
//! relaxation). A third of the triangles of [`isosurface`](crate::isosurface()), and hardly a
//! sliver.
//!
//! # Practice
//! World mm, in the order of the cells; equal volumes give bit-identical results. Linear in
//! voxels; 4 bytes a voxel meanwhile.
//!
//! # Sources
//! S. F. F. Gibson, *Constrained elastic surface nets*, MICCAI 1998.
//!
//! # When not to use it
//! For a closed manifold: sheets that touch in one cell share a vertex there, and nothing closes
//! the surface at the grid's border.

use crate::TriMesh;
use glam::DVec3;
use trepan_geometry::Vec3;
use trepan_volume::VoxelVolume;

/// Corners of a cell from its lowest, by bits x, y, z.
const CORNERS: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]];

/// The isosurface of values at or over `level`; triangles are counterclockwise from outside.
pub fn surface_nets(volume: &VoxelVolume<f32>, level: f32) -> TriMesh {
    let [nx, ny, nz] = volume.dims;
    let mut mesh = TriMesh::default();
    let mut vertex = vec![u32::MAX; volume.data.len()];
    let cells = |n: usize| 0..n.saturating_sub(1);
    for (k, j, i) in cells(nz).flat_map(|k| cells(ny).flat_map(move |j| cells(nx).map(move |i| (k, j, i)))) {
        let over = CORNERS.map(|[x, y, z]| volume.data[i + x + nx * (j + y + ny * (k + z))] - level);
        if let Some(share) = crossing(&over) {
            let at = DVec3::new(i as f64, j as f64, k as f64) + share;
            vertex[i + nx * (j + ny * k)] = mesh.positions.len() as u32;
            mesh.positions.push(volume.world_from_voxel.transform_point3(at).as_vec3());
        }
    }
    let is_mirrored = volume.world_from_voxel.matrix3.determinant() < 0.0;
    let step = [1, nx, nx * ny];
    for (k, j, i) in cells(nz).flat_map(|k| cells(ny).flat_map(move |j| cells(nx).map(move |i| (k, j, i)))) {
        let at = i + nx * (j + ny * k);
        for axis in 0..3 {
            // The edge from here along an axis, and the four cells around it.
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            let solid = [at, at + step[axis]].map(|n| volume.data[n] >= level);
            if solid[0] == solid[1] || [i, j, k][u] == 0 || [i, j, k][v] == 0 {
                continue;
            }
            let around = [at, at - step[u], at - step[u] - step[v], at - step[v]].map(|cell| vertex[cell]);
            mesh.quadrilateral(around, solid[0] != is_mirrored);
        }
    }
    mesh
}

/// Mean of where a surface crosses the edges of a cell, from its lowest corner; `None` if it does
/// not.
fn crossing(over: &[f32; 8]) -> Option<DVec3> {
    let solid = over.iter().filter(|over| **over >= 0.0).count();
    if solid == 0 || solid == 8 {
        return None;
    }
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for (a, axis) in (0..8usize).flat_map(|a| (0..3).map(move |axis| (a, axis))) {
        let b = a | 1 << axis;
        if a != b && (over[a] >= 0.0) != (over[b] >= 0.0) {
            let place = |corner: usize| DVec3::from_array(CORNERS[corner].map(|x| x as f64));
            let share = over[a] / (over[a] - over[b]);
            sum += place(a).lerp(place(b), f64::from(share));
            count += 1.0;
        }
    }
    Some(sum / count)
}

impl TriMesh {
    /// Adds a quadrilateral, split along its shorter diagonal.
    fn quadrilateral(&mut self, corners: [u32; 4], outwards: bool) {
        let [a, b, c, d] = if outwards { corners } else { [corners[3], corners[2], corners[1], corners[0]] };
        let place = |n: u32| self.positions.get(n as usize).copied().unwrap_or(Vec3::ZERO);
        let is_ac = place(a).distance_squared(place(c)) <= place(b).distance_squared(place(d));
        let split = if is_ac { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
        self.triangles.extend(split);
    }

    /// The same surface with fewer triangles: vertices in a cube of an edge, mm, become their mean.
    ///
    /// Only where their normals are within an angle, by its cosine, of the normals' mean (after
    /// Rossignac and Borrel 1993).
    pub fn clustered(&self, edge_mm: f32, cosine: f32) -> Self {
        let mut normals = vec![Vec3::ZERO; self.positions.len()];
        for (t, corners) in self.triangles.iter().enumerate() {
            let [a, b, c] = self.corners(t);
            corners.iter().for_each(|n| normals[*n as usize] += (b - a).cross(c - a));
        }
        normals.iter_mut().for_each(|normal| *normal = normal.normalize_or_zero());
        let cube = |n: u32| (self.positions[n as usize] / edge_mm).floor().as_ivec3().to_array();
        let mut order: Vec<([i32; 3], u32)> = (0..self.positions.len() as u32).map(|n| (cube(n), n)).collect();
        order.sort_unstable();
        let mut new_index = vec![0u32; self.positions.len()];
        let mut made = Self::default();
        for cube in order.chunk_by(|a, b| a.0 == b.0) {
            let sum = |of: &[Vec3]| cube.iter().map(|(_, n)| of[*n as usize]).sum::<Vec3>();
            let mean = sum(&normals).normalize_or_zero();
            let is_flat = cube.iter().all(|(_, n)| normals[*n as usize].dot(mean) > cosine);
            for (at, (_, n)) in cube.iter().enumerate() {
                if at == 0 || !is_flat {
                    let place =
                        if is_flat { sum(&self.positions) / cube.len() as f32 } else { self.positions[*n as usize] };
                    made.positions.push(place);
                }
                new_index[*n as usize] = made.positions.len() as u32 - 1;
            }
        }
        let moved = self.triangles.iter().map(|corners| corners.map(|n| new_index[n as usize]));
        made.triangles = moved.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        made
    }

    /// The part around the largest volume, such as a cortex without its ventricles.
    ///
    /// Parts share no vertex; the volume of a hollow counts as less than nothing.
    pub fn largest_part(&self) -> Self {
        let mut root: Vec<u32> = (0..self.positions.len() as u32).collect();
        fn find(root: &mut [u32], mut n: u32) -> u32 {
            while root[n as usize] != n {
                root[n as usize] = root[root[n as usize] as usize];
                n = root[n as usize];
            }
            n
        }
        for &[a, b, c] in &self.triangles {
            let [a, b, c] = [a, b, c].map(|n| find(&mut root, n));
            let least = a.min(b).min(c);
            [a, b, c].into_iter().for_each(|n| root[n as usize] = least);
        }
        // Six times the volume inside each part; that of a hollow is negative.
        let mut inside = vec![0.0f64; root.len()];
        for (t, corners) in self.triangles.iter().enumerate() {
            let [a, b, c] = self.corners(t).map(|p| (p - self.positions[0]).as_dvec3());
            inside[find(&mut root, corners[0]) as usize] += a.dot(b.cross(c));
        }
        let largest = (0..root.len()).max_by(|a, b| inside[*a].total_cmp(&inside[*b])).unwrap_or(0) as u32;
        let mut new_index = vec![u32::MAX; root.len()];
        let mut part = Self::default();
        for corners in &self.triangles {
            if find(&mut root, corners[0]) == largest {
                let corners = corners.map(|n| part.numbered(n, self.positions[n as usize], &mut new_index));
                part.triangles.push(corners);
            }
        }
        part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DMat3};

    /// Balls as the least distance into one, in a grid that mirrors if `x` is negative.
    fn balls(x: f64, all: &[(Vec3, f32)]) -> VoxelVolume<f32> {
        let world_from_voxel =
            DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::new(x, 1.0, 1.5)), DVec3::new(5.0, 0.0, -7.0));
        let mut volume = VoxelVolume::filled([40, 30, 24], world_from_voxel, 0.0f32);
        for at in 0..volume.data.len() {
            let place = volume.centre_of([at % 40, at / 40 % 30, at / 1200]).as_vec3();
            let into = |(middle, radius): &(Vec3, f32)| radius - place.distance(*middle);
            volume.data[at] = all.iter().map(into).fold(f32::MIN, f32::max);
        }
        volume
    }

    #[test]
    fn a_ball_is_round_closed_and_outside_out_also_in_a_mirrored_grid() {
        for x in [0.8f64, -0.8] {
            let middle = Vec3::new(5.0 + 16.0 * x.signum() as f32, 14.0, 10.0);
            let mesh = surface_nets(&balls(x, &[(middle, 9.0)]), 0.0);
            assert!(mesh.is_closed());
            let sphere = 4.0 / 3.0 * std::f64::consts::PI * 729.0;
            // A mean of crossings lies a little inside.
            assert!((mesh.volume_mm3() / sphere - 0.985).abs() < 0.01, "{} mm³", mesh.volume_mm3());
            let worst = mesh.positions.iter().map(|p| (p.distance(middle) - 9.0).abs()).fold(0.0, f32::max);
            assert!(worst < 0.1, "{worst} mm");
        }
    }

    #[test]
    fn clusters_leave_fewer_triangles_on_the_same_ball() {
        let mesh = surface_nets(&balls(0.8, &[(Vec3::new(21.0, 14.0, 10.0), 9.0)]), 0.0);
        let fewer = mesh.clustered(3.0, 0.85);
        assert!(fewer.is_closed() && 3 * fewer.triangles.len() < mesh.triangles.len());
        assert!((fewer.volume_mm3() / mesh.volume_mm3() - 1.0).abs() < 0.09, "{}", fewer.volume_mm3());
        assert_eq!(mesh.clustered(3.0, 1.1).triangles.len(), mesh.triangles.len(), "nothing is that flat");
    }

    #[test]
    fn of_a_ball_with_a_large_hollow_the_outside_stays() {
        let middle = Vec3::new(21.0, 14.0, 10.0);
        let mut shell = balls(0.8, &[(middle, 11.0)]);
        for at in 0..shell.data.len() {
            let place = shell.centre_of([at % 40, at / 40 % 30, at / 1200]).as_vec3();
            // The hollow's surface has folds, and so more triangles than the outside.
            let hollow = 7.5 + 1.5 * (2.0 * place.x).sin() - place.distance(middle);
            shell.data[at] = shell.data[at].min(-hollow);
        }
        let part = surface_nets(&shell, 0.0).largest_part();
        assert!(part.volume_mm3() > 5000.0 && part.positions.iter().all(|p| p.distance(middle) > 10.5));
    }

    #[test]
    fn of_two_balls_the_larger_stays() {
        let all = [(Vec3::new(12.0, 8.0, 2.0), 4.0), (Vec3::new(26.0, 18.0, 14.0), 8.0)];
        let mesh = surface_nets(&balls(0.8, &all), 0.0);
        let part = mesh.largest_part();
        assert!(part.is_closed() && part.triangles.len() < mesh.triangles.len());
        assert!(part.positions.iter().all(|p| p.distance(all[1].0) < 8.5));
        assert_eq!(TriMesh::default().largest_part(), TriMesh::default());
    }
}
