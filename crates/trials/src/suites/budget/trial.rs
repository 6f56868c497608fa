//! Scenes on trial: every choice run, the plan asked, both noted.

use super::case::{Case, Source};
use super::scene::{MACHINE, Situation};
use crate::suite::{Findings, Row};
use std::fmt::Display;
use trepan_budget::{Kind, Neighbour, Quality, Rows, bone_cores, holds_walls, picture_cores, plan_with, tissue_cores};
use trepan_simulator::measure::Own;
use trepan_simulator::measure::bone::Stretch;
use trepan_simulator::measure::tissue::{Brains, Fineness, LEAST_MM, Push};

/// Tetrahedra that a quick run has at most.
const QUICK_TETS: usize = 8_000;

/// Scenes of one case.
pub fn run(source: Source, scenes: usize, random: &mut fastrand::Rng, quick: bool, findings: &mut Findings) {
    let (rows, truth) = (stored(quick), if quick { Fineness::QUICK } else { Fineness::JUDGE });
    let case = Case::of(source, random);
    let tissues: Vec<_> = rows.tissue.iter().map(|row| row.what).collect();
    let brains = Brains::of(&case.brain, &tissues).expect("the brain can be filled");
    for number in 0..scenes {
        let (situation, stretch, push) = scene(&case, &brains, truth, random);
        let name = format!("{} {number}", case.name);
        let bones: Vec<_> = rows.bone.iter().map(|row| row.what).collect();
        let on_bone = stretch.measure(&case.skull, &bones).iter().map(|found| found.error_n).collect();
        let in_tissue = push.measure(&brains).expect("the brain is sound");
        let in_tissue = in_tissue.iter().map(|found| found.error_mm).collect();
        let pictures: Vec<_> = rows.picture.iter().map(|row| row.what).collect();
        let seen = situation.view(&case).measure(&pictures, 1).expect("the view has pixels");
        let seen = seen.iter().map(|found| found.error_percent).collect();
        let own = Own::of(&situation.sight(&case), &situation.scene, &rows, 1);
        note(&name, &situation, &rows, &own, [on_bone, in_tissue, seen], findings);
    }
}

/// A scene with bone to touch and a brain that moves under the push.
fn scene(case: &Case, brains: &Brains, truth: Fineness, random: &mut fastrand::Rng) -> (Situation, Stretch, Push) {
    loop {
        let (situation, stretch) = super::stretch(case, random);
        let push = Push::of(&case.brain, &situation.push(case), brains, truth).expect("the brain is sound");
        if push.moved_mm() >= LEAST_MM {
            return (situation, stretch, push);
        }
    }
}

/// The stored rows that a session may take; in a quick run without those that take long.
fn stored(quick: bool) -> Rows {
    let mut rows = Rows::stored().expect("the stored tables are sound");
    rows.bone.retain(|row| holds_walls(&row.what));
    rows.tissue.retain(|row| !quick || row.what.tets <= QUICK_TETS);
    rows
}

/// Rows of one scene: for each kind what the plan chose, what presets would have done and what was cheapest.
fn note(name: &str, situation: &Situation, rows: &Rows, own: &Own, errors: [Vec<f64>; 3], findings: &mut Findings) {
    let scene = &situation.scene;
    let plan = plan_with(&MACHINE, scene, &own.instead(rows.clone(), scene)).expect("the scene is sound");
    let (bone, tissue) = (plan.bone.expect("there is bone"), plan.tissue.expect("there is tissue"));
    let presets = Quality::ALL.map(|quality| (quality, quality.preset()));
    let [on_bone, in_tissue, seen] = errors;
    let of = |kind, tolerance| Of { scene: format!("{name}, {kind}"), kind, tolerance };
    let judged = rows.bone.iter().zip(on_bone).map(|(row, e)| (row.what, e, bone_cores(&MACHINE, scene, row)));
    let presets_of = presets.map(|(quality, setup)| (quality.name(), setup.map(|s| s.bone)));
    let said = Said { what: bone.what, bound: bone.error, meets: bone.meets_tolerance };
    of("bone", scene.force_error_n).note(judged.collect(), said, &presets_of, &scene.bone_features(), findings);
    let judged = rows.tissue.iter().zip(in_tissue).map(|(row, e)| (row.what, e, tissue_cores(&MACHINE, scene, row)));
    let presets_of = presets.map(|(quality, setup)| (quality.name(), setup.map(|s| s.tissue)));
    let said = Said { what: tissue.what, bound: tissue.error, meets: tissue.meets_tolerance };
    of("tissue", scene.displacement_mm).note(judged.collect(), said, &presets_of, &scene.tissue_features(), findings);
    let judged = rows.picture.iter().zip(seen).map(|(row, e)| (row.what, e, picture_cores(&MACHINE, scene, row)));
    let presets_of = presets.map(|(quality, setup)| (quality.name(), setup.map(|s| s.picture)));
    let picture = plan.picture;
    let said = Said { what: picture.what, bound: picture.error, meets: picture.meets_tolerance };
    let of = of("picture", scene.picture_error_percent);
    of.note(judged.collect(), said, &presets_of, &scene.picture_features(), findings);
}

/// A kind of choice in a scene.
struct Of {
    scene: String,
    kind: &'static str,
    tolerance: f64,
}

/// What the plan said.
struct Said<T> {
    what: T,
    bound: f64,
    meets: bool,
}

impl Of {
    fn note<T: Kind + Display + PartialEq>(
        &self,
        judged: Vec<(T, f64, f64)>,
        said: Said<T>,
        presets: &[(&str, Option<T>)],
        features: &[f64; 3],
        findings: &mut Findings,
    ) {
        let all: Vec<_> =
            judged.iter().map(|&(what, error, cost)| Neighbour { what, error, cost, in_time: true }).collect();
        let of = |what: T| all.iter().find(|n| n.what == what);
        let meeting = all.iter().filter(|n| n.error <= self.tolerance);
        let cheapest = meeting.min_by(|a, b| a.cost.total_cmp(&b.cost));
        let chosen = presets.iter().map(|&(name, what)| (name, of(what.unwrap_or(said.what))));
        for (name, taken) in chosen.chain([("cheapest", cheapest)]) {
            let Some(taken) = taken else { continue };
            findings.rows.push(self.row(name, taken));
        }
        if let Some(auto) = findings.rows.iter_mut().rev().find(|row| row.method == "auto" && row.scene == self.scene) {
            let four = |x: f64| (x * 1e4).round() / 1e4;
            auto.config.insert("errors".into(), all.iter().map(|n| four(n.error)).collect::<Vec<_>>().into());
            auto.config.insert("features".into(), features.iter().map(|f| four(*f)).collect::<Vec<_>>().into());
            auto.metrics.insert("bound_over_tolerance".into(), said.bound / self.tolerance);
            auto.metrics.insert("says_met_count".into(), f64::from(u8::from(said.meets)));
        }
    }

    fn row<T: Display>(&self, name: &str, taken: &Neighbour<T>) -> Row {
        Row::new(&self.scene, name)
            .with("kind", self.kind)
            .with("choice", taken.what.to_string())
            .with("tolerance", self.tolerance)
            .metric("error_over_tolerance", taken.error / self.tolerance)
            .metric("cost_cores", taken.cost)
    }
}
