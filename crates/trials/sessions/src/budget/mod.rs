//! Judges the plan: what it chooses in random scenes, whether that meets the tolerance, and what
//! the cheapest choice that does would cost.
//!
//! # Theory
//! In each scene every stored choice for bone, tissue and picture that a session may take (bone:
//! methods that hold thin walls) is run against a truth of high resolution; the cheapest that meets
//! the tolerance, by stored costs, is found by looking at all. The plan measures the case as a
//! session does, along other ways and from another eye. Scenes in which no choice meets a tolerance
//! are counted apart: there the plan must say so.
//!
//! # Practice
//! Rows of the budget come from other scenes, drawn with other random numbers ([`training`]).

mod case;
mod judge;
mod refinement;
mod scene;
pub mod training;
mod trial;

use case::{Case, Source};
pub use judge::judge;
use scene::Situation;
use trepan_budget::{Bone, Scene};
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::Vec3;
use trepan_models::measure::bone::Stretch;

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
    parts.push(Part::new("finer at the opening", refinement::run));
    parts
}

/// A case and a stretch of its skull with bone enough.
fn stretch<'a>(case: &'a Case, random: &mut fastrand::Rng) -> (Situation, Stretch<'a>) {
    let mut draw = || {
        let situation = Situation::draw(case, random);
        Stretch::of(&case.skull, &situation.slide()).map(|stretch| (situation, stretch.cutting()))
    };
    (0..TRIES).find_map(|_| draw()).expect("a skull has places with bone")
}

/// Compares the truth of bone with closed forms, on made-up heads. Rows beside it are the
/// recommended method and the oracle on fine voxels, against the truth.
fn truth(scope: Scope, findings: &mut Findings) {
    let mut random = scope.random(SEED + 9000);
    let mut worst = 0.0f64;
    let count = scope.pick(1, 4);
    for n in 0..2 * count {
        let case = Case::of(if n < count { Source::BuiltIn } else { Source::MadeUp }, &mut random);
        let (situation, stretch) = stretch(&case, &mut random);
        let Scene { stiffness, tool_radius_mm, .. } = situation.scene;
        let scene = format!("truth on bone {n}, {}", case.name);
        let row = |method: &str| Row::new(&scene, method).with("radius_mm", tool_radius_mm);
        let recommended_mm = stretch.recommended_error_n() / stiffness;
        findings.rows.push(row("god-object-sphere on 0.25 mm voxels").metric("off_truth_p95_mm", recommended_mm));
        if !scope.quick {
            let oracle = Bone { method: "brute", spacing_mm: 0.25, points: 0 };
            let apart_mm = stretch.measure(&[oracle])[0].error_n / stiffness;
            findings.rows.push(row("oracle on 0.25 mm voxels").metric("off_truth_p95_mm", apart_mm));
        }
        if let Some((middle, radius)) = case.ball {
            let force = |tip: Vec3| {
                let away = tip.as_dvec3() - middle;
                let depth = (radius + tool_radius_mm - away.length()).max(0.0);
                (stiffness * depth * away.normalize()).as_vec3()
            };
            let error_mm = stretch.known_error_n(force) / stiffness;
            worst = worst.max(error_mm);
            findings.rows.push(row("truth").metric("off_ball_p95_mm", error_mm));
        }
    }
    let name = "truth on bone: apart from a ball in closed form, of which a scanner has made voxels, p95 mm";
    findings.gates.push(Gate::at_most(name, worst, 0.03));
}
