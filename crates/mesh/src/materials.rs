//! Assigns a material to each tetrahedron from a label volume.
//!
//! # Theory
//! A tetrahedron gets the most frequent label among 35 evenly spread sample points, so that thin
//! structures count by their volume fraction. Material boundaries follow the elements, not the
//! labels.
//!
//! # When not to use it
//! Where the boundary between two materials must be smooth, or thinner than an element: use a
//! conforming mesh ([`labelled`](crate::lattice::labelled)).

use crate::TetMesh;
use glam::DVec3;
use rayon::prelude::*;
use trepan_volume::VoxelVolume;

/// Samples along an edge.
const STEPS: usize = 5;

/// The most frequent label of each tetrahedron; 0 outside the volume, the smallest on a tie.
/// Bit-identical for any number of threads.
pub fn majority(mesh: &TetMesh, labels: &VoxelVolume<u16>) -> Vec<u16> {
    let voxel_from_world = labels.world_from_voxel.inverse();
    let label_at = |world: DVec3| {
        let voxel = voxel_from_world.transform_point3(world).round();
        let inside = voxel.cmpge(DVec3::ZERO).all();
        inside.then(|| labels.get(voxel.to_array().map(|v| v as usize))).flatten().unwrap_or(0)
    };
    let most_frequent = |tet: usize| {
        let mut seen: Vec<u16> = samples(mesh.corners(tet).map(|p| p.as_dvec3())).map(label_at).collect();
        seen.sort_unstable();
        let runs = seen.chunk_by(|a, b| a == b);
        runs.max_by_key(|run| (run.len(), u16::MAX - run[0])).map_or(0, |run| run[0])
    };
    (0..mesh.tets.len()).into_par_iter().map(most_frequent).collect()
}

/// Evenly spread points inside a tetrahedron.
fn samples([a, b, c, d]: [DVec3; 4]) -> impl Iterator<Item = DVec3> {
    let last = STEPS - 1;
    let triples =
        (0..STEPS).flat_map(move |i| (0..STEPS - i).flat_map(move |j| (0..STEPS - i - j).map(move |k| [i, j, k])));
    triples.map(move |[i, j, k]| {
        let share = |n: usize| (n as f64 + 0.25) / (last as f64 + 1.0);
        let rest = share(last - i - j - k);
        share(i) * a + share(j) * b + share(k) * c + rest * d
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice;
    use trepan_geometry::Vec3;

    #[test]
    fn samples_lie_inside_and_average_to_the_middle() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let points: Vec<DVec3> = samples(corners).collect();
        assert_eq!(points.len(), 35);
        assert!(points.iter().all(|p| p.min_element() > 0.0 && p.element_sum() < 1.0));
        assert!((points.iter().sum::<DVec3>() / 35.0 - DVec3::splat(0.25)).length() < 1e-12);
    }

    #[test]
    fn a_ball_in_a_ball_keeps_its_volume() {
        let mut labels = VoxelVolume::isotropic([50; 3], Vec3::splat(-24.5), 1.0, 0u16);
        for at in 0..labels.data.len() {
            let radius = labels.centre_of([at % 50, at / 50 % 50, at / 2500]).length();
            labels.data[at] = if radius < 12.0 { 41 } else { 2 * u16::from(radius < 22.0) };
        }
        let config = lattice::Config { target_tets: 20_000, ..Default::default() };
        let mesh = lattice::tetrahedra(&labels.map(|l| u8::from(l != 0)), &config).unwrap();
        let materials = majority(&mesh, &labels);
        assert!(materials.iter().all(|m| [0, 2, 41].contains(m)));
        let inner: f64 = (0..mesh.tets.len()).filter(|&t| materials[t] == 41).map(|t| mesh.volume_mm3(t)).sum();
        let outer: f64 = (0..mesh.tets.len()).filter(|&t| materials[t] == 2).map(|t| mesh.volume_mm3(t)).sum();
        let ball = |radius: f64| 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        assert!((inner / ball(12.0) - 1.0).abs() < 0.03, "{}", inner / ball(12.0));
        assert!((outer / (ball(22.0) - ball(12.0)) - 1.0).abs() < 0.03);
    }
}
