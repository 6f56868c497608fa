//! Errors of the choices in a patient's case, from the cache if they were measured before.

use super::bone::Skull;
use super::tissue::Shape;
use super::{CaseErrors, Sight};
use crate::ModelError;
use crate::ingredients::Element;
use std::collections::BTreeMap;
use std::sync::Arc;
use trepan_budget::{Rows, Scene};
use trepan_haptics::script::Site;
use trepan_patient::Cache;
use trepan_patient::Case;
use trepan_patient::import::Import;
use trepan_patient::opening::eye;
use trepan_patient::preview::Preview;

/// Cache file of the errors measured in a case.
const ERRORS: &str = "own.json";
/// Errors that were measured in the built-in case before it was shipped, by cache key.
pub const SHIPPED: &str = include_str!("../../measured/built-in.json");

/// Errors of these choices in the case of an import, with that element. Empty if no opening is
/// found.
pub fn before_building(
    import: &mut Import,
    scene: &Scene,
    rows: &Rows,
    element: Element,
) -> Result<CaseErrors, ModelError> {
    let key = import.cache.under(&import.key, &CaseErrors::about(scene, rows, element));
    if let Some(errors) = import.cache.read(&key, ERRORS).or_else(|| shipped(&key)) {
        return Ok(errors);
    }
    let preview = import.preview("measuring model errors in this case")?;
    Ok(measured(preview, (import.cache, &key), scene, rows, element))
}

/// Errors of these choices in a case that is built.
pub fn built(
    case: &Case,
    cache: &Cache,
    scene: &Scene,
    rows: &Rows,
    element: Element,
) -> Result<CaseErrors, ModelError> {
    let key = cache.under(&case.hash, &CaseErrors::about(scene, rows, element));
    if let Some(errors) = cache.read(&key, ERRORS) {
        return Ok(errors);
    }
    Ok(measured(Preview::of(case)?, (cache, &key), scene, rows, element))
}

/// Errors that come with the program; `None` for other images, choices or versions of the
/// measurement.
pub fn shipped(key: &str) -> Option<CaseErrors> {
    let mut all: BTreeMap<String, CaseErrors> = serde_json::from_str(SHIPPED).ok()?;
    all.remove(key)
}

/// Measures, and caches what was found.
fn measured(
    preview: Option<Preview>,
    (cache, key): (&Cache, &str),
    scene: &Scene,
    rows: &Rows,
    element: Element,
) -> CaseErrors {
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    let of = |preview| CaseErrors::of(&sight(preview, scene), scene, rows, element, threads);
    let errors = preview.map_or_else(CaseErrors::default, of);
    cache.write(&errors, key, ERRORS);
    errors
}

/// Skull, brain and first view at an opening.
fn sight(preview: Preview, scene: &Scene) -> Sight {
    let Preview { opening, skull, isovalue_hu, brain } = preview;
    let site = Site::from(opening);
    let skull = skull.map(|(ct, bone)| (Skull { ct, isovalue: isovalue_hu }, Arc::new(bone)));
    let brain = brain.map(|(mask, field)| (Shape { field, mask, material: scene.material }, opening.brain()));
    Sight { skull, entry: site.entry, outward: -site.inward, eye: eye(&site), brain }
}
