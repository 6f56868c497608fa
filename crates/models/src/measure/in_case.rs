//! Errors of the choices in a patient's case, from the cache if they were measured before.

use super::bone::Skull;
use super::case_errors::Part;
use super::tissue::Shape;
use super::{CaseErrors, Parts, Sight};
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
pub const ERRORS: &str = "own.json";
/// Errors that were measured in the built-in case before it was shipped, by cache key.
pub const SHIPPED: &str = include_str!("../../measured/built-in.json");

/// Errors of these choices in the case of an import, with that element. Each part is measured once
/// for a case. Empty if no opening is found.
pub fn before_building(
    import: &mut Import,
    scene: &Scene,
    rows: &Rows,
    element: Element,
) -> Result<CaseErrors, ModelError> {
    let about = CaseErrors::about(import.program.has_bone(), scene, rows, element);
    let known = Known::of(import.cache, &import.key, about, rows);
    if known.missing.is_empty() {
        return Ok(known.errors);
    }
    let preview = import.preview("measuring model errors in this case")?;
    Ok(known.with_measured(preview, import.cache, scene, element))
}

/// Errors of these choices in a case that is built.
pub fn built(
    case: &Case,
    cache: &Cache,
    scene: &Scene,
    rows: &Rows,
    element: Element,
) -> Result<CaseErrors, ModelError> {
    let known = Known::of(cache, &case.hash, CaseErrors::about(case.skull.is_some(), scene, rows, element), rows);
    if known.missing.is_empty() {
        return Ok(known.errors);
    }
    Ok(known.with_measured(Preview::of(case)?, cache, scene, element))
}

/// Errors that come with the program; `None` for other images, choices or versions of the
/// measurement.
pub fn shipped(key: &str) -> Option<CaseErrors> {
    let mut all: BTreeMap<String, CaseErrors> = serde_json::from_str(SHIPPED).ok()?;
    all.remove(key)
}

/// Errors that were measured before, and what is left to measure.
struct Known {
    errors: CaseErrors,
    /// The parts that are left, with their cache keys.
    missing: Vec<(Part, String)>,
    /// The choices of those parts.
    rows: Rows,
}

impl Known {
    /// Looks for the errors of each part in the cache, and among those that are shipped.
    fn of(cache: &Cache, case: &str, about: Parts<Option<String>>, rows: &Rows) -> Self {
        let mut known = Self { errors: CaseErrors::default(), missing: Vec::new(), rows: rows.clone() };
        let parts = [(Part::Bone, about.bone), (Part::Tissue, about.tissue), (Part::Picture, about.picture)];
        for (part, about) in parts {
            let key = about.map(|about| cache.under(case, &about));
            let found = key.as_ref().map(|key| cache.read(key, ERRORS).or_else(|| shipped(key)));
            match (key, found) {
                (Some(key), Some(None)) => known.missing.push((part, key)),
                (_, found) => {
                    known.errors.add(found.flatten().unwrap_or_default());
                    match part {
                        Part::Bone => known.rows.bone.clear(),
                        Part::Tissue => known.rows.tissue.clear(),
                        Part::Picture => known.rows.picture.clear(),
                    }
                }
            }
        }
        known
    }

    /// Measures what is left, and caches what was found.
    fn with_measured(self, preview: Option<Preview>, cache: &Cache, scene: &Scene, element: Element) -> CaseErrors {
        let Self { mut errors, missing, rows } = self;
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
        let of = |preview| CaseErrors::of(&sight(preview, scene), scene, &rows, element, threads);
        let found = preview.map_or_else(CaseErrors::default, of);
        missing.iter().for_each(|(part, key)| cache.write(&found.only(*part), key, ERRORS));
        errors.add(found);
        errors
    }
}

/// Skull, brain and first view at an opening.
fn sight(preview: Preview, scene: &Scene) -> Sight {
    let Preview { opening, skull, isovalue_hu, brain } = preview;
    let site = Site::from(opening);
    let skull = skull.map(|(ct, bone)| (Skull { ct, isovalue: isovalue_hu }, Arc::new(bone)));
    let brain = brain.map(|(mask, field)| (Shape { field, mask, material: scene.material }, opening.brain()));
    Sight { skull, entry: site.entry, outward: -site.inward, eye: eye(&site), brain }
}
