//! Runs scenes that no rule was made for. Rows give each rule's size, whether a grid of that size
//! can be built, and whether it is near the best.

use super::{OURS, RULES, edge_of_512_voxels, timing};
use trepan_evidence::picture::Outcome;
use trepan_evidence::suite::{Findings, Gate};
use trepan_geometry::{Aabb, Vec3};
use trepan_trials_scenes::conditions;
use trepan_voxel_size::{CostModel, Expected, Measures, Prices, counts};

/// Prices of a usual machine, µs: ratios decide, and they are much the same on all.
pub const PRICES: Prices = Prices { fixed: 0.0, visit: 0.004, doubt: 0.006, test: 0.02 };
/// The thesis's share of boxes that touch nothing.
const NO_CONTACT: f64 = 0.99;
/// Sizes that a tuned formula tries beside its first seven.
const CANDIDATES: usize = 9;
/// Work beyond that of the best size, by which a rule degrades, and fails.
const DEGRADES: f64 = 1.3;
const FAILS: f64 = 3.0;

/// Boxes and particles.
pub type Scene = (Vec<Aabb>, Vec<Vec3>);
type Condition = (&'static str, fn() -> Scene);

const CONDITIONS: [Condition; 9] = [
    ("even elements, a cloud", || (row_of_boxes(12, |_| 1.0), cloud(1500, 12.0))),
    ("one giant element among small ones", || {
        (row_of_boxes(12, |n| if n == 0 { 12.0 } else { 1.0 }), cloud(1500, 12.0))
    }),
    ("edges graded 1:100", || (row_of_boxes(12, |n| 0.05 * 100f32.powf(n as f32 / 1728.0)), cloud(1500, 12.0))),
    ("all particles in one place", || (row_of_boxes(12, |_| 1.0), vec![Vec3::splat(6.1); 500])),
    ("one particle", || (row_of_boxes(12, |_| 1.0), vec![Vec3::splat(6.1)])),
    ("flat elements", || {
        let flat = |b: Aabb| Aabb { min: b.min, max: Vec3::new(b.max.x, b.max.y, b.min.z) };
        (row_of_boxes(12, |_| 1.0).into_iter().map(flat).collect(), cloud(1500, 12.0))
    }),
    ("one element", || (vec![Aabb { min: Vec3::ZERO, max: Vec3::ONE }], cloud(500, 2.0))),
    ("no particles", || (row_of_boxes(10, |_| 1.0), Vec::new())),
    ("particles that are nowhere", || (row_of_boxes(10, |_| 1.0), vec![Vec3::NAN; 100])),
];

/// The map of all rules.
pub fn run(findings: &mut Findings) {
    let names = CONDITIONS.map(|(name, _)| name);
    let rules = RULES.map(|rule| (rule, rule));
    conditions::judge("Odd scenes", &names, &rules, |at, rule| verdict(&CONDITIONS[at].1(), rule), findings);
    let own = findings.rows.iter().find(|row| row.scene == "Odd scenes" && row.method == OURS);
    let failed = own.map_or(f64::NAN, |row| row.metrics["fails_count"]);
    findings.gates.push(Gate::at_most(format!("{OURS}: odd scenes in which it fails"), failed, 0.0));
}

/// Boxes on a lattice that fills a cube of `edge` mm, each of an edge that its number says.
pub fn row_of_boxes(edge: usize, size: impl Fn(usize) -> f32) -> Vec<Aabb> {
    let place = |n: usize| Vec3::new((n % edge) as f32, (n / edge % edge) as f32, (n / (edge * edge)) as f32);
    (0..edge.pow(3)).map(|n| Aabb { min: place(n), max: place(n) + size(n) }).collect()
}

/// Particles anywhere in a cube, mm.
pub fn cloud(count: usize, edge: f32) -> Vec<Vec3> {
    let mut random = fastrand::Rng::with_seed(3);
    (0..count).map(|_| Vec3::new(random.f32(), random.f32(), random.f32()) * edge).collect()
}

/// Size that a rule takes at some prices, mm, or why it takes none. A tuned formula is tuned by
/// counts of work in place of times.
pub fn size_by(scene: &Scene, rule: &str, prices: &Prices) -> Result<f64, String> {
    if let Some(formula) = rule.strip_suffix(", tuned") {
        return Ok(tuned_by_work(scene, size_by(scene, formula, prices)?));
    }
    let (boxes, particles) = scene;
    let edges = edges(boxes);
    match rule {
        OURS | "expected work alone" => Expected::of(boxes, particles, REACH * edges)
            .and_then(|expected| expected.best(prices, 0.05 * edges))
            .map_err(|fault| fault.to_string()),
        "mean edge" => Ok(edges),
        "1.45 x mean edge" => Ok(1.45 * edges),
        "512 voxels" => Ok(edge_of_512_voxels(boxes)),
        _ => {
            let model = if rule == "thesis analytic" { Ok(CostModel::default()) } else { prices.model(NO_CONTACT) };
            let all = Measures {
                elements: boxes.len(),
                longest_edge_mm: edges,
                mean_edge_mm: edges,
                facet_mm2: 0.5 * edges * edges,
            };
            let size = all.checked().and_then(|measures| model.and_then(|model| model.analytic(&measures)));
            size.map_err(|fault| fault.to_string())
        }
    }
}

/// The tuned size by counts of work; the formula's where a grid is refused.
fn tuned_by_work(scene: &Scene, formula_mm: f64) -> f64 {
    let cheapest = |cells: &[f64]| {
        let work: Vec<f64> = cells.iter().map(|cell| work(scene, *cell).unwrap_or(f64::INFINITY)).collect();
        (0..cells.len()).min_by(|&a, &b| work[a].total_cmp(&work[b]))
    };
    timing::tuned(formula_mm, CANDIDATES, cheapest).unwrap_or(formula_mm)
}

/// Largest size that is looked at, in mean edges.
const REACH: f64 = 20.0;

fn edges(boxes: &[Aabb]) -> f64 {
    boxes.iter().map(|b| f64::from(b.size().max_element())).sum::<f64>() / boxes.len() as f64
}

/// Work of a grid of some cell, µs at the usual prices, or why there can be none.
pub fn work((boxes, particles): &Scene, cell_mm: f64) -> Result<f64, String> {
    let found = counts::grid(boxes, particles, cell_mm).map_err(|fault| fault.to_string())?;
    Ok(PRICES.visit * found.visits as f64 + PRICES.test * found.tests as f64)
}

/// Work over a ladder of cells: cell, mm, and µs.
pub fn ladder(scene: &Scene) -> Vec<(f64, f64)> {
    let edges = edges(&scene.0);
    let cells = (0..18).map(|n| 0.3 * edges * 1.3f64.powi(n));
    cells.filter_map(|cell| Some((cell, work(scene, cell).ok()?))).collect()
}

/// Counts of work at the rule's size against the least over a ladder of sizes.
fn verdict(scene: &Scene, rule: &str) -> Outcome {
    let (size, own) = match size_by(scene, rule, &PRICES).and_then(|size| Ok((size, work(scene, size)?))) {
        Ok(found) => found,
        Err(fault) => return Outcome::Refused(fault),
    };
    let best = ladder(scene).into_iter().map(|(_, work)| work).fold(f64::INFINITY, f64::min);
    match own / best {
        _ if !size.is_finite() => Outcome::Fails("not a number".into()),
        ratio if ratio <= DEGRADES || best == 0.0 => Outcome::Works,
        ratio if ratio <= FAILS => Outcome::Degrades("up to three times the work of the best size".into()),
        _ => Outcome::Fails("over three times the work of the best size".into()),
    }
}
