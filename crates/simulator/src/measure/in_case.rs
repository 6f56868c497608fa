//! Errors of the choices in a patient's case, from the cache if they were measured before.

use super::bone::Skull;
use super::tissue::Shape;
use super::{CaseErrors, Sight};
use crate::error::SessionError;
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
const SHIPPED: &str = include_str!("../../measured/built-in.json");

/// Errors of these choices in the case of an import, with that element. Empty if no opening is
/// found.
pub(crate) fn before_building(
    import: &mut Import,
    scene: &Scene,
    rows: &Rows,
    element: Element,
) -> Result<CaseErrors, SessionError> {
    let key = import.cache.under(&import.key, &CaseErrors::about(scene, rows, element));
    if let Some(errors) = import.cache.read(&key, ERRORS).or_else(|| shipped(&key)) {
        return Ok(errors);
    }
    let preview = import.preview("measuring model errors in this case")?;
    Ok(measured(preview, (import.cache, &key), scene, rows, element))
}

/// Errors of these choices in a case that is built.
pub(crate) fn built(
    case: &Case,
    cache: &Cache,
    scene: &Scene,
    rows: &Rows,
    element: Element,
) -> Result<CaseErrors, SessionError> {
    let key = cache.under(&case.hash, &CaseErrors::about(scene, rows, element));
    if let Some(errors) = cache.read(&key, ERRORS) {
        return Ok(errors);
    }
    Ok(measured(Preview::of(case)?, (cache, &key), scene, rows, element))
}

/// Errors that come with the program; `None` for other images, choices or versions of the
/// measurement.
fn shipped(key: &str) -> Option<CaseErrors> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choice;
    use crate::models::ModelRequest;
    use crate::options::Options;
    use clap::Parser;
    use trepan_patient::progress::Progress;
    use trepan_patient::{Inputs, tissue_class::TissueSource};
    use trepan_stages::program::Program;

    /// With `TREPAN_KEEP_MEASURED` the errors are measured, and kept in the file that is shipped.
    #[test]
    fn the_built_in_case_comes_with_its_measurements() {
        let (home, head) = (tempfile::tempdir().unwrap(), trepan_fixtures::case_head());
        let tissues = TissueSource::regions_of_aseg(head.aseg);
        let inputs = Inputs {
            name: Some(head.name),
            ct: Some(head.ct),
            mri: Some(head.mri),
            labels: Some(head.labels),
            tissues,
        };
        let patient = Options::try_parse_from(["x"]).unwrap().patient;
        let (cache, recipe) = (Cache::at(home.path().into()), choice::recipe(&patient));
        let keeps = std::env::var_os("TREPAN_KEEP_MEASURED").is_some();
        let mut all = BTreeMap::new();
        for program in [Program::Integrated, Program::Craniotomy, Program::Brain] {
            let progress = Progress::default();
            let mut import = Import::begin(program, (&inputs, &recipe), &cache, &progress).unwrap();
            import.store();
            let request = ModelRequest::to_plan(program, &patient, Default::default(), 1000.0, [960, 600]).unwrap();
            for card in [false, true] {
                let facts = import.facts;
                let settled = request.settle(
                    &facts,
                    || card,
                    |scene, rows, element| {
                        let key = cache.under(&import.key, &CaseErrors::about(scene, rows, element));
                        let errors = if keeps {
                            before_building(&mut import, scene, rows, element)?
                        } else {
                            shipped(&key).unwrap_or_default()
                        };
                        all.insert(key, errors.clone());
                        Ok(errors)
                    },
                );
                let measured = settled.unwrap().measured;
                assert_eq!((measured.bone, measured.tissue), (program.has_bone(), program.has_tissue()), "{program:?}");
            }
        }
        if keeps {
            let file = concat!(env!("CARGO_MANIFEST_DIR"), "/measured/built-in.json");
            std::fs::write(file, serde_json::to_string_pretty(&all).unwrap() + "\n").unwrap();
        }
        let shipped: BTreeMap<String, CaseErrors> = serde_json::from_str(SHIPPED).unwrap();
        assert!(keeps || shipped == all, "run this test with TREPAN_KEEP_MEASURED=1 and build again");
    }
}
