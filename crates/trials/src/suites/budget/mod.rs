//! No more model than a scene needs: what a plan chooses in random scenes, whether that meets the tolerance, and what the cheapest choice that does would cost.
//!
//! # Theory
//! In each scene every stored choice for bone, tissue and picture that a session may take (bone: methods that hold thin walls) is run against a truth of high resolution; the cheapest that meets the tolerance, by stored costs, is found by
//! looking at all. The plan is told the scene's features only. Scenes in which no choice meets a tolerance are counted apart: there the plan must say so.
//!
//! # Practice
//! Rows of the budget come from other scenes, drawn with other random numbers ([`training`]).

mod bone;
mod case;
mod judge;
mod picture;
mod scene;
mod tissue;
pub mod training;
mod trial;

use super::{Part, Scope};
use crate::suite::{Findings, Gate, Row};
use case::{Case, Source};
pub use judge::judge;
use scene::Situation;

/// Random numbers of the scenes that are judged; those of training lie elsewhere.
const SEED: u64 = 0x6275_6467_6574;
/// Tries at a scene before the case is given up.
const TRIES: usize = 200;

/// Cases, and how many parts of ten scenes each.
const CASES: [(&str, Source, usize); 3] =
    [("built-in head", Source::BuiltIn, 4), ("made-up heads", Source::MadeUp, 4), ("open heads", Source::Open, 2)];

/// Ten scenes a part; a quick run has one scene of the built-in head and one of a made-up one.
pub fn parts(scope: Scope) -> Vec<Part> {
    let mut parts = Vec::new();
    for (name, source, count) in CASES {
        // Open heads are the slowest, and a quick run says little of them.
        let quick = usize::from(source != Source::Open);
        for number in 0..scope.pick(quick, count) {
            let scenes = scope.pick(1, 10);
            let part = format!("scenes, {name} {number}");
            parts.push(Part::new(part, move |scope, found| {
                let mut random = scope.random(SEED + 1000 * source as u64 + number as u64);
                trial::run(source, scenes, &mut random, scope.quick, found);
            }));
        }
    }
    parts.push(Part::new("truth against the oracle", truth));
    parts
}

/// A case and a stretch of its skull with bone enough.
fn stretch(case: &Case, random: &mut fastrand::Rng) -> (Situation, bone::Stretch) {
    let mut draw = || {
        let situation = Situation::draw(case, random);
        bone::Stretch::of(case, &situation).map(|stretch| (situation, stretch))
    };
    (0..TRIES).find_map(|_| draw()).expect("a skull has places with bone")
}

/// The truth of bone, by the recommended method on fine voxels, beside the oracle there.
fn truth(scope: Scope, findings: &mut Findings) {
    let mut random = scope.random(SEED + 9000);
    let case = Case::of(Source::BuiltIn, &mut random);
    let mut worst = 0.0f64;
    for n in 0..scope.pick(1, 4) {
        let (situation, stretch) = stretch(&case, &mut random);
        let error_mm = stretch.oracle_error_n(scope.pick(24, 8)) / situation.scene.stiffness;
        worst = worst.max(error_mm);
        findings.rows.push(
            Row::new(format!("truth on bone {n}"), "distance-field on 0.25 mm voxels")
                .with("radius_mm", situation.scene.tool_radius_mm)
                .metric("depth_error_p95_mm", error_mm),
        );
    }
    findings.gates.push(Gate::at_most("truth on bone: apart from the oracle on the same voxels, p95 mm", worst, 0.03));
}
