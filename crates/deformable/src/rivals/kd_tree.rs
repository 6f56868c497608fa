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

use crate::method::Descriptor;
use crate::phase::{BroadPhase, Phased, TetBoxes, push_bounded};
use trepan_geometry::{Aabb, Vec3};

/// A k-d tree of points.
#[derive(Debug)]
pub struct KdTree {
    tets: TetBoxes,
    order: Vec<u32>,
    open: Vec<(u32, u32, u32)>,
}

/// Deepest range that still waits: two for each halving.
const MAX_OPEN: usize = 128;

impl KdTree {
    /// Room for so many points and tetrahedra.
    pub fn new(points: usize, tets: usize) -> Self {
        Self {
            tets: TetBoxes::with_capacity(tets),
            order: Vec::with_capacity(points),
            open: Vec::with_capacity(MAX_OPEN),
        }
    }

    fn place(&mut self, points: &[Vec3]) {
        self.order.clear();
        let finite = (0..points.len() as u32).filter(|&i| points[i as usize].is_finite());
        self.order.extend(finite.take(self.order.capacity()));
        split(&mut self.order, points, 0);
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

impl BroadPhase for KdTree {
    fn update(&mut self, positions: &[Vec3], tets: &[[u32; 4]], region: &Aabb) {
        self.tets.update(positions, tets, region);
    }

    fn pairs(&mut self, points: &[Vec3], out: &mut Vec<[u32; 2]>) -> u32 {
        out.clear();
        self.place(points);
        let mut overflow = 0;
        for &(tet, bounds) in &self.tets.boxes {
            self.open.clear();
            self.open.push((0, self.order.len() as u32, 0));
            while let Some((first, last, axis)) = self.open.pop() {
                if first == last {
                    continue;
                }
                let middle = (first + last) / 2;
                let i = self.order[middle as usize];
                let p = points[i as usize];
                if bounds.contains(p) {
                    overflow += push_bounded(out, [i, tet]);
                }
                let (x, next) = (p.to_array()[axis as usize], (axis + 1) % 3);
                if bounds.high[axis as usize] >= x {
                    self.open.push((middle + 1, last, next));
                }
                if bounds.low[axis as usize] <= x {
                    self.open.push((first, middle, next));
                }
            }
        }
        overflow
    }
}

/// Points in the k-d tree.
pub const METHOD: Descriptor = Descriptor::of_phase("kd-tree", "Bentley 1975", |inputs| {
    Box::new(Phased::new(KdTree::new(inputs.points, inputs.mesh.tets.len()), inputs.points))
});
