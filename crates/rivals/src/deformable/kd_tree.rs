//! Points in a k-d tree, made anew at every step; tetrahedra go down where their boxes lie.
//!
//! # Theory
//! Bentley 1975: the median point along one axis splits the rest in two, and so on, the axes in
//! turn. The tree needs no memory of its own: the middle of each range of the sorted list is its
//! node. A box goes to the side or sides of the split that it reaches.
//!
//! ```text
//!   list   [ . . . L . . .  M  . . . R . . . ]     M splits along x, L and R along y, …
//! ```
//!
//! # When not to use it
//! For few points in a small box: nearly every tetrahedron there meets nearly every split.
//!
//! # Sources
//! Bentley 1975; thesis 2.1.1. Liberties: the tree is of the tool's points; axes in turn, as
//! printed, and not by the longest side.

use trepan_deformable::Descriptor;
use trepan_deformable::kit::Extent;
use trepan_deformable::kit::{PointIndex, indexed, list_finite};
use trepan_geometry::Vec3;

/// A k-d tree of points.
#[derive(Debug)]
pub struct KdTree {
    order: Vec<u32>,
}

impl KdTree {
    /// Room for so many points.
    pub fn new(points: usize) -> Self {
        Self { order: Vec::with_capacity(points) }
    }
}

impl PointIndex for KdTree {
    fn place(&mut self, points: &[Vec3]) {
        list_finite(points, &mut self.order);
        split(&mut self.order, points, 0);
    }

    fn visit(&self, points: &[Vec3], bounds: &Extent, mut found: impl FnMut(u32)) {
        search(&self.order, points, 0, bounds, &mut found);
    }
}

fn split(range: &mut [u32], points: &[Vec3], axis: usize) {
    if range.len() < 2 {
        return;
    }
    let middle = range.len() / 2;
    let along = |i: &u32| points[*i as usize].to_array()[axis];
    range.select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)).then(a.cmp(b)));
    let (left, right) = range.split_at_mut(middle);
    split(left, points, (axis + 1) % 3);
    split(&mut right[1..], points, (axis + 1) % 3);
}

fn search(range: &[u32], points: &[Vec3], axis: usize, bounds: &Extent, found: &mut impl FnMut(u32)) {
    let middle = range.len() / 2;
    let Some(&i) = range.get(middle) else { return };
    let p = points[i as usize];
    if bounds.contains(p) {
        found(i);
    }
    if bounds.low[axis] <= p[axis] {
        search(&range[..middle], points, (axis + 1) % 3, bounds, found);
    }
    if bounds.high[axis] >= p[axis] {
        search(&range[middle + 1..], points, (axis + 1) % 3, bounds, found);
    }
}

/// Points in the k-d tree.
pub const METHOD: Descriptor =
    Descriptor::of("kd-tree", "Bentley 1975", |inputs| indexed(inputs, KdTree::new(inputs.points)));
