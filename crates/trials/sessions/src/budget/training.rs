//! Where the stored rows come from: every choice in scenes of training, and the laws of what was
//! found.

use super::case::{Case, Source};
use super::scene::Situation;
use serde::{Deserialize, Serialize};
use trepan_budget::{Bone, FEATURES, Kind, Picture, PowerLaw, Quality, Row, Tissue, write};
use trepan_models::Ingredients;
use trepan_models::measure::tissue::{self, Brains, Push};
use trepan_models::measure::{self, PlannedParts, bone, picture};
use trepan_patient::Fineness;

/// Random numbers of training: far from those of the scenes that are judged.
const SEED: u64 = 0x7472_6169_6e00;
/// Scenes of one part.
const SCENES: usize = 8;
/// Parts by case, and how many of them look at tissue too, which takes long.
const PARTS: [Source; 17] = {
    use Source::{BuiltIn, MadeUp, Open};
    [
        BuiltIn, MadeUp, BuiltIn, MadeUp, Open, BuiltIn, MadeUp, MadeUp, MadeUp, MadeUp, BuiltIn, MadeUp, MadeUp, Open,
        MadeUp, BuiltIn, MadeUp,
    ]
};
const WITH_TISSUE: usize = 8;
/// Least that counts as an error, mm or percent: less is as good as none.
const LEAST: f64 = 1e-3;
/// Share of the scenes that bounds cover.
const COVERED: f64 = 0.95;

/// One scene's features, and error and cost of every choice.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SceneErrors {
    features: [f64; FEATURES],
    errors: Vec<f64>,
    costs: Vec<f64>,
}

/// What a part of training found.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Observed {
    bone: Vec<SceneErrors>,
    tissue: Vec<SceneErrors>,
    picture: Vec<SceneErrors>,
}

/// How many parts there are.
pub fn parts() -> usize {
    PARTS.len()
}

/// Runs one part, for the tables of these names.
pub fn observe(part: usize, tables: &[String]) -> Observed {
    let wanted = |table: &str| tables.iter().any(|name| name == table);
    let [with_bone, with_tissue, with_picture] = [Bone::TABLE, Tissue::TABLE, Picture::TABLE].map(wanted);
    let mut random = fastrand::Rng::with_seed(SEED + part as u64);
    let case = Case::of(PARTS[part], &mut random);
    let (bones, tissues, pictures) = (bone::choices(), tissue::choices(), picture::choices());
    let brains = (part < WITH_TISSUE && with_tissue).then(|| {
        Brains::of(&case.brain, &tissues, Ingredients::of(Quality::Auto).element).expect("the brain can be filled")
    });
    let (unit_us, mut observed) = (unit_us(), Observed::default());
    for _ in 0..SCENES {
        let (situation, stretch) = super::stretch(&case, &mut random);
        let scene = &situation.scene;
        let on_bone = || {
            let found = stretch.measure(&bones);
            SceneErrors {
                features: scene.bone_features(),
                errors: found.iter().map(|found| found.error_n / scene.stiffness).collect(),
                costs: found.iter().map(|found| found.tick_us / unit_us).collect(),
            }
        };
        let drawn = || {
            let found = situation.views(&case)[0].measure(&pictures, 1).expect("the view has pixels");
            let unit_us = found.last().expect("there are choices").us;
            SceneErrors {
                features: scene.picture_features(),
                errors: found.iter().map(|found| found.error_percent).collect(),
                costs: found.iter().map(|found| found.us / unit_us).collect(),
            }
        };
        observed.bone.extend(with_bone.then(on_bone));
        observed.tissue.extend(brains.as_ref().map(|brains| pushed(&case, &situation, &tissues, brains)));
        observed.picture.extend(with_picture.then(drawn));
    }
    observed
}

/// A tick as a machine is measured, µs.
fn unit_us() -> f64 {
    let wanted = PlannedParts { bone: true, tissue: false, picture: false };
    measure::machine(wanted, false, &Ingredients::default()).us_per_rigid_tick
}

fn pushed(case: &Case, situation: &Situation, choices: &[Tissue], brains: &Brains) -> SceneErrors {
    let push = Push::of(&situation.push(case), brains, Fineness::JUDGE);
    let found = push.and_then(|push| push.measure(brains)).expect("the brain is sound");
    SceneErrors {
        features: situation.scene.tissue_features(),
        errors: found.iter().map(|found| found.error_mm).collect(),
        costs: (0..choices.len()).map(|at| tissue::cost(at, choices, &found, &situation.scene)).collect(),
    }
}

/// The names of all tables.
pub const TABLES: [&str; 3] = [Bone::TABLE, Tissue::TABLE, Picture::TABLE];

/// The tables of which the parts saw anything: name and text.
pub fn tables(parts: &[Observed]) -> Vec<(&'static str, String)> {
    let of = |kind: fn(&Observed) -> &Vec<SceneErrors>| parts.iter().flat_map(kind).collect::<Vec<_>>();
    let pictures = picture::choices().into_iter().filter(|p| !p.sparse && p.detail == 1.0).collect::<Vec<_>>();
    let exact = |row: Row<Picture>| {
        let error = if pictures.contains(&row.what) { PowerLaw::constant(0.0) } else { row.error };
        Row { error, ..row }
    };
    // Bone costs hundredths of a core: there a wide bound is cheap.
    let careful = |row: Row<Bone>| Row { error: row.error.careful(), ..row };
    let on_bone = rows(&bone::choices(), &of(|o| &o.bone), COVERED).into_iter().map(careful).collect::<Vec<_>>();
    let drawn = rows(&picture::choices(), &of(|o| &o.picture), COVERED).into_iter().map(exact).collect::<Vec<_>>();
    let moved = rows(&tissue::choices(), &of(|o| &o.tissue), COVERED);
    [table(&on_bone), table(&moved), table(&drawn)].into_iter().flatten().collect()
}

fn table<T: Kind>(rows: &[Row<T>]) -> Option<(&'static str, String)> {
    (!rows.is_empty()).then(|| (T::TABLE, write(rows)))
}

/// The laws of every choice; one that could not be run in all scenes is left out.
fn rows<T: Kind>(choices: &[T], seen: &[&SceneErrors], covered: f64) -> Vec<Row<T>> {
    let fit = |of: &dyn Fn(&SceneErrors) -> f64| {
        PowerLaw::fit(&seen.iter().map(|seen| (seen.features, of(seen))).collect::<Vec<_>>(), covered)
    };
    let row = |(n, what): (usize, &T)| {
        let error = fit(&|seen| seen.errors[n].max(LEAST))?;
        Some(Row { what: *what, error, cost: fit(&|seen| seen.costs[n])?, force: None })
    };
    choices.iter().enumerate().filter_map(row).collect()
}
