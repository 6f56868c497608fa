//! Scenes on trial: every choice run, the plan asked, both noted.

use super::case::{Case, Source};
use super::scene::Situation;
use std::fmt::Display;
use trepan_budget::{
    Bone, Choice, FEATURES, Kind, Machine, Picture, Plan, Quality, Row as Laws, Rows, Scene, Setup, Tissue,
    TissueForce, bone_error_n, holds_walls, plan_with, tissue_over,
};
use trepan_evidence::suite::{Findings, Row};
use trepan_models::measure::CaseErrors;
use trepan_models::measure::bone::Stretch;
use trepan_models::measure::picture::View;
use trepan_models::measure::tissue::{Brains, LEAST_MM, Measurement, Push};
use trepan_models::{Element, Ingredients};
use trepan_patient::Fineness;

/// Tetrahedra that a quick run has at most.
const QUICK_TETS: usize = 8_000;

/// Scenes of one case.
pub fn run(source: Source, scenes: usize, random: &mut fastrand::Rng, quick: bool, findings: &mut Findings) {
    let (rows, truth) = (stored(quick), if quick { Fineness::QUICK } else { Fineness::JUDGE });
    let case = Case::of(source, random);
    let tissues: Vec<_> = rows.tissue.iter().map(|row| row.what).collect();
    let brains = Brains::of(&case.brain, &tissues, element()).expect("the brain can be filled");
    for number in 0..scenes {
        let (situation, stretch, push) = scene(&case, &brains, truth, random);
        let name = format!("{} {number}", case.name);
        let bones: Vec<_> = rows.bone.iter().map(|row| row.what).collect();
        let on_bone = stretch.measure(&bones).iter().map(|found| found.error_n).collect();
        let in_tissue = push.measure(&brains).expect("the brain is sound");
        let pictures: Vec<_> = rows.picture.iter().map(|row| row.what).collect();
        let seen = View::measure_all(&situation.views(&case), &pictures, 1).expect("the views have pixels");
        let own = CaseErrors::of(&situation.sight(&case), &situation.scene, &rows, element(), 1);
        note(&name, &situation, &rows, &own, Found { on_bone, in_tissue, seen }, findings);
    }
}

/// The element of a session without flags.
fn element() -> Element {
    Ingredients::of(Quality::Auto).element
}

/// Measured errors of all choices in a scene.
struct Found {
    /// Of the force, N.
    on_bone: Vec<f64>,
    in_tissue: Vec<Measurement>,
    /// Of the picture, percent of white.
    seen: Vec<f64>,
}

/// A scene with bone to touch and a brain that moves under the push.
fn scene<'a>(
    case: &'a Case,
    brains: &Brains,
    truth: Fineness,
    random: &mut fastrand::Rng,
) -> (Situation, Stretch<'a>, Push) {
    loop {
        let (situation, stretch) = super::stretch(case, random);
        let push = Push::of(&situation.push(case), brains, truth).expect("the brain is sound");
        if push.moved_mm() >= LEAST_MM {
            return (situation, stretch, push);
        }
    }
}

/// The stored rows that a session may take; in a quick run without those that take long.
fn stored(quick: bool) -> Rows {
    let mut rows = Rows::stored().expect("the stored tables are sound");
    rows.bone.retain(|row| holds_walls(&row.what, 0.0));
    rows.tissue.retain(|row| !quick || row.what.tets <= QUICK_TETS);
    rows
}

/// Rows of one scene: for each kind what the plan chose, what presets would have done and what was
/// cheapest.
fn note(name: &str, situation: &Situation, rows: &Rows, own: &CaseErrors, found: Found, findings: &mut Findings) {
    let scene = &situation.scene;
    let Found { on_bone, in_tissue, seen } = found;
    let holds_walls = |(row, _): &(Laws<Bone>, f64)| holds_walls(&row.what, scene.tool_radius_mm);
    let (holding, on_bone): (Vec<_>, Vec<_>) = rows.bone.iter().copied().zip(on_bone).filter(holds_walls).unzip();
    let rows = &Rows { bone: holding, ..rows.clone() };
    let looked_at = own.instead(rows.clone(), &situation.scene);
    let machine = &situation.machine;
    let plan = plan_with(machine, scene, &looked_at).expect("the scene is sound");
    let (bone, tissue, picture) =
        (plan.bone.expect("there is bone"), plan.tissue.expect("there is tissue"), plan.picture);
    let chosen = Alone {
        bone: of_choice(&rows.bone, bone.what),
        tissue: of_choice(&rows.tissue, tissue.what),
        picture: of_choice(&rows.picture, picture.what),
    };
    let planned = |alone: Alone| alone.plan(machine, scene);
    let of = |kind, tolerance, features| Of { scene: format!("{name}, {kind}"), kind, tolerance, features };
    let all = rows.bone.iter().zip(on_bone).map(|(row, error)| {
        let priced = planned(Alone { bone: *row, ..chosen }).bone.expect("there is bone");
        let over = error / scene.force_error_n;
        Judged { what: row.what, error, force: None, over, cost: priced.cost, in_time: priced.in_time }
    });
    let claim =
        Claim::of(&bone, bone.error / scene.force_error_n, &rows.bone, &looked_at.bone, |row| bone_error_n(scene, row));
    of("bone", scene.force_error_n, scene.bone_features()).note(all.collect(), claim, |setup| setup.bone, findings);
    let all = rows.tissue.iter().zip(in_tissue).map(|(row, found)| {
        let priced = planned(Alone { tissue: *row, ..chosen }).tissue.expect("there is tissue");
        let (error, force) = (found.error_mm, Some(found.force));
        let over = tissue_over(scene, error, force);
        Judged { what: row.what, error, force, over, cost: priced.cost, in_time: priced.in_time }
    });
    let features = scene.tissue_features();
    let over = tissue_over(scene, tissue.error, tissue.force);
    let claim = Claim::of(&tissue, over, &rows.tissue, &looked_at.tissue, |row| row.error.at_most(&features));
    of("tissue", scene.displacement_mm, features).note(all.collect(), claim, |setup| setup.tissue, findings);
    let all = rows.picture.iter().zip(seen).map(|(row, error)| {
        let priced = planned(Alone { picture: *row, ..chosen }).picture;
        let over = error / scene.picture_error_percent;
        Judged { what: row.what, error, force: None, over, cost: priced.cost, in_time: priced.in_time }
    });
    let features = scene.picture_features();
    let over = picture.error / scene.picture_error_percent;
    let claim = Claim::of(&picture, over, &rows.picture, &looked_at.picture, |row| row.error.at_most(&features));
    of("picture", scene.picture_error_percent, features).note(all.collect(), claim, |setup| setup.picture, findings);
}

/// One row of each kind.
#[derive(Clone, Copy)]
struct Alone {
    bone: Laws<Bone>,
    tissue: Laws<Tissue>,
    picture: Laws<Picture>,
}

impl Alone {
    /// The plan without another choice: what it costs, and whether it runs in time.
    fn plan(self, machine: &Machine, scene: &Scene) -> Plan {
        let Self { bone, tissue, picture } = self;
        let rows = Rows { bone: vec![bone], tissue: vec![tissue], picture: vec![picture] };
        plan_with(machine, scene, &rows).expect("the scene is sound")
    }
}

/// The row of a choice.
fn of_choice<T: Kind + PartialEq>(rows: &[Laws<T>], what: T) -> Laws<T> {
    *rows.iter().find(|row| row.what == what).expect("a choice comes from a row")
}

/// A choice as it was found to be.
#[derive(Clone, Copy)]
struct Judged<T> {
    what: T,
    error: f64,
    force: Option<TissueForce>,
    /// The worst of its errors over their tolerances.
    over: f64,
    cost: f64,
    in_time: bool,
}

/// A kind of choice in a scene.
struct Of {
    scene: String,
    kind: &'static str,
    tolerance: f64,
    features: [f64; FEATURES],
}

/// A plan's claim, and what it believed of every choice; `None` of those that it left out.
struct Claim<T> {
    what: T,
    /// The worst of its bounds over their tolerances.
    over: f64,
    meets: bool,
    believed: Vec<Option<f64>>,
    /// The same of the force on tissue, N.
    believed_force: Vec<Option<f64>>,
}

impl<T: Kind + PartialEq> Claim<T> {
    fn of(
        choice: &Choice<T>,
        over: f64,
        rows: &[Laws<T>],
        looked_at: &[Laws<T>],
        error: impl Fn(&Laws<T>) -> f64,
    ) -> Self {
        let of = |row: &Laws<T>| looked_at.iter().find(|seen| seen.what == row.what);
        Self {
            what: choice.what,
            over,
            meets: choice.meets_tolerance && choice.in_time,
            believed: rows.iter().map(|row| of(row).map(&error)).collect(),
            believed_force: rows.iter().map(|row| Some(of(row)?.force?.error_n)).collect(),
        }
    }
}

impl Of {
    fn note<T: Kind + Display + PartialEq>(
        &self,
        all: Vec<Judged<T>>,
        claim: Claim<T>,
        of_setup: impl Fn(Setup) -> T,
        findings: &mut Findings,
    ) {
        let of = |what: T| all.iter().find(|n| n.what == what);
        let meeting = all.iter().filter(|n| n.over <= 1.0 && n.in_time);
        let cheapest = meeting.min_by(|a, b| a.cost.total_cmp(&b.cost));
        let chosen = Quality::ALL.iter().map(|q| (q.name(), of(q.preset().map_or(claim.what, &of_setup))));
        for (name, taken) in chosen.chain([("cheapest", cheapest)]) {
            let Some(taken) = taken else { continue };
            findings.rows.push(self.row(name, taken));
        }
        if let Some(auto) = findings.rows.iter_mut().rev().find(|row| row.method == "auto" && row.scene == self.scene) {
            let four = |x: f64| (x * 1e4).round() / 1e4;
            auto.config.insert("errors".into(), all.iter().map(|n| four(n.error)).collect::<Vec<_>>().into());
            auto.config.insert("features".into(), self.features.map(four).to_vec().into());
            let believed = |of: &[Option<f64>]| of.iter().map(|e| e.map(four)).collect::<Vec<_>>();
            auto.config.insert("believed".into(), believed(&claim.believed).into());
            let forces: Vec<f64> = all.iter().filter_map(|n| Some(four(n.force?.error_n))).collect();
            if !forces.is_empty() {
                auto.config.insert("force_errors".into(), forces.into());
                auto.config.insert("believed_forces".into(), believed(&claim.believed_force).into());
            }
            auto.metrics.insert("bound_over_tolerance".into(), claim.over);
            auto.metrics.insert("says_met_count".into(), f64::from(u8::from(claim.meets)));
        }
    }

    fn row<T: Display>(&self, name: &str, taken: &Judged<T>) -> Row {
        let row = Row::new(&self.scene, name)
            .with("kind", self.kind)
            .with("choice", taken.what.to_string())
            .with("tolerance", self.tolerance)
            .metric("error_over_tolerance", taken.over)
            .metric("own_error_over_tolerance", taken.error / self.tolerance)
            .metric("in_time_count", f64::from(u8::from(taken.in_time)))
            .metric("cost_cores", taken.cost);
        match taken.force {
            Some(TissueForce { error_n, force_n }) => row.metric("force_error_n", error_n).metric("force_n", force_n),
            None => row,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_rivals::Family;

    #[test]
    fn every_stored_method_exists_and_only_those_with_a_proxy_hold_walls() {
        let rows = Rows::stored().unwrap();
        for what in rows.bone.iter().map(|row| row.what) {
            let method = trepan_rigid::Method::named(what.method).expect(what.method);
            let fits = holds_walls(&Bone { spacing_mm: 100.0, ..what }, 1.0);
            assert_eq!(fits, method.has_proxy(), "{}", what.method);
            let points = method.with_points(what.points).points() as f64;
            let jams = !holds_walls(&what, 10.0);
            let sparse = points > 0.0 && 400.0 * std::f64::consts::PI > points * what.spacing_mm.powi(2);
            assert_eq!(jams, !method.has_proxy() || sparse, "{} {}", what.method, what.points);
        }
        for solver in rows.tissue.iter().map(|row| row.what.solver) {
            assert!(solver == "tled" || trepan_soft::Method::named(solver).is_some(), "{solver}");
        }
    }
}
