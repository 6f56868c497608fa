//! Points in a hashed grid with time stamps, tetrahedra looked up through the cells of their boxes.
//!
//! # Theory
//! Teschner et al. 2003: the cell `(i, j, k)` of a point is hashed,
//! `(73856093 i) xor (19349663 j) xor (83492791 k)` modulo the size of the table, and the point
//! goes into that bucket. A bucket written at an earlier step is empty: its time stamp says so, and
//! nothing is ever cleared. A tetrahedron asks the buckets of all cells that its box meets. Two
//! cells may share a bucket, so a point counts only for its own cell, once.
//!
//! # Practice
//! Memory depends on the number of points alone, however small the cells and however far apart the
//! points. As in the uniform grid, cells that a box would have to ask in too great a number are
//! doubled, and counted in [`HashedGrid::coarsened`].
//!
//! # When not to use it
//! When the points lie close together, as on a tool: the array of
//! [`UniformGrid`](super::UniformGrid) is as small and needs no hash.
//!
//! # Sources
//! Teschner et al. 2003: hash function, time stamps, barycentric test. Liberties: points of one
//! tool instead of the nodes of all bodies; a point keeps its cell, so that two cells in one bucket
//! give no pair twice.

use super::uniform_grid::fitting_cell;
use crate::extent::Extent;
use crate::method::Descriptor;
use crate::narrow::NONE;
use crate::phase::{PointIndex, indexed};
use trepan_geometry::Vec3;

/// A hash table of points by cell.
#[derive(Debug)]
pub struct HashedGrid {
    wanted_mm: f32,
    cell_mm: f32,
    bounds: Extent,
    first: Vec<u32>,
    written_at: Vec<u32>,
    next: Vec<u32>,
    cell_of: Vec<[i32; 3]>,
    step: u32,
    /// Steps in which the cells had to be coarsened.
    pub coarsened: u32,
}

impl HashedGrid {
    /// A grid with cells of `cell_mm` (positive) for at most so many points.
    pub fn new(cell_mm: f32, points: usize) -> Self {
        let table = (4 * points).next_power_of_two() - 1;
        Self {
            wanted_mm: cell_mm,
            cell_mm,
            bounds: Extent::EMPTY,
            first: vec![NONE; table],
            written_at: vec![0; table],
            next: vec![NONE; points],
            cell_of: vec![[0; 3]; points],
            step: 0,
            coarsened: 0,
        }
    }

    /// Calls `found` for every point of the cell that lies in `bounds`.
    fn visit_cell(&self, points: &[Vec3], cell: [i32; 3], bounds: &Extent, found: &mut impl FnMut(u32)) {
        let bucket = self.bucket(cell);
        let mut at = if self.written_at[bucket] == self.step { self.first[bucket] } else { NONE };
        while at != NONE {
            let i = at as usize;
            if self.cell_of[i] == cell && bounds.contains(points[i]) {
                found(at);
            }
            at = self.next[i];
        }
    }

    /// Counted from the lowest point, so that the numbers stay small anywhere in the world.
    fn cell_at(&self, p: Vec3) -> [i32; 3] {
        let p = p.to_array();
        core::array::from_fn(|axis| ((p[axis] - self.bounds.low[axis]) / self.cell_mm).floor() as i32)
    }

    fn bucket(&self, [i, j, k]: [i32; 3]) -> usize {
        let hash = (i as u32).wrapping_mul(73_856_093)
            ^ (j as u32).wrapping_mul(19_349_663)
            ^ (k as u32).wrapping_mul(83_492_791);
        hash as usize % self.first.len()
    }
}

impl PointIndex for HashedGrid {
    /// Puts the points into their buckets, the last one first, so that buckets run upwards.
    fn place(&mut self, points: &[Vec3]) {
        self.bounds = Extent::of(points.iter().filter(|p| p.is_finite()));
        self.cell_mm = fitting_cell(self.wanted_mm, &self.bounds);
        self.coarsened += u32::from(self.cell_mm != self.wanted_mm);
        self.step = self.step.wrapping_add(1);
        if self.step == 0 {
            self.written_at.fill(0);
            self.step = 1;
        }
        for i in (0..points.len().min(self.next.len())).rev().filter(|&i| points[i].is_finite()) {
            self.cell_of[i] = self.cell_at(points[i]);
            let bucket = self.bucket(self.cell_of[i]);
            self.next[i] = if self.written_at[bucket] == self.step { self.first[bucket] } else { NONE };
            (self.first[bucket], self.written_at[bucket]) = (i as u32, self.step);
        }
    }

    fn visit(&self, points: &[Vec3], bounds: &Extent, mut found: impl FnMut(u32)) {
        if !bounds.overlaps(&self.bounds) {
            return;
        }
        let shared = bounds.shared(&self.bounds);
        let (low, high) = (self.cell_at(shared.low.into()), self.cell_at(shared.high.into()));
        for k in low[2]..=high[2] {
            for j in low[1]..=high[1] {
                for i in low[0]..=high[0] {
                    self.visit_cell(points, [i, j, k], bounds, &mut found);
                }
            }
        }
    }
}

/// Points in the hashed grid.
pub const METHOD: Descriptor = Descriptor::of("hashed-grid", "Teschner et al. 2003", |inputs| {
    indexed(inputs, HashedGrid::new(inputs.cell_mm, inputs.points))
});
