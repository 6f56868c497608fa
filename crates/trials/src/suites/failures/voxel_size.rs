//! Voxel size: a rule whose grid works more than twice as hard as the best one.

use super::{Candidate, Family, Scope, Standing};
use crate::suites::voxel_size::odd::{PRICES, Scene, cloud, ladder, row_of_boxes, size_by, work};
use crate::suites::voxel_size::{OURS, RULES};
use trepan_evidence::nearest::{Condition, Scale, Trial};
use trepan_geometry::{Aabb, Vec3};
use trepan_voxel_size::Prices;

/// Largest work over that of the best cell.
const MOST: f64 = 2.0;
/// Boxes along an axis, each of 1 mm, and particles.
const EDGE: usize = 8;
const PARTICLES: f64 = 450.0;

pub const FAMILY: Family<&str> = Family {
    suite: "voxel-size",
    criterion: "a rule fails when the grid of its cell does more than twice the work of the best of 18 cells (visits \
                and tests are counted and weighted by their usual prices), or when it gives no cell",
    methods,
};

fn methods(_: Scope) -> Vec<Candidate<&'static str>> {
    let candidate = |rule: &'static str| {
        let own = rule == OURS || rule == RULES[1];
        let standing = if own { Standing::Own } else { Standing::by_name(rule) };
        Candidate { name: rule.into(), standing, conditions: &CONDITIONS, method: rule }
    };
    RULES.into_iter().map(candidate).collect()
}

const fn condition(
    name: &'static str,
    unit: &'static str,
    nominal: f64,
    limits: [f64; 2],
    trial: fn(&&str, f64) -> Trial,
) -> Condition<&'static str> {
    let axes = ["cell, mm", "work / least work"];
    Condition { name, unit, nominal, limits, scale: Scale::Log, axes, trial }
}

const CONDITIONS: [Condition<&str>; 7] = [
    condition("particles", "1", PARTICLES, [2.0, 16_000.0], |rule, count| {
        grid(rule, (row_of_boxes(EDGE, |_| 1.0), cloud(count as usize, EDGE as f32)))
    }),
    condition("elements along an axis", "1", EDGE as f64, [1.0, EDGE as f64], |rule, edge| {
        let edge = edge.round();
        let particles = PARTICLES * (edge / EDGE as f64).powi(3);
        grid(rule, (row_of_boxes(edge as usize, |_| 1.0), cloud(particles.ceil() as usize, edge as f32)))
    }),
    condition("error of the timed price of a test", "1", 1.0, [1.0 / 64.0, 64.0], |rule, error| {
        let scene = (row_of_boxes(EDGE, |_| 1.0), cloud(PARTICLES as usize, EDGE as f32));
        priced(rule, &scene, &Prices { test: error * PRICES.test, ..PRICES })
    }),
    condition("size of the particles' cloud", "mm", EDGE as f64, [0.01, 128.0], |rule, size| {
        let middle = Vec3::splat(0.5 * (EDGE as f32 - size as f32));
        let particles = cloud(PARTICLES as usize, size as f32).into_iter().map(|p| p + middle).collect();
        grid(rule, (row_of_boxes(EDGE, |_| 1.0), particles))
    }),
    condition("largest over smallest element", "1", 1.0, [1.0, 256.0], |rule, ratio| {
        let last = (EDGE.pow(3) - 1) as f64;
        let size = |n: usize| (ratio.powf(n as f64 / last - 0.5)) as f32;
        grid(rule, (row_of_boxes(EDGE, size), cloud(PARTICLES as usize, EDGE as f32)))
    }),
    condition("flatness of the elements", "1", 1.0, [1e-3, 1.0], |rule, flat| {
        let pressed = |b: Aabb| Aabb { min: b.min, max: b.max.with_z(b.min.z + flat as f32) };
        let boxes = row_of_boxes(EDGE, |_| 1.0).into_iter().map(pressed).collect();
        grid(rule, (boxes, cloud(PARTICLES as usize, EDGE as f32)))
    }),
    condition("edge of one element in 24", "mm", 1.0, [1.0, 64.0], |rule, edge| {
        let size = |n: usize| if n.is_multiple_of(24) { edge as f32 } else { 1.0 };
        grid(rule, (row_of_boxes(EDGE, size), cloud(PARTICLES as usize, EDGE as f32)))
    }),
];

/// A rule that knows the prices.
fn grid(rule: &str, scene: Scene) -> Trial {
    priced(rule, &scene, &PRICES)
}

/// A rule that takes these for the prices.
fn priced(rule: &str, scene: &Scene, prices: &Prices) -> Trial {
    let ladder = ladder(scene);
    let best = ladder.iter().map(|(_, work)| *work).fold(f64::INFINITY, f64::min);
    let trace = ladder.iter().map(|(cell, work)| (*cell, work / best)).collect();
    let fault = match size_by(scene, rule, prices).and_then(|cell| Ok((cell, work(scene, cell)?))) {
        Err(fault) => Some(format!("gives no cell: {fault}")),
        Ok((_, own)) if own <= MOST * best => None,
        Ok((cell, own)) => Some(format!("takes a cell of {cell:.2} mm: {:.1} times the least work", own / best)),
    };
    Trial { fault, trace }
}
