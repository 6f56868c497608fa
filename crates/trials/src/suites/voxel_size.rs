//! The best cell edge of a uniform grid: the thesis's formula, the usual rule and a search, on pairs of equal spheres.

use super::Scope;
use crate::suite::{Findings, Gate, Row};
use crate::timer::Samples;
use trepan_geometry::{Aabb, Vec3};
use trepan_mesh::{TetMesh, lattice};
use trepan_volume::VoxelVolume;
use trepan_voxel_size::{CostModel, Measures, Prices, counts, fit};

/// Radius of the sphere, mm.
const RADIUS_MM: f32 = 22.0;

/// Every rule on spheres of several fineness.
pub fn run(scope: Scope) -> Findings {
    let mut findings = Findings::default();
    let sizes = scope.pick(&[8_000usize][..], &[41_937, 52_326, 60_688, 72_631, 80_927][..]);
    for (number, &tets) in sizes.iter().enumerate() {
        if scope.takes(number) {
            sphere(tets, scope, &mut findings);
        }
    }
    findings
}

fn sphere(tets: usize, scope: Scope, findings: &mut Findings) {
    let mesh = ball(tets);
    let boxes = counts::boxes(&mesh);
    let particles = pressed(&mesh, &boxes);
    let measures = Measures::of(&mesh).expect("the sphere is sound");
    let usual = measures.traditional_mm();
    let ladder: Vec<f64> = (0..24).map(|i| usual * 0.3 * 1.12f64.powi(i)).collect();
    let repeats = scope.pick(3, 9);
    let measured: Vec<(f64, f64, counts::Counts)> =
        ladder.iter().filter_map(|&cell| timed(&boxes, &particles, cell, repeats)).collect();
    let Some(best) = measured.iter().min_by(|a, b| a.1.total_cmp(&b.1)) else { return };
    let samples: Vec<(counts::Counts, f64)> = measured.iter().map(|m| (m.2, m.1)).collect();
    let prices = fit(&samples).unwrap_or(Prices { fixed: 0.0, visit: 1.0, test: 5.0 });
    let p_nc = 1.0 - best.2.busy_boxes as f64 / boxes.len() as f64;
    let own = prices.model(p_nc).unwrap_or_default();
    let analytic = CostModel::default().analytic(&measures).expect("the default model is sound");
    let rules = [
        ("thesis analytic", analytic),
        ("measured prices", own.analytic(&measures).unwrap_or(analytic)),
        ("mean edge", usual),
        ("1.45 x mean edge", 1.45 * usual),
        ("best of the ladder", best.0),
    ];
    let scene = format!("pair of spheres, {} tetrahedra", mesh.tets.len());
    for (rule, cell) in rules {
        let Some((_, time, counted)) = timed(&boxes, &particles, cell, repeats) else { continue };
        findings.rows.push(
            Row::new(&scene, rule)
                .with("cell_mm", cell)
                .with("voxels_per_axis", f64::from(2.0 * RADIUS_MM) / cell)
                .metric("cost_us", time)
                .metric("regret_percent", 100.0 * (time / best.1 - 1.0))
                .metric("visits_count", counted.visits as f64)
                .metric("tests_count", counted.tests as f64),
        );
    }
    let ratio = analytic / usual;
    findings.gates.push(Gate::at_least(format!("{scene}: analytic over mean edge"), ratio, 1.40));
    findings.gates.push(Gate::at_most(format!("{scene}: analytic over mean edge"), ratio, 1.60));
}

fn ball(tets: usize) -> TetMesh {
    let n = 48;
    let mut mask = VoxelVolume::isotropic([n; 3], Vec3::splat(-23.5), 1.0, 0u8);
    for at in 0..mask.data.len() {
        let inside = mask.centre_of([at % n, at / n % n, at / (n * n)]).length() < f64::from(RADIUS_MM);
        mask.data[at] = u8::from(inside);
    }
    let config = lattice::Config { target_tets: tets, ..Default::default() };
    lattice::tetrahedra(&mask, &config).expect("a ball can be meshed")
}

/// The nodes of an equal sphere beside it, pressed in until about 1 % of the tetrahedra collide.
fn pressed(mesh: &TetMesh, boxes: &[Aabb]) -> Vec<Vec3> {
    let moved = |by: f32| mesh.positions.iter().map(|p| *p + Vec3::X * by).collect::<Vec<Vec3>>();
    let usual = 2.0;
    let (mut near, mut far) = (RADIUS_MM, 2.0 * RADIUS_MM + 1.0);
    for _ in 0..18 {
        let middle = 0.5 * (near + far);
        let busy = counts::grid(boxes, &moved(middle), usual).map_or(0, |c| c.busy_boxes);
        if busy as f64 > 0.01 * boxes.len() as f64 {
            near = middle;
        } else {
            far = middle;
        }
    }
    moved(near)
}

/// A pass with this cell edge: (edge, median time in µs, counts).
fn timed(boxes: &[Aabb], particles: &[Vec3], cell_mm: f64, repeats: usize) -> Option<(f64, f64, counts::Counts)> {
    let counted = counts::grid(boxes, particles, cell_mm).ok()?;
    let times = Samples::of(repeats, |_| _ = std::hint::black_box(counts::grid(boxes, particles, cell_mm)));
    Some((cell_mm, times.quantile(0.5), counted))
}
