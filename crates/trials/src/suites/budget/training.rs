//! Where the stored rows come from: every choice in scenes of training, and the laws of what was found.

use super::case::{Case, Source};
use super::{bone, picture, tissue};
use serde::{Deserialize, Serialize};
use trepan_budget::{FEATURES, Kind, Law, Row, write};

/// Random numbers of training: far from those of the scenes that are judged.
const SEED: u64 = 0x7472_6169_6e00;
/// Scenes of one part.
const SCENES: usize = 8;
/// Parts, by case.
const PARTS: [Source; 8] = {
    use Source::{BuiltIn, MadeUp, Open};
    [BuiltIn, MadeUp, BuiltIn, MadeUp, Open, BuiltIn, MadeUp, MadeUp]
};
/// Least that counts as an error, mm or percent: less is as good as none.
const LEAST: f64 = 1e-3;
/// Times that a picture is drawn for its time.
const DRAWN: usize = 1;

/// One scene's features, and error and cost of every choice.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Seen {
    features: [f64; FEATURES],
    errors: Vec<f64>,
    costs: Vec<f64>,
}

/// What a part of training found.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Observed {
    bone: Vec<Seen>,
    tissue: Vec<Seen>,
    picture: Vec<Seen>,
}

/// How many parts there are.
pub fn parts() -> usize {
    PARTS.len()
}

/// Runs one part.
pub fn observe(part: usize) -> Observed {
    let mut random = fastrand::Rng::with_seed(SEED + part as u64);
    let case = Case::of(PARTS[part], &mut random);
    let (bones, tissues, pictures) = (bone::choices(), tissue::choices(), picture::choices());
    let mut brains = tissue::Brains::of(&case, &tissues);
    let (unit_us, mut observed) = (bone::unit_us(), Observed::default());
    for _ in 0..SCENES {
        let (situation, stretch) = super::stretch(&case, &mut random);
        let scene = &situation.scene;
        let found = stretch.measure(&case, &bones);
        observed.bone.push(Seen {
            features: scene.bone_features(),
            errors: found.iter().map(|found| found.error_n / scene.stiffness).collect(),
            costs: found.iter().map(|found| found.tick_us / unit_us).collect(),
        });
        let found = tissue::Push::of(&case, &situation, &brains).measure(&mut brains);
        let unit_ns = found[tissue::unit(&tissues)].ns;
        let cost = |(found, choice): (&tissue::Found, &trepan_budget::Tissue)| {
            if choice.solver == "tled" { found.awake } else { found.ns / unit_ns }
        };
        observed.tissue.push(Seen {
            features: scene.tissue_features(),
            errors: found.iter().map(|found| found.error_mm).collect(),
            costs: found.iter().zip(&tissues).map(cost).collect(),
        });
        let found = picture::measure(&case, &situation, &pictures, DRAWN);
        let unit_us = found.last().expect("there are choices").us;
        observed.picture.push(Seen {
            features: scene.picture_features(),
            errors: found.iter().map(|found| found.error_percent).collect(),
            costs: found.iter().map(|found| found.us / unit_us).collect(),
        });
    }
    observed
}

/// The tables of all parts: name and text.
pub fn tables(parts: &[Observed]) -> [(&'static str, String); 3] {
    let of = |kind: fn(&Observed) -> &Vec<Seen>| parts.iter().flat_map(kind).collect::<Vec<_>>();
    let pictures = picture::choices().into_iter().filter(|p| !p.sparse && p.detail == 1.0).collect::<Vec<_>>();
    let exact = |row: Row<trepan_budget::Picture>| {
        let error = if pictures.contains(&row.what) { Law::constant(0.0) } else { row.error };
        Row { error, ..row }
    };
    let drawn = rows(&picture::choices(), &of(|o| &o.picture)).into_iter().map(exact).collect::<Vec<_>>();
    [
        table(&rows(&bone::choices(), &of(|o| &o.bone))),
        table(&rows(&tissue::choices(), &of(|o| &o.tissue))),
        table(&drawn),
    ]
}

fn table<T: Kind>(rows: &[Row<T>]) -> (&'static str, String) {
    (T::TABLE, write(rows))
}

/// The laws of every choice; one that could not be run in all scenes is left out.
fn rows<T: Kind>(choices: &[T], seen: &[&Seen]) -> Vec<Row<T>> {
    let fit =
        |of: &dyn Fn(&Seen) -> f64| Law::fit(&seen.iter().map(|seen| (seen.features, of(seen))).collect::<Vec<_>>());
    let row = |(n, what): (usize, &T)| {
        let error = fit(&|seen| seen.errors[n].max(LEAST))?;
        Some(Row { what: *what, error, cost: fit(&|seen| seen.costs[n])? })
    };
    choices.iter().enumerate().filter_map(row).collect()
}
