//! Points in a uniform grid of cells, tetrahedra looked up through the cells of their boxes.
//!
//! # Theory
//! Teschner et al. 2003 with an array in place of the hash, as in the thesis 4.2.2: a point belongs
//! to the one cell `floor((x - origin) / cell)`, a tetrahedron asks every cell that its box meets.
//! Each pair is found once, since a point has one cell.
//!
//! # Practice
//! The array spans only the box of the points, so a mesh that leaves any preset world box does no
//! harm. `cell_mm` trades cells visited against points per cell: see `trepan-voxel-size`. When the
//! points' box asks for more than [`UniformGrid::MAX_CELLS`] cells, the cells of that step are
//! doubled until they fit, and [`UniformGrid::coarsened`] counts it. O(tetrahedra + points + cells)
//! in each step.
//!
//! # When not to use it
//! For a small tool in a large mesh: it still looks at every tetrahedron's box.
//!
//! # Sources
//! Teschner et al. 2003; thesis 4.2.2. Liberties: an array over the points' box instead of a hash;
//! points of one tool instead of the nodes of all bodies.

use crate::extent::Extent;
use crate::method::Descriptor;
use crate::phase::{PointIndex, indexed};
use trepan_geometry::{Aabb, Vec3};

/// A uniform grid over the points, as an array: points sorted by cell.
#[derive(Debug)]
pub struct UniformGrid {
    wanted_mm: f32,
    cell_mm: f32,
    origin: Vec3,
    bounds: Extent,
    dims: [usize; 3],
    starts: Vec<u32>,
    sorted: Vec<u32>,
    cell_of: Vec<u32>,
    /// Steps in which the cells had to be coarsened.
    pub coarsened: u32,
}

impl UniformGrid {
    /// Most cells in the array.
    pub const MAX_CELLS: usize = 1 << 16;

    /// A grid with cells of `cell_mm` (positive) for at most so many points.
    pub fn new(cell_mm: f32, points: usize) -> Self {
        Self {
            wanted_mm: cell_mm,
            cell_mm,
            origin: Vec3::ZERO,
            bounds: Extent::EMPTY,
            dims: [0; 3],
            starts: vec![0; Self::MAX_CELLS + 1],
            sorted: vec![0; points],
            cell_of: vec![0; points],
            coarsened: 0,
        }
    }

    /// Counting sort: cells ascending, in each cell points ascending.
    fn count_and_sort(&mut self, points: &[Vec3]) {
        let cells = self.dims.iter().product::<usize>();
        self.starts[..=cells].fill(0);
        for (i, p) in points.iter().enumerate() {
            self.cell_of[i] = self.index(self.cell_at(*p)) as u32;
            self.starts[self.cell_of[i] as usize] += 1;
        }
        for cell in 0..cells {
            self.starts[cell + 1] += self.starts[cell];
        }
        for i in (0..points.len()).rev() {
            let next = &mut self.starts[self.cell_of[i] as usize];
            *next -= 1;
            self.sorted[*next as usize] = i as u32;
        }
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    fn points_in(&self, cell: usize) -> &[u32] {
        &self.sorted[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// `floor((x - origin) / cell)`, kept inside the array.
    fn cell_at(&self, p: Vec3) -> [usize; 3] {
        let at = ((p - self.origin) / self.cell_mm).floor().to_array();
        core::array::from_fn(|axis| (at[axis].max(0.0) as usize).min(self.dims[axis] - 1))
    }
}

impl PointIndex for UniformGrid {
    fn place(&mut self, points: &[Vec3]) {
        let points = &points[..points.len().min(self.sorted.len())];
        let bounds = Aabb::of_points(points.iter().filter(|p| p.is_finite()));
        self.dims = [0; 3];
        if bounds.is_empty() || !bounds.size().is_finite() {
            return;
        }
        (self.origin, self.bounds) = (bounds.min, bounds.into());
        self.cell_mm = fitting_cell(self.wanted_mm, &self.bounds);
        self.coarsened += u32::from(self.cell_mm != self.wanted_mm);
        self.dims = bounds.size().to_array().map(|s| (s / self.cell_mm) as usize + 1);
        self.count_and_sort(points);
    }

    fn visit(&self, points: &[Vec3], bounds: &Extent, mut found: impl FnMut(u32)) {
        if self.dims[0] == 0 || !bounds.overlaps(&self.bounds) {
            return;
        }
        let (low, high) = (self.cell_at(bounds.low.into()), self.cell_at(bounds.high.into()));
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    let inside = |i: &&u32| bounds.contains(points[**i as usize]);
                    self.points_in(self.index([x, y, z])).iter().filter(inside).for_each(|&i| found(i));
                }
            }
        }
    }
}

/// The wanted cell, doubled until the box holds no more than [`UniformGrid::MAX_CELLS`] of them.
pub(crate) fn fitting_cell(wanted_mm: f32, bounds: &Extent) -> f32 {
    let cells = |cell_mm: f32| -> f64 {
        (0..3).map(|axis| f64::from((bounds.high[axis] - bounds.low[axis]) / cell_mm) + 1.0).product()
    };
    let mut cell_mm = wanted_mm;
    while cells(cell_mm) > UniformGrid::MAX_CELLS as f64 && cell_mm < f32::MAX / 2.0 {
        cell_mm *= 2.0;
    }
    cell_mm
}

/// Points in the uniform grid.
pub const METHOD: Descriptor = Descriptor::of("uniform-grid", "Teschner et al. 2003", |inputs| {
    indexed(inputs, UniformGrid::new(inputs.cell_mm, inputs.points))
});

/// One cell for all: the box of every tetrahedron against the tool's box, the plain baseline.
pub const SCAN: Descriptor =
    Descriptor::of("scan", "none", |inputs| indexed(inputs, UniformGrid::new(f32::MAX, inputs.points)));
