//! Times of a grid's passes that a busy machine does not spoil: the least of many, in turn, slice
//! by slice.
//!
//! # Practice
//! A pass is timed in slices of some 50 us, each far shorter than the turns in which a busy machine
//! shares its cores out; the least time of every slice over all rounds counts, and a pass takes
//! their sum.

use super::pass::HashedGrid;
use super::scene::Scene;
use glam::DVec3;
use std::time::Instant;
use trepan_geometry::{Aabb, Vec3};
use trepan_voxel_size::counts::Counts;
use trepan_voxel_size::{Expected, Prices, Work, fit};

/// Placements of the grid against the scene, over which times are averaged.
const PLACEMENTS: usize = 3;
/// Boxes in one slice.
const SLICE: usize = 512;
/// Rounds between two looks at whether the halves agree.
const BLOCK: usize = 8;
/// Halves of the rounds that differ by no more than this at any size agree.
const AGREED: f64 = 0.01;
/// Sizes that are timed for the prices, in mean edges.
const CALIBRATION: [f64; 7] = [0.4, 0.6, 0.9, 1.3, 1.9, 2.8, 4.0];
/// How far a tuned formula looks beyond the first constants when the outermost is best.
const BEYOND: f64 = 4.0;
/// Boxes that are timed for the prices; the others cost the same.
const SAMPLE: usize = 3_000;
/// Neighbouring boxes that are sampled together.
const RUN: usize = 128;
/// Time for the rounds over some sizes, ms, and how many are made at least.
const CALIBRATION_MS: (f64, usize) = (25.0, 4);

/// The least time of each size, µs: of the even rounds, and of the odd ones.
pub struct Least {
    /// Of the even rounds, from which a size is chosen.
    pub choose: Vec<f64>,
    /// Of the odd ones, by which it is judged.
    pub judge: Vec<f64>,
    /// Number of rounds.
    pub rounds: usize,
}

impl Least {
    /// The largest difference between the two halves, as a share.
    pub fn apart(&self) -> f64 {
        self.choose.iter().zip(&self.judge).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
    }
}

/// The size of a formula times the constant that is cheapest, mm.
///
/// Tries seven constants, then as many sizes as this crate's rule, between the neighbours of the
/// best. `cheapest` gives the number of the cheapest size.
pub fn tuned(formula_mm: f64, candidates: usize, mut cheapest: impl FnMut(&[f64]) -> Option<usize>) -> Option<f64> {
    let first = CALIBRATION.map(|constant| constant * formula_mm);
    let best = cheapest(&first)?;
    let low = if best == 0 { first[0] / BEYOND } else { first[best - 1] };
    let high = if best + 1 == first.len() { first[best] * BEYOND } else { first[best + 1] };
    let between = |n: usize| low * (high / low).powf((n + 1) as f64 / (candidates + 1) as f64);
    let second: Vec<f64> = (0..candidates.max(1)).map(between).collect();
    cheapest(&second).map(|n| second[n])
}

/// Number of the size with the cheapest pass over the scene, by the time that a calibration takes.
pub fn cheapest(scene: &Scene, cells: &[f64]) -> Option<usize> {
    let (mut grid, (least_ms, least_rounds)) = (HashedGrid::default(), CALIBRATION_MS);
    let mut slices: Vec<Slices> = cells.iter().map(|_| Slices::default()).collect();
    let (start, mut rounds) = (Instant::now(), 0);
    while rounds < least_rounds || start.elapsed().as_secs_f64() * 1e3 < least_ms {
        for (slices, cell) in slices.iter_mut().zip(cells) {
            slices.pass(&mut grid, &scene.boxes, &scene.particles, *cell, DVec3::splat(0.37 * cell));
        }
        rounds += 1;
    }
    (0..cells.len()).min_by(|&a, &b| slices[a].sum_us().total_cmp(&slices[b].sum_us()))
}

/// Rounds over all sizes, so that a slow moment of the machine meets every size, until the halves
/// agree or `most` are done.
///
/// `calibration` gets a round in each, so that prices and times are of the same moments of the
/// machine.
pub fn least(scene: &Scene, cells: &[f64], calibration: &mut Calibration, most: usize) -> Least {
    let mut random = fastrand::Rng::with_seed(23);
    let places: [DVec3; PLACEMENTS] = std::array::from_fn(|_| DVec3::new(random.f64(), random.f64(), random.f64()));
    let mut grid = HashedGrid::default();
    let half = || vec![std::array::from_fn::<_, PLACEMENTS, _>(|_| Slices::default()); cells.len()];
    let mut halves = [half(), half()];
    let mut rounds = 0;
    loop {
        for (least, cell) in halves[rounds % 2].iter_mut().zip(cells) {
            for (least, place) in least.iter_mut().zip(places) {
                least.pass(&mut grid, &scene.boxes, &scene.particles, *cell, place * *cell);
            }
        }
        calibration.round();
        rounds += 1;
        if rounds.is_multiple_of(BLOCK) {
            let mean = |half: &Vec<[Slices; PLACEMENTS]>| {
                half.iter().map(|places| places.iter().map(Slices::sum_us).sum::<f64>() / PLACEMENTS as f64).collect()
            };
            let found = Least { choose: mean(&halves[0]), judge: mean(&halves[1]), rounds };
            if found.apart() < AGREED || rounds >= most {
                return found;
            }
        }
    }
}

/// The least times of a pass so far, µs: of sorting the particles, then of every slice of the
/// boxes.
#[derive(Clone, Debug, Default)]
struct Slices(Vec<f64>);

impl Slices {
    /// Once more; gives the work done.
    fn pass(&mut self, grid: &mut HashedGrid, boxes: &[Aabb], particles: &[Vec3], cell: f64, offset: DVec3) -> Counts {
        self.0.resize(1 + boxes.len().div_ceil(SLICE), f64::INFINITY);
        let mut counts = Counts::default();
        let start = Instant::now();
        grid.place(particles, cell, offset);
        self.0[0] = self.0[0].min(start.elapsed().as_secs_f64() * 1e6);
        for (least, slice) in self.0[1..].iter_mut().zip(boxes.chunks(SLICE)) {
            let start = Instant::now();
            let work = std::hint::black_box(grid.look(slice));
            *least = least.min(start.elapsed().as_secs_f64() * 1e6);
            (counts.visits, counts.tests) = (counts.visits + work.visits, counts.tests + work.tests);
        }
        counts
    }

    fn sum_us(&self) -> f64 {
        self.0.iter().sum()
    }
}

/// Passes of a sample of the boxes at a few sizes; the least time counts, against the work that was
/// really done.
pub struct Calibration<'a> {
    scene: &'a Scene,
    sample: Vec<Aabb>,
    of_sample: Expected,
    grid: HashedGrid,
    sizes: Vec<Timed>,
}

/// A cell size, what a pass over the sample does with it, and what it took.
struct Timed {
    cell_mm: f64,
    slices: Slices,
    work: Work,
}

impl<'a> Calibration<'a> {
    /// Rounds over `CALIBRATION` for `CALIBRATION_MS`.
    pub fn of(scene: &'a Scene, usual: f64) -> Self {
        let sample = sample(scene);
        let of_sample = Expected::of(&sample, &[], usual).expect("the scene is finite");
        let mut calibration = Self { scene, sample, of_sample, grid: HashedGrid::default(), sizes: Vec::new() };
        calibration.time(CALIBRATION.map(|share| share * usual).into_iter());
        calibration
    }

    /// Times more sizes and gives the cheapest: what no model knows, such as a lattice that the
    /// cells fit, is seen here. The sample says how far off the model is at a size, the model what
    /// a whole pass does there.
    pub fn cheapest_of(&mut self, cells: &[f64], of_all: &Expected) -> Option<f64> {
        let known = self.sizes.len();
        self.time(cells.iter().copied());
        let (of_sample, prices) = (self.sample_prices(), self.prices());
        let whole_us = |t: &Timed| t.slices.sum_us() / of_sample.time(&t.work) * of_all.time(&prices, t.cell_mm);
        let cheapest = self.sizes[known..].iter().min_by(|a, b| whole_us(a).total_cmp(&whole_us(b)));
        cheapest.map(|timed| timed.cell_mm)
    }

    /// Adds sizes, and rounds over them for [`CALIBRATION_MS`].
    fn time(&mut self, cells: impl Iterator<Item = f64>) {
        let known = self.sizes.len();
        self.sizes.extend(cells.map(|cell_mm| Timed { cell_mm, slices: Slices::default(), work: Work::default() }));
        let (least_ms, least_rounds) = CALIBRATION_MS;
        let start = Instant::now();
        let mut rounds = 0;
        while rounds < least_rounds || start.elapsed().as_secs_f64() * 1e3 < least_ms {
            self.round_from(known);
            rounds += 1;
        }
    }

    /// Every size once.
    fn round(&mut self) {
        self.round_from(0);
    }

    fn round_from(&mut self, first: usize) {
        for Timed { cell_mm, slices, work } in &mut self.sizes[first..] {
            let offset = DVec3::splat(0.37 * *cell_mm);
            let counts = slices.pass(&mut self.grid, &self.sample, &self.scene.particles, *cell_mm, offset);
            let doubts = self.of_sample.doubts(*cell_mm);
            *work = Work { visits: counts.visits as f64, doubts, tests: counts.tests as f64 };
        }
    }

    /// What the least times of all rounds so far say of the sample.
    fn sample_prices(&self) -> Prices {
        let measured: Vec<_> = self.sizes.iter().map(|timed| (timed.work, timed.slices.sum_us())).collect();
        fit(&measured).unwrap_or(Prices { fixed: 0.0, visit: 1.0, doubt: 0.0, test: 5.0 })
    }

    /// What they say of the whole scene: the same, but for more boxes.
    pub fn prices(&self) -> Prices {
        let prices = self.sample_prices();
        let sort_us = self.sizes.iter().map(|timed| timed.slices.0[0]).fold(f64::INFINITY, f64::min);
        let share = self.scene.boxes.len() as f64 / self.sample.len() as f64;
        Prices { fixed: sort_us + (prices.fixed - sort_us).max(0.0) * share, ..prices }
    }
}

/// Runs of neighbouring boxes, half of them from where the particles are, spread evenly. Single
/// boxes would find neither caches nor branches as a whole pass does.
fn sample(scene: &Scene) -> Vec<Aabb> {
    let touched = Aabb::of_points(&scene.particles);
    let is_near = |run: &&[Aabb]| run.iter().any(|b| b.overlaps(touched));
    let (near, far): (Vec<_>, Vec<_>) = scene.boxes.chunks(RUN).partition(is_near);
    let spread = |runs: Vec<&'_ [Aabb]>| {
        let stride = (runs.len() * RUN).div_ceil(SAMPLE / 2).max(1);
        runs.into_iter().step_by(stride).flatten().copied().collect::<Vec<Aabb>>()
    };
    [spread(near), spread(far)].concat()
}
