//! Assigns materials to each tetrahedron from a label volume.
//!
//! # Theory
//! A tetrahedron gets the most frequent label among 35 evenly spread sample points, or the share of
//! each label among 165, so that thin structures count by their volume fraction. Material
//! boundaries follow the elements, not the labels.
//!
//! # When not to use it
//! Where the boundary between two materials must be smooth: use a conforming mesh
//! ([`labelled`](crate::lattice::labelled)), which takes shares where a label is too thin for one.

use crate::TetMesh;
use glam::DVec3;
use rayon::prelude::*;
use trepan_volume::VoxelVolume;

/// Samples along an edge for the most frequent label.
const STEPS: usize = 5;
/// Samples along an edge for shares.
const FINE_STEPS: usize = 9;

/// The share of a tetrahedron's volume that has a label.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// The tetrahedron.
    pub tet: u32,
    /// The volume's label.
    pub label: u16,
    /// Its share of what is labelled there, over 0 and at most 1.
    pub share: f32,
}

/// The most frequent label of each tetrahedron; 0 outside the volume, the smallest on a tie.
/// Bit-identical for any number of threads.
pub fn majority(mesh: &TetMesh, labels: &VoxelVolume<u16>) -> Vec<u16> {
    let of = counter(mesh, labels, STEPS);
    let most_frequent = |tet: usize| {
        let of_tet = of(tet);
        of_tet.iter().max_by_key(|(label, count)| (*count, u16::MAX - label)).map_or(0, |(label, _)| *label)
    };
    (0..mesh.tets.len()).into_par_iter().map(most_frequent).collect()
}

/// Shares of the nonzero labels in the tetrahedra that `wanted` names, ascending by tetrahedron,
/// then label. The shares of a tetrahedron sum up to 1; one without any label has none.
/// Bit-identical for any number of threads.
pub fn shares(mesh: &TetMesh, labels: &VoxelVolume<u16>, wanted: impl Fn(usize) -> bool + Sync) -> Vec<Share> {
    let of = counter(mesh, labels, FINE_STEPS);
    let of_tet = |tet: usize| {
        let found: Vec<(u16, usize)> = of(tet).into_iter().filter(|(label, _)| *label != 0).collect();
        let all: usize = found.iter().map(|(_, count)| count).sum();
        let share = move |(label, count)| Share { tet: tet as u32, label, share: count as f32 / all as f32 };
        found.into_iter().map(share)
    };
    (0..mesh.tets.len()).into_par_iter().filter(|tet| wanted(*tet)).flat_map_iter(of_tet).collect()
}

/// Counts the labels at a tetrahedron's samples, ascending by label.
fn counter(mesh: &TetMesh, labels: &VoxelVolume<u16>, steps: usize) -> impl Fn(usize) -> Vec<(u16, usize)> + Sync {
    let voxel_from_world = labels.world_from_voxel.inverse();
    let label_at = move |world: DVec3| {
        let voxel = voxel_from_world.transform_point3(world).round();
        let inside = voxel.cmpge(DVec3::ZERO).all();
        inside.then(|| labels.get(voxel.to_array().map(|v| v as usize))).flatten().unwrap_or(0)
    };
    move |tet| {
        let mut seen: Vec<u16> = samples(mesh.corners(tet).map(|p| p.as_dvec3()), steps).map(&label_at).collect();
        seen.sort_unstable();
        seen.chunk_by(|a, b| a == b).map(|run| (run[0], run.len())).collect()
    }
}

/// Evenly spread points inside a tetrahedron.
fn samples([a, b, c, d]: [DVec3; 4], steps: usize) -> impl Iterator<Item = DVec3> {
    let last = steps - 1;
    let triples =
        (0..steps).flat_map(move |i| (0..steps - i).flat_map(move |j| (0..steps - i - j).map(move |k| [i, j, k])));
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
        for (steps, count) in [(STEPS, 35), (FINE_STEPS, 165)] {
            let points: Vec<DVec3> = samples(corners, steps).collect();
            assert_eq!(points.len(), count);
            assert!(points.iter().all(|p| p.min_element() > 0.0 && p.element_sum() < 1.0));
            assert!((points.iter().sum::<DVec3>() / count as f64 - DVec3::splat(0.25)).length() < 1e-12);
        }
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
