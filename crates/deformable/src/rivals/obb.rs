//! Turned boxes as bounding volumes (Gottschalk et al. 1996), their directions taken at rest.
//!
//! # Theory
//! Directions: eigenvectors of the covariance of a node's corners at rest, found by Jacobi's
//! rotations. A refit keeps them and takes the extents anew: of a leaf from its corners, of a
//! parent from the eight corners of each child's box.
//!
//! # Practice
//! 60 bytes. Extents through the children's corners grow from level to level; taking them from all
//! nodes below would be tight, but O(n log n).
//!
//! # When not to use it
//! Where the mesh turns: directions from rest then fit no better than those of the axes.

use super::volume_tree::{Volume, search};
use crate::method::Descriptor;
use glam::Mat3;
use trepan_geometry::Vec3;

/// A box along its own directions; empty when a `low` exceeds its `high`.
#[derive(Clone, Copy, Debug)]
pub struct Obb {
    /// Rows: the three directions.
    box_from_world: Mat3,
    low: Vec3,
    high: Vec3,
}

/// Rounding of a turned coordinate, as a share of its size.
const ROUNDING: f32 = 1e-6;

impl Obb {
    fn add(&mut self, p: Vec3) {
        let q = self.box_from_world * p;
        let room = Vec3::splat(ROUNDING * p.abs().max_element());
        (self.low, self.high) = (self.low.min(q - room), self.high.max(q + room));
    }

    fn corners(&self) -> [Vec3; 8] {
        let world_from_box = self.box_from_world.transpose();
        core::array::from_fn(|c| {
            let side = |axis: usize| if c >> axis & 1 == 1 { self.high[axis] } else { self.low[axis] };
            world_from_box * Vec3::new(side(0), side(1), side(2))
        })
    }
}

impl Volume for Obb {
    fn for_points(points: &[Vec3]) -> Self {
        let mut empty = Self { box_from_world: directions(points).transpose(), low: Vec3::ZERO, high: Vec3::ZERO };
        empty.clear();
        empty
    }

    fn clear(&mut self) {
        (self.low, self.high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    }

    fn add_corners(&mut self, corners: &[Vec3; 4]) {
        corners.iter().for_each(|&c| self.add(c));
    }

    fn add_child(&mut self, child: &Self) {
        if child.low.cmple(child.high).all() {
            child.corners().into_iter().for_each(|c| self.add(c));
        }
    }

    fn holds(&self, p: Vec3) -> bool {
        let q = self.box_from_world * p;
        let room = Vec3::splat(ROUNDING * p.abs().max_element());
        (self.low - room).cmple(q).all() && q.cmple(self.high + room).all()
    }
}

/// Columns: the eigenvectors of the covariance.
fn directions(points: &[Vec3]) -> Mat3 {
    let mean = points.iter().sum::<Vec3>() / points.len().max(1) as f32;
    let mut covariance = [[0.0f32; 3]; 3];
    for p in points {
        let d = (*p - mean).to_array();
        (0..9).for_each(|n| covariance[n / 3][n % 3] += d[n / 3] * d[n % 3]);
    }
    let mut turned = Mat3::IDENTITY;
    for (i, j) in [(0, 1), (0, 2), (1, 2)].into_iter().cycle().take(24) {
        let (c, s) = rotation(&covariance, i, j);
        let rotate = |a: f32, b: f32| (c * a - s * b, s * a + c * b);
        for row in &mut covariance {
            (row[i], row[j]) = rotate(row[i], row[j]);
        }
        for col in 0..3 {
            (covariance[i][col], covariance[j][col]) = rotate(covariance[i][col], covariance[j][col]);
        }
        let (a, b) = (turned.col(i), turned.col(j));
        (*turned.col_mut(i), *turned.col_mut(j)) = (c * a - s * b, s * a + c * b);
    }
    turned
}

/// Cosine and sine that make the element (i, j) vanish.
fn rotation(m: &[[f32; 3]; 3], i: usize, j: usize) -> (f32, f32) {
    let angle = 0.5 * (2.0 * m[i][j]).atan2(m[j][j] - m[i][i]);
    (angle.cos(), angle.sin())
}

/// A tree of turned boxes.
pub const METHOD: Descriptor = Descriptor::of("obb-tree", "Gottschalk et al. 1996", search::<Obb>);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_follow_a_slanted_rod() {
        let along = Vec3::new(1.0, 2.0, -0.5).normalize();
        let across = along.any_orthonormal_vector();
        let rod: Vec<Vec3> = (-50..50).map(|n| along * n as f32 + across * (n % 3) as f32).collect();
        let found = directions(&rod);
        let best = (0..3).map(|n| found.col(n).dot(along).abs()).fold(0.0, f32::max);
        assert!(best > 0.999, "{best}");
        assert!((found.determinant().abs() - 1.0).abs() < 1e-4);
    }
}
