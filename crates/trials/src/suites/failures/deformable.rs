//! Tool and moving tissue: points that are missed or invented, a depth that is wrong.
//!
//! # Theory
//! Points are counted by the f64 oracle on the mesh of each step. On a flat side at rest the depth
//! of a ball is known in closed form: how far it was pushed past the side.

use super::{Candidate, Family, Scope, Standing};
use crate::suites::deformable::scene::{self, Scene};
use crate::suites::deformable::stability::{self, EDGE_MM, PLAIN, cube, endure};
use trepan_deformable::{Config, Method, TissueCollision, TissueStep};
use trepan_evidence::nearest::{Condition, Scale, Trial, exceeds};
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_rivals::Family as _;

/// Largest share of the points inside that may be missed or invented.
const MOST_SHARE: f64 = 0.01;
/// Largest error of a depth, mm.
const MOST_MM: f64 = 0.25;
/// Steps of a trial; the oracle's.
const STEPS: [usize; 2] = [120, 20];

pub const FAMILY: Family<Method> = Family {
    suite: "deformable",
    criterion: "a method fails when it misses or invents more than 1 % of the tool's points that the f64 oracle finds in \
                the tissue, when the depth on a flat side is more than 0.25 mm from how far the ball was pushed past \
                it, or when anything is not a number",
    methods,
};

fn methods(_: Scope) -> Vec<Candidate<Method>> {
    let candidate = |method: Method| {
        let descriptor = method.descriptor();
        let standing = if descriptor.is_oracle {
            Standing::Oracle
        } else if method == Method::RECOMMENDED {
            Standing::Own
        } else {
            Standing::by_name(descriptor.name)
        };
        // The oracle is too slow for a way of a thousand steps.
        let conditions = if descriptor.is_oracle { &CONDITIONS[..POINTWISE] } else { &CONDITIONS[..] };
        Candidate { name: descriptor.name.into(), standing, method, conditions }
    };
    Method::all().into_iter().map(candidate).collect()
}

const POINTS: [&str; 2] = ["step", "points invented (over 0), missed"];
const DEPTH: [&str; 2] = ["way of the tool, mm", "depth, mm"];

/// Conditions that are judged point by point, which are the first.
const POINTWISE: usize = 5;

const CONDITIONS: [Condition<Method>; 10] = [
    Condition {
        name: "tool radius",
        unit: "mm",
        nominal: 2.0,
        limits: [0.01, 64.0],
        scale: Scale::Log,
        axes: POINTS,
        trial: |method, radius| points(method, &stability::Condition { radius_mm: radius as f32, ..PLAIN }),
    },
    Condition {
        name: "height of every second layer of elements",
        unit: "edges",
        nominal: 1.0,
        limits: [1e-7, 1.0],
        scale: Scale::Log,
        axes: POINTS,
        trial: |method, height| {
            points(method, &stability::Condition { shape: &|p| squeezed(p, height as f32), ..PLAIN })
        },
    },
    Condition {
        name: "cell of the grid",
        unit: "edges",
        nominal: 1.45,
        limits: [0.02, 64.0],
        scale: Scale::Log,
        axes: POINTS,
        trial: |method, cell| points(method, &stability::Condition { cell_edges: Some(cell as f32), ..PLAIN }),
    },
    Condition {
        name: "leap of the tissue in a step",
        unit: "mm",
        nominal: 0.1,
        limits: [0.1, 100.0],
        scale: Scale::Log,
        axes: POINTS,
        trial: |method, leap| {
            let leaps = |step: usize, _: &mut fastrand::Rng, positions: &mut [Vec3]| {
                let up = if step.is_multiple_of(2) { 0.0 } else { leap as f32 };
                positions.iter_mut().for_each(|p| p.z += up);
            };
            points(method, &stability::Condition { motion: &leaps, ..PLAIN })
        },
    },
    Condition {
        name: "shaking of every node",
        unit: "edges",
        nominal: 0.05,
        limits: [0.05, 50.0],
        scale: Scale::Log,
        axes: POINTS,
        trial: |method, share| {
            let shaken = |_: usize, random: &mut fastrand::Rng, positions: &mut [Vec3]| {
                positions.iter_mut().for_each(|p| *p += share as f32 * EDGE_MM * cube(random));
            };
            points(method, &stability::Condition { motion: &shaken, ..PLAIN })
        },
    },
    Condition {
        name: "points on the tool",
        unit: "1",
        nominal: 500.0,
        limits: [1.0, 4000.0],
        scale: Scale::Whole,
        axes: DEPTH,
        trial: |method, points| pushed(method, &Tip { points: points as usize, ..TIP }, 0.1, 0.25),
    },
    Condition {
        name: "way of a stroke in a step",
        unit: "mm",
        nominal: 0.1,
        limits: [0.1, 50.0],
        scale: Scale::Log,
        axes: DEPTH,
        trial: |method, way_mm| {
            let scene = Scene::cube_at_rest(CELLS);
            let (ends, depth_mm) = scene.stroke(2);
            let steps = (2.0 * f64::from(ends[0].distance(ends[1])) / way_mm).ceil().max(2.0) as usize;
            depths(method, &scene, &TIP, scene.stroke(steps).0.into_iter().map(|tip| (tip, depth_mm)))
        },
    },
    Condition {
        name: "depth of a press",
        unit: "mm",
        nominal: 10.0,
        limits: [1.0, 144.0],
        scale: Scale::Log,
        axes: DEPTH,
        trial: |method, deepest_mm| pushed(method, &TIP, deepest_mm / EDGE_OF_CUBE_MM, 0.25),
    },
    Condition {
        name: "way of a press in a step",
        unit: "mm",
        nominal: 0.25,
        limits: [0.25, 90.0],
        scale: Scale::Log,
        axes: DEPTH,
        trial: |method, way_mm| pushed(method, &TIP, 0.6, way_mm),
    },
    Condition {
        name: "distance from the origin",
        unit: "mm",
        nominal: 100.0,
        limits: [100.0, 1e9],
        scale: Scale::Log,
        axes: DEPTH,
        trial: |method, away_mm| pushed(method, &Tip { away_mm: away_mm as f32, ..TIP }, 0.1, 0.25),
    },
];

/// Cells of the cube along an axis, and its edge.
const CELLS: usize = 7;
const EDGE_OF_CUBE_MM: f64 = 145.0;

/// A tool's tip, and where the cube stands.
struct Tip {
    points: usize,
    /// Distance of the cube from the origin, mm.
    away_mm: f32,
}

const TIP: Tip = Tip { points: 500, away_mm: 0.0 };

/// Every second layer of nodes at a share of its height over the one below.
fn squeezed(p: Vec3, height: f32) -> Vec3 {
    let layer = (p.z / EDGE_MM).round();
    p.with_z(if layer % 2.0 == 1.0 { (layer - 1.0 + height) * EDGE_MM } else { p.z })
}

fn steps(method: &Method) -> usize {
    STEPS[usize::from(method.descriptor().is_oracle)]
}

fn points(method: &Method, condition: &stability::Condition) -> Trial {
    let mut trace = Vec::new();
    let scope = Scope { quick: false, seed: 1 };
    let each = |off: f64| trace.push((trace.len() as f64, off));
    let record = endure(condition, *method, steps(method), scope, each);
    let wrong = record.missed_points + record.invented_points;
    let fault = if record.not_finite > 0 {
        Some("not a number".into())
    } else if wrong as f64 > MOST_SHARE * record.inside as f64 {
        Some(format!(
            "misses {} and invents {} of {} points",
            record.missed_points, record.invented_points, record.inside
        ))
    } else {
        None
    };
    Trial { fault, trace }
}

/// Straight down into a flat side to a share of the cube's thickness, by ways of some mm.
fn pushed(method: &Method, tip: &Tip, share: f64, way_mm: f64) -> Trial {
    let mut scene = Scene::cube_at_rest(CELLS);
    let (tips, deepest_mm) = scene.push(share as f32);
    scene.mesh.positions.iter_mut().for_each(|p| p.x += tip.away_mm);
    let last = (tips.len() - 1) as f64;
    let each = (way_mm / (f64::from(deepest_mm) / last)).round().max(1.0) as usize;
    // The first tip, every so many, and the last.
    let count = tips.len();
    let kept = tips.into_iter().enumerate().filter(|(step, _)| step % each == 0 || step + 1 == count);
    let known = kept.map(|(step, at)| (at + Vec3::X * tip.away_mm, f64::from(deepest_mm) * step as f64 / last));
    depths(method, &scene, tip, known)
}

/// A way of the tool on which the depth is known at every step.
fn depths(method: &Method, scene: &Scene, tip: &Tip, way: impl Iterator<Item = (Vec3, f64)>) -> Trial {
    let config = Config { method: *method, points: tip.points, ..Config::default() };
    let tool = Tool::probe(scene::RADIUS_MM);
    let mut collision = TissueCollision::new(&scene.mesh, &tool, &config).expect("the scene is sound");
    let still = vec![Vec3::ZERO; scene.mesh.positions.len()];
    let (mut out, mut trial) = (TissueStep::default(), Trial::default());
    let mut first = None;
    for (at, truth) in way {
        collision.step(&scene.mesh.positions, &still, &ToolState::at(Pose::from_translation(at)), &mut out);
        let found = f64::from(out.manifold.depth_mm);
        trial.trace.push((f64::from(at.distance(*first.get_or_insert(at))), found));
        let off = (found - truth).abs();
        if trial.fault.is_none() && exceeds(off, MOST_MM) {
            trial.fault = Some(format!("a depth of {truth:.2} mm is felt as {found:.2} mm"));
        }
    }
    trial
}
