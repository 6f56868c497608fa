//! The best cell edge of a uniform grid: the thesis's formula, the usual rule and our model against a ladder of measured sizes.

mod pass;
mod scene;

use super::Scope;
use crate::suite::{Findings, Gate, Row};
use glam::DVec3;
use pass::HashedGrid;
use scene::{Body, Scene, Touch};
use std::time::Instant;
use trepan_geometry::Aabb;
use trepan_voxel_size::{CostModel, Expected, Measures, Prices, counts, fit, zone_error};

/// Tables 5.2 and 5.3 of the thesis, in cells per axis: tetrahedra, low, best, high, analytic, mean edge; errors of the last two.
const TABLE: [[f64; 8]; 5] = [
    [41_937.0, 20.0, 28.33, 39.0, 28.73, 41.90, 0.038, 1.272],
    [52_326.0, 22.0, 28.16, 38.0, 30.94, 45.16, 0.283, 1.727],
    [60_688.0, 16.0, 34.04, 54.0, 32.49, 47.40, 0.086, 0.669],
    [72_631.0, 8.0, 26.63, 47.0, 34.48, 50.29, 0.385, 1.162],
    [80_927.0, 20.0, 37.87, 57.0, 35.65, 51.90, 0.124, 0.734],
];
/// The name of our rule in the rows.
const OURS: &str = "expected work";
/// Sizes of the ladder, the first in mean edges, and the step between them.
const LADDER: (usize, f64, f64) = (26, 0.3, 1.11);
/// A size belongs to the good zone up to this much over the best time.
const ZONE: f64 = 1.10;
/// Sizes that are timed for the prices, in mean edges.
const CALIBRATION: [f64; 7] = [0.4, 0.6, 0.9, 1.3, 1.9, 2.8, 4.0];
/// Boxes that are timed for the prices; the others cost the same.
const SAMPLE: usize = 6_000;
/// Passes at each of these sizes.
const PASSES: usize = 4;

/// What the scenes found, for the gates over all.
#[derive(Default)]
struct Totals {
    regrets: Vec<f64>,
    /// Measured and predicted times, µs, with their scene's number.
    times: Vec<(usize, f64, f64)>,
    calibration_ms: Vec<f64>,
}

/// Every rule in every scene.
pub fn run(scope: Scope) -> Findings {
    let mut findings = Findings::default();
    let mut totals = Totals::default();
    for (number, &(body, table_row)) in bodies(scope).iter().enumerate() {
        if scope.takes(number) {
            let mesh = scene::mesh(body);
            for touch in [Touch::Twin(0.01), Touch::Twin(0.05), Touch::Tool, Touch::Cloud] {
                let row = table_row.filter(|_| matches!(touch, Touch::Twin(share) if share < 0.02));
                rules(&Scene::new(body, &mesh, touch, row), scope, &mut totals, &mut findings);
            }
        }
    }
    sum_up(&totals, scope, &mut findings);
    findings
}

fn bodies(scope: Scope) -> Vec<(Body, Option<usize>)> {
    if scope.quick {
        return vec![(Body::Ball(8000), None), (Body::Graded(8000), None)];
    }
    let spheres = TABLE.iter().enumerate().map(|(n, row)| (Body::Ball(row[0] as usize), Some(n)));
    let others =
        [Body::Graded(8000), Body::Graded(40_000), Body::Torus(30_000), Body::Brain(15_000), Body::Brain(60_000)];
    spheres.chain(others.map(|body| (body, None))).collect()
}

/// Times the ladder and every rule's size in turn, round by round.
fn rules(scene: &Scene, scope: Scope, totals: &mut Totals, findings: &mut Findings) {
    let measures = Measures::of(&scene.mesh).expect("the mesh is sound");
    let usual = measures.traditional_mm();
    let (steps, first, step) = LADDER;
    let ladder: Vec<f64> = (0..steps).map(|i| usual * first * step.powi(i as i32)).collect();
    let start = Instant::now();
    let reach = ladder[steps - 1] * 1.001;
    let expected = Expected::of(&scene.boxes, &scene.particles, reach).expect("the scene is finite");
    let prices = calibrated(scene, usual);
    let ours = expected.best(&prices, ladder[0]).unwrap_or(usual);
    let calibration_ms = start.elapsed().as_secs_f64() * 1e3;
    let busy = counts::grid(&scene.boxes, &scene.particles, usual).map_or(0, |c| c.busy_boxes);
    let p_nc = 1.0 - (busy as f64 / scene.boxes.len() as f64).clamp(1e-4, 1.0);
    let thesis = CostModel::default().analytic(&measures).expect("the default model is sound");
    let priced = prices.model(p_nc).and_then(|model| model.analytic(&measures)).unwrap_or(thesis);
    let mut cells = ladder.clone();
    cells.extend([thesis, priced, usual, 1.45 * usual, ours]);
    let rounds = rounds(scene, &cells, scope.pick(8, 16));
    // The best size is chosen on one half of the rounds and every size judged on the other, so that luck does not make it better.
    let (choose, judge) = (times(&rounds, 0, 2), times(&rounds, 1, 2));
    let best = (0..steps).min_by(|&a, &b| choose[a].total_cmp(&choose[b])).unwrap_or(0);
    let zone = zone(&ladder, &choose[..steps], best);
    let number = totals.calibration_ms.len();
    totals.calibration_ms.push(calibration_ms);
    totals.times.extend((0..steps).map(|n| (number, judge[n], expected.time(&prices, ladder[n]))));
    totals.regrets.push(judge[steps + 4] / judge[best] - 1.0);
    let axis_mm = f64::from(2.0 * scene.mesh.bounds().size().max_element());
    let names =
        ["thesis analytic", "thesis, measured prices", "mean edge", "1.45 x mean edge", OURS, "best of the ladder"];
    for (rule, at) in names.into_iter().zip([steps, steps + 1, steps + 2, steps + 3, steps + 4, best]) {
        let [low, middle, high] = zone.map(|size| axis_mm / size);
        findings.rows.push(
            Row::new(&scene.name, rule)
                .with("tets", scene.mesh.tets.len())
                .with("particles", scene.particles.len())
                .with("cell_mm", cells[at])
                .with("cells_per_axis", axis_mm / cells[at])
                .with("zone_cells_per_axis", vec![low, middle, high])
                .with("colliding_percent", 100.0 * (1.0 - p_nc))
                .with("visit_ns", 1e3 * prices.visit)
                .with("test_ns", 1e3 * prices.test)
                .metric("cost_us", judge[at])
                .metric("regret_percent", 100.0 * (judge[at] / judge[best] - 1.0))
                .metric("zone_error", zone_error(axis_mm / cells[at], low, middle, high))
                .metric("predicted_us", expected.time(&prices, cells[at].min(reach)))
                .metric("calibration_ms", calibration_ms),
        );
    }
    if let Some(row) = scene.table_row {
        beside_the_table(&scene.name, row, thesis / usual, findings);
    }
}

/// Prices from a few passes of a sample of the boxes at each of a few sizes; the least time counts, against the work that was really done.
fn calibrated(scene: &Scene, usual: f64) -> Prices {
    let stride = scene.boxes.len().div_ceil(SAMPLE).max(1);
    let sample: Vec<Aabb> = scene.boxes.iter().step_by(stride).copied().collect();
    let mut grid = HashedGrid::default();
    let mut least = |boxes: &[Aabb], cell: f64| {
        let mut best = (counts::Counts::default(), f64::INFINITY);
        for _ in 0..PASSES {
            let start = Instant::now();
            let work = grid.pass(boxes, &scene.particles, cell, DVec3::splat(0.37 * cell));
            let (visits, tests) = (work.visits, work.tests);
            let counted = counts::Counts { visits, tests, ..Default::default() };
            best = (counted, best.1.min(start.elapsed().as_secs_f64() * 1e6));
        }
        best
    };
    let (_, sort_us) = least(&[], usual);
    let prices = fit(&CALIBRATION.map(|share| least(&sample, share * usual)));
    let prices = prices.unwrap_or(Prices { fixed: 0.0, visit: 1.0, test: 5.0 });
    let of_boxes_us = (prices.fixed - sort_us).max(0.0) * scene.boxes.len() as f64 / sample.len() as f64;
    Prices { fixed: sort_us + of_boxes_us, ..prices }
}

/// Placements of the grid against the scene, over which times are averaged.
const PLACEMENTS: usize = 3;

/// Rounds over all sizes, so that a slow moment of the machine meets every size: `[round][size][placement]`, µs.
fn rounds(scene: &Scene, cells: &[f64], count: usize) -> Vec<Vec<[f64; PLACEMENTS]>> {
    let mut random = fastrand::Rng::with_seed(23);
    let places: [DVec3; PLACEMENTS] = std::array::from_fn(|_| DVec3::new(random.f64(), random.f64(), random.f64()));
    let mut grid = HashedGrid::default();
    let mut time = |cell: f64, place: DVec3| {
        let start = Instant::now();
        std::hint::black_box(grid.pass(&scene.boxes, &scene.particles, cell, place * cell));
        start.elapsed().as_secs_f64() * 1e6
    };
    let mut round = |_| cells.iter().map(|&cell| places.map(|place| time(cell, place))).collect();
    (0..count).map(&mut round).collect()
}

/// The time of each size over every `step`th round from `first`: the least for each placement (what the machine takes when nothing
/// disturbs it), and their mean.
fn times(rounds: &[Vec<[f64; PLACEMENTS]>], first: usize, step: usize) -> Vec<f64> {
    let least = |size: usize, place: usize| {
        rounds.iter().skip(first).step_by(step).map(|round| round[size][place]).fold(f64::INFINITY, f64::min)
    };
    let mean = |size: usize| (0..PLACEMENTS).map(|place| least(size, place)).sum::<f64>() / PLACEMENTS as f64;
    (0..rounds[0].len()).map(mean).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Largest, best and smallest cell of the good zone, mm: so lowest, best and highest count of cells.
fn zone(ladder: &[f64], times: &[f64], best: usize) -> [f64; 3] {
    let good = |n: &usize| times[*n] <= ZONE * times[best];
    let low = (0..best).rev().take_while(good).last().unwrap_or(best).saturating_sub(1);
    let high = (best + 1..ladder.len()).take_while(good).last().unwrap_or(best);
    [ladder[(high + 1).min(ladder.len() - 1)], ladder[best], ladder[low]]
}

/// The thesis's numbers for a pair of spheres as rows, and the ratio that its formula must give.
fn beside_the_table(scene: &str, row: usize, ratio: f64, findings: &mut Findings) {
    let [tets, low, best, high, analytic, edge, error_analytic, error_edge] = TABLE[row];
    for (rule, cells, error) in [("analytic", analytic, error_analytic), ("mean edge", edge, error_edge)] {
        findings.rows.push(
            Row::new(scene, format!("printed in the thesis: {rule}"))
                .with("tets", tets)
                .with("cells_per_axis", cells)
                .with("zone_cells_per_axis", vec![low, best, high])
                .metric("zone_error", error)
                .metric("mean_edge_over_analytic_cells", edge / analytic),
        );
    }
    findings.gates.push(Gate::at_least(format!("{scene}: analytic over mean edge"), ratio, 1.40));
    findings.gates.push(Gate::at_most(format!("{scene}: analytic over mean edge"), ratio, 1.60));
}

/// Promises over all scenes of this run; wider in a quick one, whose scenes are so small that the time hardly depends on the size.
fn sum_up(totals: &Totals, scope: Scope, findings: &mut Findings) {
    if totals.regrets.is_empty() {
        return;
    }
    let percent = |regret: f64| 100.0 * regret;
    let worst = totals.regrets.iter().copied().fold(f64::MIN, f64::max);
    let scenes = totals.regrets.len();
    let of_scene = |n: usize| r_squared(totals.times.iter().filter(|t| t.0 == n));
    let (middle, slowest) = (median(totals.regrets.clone()), totals.calibration_ms.iter().copied().fold(0.0, f64::max));
    findings.gates.extend([
        Gate::at_most(
            format!("{OURS}: median regret over {scenes} scenes, percent"),
            percent(middle),
            scope.pick(15.0, 3.0),
        ),
        Gate::at_most(
            format!("{OURS}: worst regret over {scenes} scenes, percent"),
            percent(worst),
            scope.pick(40.0, 10.0),
        ),
        Gate::at_least(
            "predicted against measured time, R squared over all",
            r_squared(totals.times.iter()),
            scope.pick(0.8, 0.95),
        ),
    ]);
    findings.rows.push(
        Row::new("all scenes", OURS)
            .with("scenes", scenes)
            .metric("median_regret_percent", percent(middle))
            .metric("worst_regret_percent", percent(worst))
            .metric("median_r_squared", median((0..scenes).map(of_scene).collect()))
            .metric("worst_r_squared", (0..scenes).map(of_scene).fold(f64::MAX, f64::min))
            .metric("median_calibration_ms", median(totals.calibration_ms.clone()))
            .metric("worst_calibration_ms", slowest),
    );
}

/// The share of the measured times' spread that the predictions explain.
fn r_squared<'a>(times: impl Iterator<Item = &'a (usize, f64, f64)> + Clone) -> f64 {
    let count = times.clone().count() as f64;
    let mean = times.clone().map(|t| t.1).sum::<f64>() / count;
    let total: f64 = times.clone().map(|t| (t.1 - mean).powi(2)).sum();
    1.0 - times.map(|t| (t.1 - t.2).powi(2)).sum::<f64>() / total
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_zone_ends_where_times_leave_it() {
        let ladder = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(zone(&ladder, &[9.0, 1.05, 1.0, 1.09, 1.2, 1.0], 2), [5.0, 3.0, 1.0]);
    }

    #[test]
    fn a_perfect_prediction_explains_everything() {
        let times = [(0, 1.0, 1.0), (0, 2.0, 2.0), (0, 4.0, 4.0)];
        assert_eq!(r_squared(times.iter()), 1.0);
        let mean = [(0, 1.0, 2.0), (0, 3.0, 2.0)];
        assert_eq!(r_squared(mean.iter()), 0.0);
    }
}
