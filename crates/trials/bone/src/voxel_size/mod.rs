//! The best cell edge of a uniform grid: compares the thesis's formula, the usual rule and our
//! model
//! with a ladder of measured sizes.
//!
//! # Practice
//! Times are the minimum of many short passes, in rounds over all sizes, until two halves of the
//! rounds agree: the time on an undisturbed machine. The verdict is therefore robust on a loaded
//! machine; only the number of rounds grows. `TREPAN_DATA` may name a folder with triangle meshes
//! in `meshes-collision` (`stanford-bunny.obj`, `spot.obj`, ...).

pub mod odd;
pub mod pass;
mod published;
pub mod scene;
pub mod timing;

use scene::{Body, Elements, Scene, Touch};
use std::time::Instant;
use timing::Calibration;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Aabb, quantile};
use trepan_voxel_size::{CostModel, Expected, counts, zone_error};

/// Tables 5.2 and 5.3 of the thesis, in cells per axis: tetrahedra, low, best, high, analytic, mean
/// edge; errors of the last two.
pub const TABLE: [[f64; 8]; 5] = [
    [41_937.0, 20.0, 28.33, 39.0, 28.73, 41.90, 0.038, 1.272],
    [52_326.0, 22.0, 28.16, 38.0, 30.94, 45.16, 0.283, 1.727],
    [60_688.0, 16.0, 34.04, 54.0, 32.49, 47.40, 0.086, 0.669],
    [72_631.0, 8.0, 26.63, 47.0, 34.48, 50.29, 0.385, 1.162],
    [80_927.0, 20.0, 37.87, 57.0, 35.65, 51.90, 0.124, 0.734],
];
/// Triangle models: bunny, cow, armadillo.
pub const MODELS: [&str; 3] = ["stanford-bunny.obj", "spot.obj", "Armadillo_simplified.obj"];
/// The rules in the rows, this crate's first. A tuned one is the formula times a constant that is
/// chosen by as many timed passes as ours takes.
pub const RULES: [&str; 10] = [
    OURS,
    "expected work alone",
    "thesis analytic",
    "thesis, measured prices",
    "mean edge",
    "1.45 x mean edge",
    "512 voxels",
    "thesis analytic, tuned",
    "mean edge, tuned",
    "512 voxels, tuned",
];
/// This crate's rule.
pub const OURS: &str = "expected work, then timed";
/// Ladder: number of sizes, the first in mean edges, and the factor between them.
const LADDER: (usize, f64, f64) = (26, 0.3, 1.11);
/// Largest time of the good zone relative to the best.
const ZONE: f64 = 1.10;
/// Method name of the row that holds a scene's curves.
const CURVES: &str = "every size of the ladder";

/// Lists a part for every scene.
pub fn parts(scope: Scope) -> Vec<Part> {
    let part = |(body, table_row): (Body, Option<usize>)| {
        Part::new(format!("{body:?}"), move |scope, findings: &mut Findings| {
            let Some(elements) = Elements::of(body) else { return };
            for touch in [Touch::Twin(0.01), Touch::Twin(0.05), Touch::Tool, Touch::Cloud] {
                let row = table_row.filter(|_| matches!(touch, Touch::Twin(share) if share < 0.02));
                rules(&Scene::new(&elements, touch, row), scope, findings);
            }
        })
    };
    bodies(scope).into_iter().map(part).chain([Part::new("odd scenes", |_, findings| odd::run(findings))]).collect()
}

fn bodies(scope: Scope) -> Vec<(Body, Option<usize>)> {
    if scope.quick {
        return vec![(Body::Ball(20_000), None), (Body::Graded(20_000), None), (Body::Model("Bunny.stl"), None)];
    }
    let spheres = TABLE.iter().enumerate().map(|(n, row)| (Body::Ball(row[0] as usize), Some(n)));
    let others =
        [Body::Graded(8000), Body::Graded(40_000), Body::Torus(30_000), Body::Brain(15_000), Body::Brain(60_000)];
    let models = MODELS.map(Body::Model);
    spheres.chain(others.into_iter().chain(models).map(|body| (body, None))).collect()
}

/// Times the ladder and every rule's size in turn, round by round.
fn rules(scene: &Scene, scope: Scope, findings: &mut Findings) {
    let measures = &scene.measures;
    let usual = measures.traditional_mm();
    let steps = LADDER.0;
    let ladder = ladder(usual, steps);
    let reach = ladder[steps - 1] * 1.001;
    let start = Instant::now();
    let expected = Expected::of(&scene.boxes, &scene.particles, reach).expect("the scene is finite");
    let mut calibration = Calibration::of(scene, usual);
    let prices = calibration.prices();
    let Chosen { ours, alone, candidates } =
        chosen(&mut calibration, &expected, ladder[0]).unwrap_or(Chosen { ours: usual, alone: usual, candidates: 1 });
    let calibration_ms = start.elapsed().as_secs_f64() * 1e3;
    let p_nc = share_without_contact(scene, usual);
    let thesis = thesis_mm(scene);
    let priced = prices.model(p_nc).and_then(|model| model.analytic(measures)).unwrap_or(thesis);
    let voxels = edge_of_512_voxels(&scene.boxes);
    let tuned =
        |formula: f64| timing::tuned(formula, candidates, |cells| timing::cheapest(scene, cells)).unwrap_or(formula);
    let tuned = [thesis, usual, voxels].map(tuned);
    let sizes = [ours, alone, thesis, priced, usual, 1.45 * usual, voxels, tuned[0], tuned[1], tuned[2]];
    let rules: [(&str, f64); 10] = std::array::from_fn(|at| (RULES[at], sizes[at]));
    let cells: Vec<f64> = ladder.iter().copied().chain(rules.map(|rule| rule.1)).collect();
    let measured = timing::least(scene, &cells, &mut calibration, scope.pick(8, 64));
    // The size was chosen with the first prices; the times are predicted with the prices calibrated
    // during the measurement.
    let prices = calibration.prices();
    // The best size is chosen on one half of the rounds and every size judged on the other, to
    // avoid
    // selection bias.
    let timing::Least { choose, judge, .. } = &measured;
    let best = (0..steps).min_by(|&a, &b| choose[a].total_cmp(&choose[b])).unwrap_or(0);
    let axis_mm = f64::from(2.0 * scene.size_mm.max_element());
    let [low, middle, high] = zone(&ladder, &choose[..steps], best).map(|size| axis_mm / size);
    let predicted: Vec<f64> = cells.iter().map(|cell| expected.time(&prices, cell.min(reach))).collect();
    let named = rules.iter().enumerate().map(|(n, rule)| (rule.0, steps + n)).chain([("best of the ladder", best)]);
    let row = |(rule, at): (&str, usize)| {
        Row::new(&scene.name, rule)
            .with("elements", measures.elements)
            .with("particles", scene.particles.len())
            .with("cell_mm", cells[at])
            .with("cells_per_axis", axis_mm / cells[at])
            .with("zone_cells_per_axis", vec![low, middle, high])
            .with("colliding_percent", 100.0 * (1.0 - p_nc))
            .with("prices_ns", [prices.visit, prices.doubt, prices.test].map(|us| 1e3 * us).to_vec())
            .metric("cost_us", judge[at])
            .metric("regret_percent", 100.0 * (judge[at] / judge[best] - 1.0))
            .metric("zone_error", zone_error(axis_mm / cells[at], low, middle, high))
            .metric("predicted_us", predicted[at])
            .metric("calibration_ms", calibration_ms)
            .metric("halves_apart_percent", 100.0 * measured.apart())
            .metric("rounds_count", measured.rounds as f64)
    };
    findings.rows.extend(named.map(row));
    let curves = Row::new(&scene.name, CURVES).with("cells_mm", ladder.clone());
    let curves = curves.with(MEASURED, judge[..steps].to_vec()).with(PREDICTED, predicted[..steps].to_vec());
    findings.rows.push(curves);
    if let Some(row) = scene.table_row {
        beside_the_table(&scene.name, row, thesis / usual, findings);
    }
}

/// So many cell edges to time, mm, for a usual one.
pub fn ladder(usual_mm: f64, steps: usize) -> Vec<f64> {
    let (_, first, step) = LADDER;
    (0..steps).map(|i| usual_mm * first * step.powi(i as i32)).collect()
}

/// The thesis's analytic cell edge, mm.
pub fn thesis_mm(scene: &Scene) -> f64 {
    CostModel::default().analytic(&scene.measures).expect("the default model is sound")
}

/// Cell edges by our model, mm.
pub struct Chosen {
    /// Edge by the model and times of a sample.
    pub ours: f64,
    /// Edge by the model alone.
    pub alone: f64,
    /// Number of edges that were timed.
    pub candidates: usize,
}

/// The cell edges by our model; `None` if it has no finite one.
pub fn chosen(calibration: &mut Calibration, expected: &Expected, least_mm: f64) -> Option<Chosen> {
    let prices = calibration.prices();
    let alone = expected.best(&prices, least_mm).ok()?;
    let candidates = expected.candidates(&prices, alone);
    let ours = calibration.cheapest_of(&candidates, expected).unwrap_or(alone);
    Some(Chosen { ours, alone, candidates: candidates.len() })
}

/// Edge of the cubes of which 512 fill the box of an object, mm (Garcia-Alonso et al. 1994).
pub fn edge_of_512_voxels(boxes: &[Aabb]) -> f64 {
    let size = Aabb::of_points(boxes.iter().flat_map(|b| [&b.min, &b.max])).size().as_dvec3();
    (size.x * size.y * size.z / 512.0).cbrt()
}

/// p_nc: the share of boxes without a particle in their cells, at the usual size.
pub fn share_without_contact(scene: &Scene, usual: f64) -> f64 {
    let busy = counts::grid(&scene.boxes, &scene.particles, usual).map_or(0, |c| c.busy_boxes);
    1.0 - (busy as f64 / scene.boxes.len() as f64).clamp(1e-4, 1.0)
}

/// Largest, best and smallest cell of the good zone, mm, hence lowest, best and highest count of
/// cells.
pub fn zone(ladder: &[f64], times: &[f64], best: usize) -> [f64; 3] {
    let good = |n: &usize| times[*n] <= ZONE * times[best];
    let low = (0..best).rev().take_while(good).last().unwrap_or(best).saturating_sub(1);
    let high = (best + 1..ladder.len()).take_while(good).last().unwrap_or(best);
    [ladder[(high + 1).min(ladder.len() - 1)], ladder[best], ladder[low]]
}

/// Rows of the thesis's numbers for a pair of spheres, and the ratio that its formula must give.
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

/// Setting of the row of curves.
const MEASURED: &str = "measured_us";
const PREDICTED: &str = "predicted_us";

/// Gates over all scenes of a run; wider in a quick run, which has few scenes and rounds.
pub fn judge(_: Scope, findings: &mut Findings) {
    let ours = |metric: &str| {
        let rows = findings.rows.iter().filter(|row| row.method == OURS);
        rows.filter_map(|row| row.metrics.get(metric).copied()).collect::<Vec<f64>>()
    };
    let (mut regrets, mut calibration) = (ours("regret_percent"), ours("calibration_ms"));
    let curves = findings.rows.iter().filter(|row| row.method == CURVES).enumerate();
    let of_row = |(number, row): (usize, &Row)| {
        row.numbers(MEASURED)
            .into_iter()
            .zip(row.numbers(PREDICTED))
            .map(move |(m, p)| (number, m, p))
            .collect::<Vec<_>>()
    };
    let times: Vec<(usize, f64, f64)> = curves.flat_map(of_row).collect();
    if regrets.is_empty() {
        return;
    }
    let tables = published::tables(&findings.rows);
    findings.tables.extend(tables);
    let worst = regrets.iter().copied().fold(f64::MIN, f64::max);
    let scenes = regrets.len();
    let of_scene = |n: usize| r_squared(times.iter().filter(|t| t.0 == n));
    let middle = quantile(&mut regrets, 0.5);
    let slowest = calibration.iter().copied().fold(0.0, f64::max);
    let calibration_ms = quantile(&mut calibration, 0.5);
    findings.gates.extend([
        Gate::at_most(format!("{OURS}: median regret over {scenes} scenes, percent"), middle, 3.0),
        Gate::at_most(format!("{OURS}: worst regret over {scenes} scenes, percent"), worst, 10.0),
        Gate::at_least("predicted against measured time, R squared over all", r_squared(times.iter()), 0.95),
    ]);
    findings.rows.push(
        Row::new("all scenes", OURS)
            .with("scenes", scenes)
            .metric("median_regret_percent", middle)
            .metric("worst_regret_percent", worst)
            .metric("median_r_squared", quantile(&mut (0..scenes).map(of_scene).collect::<Vec<_>>(), 0.5))
            .metric("worst_r_squared", (0..scenes).map(of_scene).fold(f64::MAX, f64::min))
            .metric("median_calibration_ms", calibration_ms)
            .metric("worst_calibration_ms", slowest),
    );
}

/// Coefficient of determination of the predicted times.
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
