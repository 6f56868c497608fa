//! Moves nodes to increase the height of the flattest elements.
//!
//! # Theory
//! The stable step of an explicit solver is proportional to the smallest height of an element. At a
//! node with a flat element, steps along the axes are tried, shorter each round; a node on a
//! boundary is projected back to it, p ← p − φ ∇φ / |∇φ|²; a node where three labels meet is fixed.
//! A step is accepted if the smallest height around the node grows and no angle there becomes worse
//! than the worst before. At a sharp angle, a step is also accepted if the worst angle improves and
//! the height does not decrease. So the worst values never get worse. On a brain the lowest element
//! becomes twice as high, and the stable time step twice as long.

use super::LabelledMesh;
use super::regions::Partition;
use crate::quality::{EDGES, volume};
use crate::{FACES, Surface, TetMesh, Topology};
use glam::DVec3;

/// Rounds over all nodes.
const ROUNDS: usize = 8;
/// Nodes are not moved if all their elements are higher than this fraction of the spacing (0.71 in
/// the regular lattice).
const HIGH_ENOUGH: f64 = 0.33;
/// An angle is sharp when its |cos| is over this (20° and 160°).
const SHARP: f64 = 0.94;

/// Where a node may move.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Room {
    /// Inside one label.
    Free,
    /// On the boundary between two labels.
    Border(u16, u16),
    /// Where three labels meet.
    Fixed,
}

/// Improves a mesh in place; `spacing` is that of the finest cubes, mm.
pub(super) fn polish(labelled: &mut LabelledMesh, spacing: f64, regions: &impl Partition) {
    let topology = Topology::of(&labelled.mesh);
    let rooms = rooms(labelled, &topology);
    for round in 0..ROUNDS {
        let step = 0.12 * 0.7f64.powi(round as i32);
        for (node, room) in rooms.iter().enumerate().filter(|(_, room)| **room != Room::Fixed) {
            let place = |p: DVec3| match *room {
                Room::Border(a, b) => back_to(|p| regions.lead(a, b, p), p, 0.01 * spacing),
                _ => p,
            };
            let around = topology.tets_of_node.row(node);
            let step = step * shortest_edge(&labelled.mesh, node, around).max(spacing);
            improve(&mut labelled.mesh, node, around, HIGH_ENOUGH * spacing, |p, axis| place(p + axis * step));
        }
    }
}

fn rooms(labelled: &LabelledMesh, topology: &Topology) -> Vec<Room> {
    let mut outside = vec![false; labelled.mesh.positions.len()];
    Surface::with(&labelled.mesh, topology).nodes().iter().for_each(|&n| outside[n as usize] = true);
    let room = |node: usize| {
        let around = topology.tets_of_node.row(node).iter().map(|&t| labelled.label_of_tet[t as usize]);
        let mut labels: Vec<u16> = around.chain(outside[node].then_some(0)).collect();
        labels.sort_unstable();
        labels.dedup();
        match labels[..] {
            [_] => Room::Free,
            [a, b] => Room::Border(b, a),
            _ => Room::Fixed,
        }
    };
    (0..outside.len()).map(room).collect()
}

/// The length of the shortest edge at a node.
fn shortest_edge(mesh: &TetMesh, node: usize, around: &[u32]) -> f64 {
    let ends = around.iter().flat_map(|&t| mesh.tets[t as usize]).filter(|&n| n as usize != node);
    let length = |n: u32| f64::from(mesh.positions[n as usize].distance(mesh.positions[node]));
    ends.map(length).fold(f64::INFINITY, f64::min)
}

/// Tries the positions from `moved` in six directions and keeps the best.
fn improve(mesh: &mut TetMesh, node: usize, around: &[u32], high_enough: f64, moved: impl Fn(DVec3, DVec3) -> DVec3) {
    let here = mesh.positions[node];
    let mut best = (worth(mesh, around), here);
    let sharp = -best.0.1 > SHARP;
    if best.0.0 > high_enough && !sharp {
        return;
    }
    for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z] {
        mesh.positions[node] = moved(here.as_dvec3(), axis).as_vec3();
        let now = worth(mesh, around);
        let higher = now.0 > best.0.0 * 1.001 && now.1 >= best.0.1;
        if higher || (sharp && now.1 > best.0.1 + 1e-3 && now.0 >= best.0.0) {
            best = (now, mesh.positions[node]);
        }
    }
    mesh.positions[node] = best.1;
}

/// Projects `p` to the surface: two Newton steps with central differences over `h`.
fn back_to(surface: impl Fn(DVec3) -> f64, mut p: DVec3, h: f64) -> DVec3 {
    for _ in 0..2 {
        let slope = |axis: DVec3| (surface(p + axis * h) - surface(p - axis * h)) / (2.0 * h);
        let gradient = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
        p -= gradient * (surface(p) / gradient.length_squared().max(0.01));
    }
    p
}

/// The smallest height, mm, and minus the largest |cos| of an angle, of some tetrahedra; −∞ if one
/// is inverted.
fn worth(mesh: &TetMesh, tets: &[u32]) -> (f64, f64) {
    let mut worst = (f64::INFINITY, 0.0f64);
    for &tet in tets {
        let corners = mesh.corners(tet as usize).map(|p| p.as_dvec3());
        let mm3 = volume(corners);
        let sound = mm3 > 0.0;
        if !sound {
            return (f64::NEG_INFINITY, f64::NEG_INFINITY);
        }
        let normals = FACES.map(|[i, j, k]| (corners[j] - corners[i]).cross(corners[k] - corners[i]));
        let lengths = normals.map(DVec3::length);
        worst.0 = worst.0.min(6.0 * mm3 / lengths.into_iter().fold(0.0, f64::max));
        for [f, g, ..] in EDGES {
            let cos = normals[f].dot(normals[g]) / (lengths[f] * lengths[g]);
            worst.1 = worst.1.min(-cos.abs());
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Quality;
    use trepan_geometry::Vec3;

    #[test]
    fn a_point_comes_back_to_a_ball() {
        let p = back_to(|p| 5.0 - p.length(), DVec3::new(3.0, 4.0, 1.0), 0.01);
        assert!((p.length() - 5.0).abs() < 1e-6);
    }

    struct Nowhere;

    impl Partition for Nowhere {
        fn lead(&self, _: u16, _: u16, _: DVec3) -> f64 {
            f64::NAN
        }

        fn label_at(&self, _: DVec3) -> u16 {
            0
        }

        fn inner_at(&self, _: DVec3) -> u16 {
            0
        }
    }

    #[test]
    fn a_node_near_a_face_moves_away_and_nothing_else_does() {
        let mesh = TetMesh {
            positions: vec![Vec3::ZERO, 4.0 * Vec3::X, 4.0 * Vec3::Y, 4.0 * Vec3::Z, Vec3::new(1.0, 1.0, 0.05)],
            tets: vec![[0, 1, 2, 4], [0, 3, 1, 4], [0, 2, 3, 4], [1, 3, 2, 4]],
        };
        let before = mesh.clone();
        assert_eq!(mesh.check(), Ok(()));
        let mut labelled = LabelledMesh { mesh, label_of_tet: vec![1; 4], ..LabelledMesh::default() };
        polish(&mut labelled, 4.0, &Nowhere);
        let mesh = labelled.mesh;
        assert_eq!(mesh.check(), Ok(()));
        assert_eq!(mesh.positions[..4], before.positions[..4]);
        let (was, is) = (Quality::of(&before), Quality::of(&mesh));
        assert!(is.min_height_mm > 10.0 * was.min_height_mm && is.min_dihedral_deg > was.min_dihedral_deg);
        assert!((is.total_mm3 - was.total_mm3).abs() < 1e-5);
    }
}
