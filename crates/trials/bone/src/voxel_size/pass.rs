//! One pass of a hashed uniform grid, to be timed: particles sorted into cells, boxes looking
//! through the cells they cover (Teschner et al. 2003).

use glam::DVec3;
use trepan_geometry::{Aabb, Vec3};

/// Buckets for each particle: few cells share one.
const BUCKETS: usize = 8;

/// What a pass did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Entries of cells that were looked at.
    pub visits: u64,
    /// Boxes that were tested.
    pub tests: u64,
    /// Particles that lay in a box.
    pub inside: u64,
}

/// The grid's memory, kept from pass to pass.
#[derive(Default)]
pub struct HashedGrid {
    starts: Vec<u32>,
    bucket_of: Vec<u32>,
    items: Vec<(u64, Vec3)>,
    cell_mm: f64,
    offset: DVec3,
}

impl HashedGrid {
    /// Sorts the particles into cells of `cell_mm` whose corner lies at −`offset`.
    pub fn place(&mut self, particles: &[Vec3], cell_mm: f64, offset: DVec3) {
        (self.cell_mm, self.offset) = (cell_mm, offset);
        self.sort(particles, |p| cell_of(p, cell_mm, offset));
    }

    /// Boxes against the particles in the cells that they cover.
    pub fn look(&self, boxes: &[Aabb]) -> Work {
        let cell = |p: Vec3| cell_of(p, self.cell_mm, self.offset);
        let mut work = Work::default();
        for b in boxes {
            let (low, high) = (cell(b.min), cell(b.max));
            for k in low[2]..=high[2] {
                for j in low[1]..=high[1] {
                    for i in low[0]..=high[0] {
                        self.visit([i, j, k], b, &mut work);
                    }
                }
            }
        }
        work
    }

    fn visit(&self, cell: [i32; 3], b: &Aabb, work: &mut Work) {
        work.visits += 1;
        let bucket = hash(cell, self.starts.len() - 1);
        let range = self.starts[bucket] as usize..self.starts[bucket + 1] as usize;
        for &(own, p) in &self.items[range] {
            if own == key(cell) {
                work.tests += 1;
                work.inside += u64::from(b.contains(p));
            }
        }
    }

    /// Counting sort of the particles by bucket.
    fn sort(&mut self, particles: &[Vec3], cell: impl Fn(Vec3) -> [i32; 3]) {
        let buckets = (BUCKETS * particles.len()).next_power_of_two();
        self.starts.clear();
        self.starts.resize(buckets + 1, 0);
        self.bucket_of.clear();
        self.bucket_of.extend(particles.iter().map(|&p| hash(cell(p), buckets) as u32));
        self.bucket_of.iter().for_each(|&b| self.starts[b as usize] += 1);
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        self.items.clear();
        self.items.resize(particles.len(), (0, Vec3::ZERO));
        for (&p, &bucket) in particles.iter().zip(&self.bucket_of) {
            let at = &mut self.starts[bucket as usize];
            *at -= 1;
            self.items[*at as usize] = (key(cell(p)), p);
        }
    }
}

/// `floor((p + offset) / cell)`, without the library's floor: a call for each coordinate took
/// longer than the visits.
#[inline]
fn cell_of(p: Vec3, cell_mm: f64, offset: DVec3) -> [i32; 3] {
    ((p.as_dvec3() + offset) / cell_mm).to_array().map(|x| {
        let towards_zero = x as i32;
        towards_zero - i32::from(f64::from(towards_zero) > x)
    })
}

fn key(cell: [i32; 3]) -> u64 {
    cell.iter().fold(0, |key, &n| key << 21 | (n as u64 & 0x1F_FFFF))
}

/// Bucket of a cell, of a power of two of them, by Knuth's multiplication. Teschner's xor of three
/// products leaves most of such a table empty when particles lie on a lattice: all that meet in a
/// bucket are then looked at in vain.
fn hash(cell: [i32; 3], buckets: usize) -> usize {
    (key(cell).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> (u64::BITS - buckets.trailing_zeros())) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_voxel_size::counts;

    #[test]
    fn it_does_what_the_counts_say() {
        let mut random = fastrand::Rng::with_seed(5);
        let mut point = |size: f32| size * Vec3::new(random.f32(), random.f32(), random.f32());
        let particles: Vec<Vec3> = (0..500).map(|_| point(20.0) - Vec3::splat(7.0)).collect();
        let boxes: Vec<Aabb> = (0..400)
            .map(|_| point(20.0) - Vec3::splat(9.0))
            .map(|min| Aabb { min, max: min + Vec3::new(2.0, 3.0, 1.0) })
            .collect();
        let mut grid = HashedGrid::default();
        for cell_mm in [0.7, 2.3, 9.0] {
            let counted = counts::grid(&boxes, &particles, cell_mm).unwrap();
            grid.place(&particles, cell_mm, DVec3::ZERO);
            let done = grid.look(&boxes);
            assert_eq!([done.visits, done.tests, done.inside], [counted.visits, counted.tests, counted.inside]);
        }
    }
}
