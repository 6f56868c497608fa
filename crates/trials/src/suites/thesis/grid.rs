//! Figure 5.3 and Tables 5.1 to 5.5: time of the grid's collision over the size of its cells.
//!
//! # Theory
//! Two equal bodies lie so that 1 % of the tetrahedra collide; then ten frames of 5 ms follow with
//! gravity, the springs that push the two apart, and the material of Table 6.1 (total Lagrangian
//! explicit dynamics). The time of a size is the mean over the frames, each the least of some
//! passes. Sizes are counted in cells for each axis of a scene twice as wide as a body: in the
//! thesis, 4 for spheres of radius 1.
//!
//! # Practice
//! The scanned models are not to be had everywhere: brains of the same number of tetrahedra stand
//! in for bunny, cow and armadillo. With `TREPAN_DATA`, the suite `voxel-size` has scanned models.
//! Cells of 512 for an object are of Garcia-Alonso et al. 1994, a constant times the edge of
//! Gregory et al. 2000.
//!
//! # Sources
//! Thesis, 5.4, Eq 5.9.

use super::comparison::{Comparison, Rule};
use crate::suites::voxel_size::pass::HashedGrid;
use crate::suites::voxel_size::scene::{Body, Elements, Scene, Touch, mesh};
use crate::suites::voxel_size::timing::Calibration;
use crate::suites::voxel_size::{TABLE, chosen, edge_of_512_voxels, ladder, share_without_contact, thesis_mm, zone};
use crate::suites::{Part, Scope};
use glam::DVec3;
use std::time::Instant;
use trepan_contact::{NodalContacts, PlaneContact};
use trepan_deformable::MeshCollision;
use trepan_evidence::picture::Series;
use trepan_evidence::suite::Findings;
use trepan_geometry::{Aabb, Vec3, units};
use trepan_mesh::TetMesh;
use trepan_soft::{Body as SoftBody, Loads, Material, SoftSolver};
use trepan_tled::{Config, Tled};
use trepan_voxel_size::{Expected, counts, zone_error};

/// Frames, as in the thesis, their length and that of a step between two collisions, ms.
const FRAMES: usize = 10;
const FRAME_MS: f32 = 5.0;
const STEP_MS: f32 = 0.5;
/// Spring on a node inside the other body, N/mm, and its damper, N ms/mm.
const SPRING: f32 = 0.02;
const DAMPER: f32 = 0.01;
/// Sizes of cells: the last is eleven mean edges, beyond the best of every pair.
const SIZES: usize = 35;
/// Constant times the edge, left open by Gregory et al.: the one that fits the thesis's spheres.
const EDGES: f64 = 1.45;
/// Why sizes differ.
const PRICES: &str = "the best size follows from the prices of visits and tests on a machine";

/// Tables 5.4 and 5.5 in the columns of [`TABLE`].
const SCANNED: [(&str, [f64; 8]); 3] = [
    ("Bunny", [20_462.0, 16.0, 22.97, 34.0, 31.35, 44.94, 0.759, 1.992]),
    ("Cow", [50_380.0, 13.0, 31.15, 54.0, 48.80, 70.93, 0.772, 1.741]),
    ("Armadillo", [16_377.0, 13.0, 20.49, 37.0, 31.55, 45.48, 0.669, 1.516]),
];

/// Rules in the order of [`Measured::sizes_mm`].
const RULES: [&str; 5] = ["ours", "analytic", "mean edge", "512 cells for an object", "1.45 times the mean edge"];

/// A part for every pair.
pub fn parts(scope: Scope) -> Vec<Part> {
    let spheres = TABLE.iter().enumerate().map(|(n, row)| {
        let name = format!("Sphere0{}", n + 1);
        let tables = ["Table 5.1", "Table 5.2", "Table 5.3"];
        Printed { name, stand_in: "", body: Body::Ball(row[0] as usize), tables, row: *row }
    });
    let scanned = SCANNED.iter().map(|(name, row)| Printed {
        name: (*name).into(),
        stand_in: "a brain of as many tetrahedra stands in for the scanned model",
        body: Body::Brain(row[0] as usize),
        tables: ["Figure 5.4", "Table 5.4", "Table 5.5"],
        row: *row,
    });
    let taken = |printed: &Printed| !scope.quick || ["Sphere01", "Armadillo"].contains(&printed.name.as_str());
    let part = |printed: Printed| {
        Part::new(format!("pair of {}", printed.name), move |scope, findings| printed.measure(scope, findings))
    };
    spheres.chain(scanned).filter(taken).map(part).collect()
}

/// A pair with what the thesis prints of it.
struct Printed {
    name: String,
    /// What stands in for the model, if anything does.
    stand_in: &'static str,
    body: Body,
    /// Figure or table of the count, of the sizes, of their errors.
    tables: [&'static str; 3],
    row: [f64; 8],
}

/// The boxes of one body and the nodes of the other in a frame.
struct Frame {
    boxes: Vec<Aabb>,
    particles: Vec<Vec3>,
}

/// Times over sizes.
struct Measured {
    ladder_mm: Vec<f64>,
    /// Of the ladder, then of the rules, µs.
    times_us: Vec<f64>,
    sizes_mm: [f64; 5],
    /// Time by the model with fitted prices, of the ladder, µs.
    fitted_us: Vec<f64>,
}

/// One of the two bodies.
struct Side {
    solver: Tled,
    collision: MeshCollision,
}

impl Side {
    fn new(own: &TetMesh, other: &TetMesh) -> Self {
        let body = SoftBody::uniform(own.clone(), Vec::new(), Material::THESIS);
        let solver = Tled::new(&body, &Config::default()).expect("the body is sound");
        Self { solver, collision: MeshCollision::between(own, other).expect("the meshes are sound") }
    }

    /// A plane for each node inside the other body, through the place where it leaves.
    fn pushed_out_of(&mut self, other: &[Vec3]) -> Loads {
        let (mut inside, mut contacts) =
            (Vec::with_capacity(self.solver.positions().len()), NodalContacts::with_room());
        self.collision.step(self.solver.positions(), other, &mut inside);
        for contact in &inside {
            let place = self.solver.positions()[contact.node as usize] + contact.depth_mm * contact.normal;
            let normal = -contact.normal;
            contacts.push_plane(PlaneContact {
                node: contact.node,
                normal,
                offset_mm: -place.dot(normal),
                stiffness: SPRING,
                damping: DAMPER,
            });
        }
        Loads { gravity: Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2, contacts, ..Loads::default() }
    }
}

/// Ten frames of two bodies that fall and push each other apart.
fn frames(body: Body, scene: &Scene) -> Vec<Frame> {
    let own = mesh(body);
    let offset = scene.particles[0] - own.positions[0];
    let other = TetMesh { positions: own.positions.iter().map(|p| *p + offset).collect(), ..own.clone() };
    let (mut left, mut right) = (Side::new(&own, &other), Side::new(&other, &own));
    let mut frame = |_| {
        let positions = left.solver.positions().to_vec();
        let boxes = counts::boxes(&TetMesh { positions, ..own.clone() });
        let frame = Frame { boxes, particles: right.solver.positions().to_vec() };
        for _ in 0..(FRAME_MS / STEP_MS) as usize {
            let (on_left, on_right) =
                (left.pushed_out_of(right.solver.positions()), right.pushed_out_of(left.solver.positions()));
            left.solver.step(&on_left, STEP_MS);
            right.solver.step(&on_right, STEP_MS);
        }
        frame
    };
    (0..FRAMES).map(&mut frame).collect()
}

/// Mean over the frames of the least time of a pass, for each size, µs.
fn times_us(frames: &[Frame], cells_mm: &[f64], rounds: usize) -> Vec<f64> {
    let mut grid = HashedGrid::default();
    let mut least = vec![vec![f64::INFINITY; cells_mm.len()]; frames.len()];
    for _ in 0..rounds {
        for (frame, least) in frames.iter().zip(&mut least) {
            for (&cell_mm, least) in cells_mm.iter().zip(least) {
                let start = Instant::now();
                grid.place(&frame.particles, cell_mm, DVec3::splat(0.37 * cell_mm));
                std::hint::black_box(grid.look(&frame.boxes));
                *least = least.min(start.elapsed().as_secs_f64() * 1e6);
            }
        }
    }
    (0..cells_mm.len()).map(|n| least.iter().map(|frame| frame[n]).sum::<f64>() / frames.len() as f64).collect()
}

fn measured(scene: &Scene, frames: &[Frame], rounds: usize) -> Measured {
    let usual_mm = scene.measures.traditional_mm();
    let ladder_mm = ladder(usual_mm, SIZES);
    let reach_mm = 1.001 * ladder_mm[ladder_mm.len() - 1];
    let expected = Expected::of(&scene.boxes, &scene.particles, reach_mm).expect("the scene is finite");
    let mut calibration = Calibration::of(scene, usual_mm);
    let ours = chosen(&mut calibration, &expected, ladder_mm[0]).map_or(usual_mm, |chosen| chosen.ours);
    let of_object = edge_of_512_voxels(&scene.boxes);
    let sizes_mm = [ours, thesis_mm(scene), usual_mm, of_object, EDGES * usual_mm];
    let cells_mm: Vec<f64> = ladder_mm.iter().copied().chain(sizes_mm).collect();
    let times_us = times_us(frames, &cells_mm, rounds);
    let prices = calibration.prices();
    let fitted_us = ladder_mm.iter().map(|&cell_mm| expected.time(&prices, cell_mm)).collect();
    Measured { ladder_mm, times_us, sizes_mm, fitted_us }
}

impl Printed {
    fn measure(&self, scope: Scope, findings: &mut Findings) {
        let elements = Elements::of(self.body).expect("the body can be meshed");
        let scene = Scene::new(&elements, Touch::Twin(0.01), None);
        let frames = frames(self.body, &scene);
        let measured = measured(&scene, &frames, scope.pick(2, 6));
        let axis_mm = f64::from(2.0 * scene.size_mm.max_element());
        let times = &measured.times_us[..measured.ladder_mm.len()];
        let best = (0..times.len()).min_by(|&a, &b| times[a].total_cmp(&times[b])).unwrap_or(0);
        let [low, middle, high] = zone(&measured.ladder_mm, times, best).map(|size_mm| axis_mm / size_mm);
        let [count, sizes, errors] = self.tables;
        let [tets, printed_low, printed_best, printed_high, analytic, edge, error_analytic, error_edge] = self.row;
        let mut add = |comparison: Comparison| findings.rows.push(comparison.row());
        let named = |item: &str, what: &str, unit: &str| Comparison::new(item, format!("{}: {what}", self.name), unit);
        let equal = |within: f64, printed: f64, ours: f64, what: &str, why: &str| {
            let why = [self.stand_in, why].into_iter().filter(|why| !why.is_empty()).collect::<Vec<_>>().join("; ");
            named(sizes, what, "").printed(Rule::Equal(within), printed).ours(ours).why(&why)
        };
        let of_count = named(count, "tetrahedra", "").printed(Rule::Equal(0.02), tets);
        add(of_count.ours(scene.boxes.len() as f64).why(self.stand_in));
        let usual_mm = scene.measures.traditional_mm();
        let colliding = |frame: &Frame| {
            let moved = Scene { boxes: frame.boxes.clone(), particles: frame.particles.clone(), ..bare(&scene) };
            100.0 * (1.0 - share_without_contact(&moved, usual_mm))
        };
        let share = frames.iter().map(colliding).sum::<f64>() / frames.len() as f64;
        let quantity = "tetrahedra in collision, mean of ten frames";
        let of_share = named(sizes, quantity, "%").printed(Rule::Equal(0.5), 1.0);
        add(of_share.ours(share).why("the two push each other apart during the frames"));
        add(equal(0.25, printed_low, low, "lowest good number of cells for each axis", PRICES));
        add(equal(0.25, printed_best, middle, "best number of cells for each axis", PRICES));
        add(equal(0.25, printed_high, high, "highest good number of cells for each axis", PRICES));
        add(equal(0.1, analytic, axis_mm / measured.sizes_mm[1], "analytic number of cells for each axis", ""));
        add(equal(0.1, edge, axis_mm / measured.sizes_mm[2], "cells of the mean edge for each axis", ""));
        let error = |rule: usize| zone_error(axis_mm / measured.sizes_mm[rule], low, middle, high);
        let here = [error(1), f64::NAN, error(0)];
        let of_error = named(errors, "error of the analytic size, beside our rule's", "");
        add(of_error.printed(Rule::Less, error_analytic).measured(here).why(self.stand_in));
        let of_error = named(errors, "error of the mean edge, beside our rule's", "");
        add(of_error.printed(Rule::Less, error_edge).measured([error(2), f64::NAN, error(0)]).why(self.stand_in));
        let over_best = |rule: usize| measured.times_us[times.len() + rule] / times[best];
        for (rule, name) in RULES.iter().enumerate().skip(1) {
            let comparison = named(errors, &format!("time over the least of all sizes: {name}, beside our rule's"), "");
            add(comparison.measured([over_best(rule), f64::NAN, over_best(0)]).why("what a user pays"));
        }
        if self.name == "Sphere01" {
            let of_best = named("Figure 5.3", "cells for each axis at the least time", "");
            add(of_best.printed(Rule::Equal(0.25), printed_best).ours(middle).why(PRICES));
            findings.series.push(measured.curve(axis_mm));
        }
    }
}

/// A scene without boxes and particles.
fn bare(scene: &Scene) -> Scene {
    let (boxes, particles) = (Vec::new(), Vec::new());
    Scene { name: String::new(), measures: scene.measures, size_mm: scene.size_mm, boxes, particles, table_row: None }
}

impl Measured {
    /// Measured and fitted time over cells for each axis.
    fn curve(&self, axis_mm: f64) -> Series {
        let points = |times: &[f64]| {
            let all = self.ladder_mm.iter().zip(times).map(|(size_mm, us)| (axis_mm / size_mm, 1e-3 * us));
            all.collect::<Vec<(f64, f64)>>()
        };
        let rules = RULES.iter().zip(self.sizes_mm).zip(&self.times_us[self.ladder_mm.len()..]);
        // A short upright stroke marks a rule's size.
        let rule = |((name, size_mm), us): ((&&str, f64), &f64)| {
            let x = axis_mm / size_mm;
            ((*name).to_string(), vec![(x, 0.9e-3 * us), (x, 1.1e-3 * us)])
        };
        let curves = [
            ("measured, mean of ten frames".to_string(), points(&self.times_us)),
            ("model with fitted prices, first frame".to_string(), points(&self.fitted_us)),
        ];
        Series {
            title: "Figure 5.3: two Sphere01, time over the number of cells".into(),
            x: "cells for each axis".into(),
            y: "time, ms".into(),
            logarithmic: true,
            lines: curves.into_iter().chain(rules.map(rule)).collect(),
            ..Series::default()
        }
    }
}
