//! Measures meshes that are finer at the opening. TLED runs with edges halved there none, one and
//! two times, with and without averaged nodal pressure, in pushes of the judged kind.
//!
//! # Theory
//! Cost is that of the step that the mesh really allows, on the machine for which choices are
//! priced; the cure's as a ratio in one run.
//!
//! The truth is held against a mesh with half of its edges under the tool.
//!
//! # Practice
//! Plans and presets take such meshes, without averaged pressure.

use super::case::{Case, Source};
use super::scene::MACHINE;
use trepan_budget::Tissue;
use trepan_evidence::part::Scope;
use trepan_evidence::picture::{Chart, Mark};
use trepan_evidence::suite::{Findings, Row};
use trepan_models::Element;
use trepan_models::measure::tissue::{Brains, Push};
use trepan_patient::Fineness;

/// Tetrahedra of the whole brain.
const TETS: [usize; 4] = [3_000, 8_000, 20_000, 50_000];
/// Those of a quick run, and most of them with every edge halved.
const QUICK_TETS: usize = 8_000;
const MOST_HALVED: usize = 20_000;

/// What the truth is held against: about half of its own edges under the tool.
const FINER: Fineness = Fineness { tets: 400_000, halvings: 4, radius_mm: 6.0, above_mm: 0.0 };

/// Error and cost of every mesh.
pub fn run(scope: Scope, findings: &mut Findings) {
    let mut random = scope.random(super::SEED + 9100);
    for &source in scope.pick(&[Source::BuiltIn][..], &[Source::BuiltIn, Source::MadeUp]) {
        let case = Case::of(source, &mut random);
        let unit = Tissue { solver: "tled", tets: TETS[0], halvings: 0 };
        let brains = Brains::of(&case.brain, &[unit], Element::Plain).expect("the brain can be filled");
        for n in 0..scope.pick(1, 4) {
            let (situation, _) = super::stretch(&case, &mut random);
            let truth = if scope.quick { Fineness::QUICK } else { Fineness::JUDGE };
            let push = Push::of(&situation.push(&case), &brains, truth).expect("the brain is sound");
            let motion_mm = situation.scene.tissue_motion_mm;
            if !scope.quick {
                let finer = Push::of(&situation.push(&case), &brains, FINER).expect("the brain is sound");
                findings.rows.push(
                    Row::new(
                        format!("truth in tissue, {} {n}", case.name),
                        "a sixteenth of the edge under the tool, cured",
                    )
                    .with("motion_mm", motion_mm)
                    .with("motion_over_radius", motion_mm / situation.scene.probe_radius_mm)
                    .metric("off_finer_p95_mm", push.apart_mm(&finer)),
                );
            }
            let scene = format!("finer at the opening, {} {n}", case.name);
            let mut marks = Vec::new();
            for (halvings, tets) in [0, 2, 3, 4].into_iter().flat_map(|halvings| TETS.map(|tets| (halvings, tets))) {
                if tets > scope.pick(QUICK_TETS, MOST_HALVED) && (scope.quick || halvings > 0) {
                    continue;
                }
                let found = [false, true].map(|cure| {
                    push.measure_finer(&brains, Fineness::stepped(tets, halvings), cure).expect("the brain is sound")
                });
                let cured_over = (found[1].ns / found[0].ns).max(1.0);
                for (found, over, cure) in [(found[0], 1.0, ""), (found[1], cured_over, ", cured")] {
                    let method = match halvings {
                        0 => format!("alike everywhere{cure}"),
                        n => format!("edge 1/{} at the opening{cure}", 1 << n),
                    };
                    let cores = tets as f64 * MACHINE.ns_per_tet_step * 1e-6 * over / found.dt_ms;
                    marks.push(Mark { method: method.clone(), cost: cores, error: found.error_mm / motion_mm });
                    findings.rows.push(
                        Row::new(&scene, method)
                            .with("tets", tets)
                            .with("motion_mm", motion_mm)
                            .metric("error_over_motion", found.error_mm / motion_mm)
                            .metric("cost_cores", cores)
                            .metric("dt_ms", found.dt_ms),
                    );
                }
            }
            findings.charts.push(Chart {
                title: format!("Displacement near the tool over cost: {scene}"),
                cost: "cost_cores".into(),
                error: "error_over_motion".into(),
                marks,
                ..Chart::default()
            });
        }
    }
}
