//! Expected work of a grid for given boxes and particles, as a smooth function of the cell size.
//!
//! # Theory
//! Let the grid's position be uniformly distributed. On one axis a box of width w covers w/δ + 1
//! cells of edge δ on average, and tests a particle at a gap g with probability max(0, 1 − g/δ) (1
//! inside). The axes are independent, so
//!
//! ```text
//! visits(δ) = Σ boxes  Π (w_d/δ + 1)          tests(δ) = Σ boxes, particles  Π max(0, 1 − g_d/δ)
//! ```
//!
//! exactly, in the mean over placements. A processor predicts when the loop over a box's cells
//! ends. On one axis there are ⌊w/δ⌋ + 2 cells with probability f = frac(w/δ) and one less
//! otherwise, so that the misprediction probability is min(f, 1 − f), each costing as much as
//! several visits: `doubts(δ) = Σ boxes Σ_d min(f_d, 1 − f_d)`. The thesis's formula has a single
//! box size, s, one cell too many on each axis, and estimates particles from facets. This model
//! uses the actual data: a tool's points, graded meshes, any overlap.
//!
//! # Practice
//! Gaps up to a reach are stored, so that δ may be at most that. At most [`MAX_GAPS`] are stored:
//! with more, every second, third … box represents its neighbours.

use crate::counts::Table;
use crate::error::{VoxelSizeError, checked, positive};
use crate::{Prices, Work, cost::golden_section};
use glam::{DVec3, Vec3};
use trepan_geometry::Aabb;

/// Most pairs of a box and a particle that are stored.
pub const MAX_GAPS: usize = 300_000;
/// Most box sizes that are stored.
const MAX_SIZES: usize = 4_096;
/// Candidates on each side of the best size.
const CANDIDATES_EACH_WAY: i32 = 8;
const CANDIDATE_STEP: f64 = 1.07;
/// Ratio to the lowest expected cost up to which a size is a candidate.
const WORTH_TIMING: f64 = 1.12;

/// Statistics of boxes and particles for the expected work.
#[derive(Clone, Debug)]
pub struct Expected {
    /// Σ of 1, w_x + w_y + w_z, w_x w_y + w_y w_z + w_z w_x and w_x w_y w_z over the boxes.
    moments: [f64; 4],
    /// Gaps between boxes and particles, mm, 0 inside.
    gaps: Vec<Vec3>,
    /// Number of pairs that each gap represents.
    weight: f64,
    /// Sizes of boxes, mm, and the number of boxes that each represents.
    sizes: Vec<DVec3>,
    boxes_per_size: f64,
    reach_mm: f64,
}

impl Expected {
    /// Computes the statistics for cells of up to `reach_mm`.
    pub fn of(boxes: &[Aabb], particles: &[Vec3], reach_mm: f64) -> Result<Self, VoxelSizeError> {
        positive("reach_mm", reach_mm)?;
        crate::counts::check_finite(boxes, particles)?;
        let table = Table::new(particles, reach_mm)?;
        let boxes: Vec<Aabb> = boxes.iter().copied().filter(|b| !b.is_empty()).collect();
        let near = |b: &Aabb| table.particles_in(table.cell(b.min) - 1, table.cell(b.max) + 1) as usize;
        let stride = boxes.iter().map(near).sum::<usize>().div_ceil(MAX_GAPS).max(1);
        let mut gaps = Vec::new();
        for b in boxes.iter().step_by(stride) {
            table.each_in(table.cell(b.min) - 1, table.cell(b.max) + 1, |n| {
                let p = particles[n as usize];
                let gap = (b.min - p).max(p - b.max).max(Vec3::ZERO);
                if gap.max_element() < reach_mm as f32 {
                    gaps.push(gap);
                }
            });
        }
        let every = boxes.len().div_ceil(MAX_SIZES).max(1);
        let sizes: Vec<DVec3> = boxes.iter().step_by(every).map(|b| b.size().as_dvec3()).collect();
        let boxes_per_size = boxes.len() as f64 / sizes.len().max(1) as f64;
        Ok(Self { moments: moments(&boxes), gaps, weight: stride as f64, sizes, boxes_per_size, reach_mm })
    }

    /// Expected number of cells visited with cells of `delta_mm`.
    pub fn visits(&self, delta_mm: f64) -> f64 {
        let [n, w, ww, www] = self.moments;
        n + (w + (ww + www / delta_mm) / delta_mm) / delta_mm
    }

    /// Expected number of particles tested with cells of `delta_mm`, at most the reach.
    pub fn tests(&self, delta_mm: f64) -> f64 {
        let per_mm = (1.0 / delta_mm) as f32;
        let chance = |gap: &Vec3| f64::from((Vec3::ONE - *gap * per_mm).max(Vec3::ZERO).element_product());
        self.weight * self.gaps.iter().map(chance).sum::<f64>()
    }

    /// Expected number of mispredicted loop ends, with cells of `delta_mm`.
    pub fn doubts(&self, delta_mm: f64) -> f64 {
        let even = |size: &DVec3| (*size / delta_mm).fract();
        self.boxes_per_size * self.sizes.iter().map(|s| even(s).min(1.0 - even(s)).element_sum()).sum::<f64>()
    }

    /// Expected work with cells of `delta_mm`, at most the reach.
    pub fn work(&self, delta_mm: f64) -> Work {
        Work { visits: self.visits(delta_mm), doubts: self.doubts(delta_mm), tests: self.tests(delta_mm) }
    }

    /// Expected time of a pass, in the unit of the costs.
    pub fn time(&self, prices: &Prices, delta_mm: f64) -> f64 {
        prices.time(&self.work(delta_mm))
    }

    /// The cheapest cell edge from `low_mm` up to the reach, mm.
    pub fn best(&self, prices: &Prices, low_mm: f64) -> Result<f64, VoxelSizeError> {
        checked("low_mm", low_mm, low_mm > 0.0 && low_mm < self.reach_mm, "positive and under the reach")?;
        positive("visit", prices.visit)?;
        for (field, price) in [("doubt", prices.doubt), ("test", prices.test)] {
            checked(field, price, price >= 0.0 && price.is_finite(), "0 or more and finite")?;
        }
        const STEPS: usize = 24;
        let (low, high) = (low_mm.ln(), self.reach_mm.ln());
        let at = |n: usize| low + (high - low) * n as f64 / STEPS as f64;
        let cost = |log: f64| self.time(prices, log.exp());
        let costs: Vec<f64> = (0..=STEPS).map(|n| cost(at(n))).collect();
        let cheapest = (0..=STEPS).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
        let best = golden_section(cost, at(cheapest.saturating_sub(1)), at((cheapest + 1).min(STEPS)), 24);
        Ok(best.exp())
    }

    /// Sizes around the best one with little higher expected cost, mm, the best one first:
    /// candidates for timing on a sample of the boxes.
    ///
    /// No model covers everything, for example cells that match a mesh's lattice. The sample shows
    /// the model's error at each size; so take the size with the least
    /// `measured(sample) / expected(sample) · expected(all)`.
    pub fn candidates(&self, prices: &Prices, best_mm: f64) -> Vec<f64> {
        let enough = WORTH_TIMING * self.time(prices, best_mm);
        let size = |n: i32| best_mm * CANDIDATE_STEP.powi(n);
        let good = |n: &i32| size(*n) <= self.reach_mm && self.time(prices, size(*n)) <= enough;
        let larger = (0..CANDIDATES_EACH_WAY).take_while(good);
        larger.chain((1..CANDIDATES_EACH_WAY).map(|n| -n).take_while(good)).map(size).collect()
    }
}

fn moments(boxes: &[Aabb]) -> [f64; 4] {
    let mut sums = [0.0; 4];
    for b in boxes {
        let [x, y, z] = b.size().as_dvec3().to_array();
        [1.0, x + y + z, x * y + y * z + z * x, x * y * z].iter().zip(&mut sums).for_each(|(m, sum)| *sum += m);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts;

    fn random(seed: &mut u64) -> f32 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 40) as f32 / (1 << 24) as f32
    }

    fn scene() -> (Vec<Aabb>, Vec<Vec3>) {
        let mut seed = 7;
        let mut point = |size: f32| size * Vec3::new(random(&mut seed), random(&mut seed), random(&mut seed));
        let boxes: Vec<(Vec3, Vec3)> = (0..400).map(|_| (point(20.0), point(3.0))).collect();
        let boxes = boxes.into_iter().map(|(min, size)| Aabb { min, max: min + size }).collect();
        (boxes, (0..300).map(|_| point(12.0) + Vec3::splat(4.0)).collect())
    }

    #[test]
    fn it_is_the_mean_over_placements_of_the_grid() {
        let (boxes, particles) = scene();
        let expected = Expected::of(&boxes, &particles, 6.0).unwrap();
        let mut seed = 3;
        for delta in [0.7, 1.5, 4.0] {
            let (mut visits, mut tests) = (0.0, 0.0);
            for _ in 0..200 {
                let shift = delta as f32 * Vec3::new(random(&mut seed), random(&mut seed), random(&mut seed));
                let boxes: Vec<Aabb> = boxes.iter().map(|b| Aabb { min: b.min + shift, max: b.max + shift }).collect();
                let particles: Vec<Vec3> = particles.iter().map(|p| *p + shift).collect();
                let counts = counts::grid(&boxes, &particles, delta).unwrap();
                visits += counts.visits as f64 / 200.0;
                tests += counts.tests as f64 / 200.0;
            }
            assert!((expected.visits(delta) / visits - 1.0).abs() < 0.01, "{} {visits}", expected.visits(delta));
            assert!((expected.tests(delta) / tests - 1.0).abs() < 0.02, "{} {tests}", expected.tests(delta));
        }
    }

    #[test]
    fn boxes_of_one_size_leave_no_doubt_where_cells_fit_them() {
        let unit = |at: f32| Aabb { min: Vec3::splat(at), max: Vec3::splat(at + 3.0) };
        let expected = Expected::of(&[unit(0.0), unit(0.3), unit(7.1)], &[], 6.0).unwrap();
        for (delta, doubts) in [(1.0, 0.0), (1.5, 0.0), (3.0, 0.0), (2.0, 4.5), (4.0, 2.25)] {
            assert!((expected.doubts(delta) - doubts).abs() < 1e-5, "{delta}: {}", expected.doubts(delta));
        }
        assert_eq!(expected.work(2.0).doubts, expected.doubts(2.0));
    }

    #[test]
    fn the_best_size_is_no_dearer_than_any_other() {
        let (boxes, particles) = scene();
        let expected = Expected::of(&boxes, &particles, 8.0).unwrap();
        let prices = Prices { fixed: 0.0, visit: 1.0, doubt: 0.0, test: 5.0 };
        let best = expected.best(&prices, 0.1).unwrap();
        for n in 1..80 {
            assert!(expected.time(&prices, 0.1 * n as f64) >= expected.time(&prices, best) * (1.0 - 1e-9));
        }
        assert!((expected.best(&Prices { test: 0.0, ..prices }, 0.1).unwrap() - 8.0).abs() < 1e-3);
    }

    #[test]
    fn candidates_lie_around_the_best_and_cost_little_more() {
        let (boxes, particles) = scene();
        let expected = Expected::of(&boxes, &particles, 6.0).unwrap();
        let prices = Prices { fixed: 50.0, visit: 1.0, doubt: 0.0, test: 5.0 };
        let best = expected.best(&prices, 0.1).unwrap();
        let sizes = expected.candidates(&prices, best);
        assert_eq!(sizes[0], best);
        assert!(sizes.iter().any(|&s| s > best) && sizes.iter().any(|&s| s < best), "{sizes:?}");
        assert!(sizes.iter().all(|&s| s <= 6.0 && expected.time(&prices, s) < 1.13 * expected.time(&prices, best)));
    }

    #[test]
    fn bad_numbers_are_named() {
        let (boxes, particles) = scene();
        let field = |e: VoxelSizeError| matches!(e, VoxelSizeError::Field { .. });
        assert!(field(Expected::of(&boxes, &particles, 0.0).unwrap_err()));
        assert!(field(Expected::of(&boxes, &[Vec3::NAN], 1.0).unwrap_err()));
        let expected = Expected::of(&boxes, &particles, 2.0).unwrap();
        assert!(field(expected.best(&Prices { fixed: 0.0, visit: 0.0, doubt: 0.0, test: 1.0 }, 0.1).unwrap_err()));
        assert!(field(expected.best(&Prices { fixed: 0.0, visit: 1.0, doubt: 0.0, test: 1.0 }, 3.0).unwrap_err()));
    }
}
