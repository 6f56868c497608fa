//! Counts the work of a uniform grid at a cell size: cells visited, particles tested, boxes hit. It
//! measures no times.
//!
//! # Theory
//! Algorithm of 5.2 (Teschner et al. 2003): particles are sorted into cells; each box visits the
//! cells that it covers and tests their particles. The sum of particles over a block of cells comes
//! from a summed-volume table in eight look-ups, so that counting costs far less than the search
//! itself.
//!
//! # Practice
//! Cells are `floor(x / cell)`, half open, with the world origin at 0. At most [`MAX_CELLS`] cells
//! around the particles; visits outside them count too.

use crate::error::{VoxelSizeError, positive};
use glam::{DVec3, I64Vec3};
use trepan_geometry::{Aabb, Vec3};
use trepan_mesh::TetMesh;

/// Most cells of a table.
pub const MAX_CELLS: usize = 10_000_000;

/// The work of one pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Boxes that searched.
    pub boxes: u64,
    /// Particles sorted into cells.
    pub particles: u64,
    /// Cells visited: Σ over boxes of the cells they cover.
    pub visits: u64,
    /// Particles tested against a box: Σ over visited cells of the particles in them.
    pub tests: u64,
    /// Tests in which the particle was inside the box (work of the narrow phase); independent of
    /// the cell size.
    pub inside: u64,
    /// Boxes with at least one test.
    pub busy_boxes: u64,
}

/// The boxes of the tetrahedra of a mesh.
pub fn boxes(mesh: &TetMesh) -> Vec<Aabb> {
    (0..mesh.tets.len()).map(|t| Aabb::of_points(&mesh.corners(t))).collect()
}

/// Counts the work of a grid with cells of `cell_mm` for these boxes and particles.
pub fn grid(boxes: &[Aabb], particles: &[Vec3], cell_mm: f64) -> Result<Counts, VoxelSizeError> {
    positive("cell_mm", cell_mm)?;
    check_finite(boxes, particles)?;
    let table = Table::new(particles, cell_mm)?;
    let mut counts = Counts { boxes: boxes.len() as u64, particles: particles.len() as u64, ..Counts::default() };
    for b in boxes.iter().filter(|b| !b.is_empty()) {
        let (low, high) = (table.cell(b.min), table.cell(b.max));
        let tests = table.particles_in(low, high);
        counts.visits += (high - low + 1).to_array().iter().map(|&n| n as u64).product::<u64>();
        counts.tests += tests;
        counts.busy_boxes += u64::from(tests > 0);
        counts.inside += if tests > 0 { table.inside(b, low, high, particles) } else { 0 };
    }
    Ok(counts)
}

/// Counts the work without a grid: every box tests every particle.
pub fn brute_force(boxes: &[Aabb], particles: &[Vec3]) -> Counts {
    let inside = |b: &Aabb| particles.iter().filter(|p| b.contains(**p)).count() as u64;
    let (boxes_count, particles_count) = (boxes.len() as u64, particles.len() as u64);
    Counts {
        boxes: boxes_count,
        particles: particles_count,
        visits: 0,
        tests: boxes_count * particles_count,
        inside: boxes.iter().map(inside).sum(),
        busy_boxes: if particles.is_empty() { 0 } else { boxes_count },
    }
}

pub(crate) fn check_finite(boxes: &[Aabb], particles: &[Vec3]) -> Result<(), VoxelSizeError> {
    let bad = particles.iter().find(|p| !p.is_finite()).map(|p| ("a particle's coordinate", p.element_sum()));
    let bad_box = |b: &&Aabb| !(b.is_empty() || b.min.is_finite() && b.max.is_finite());
    let bad = bad.or_else(|| boxes.iter().find(bad_box).map(|b| ("a box's corner", (b.min + b.max).element_sum())));
    bad.map_or(Ok(()), |(field, got)| Err(VoxelSizeError::Field { field, got: got.into(), wanted: "finite" }))
}

/// Particles sorted by cell, with a summed-volume table.
pub(crate) struct Table {
    cell_mm: f64,
    low: I64Vec3,
    dims: [usize; 3],
    /// `sums[i + (nx + 1) (j + (ny + 1) k)]`: particles in cells below i, j and k.
    sums: Vec<u32>,
    /// Start of each cell's particles in `order`.
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl Table {
    pub(crate) fn new(particles: &[Vec3], cell_mm: f64) -> Result<Self, VoxelSizeError> {
        let bounds = Aabb::of_points(particles);
        let (min, max) = if particles.is_empty() { (Vec3::ZERO, Vec3::ZERO) } else { (bounds.min, bounds.max) };
        let span = (max.as_dvec3() / cell_mm).floor() - (min.as_dvec3() / cell_mm).floor() + 1.0;
        let cells = span.x * span.y * span.z;
        if cells > MAX_CELLS as f64 {
            let smallest_mm = cell_mm * (cells / MAX_CELLS as f64).cbrt();
            return Err(VoxelSizeError::TooManyCells { cell_mm, cells, limit: MAX_CELLS as f64, smallest_mm });
        }
        let dims = span.to_array().map(|n| n as usize);
        let mut table =
            Self { cell_mm, low: cell_of(min, cell_mm), dims, sums: Vec::new(), starts: Vec::new(), order: Vec::new() };
        table.sort(particles);
        table.sum();
        Ok(table)
    }

    pub(crate) fn cell(&self, p: Vec3) -> I64Vec3 {
        cell_of(p, self.cell_mm)
    }

    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.dims[0] * (j + self.dims[1] * k)
    }

    fn sort(&mut self, particles: &[Vec3]) {
        let cell_of = |p: &Vec3| self.index((self.cell(*p) - self.low).to_array().map(|n| n as usize));
        let pairs = particles.iter().enumerate().map(|(n, p)| (cell_of(p) as u32, n as u32));
        let csr = trepan_mesh::Csr::of_pairs(self.dims.iter().product(), pairs);
        (self.starts, self.order) = (csr.starts, csr.items);
    }

    fn sum(&mut self) {
        let [nx, ny, nz] = self.dims;
        let at = |i: usize, j: usize, k: usize| i + (nx + 1) * (j + (ny + 1) * k);
        self.sums = vec![0; (nx + 1) * (ny + 1) * (nz + 1)];
        for k in 0..nz {
            for j in 0..ny {
                let mut row = 0;
                for i in 0..nx {
                    let cell = self.index([i, j, k]);
                    row += self.starts[cell + 1] - self.starts[cell];
                    let below =
                        self.sums[at(i + 1, j, k + 1)] + self.sums[at(i + 1, j + 1, k)] - self.sums[at(i + 1, j, k)];
                    self.sums[at(i + 1, j + 1, k + 1)] = below + row;
                }
            }
        }
    }

    /// Cells from `low` to `high` inside the table, as half-open ranges; `None` if there are none.
    fn clipped(&self, low: I64Vec3, high: I64Vec3) -> Option<([usize; 3], [usize; 3])> {
        let dims = I64Vec3::from_array(self.dims.map(|n| n as i64));
        let from = (low - self.low).max(I64Vec3::ZERO);
        let to = (high - self.low + 1).min(dims);
        from.cmplt(to).all().then(|| (from.to_array().map(|n| n as usize), to.to_array().map(|n| n as usize)))
    }

    pub(crate) fn particles_in(&self, low: I64Vec3, high: I64Vec3) -> u64 {
        let Some((from, to)) = self.clipped(low, high) else { return 0 };
        let [nx, ny, _] = self.dims;
        let mut sum = 0i64;
        for corner in 0..8 {
            let pick = |d: usize| if corner >> d & 1 == 1 { to[d] } else { from[d] };
            let below = self.sums[pick(0) + (nx + 1) * (pick(1) + (ny + 1) * pick(2))];
            let sign = if (corner as u32).count_ones() % 2 == 1 { 1 } else { -1 };
            sum += sign * i64::from(below);
        }
        sum as u64
    }

    fn inside(&self, b: &Aabb, low: I64Vec3, high: I64Vec3, particles: &[Vec3]) -> u64 {
        let mut found = 0;
        self.each_in(low, high, |n| found += u64::from(b.contains(particles[n as usize])));
        found
    }

    /// Calls `visit` with each particle in the cells from `low` to `high`.
    pub(crate) fn each_in(&self, low: I64Vec3, high: I64Vec3, mut visit: impl FnMut(u32)) {
        let Some((from, to)) = self.clipped(low, high) else { return };
        for k in from[2]..to[2] {
            for j in from[1]..to[1] {
                let (first, last) = (self.index([from[0], j, k]), self.index([to[0] - 1, j, k]));
                let row = &self.order[self.starts[first] as usize..self.starts[last + 1] as usize];
                row.iter().for_each(|&n| visit(n));
            }
        }
    }
}

fn cell_of(p: Vec3, cell_mm: f64) -> I64Vec3 {
    let cell: DVec3 = (p.as_dvec3() / cell_mm).floor();
    cell.as_i64vec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plain(boxes: &[Aabb], particles: &[Vec3], cell: f64) -> (u64, u64) {
        let mut totals = (0, 0);
        for b in boxes {
            let (low, high) = (cell_of(b.min, cell), cell_of(b.max, cell));
            for k in low.z..=high.z {
                for j in low.y..=high.y {
                    for i in low.x..=high.x {
                        totals.0 += 1;
                        totals.1 +=
                            particles.iter().filter(|p| cell_of(**p, cell) == I64Vec3::new(i, j, k)).count() as u64;
                    }
                }
            }
        }
        totals
    }

    fn point() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-5.0f32..5.0).prop_map(Vec3::from)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn counts_are_those_of_the_plain_loops(particles in prop::collection::vec(point(), 0..40),
                                               boxes in prop::collection::vec((point(), point()), 0..20), cell in 0.4f64..6.0) {
            let boxes: Vec<Aabb> = boxes.into_iter().map(|(a, b)| Aabb { min: a.min(b), max: a.max(b) }).collect();
            let counts = grid(&boxes, &particles, cell).unwrap();
            prop_assert_eq!((counts.visits, counts.tests), plain(&boxes, &particles, cell));
            let brute = brute_force(&boxes, &particles);
            prop_assert_eq!(counts.inside, brute.inside);
            prop_assert!(counts.tests <= brute.tests);
        }
    }

    #[test]
    fn bad_sizes_are_refused() {
        let particles = [Vec3::ZERO, Vec3::splat(100.0)];
        assert!(matches!(grid(&[], &particles, 0.0), Err(VoxelSizeError::Field { field: "cell_mm", .. })));
        assert!(matches!(grid(&[], &particles, f64::NAN), Err(VoxelSizeError::Field { .. })));
        let error = grid(&[], &particles, 0.1).unwrap_err();
        assert!(
            matches!(error, VoxelSizeError::TooManyCells { smallest_mm, .. } if (0.4..0.6).contains(&smallest_mm)),
            "{error}"
        );
        assert!(matches!(grid(&[], &[Vec3::NAN], 1.0), Err(VoxelSizeError::Field { .. })));
        let far = Aabb { min: Vec3::ZERO, max: Vec3::INFINITY };
        assert!(matches!(grid(&[far], &particles, 1.0), Err(VoxelSizeError::Field { .. })));
    }
}
