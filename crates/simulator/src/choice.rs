//! Opens the case that the options name, and builds case folders.

use crate::error::SessionError;
use crate::models::{self, ModelRequest, Models};
use crate::options::{Options, Patient};
use std::path::Path;
use trepan_budget::Setup;
use trepan_models::measure::in_case;
use trepan_patient::Cache;
use trepan_patient::Recipe;
use trepan_patient::TissueClass;
use trepan_patient::identity::{self, Identity, USERS};
use trepan_patient::import::{self, Import};
use trepan_patient::progress::Progress;
use trepan_patient::{Case, Inputs, folder};
use trepan_stages::program::Program;

/// Opens the named case folder, the given images or the built-in case, with the models of the
/// session. `card`: whether a graphics card draws.
pub(crate) fn open_case(
    program: Program,
    options: &Options,
    built_in: Inputs,
    request: ModelRequest,
    (progress, card): (&Progress, impl FnOnce() -> bool),
) -> Result<(Case, Models), SessionError> {
    progress.next("looking at the images")?;
    if let Some(folder) = &options.case {
        let case = fitting(program, folder::load(folder)?)?;
        let classes = case.brain.as_ref().map(|brain| &brain.classes.data);
        check_forbidden(options, |class| classes.is_some_and(|classes| classes.contains(&class.code())))?;
        let models = on_case(request, &case, &cache(&options.patient)?, card)?;
        models.log();
        return Ok((case, models));
    }
    let inputs = inputs(&options.patient, built_in);
    check_forbidden(options, |class| class == TissueClass::Brain || inputs.tissues.iter().any(|t| t.class == class))?;
    let (requested, cache) = (recipe(&options.patient), cache(&options.patient)?);
    let mut import = Import::begin(program, (&inputs, &requested), &cache, progress)?;
    let facts = import.facts;
    let models = request
        .settle(&facts, card, |scene, rows, element| in_case::before_building(&mut import, scene, rows, element))?;
    import.stages.suspend(|| models.log());
    let Setup { bone, tissue, .. } = models.setup;
    let (spacing_mm, tets, halvings) = (bone.spacing_mm as f32, tissue.tets, tissue.halvings);
    let case = import.build(Recipe { spacing_mm, tets, halvings, ..requested })?;
    Ok((case, models))
}

/// Opens a case to look at, without the models of a session. It is the named folder, the cached
/// case of this hash, else the images in voxels and tetrahedra of preset `usual`.
pub(crate) fn case_to_check(
    program: Program,
    options: &Options,
    built_in: Inputs,
    hash: &str,
    progress: &Progress,
) -> Result<Case, SessionError> {
    progress.next("looking at the images")?;
    if let Some(folder) = &options.case {
        return Ok(folder::load(folder)?);
    }
    let cache = cache(&options.patient)?;
    let known = Some(hash).filter(|hash| !hash.is_empty()).and_then(|hash| cache.find(hash));
    if let Some(Ok(case)) = known.map(|folder| folder::load(&folder)) {
        return Ok(case);
    }
    let recipe = recipe(&options.patient);
    Ok(Import::begin(program, (&inputs(&options.patient, built_in), &recipe), &cache, progress)?.build(recipe)?)
}

/// Refuses a class of `--forbid` that the case does not contain.
fn check_forbidden(options: &Options, has_class: impl Fn(TissueClass) -> bool) -> Result<(), SessionError> {
    match options.forbid.iter().flatten().find(|class| !has_class(**class)) {
        None => Ok(()),
        Some(class) => {
            let name = class.name();
            Err(SessionError::Usage(format!(
                "--forbid {name}: the case contains no {name}: give its labels with --tissue {name}=PATH, or leave it out"
            )))
        }
    }
}

/// Identity of the case that the options name, without building it.
pub(crate) fn identity(options: &Options, built_in: &Inputs) -> Result<Identity, SessionError> {
    match &options.case {
        Some(folder) => Ok(folder::identity(folder)?),
        None => {
            let (inputs, recipe) = (inputs(&options.patient, built_in.clone()), recipe(&options.patient));
            let name = inputs.name.unwrap_or(USERS).to_string();
            Ok(Identity { name, case: None, images: identity::images(&inputs, &recipe)? })
        }
    }
}

/// Models planned for a case that is not built, with remarks on its images.
pub(crate) struct PlannedCase {
    /// The models.
    pub models: Models,
    /// Remarks of the import.
    pub notes: Vec<String>,
}

/// Plans the models for a case without building it.
pub(crate) fn plan_case(
    program: Program,
    case: Option<&Path>,
    patient: &Patient,
    built_in: Inputs,
    request: ModelRequest,
    card: impl FnOnce() -> bool,
) -> Result<PlannedCase, SessionError> {
    patient.check()?;
    match case {
        Some(folder) => {
            let case = fitting(program, folder::load(folder)?)?;
            Ok(PlannedCase { models: on_case(request, &case, &cache(patient)?, card)?, notes: case.notes })
        }
        None => {
            let (inputs, recipe, cache) = (inputs(patient, built_in), recipe(patient), cache(patient)?);
            let mut import = Import::begin(program, (&inputs, &recipe), &cache, &Progress::default())?;
            let (facts, notes) = (import.facts, import.notes.clone());
            let models = request.settle(&facts, card, |scene, rows, element| {
                in_case::before_building(&mut import, scene, rows, element)
            })?;
            import.store();
            Ok(PlannedCase { models, notes })
        }
    }
}

/// Models for a case folder.
fn on_case(
    request: ModelRequest,
    case: &Case,
    cache: &Cache,
    card: impl FnOnce() -> bool,
) -> Result<Models, SessionError> {
    let request = case.recipe.iter().fold(request, ModelRequest::on);
    request.settle(&case.facts(), card, |scene, rows, element| in_case::built(case, cache, scene, rows, element))
}

/// A case that was built in a folder.
pub(crate) struct BuiltCase {
    /// Its name.
    pub name: String,
    /// Remarks of the import.
    pub notes: Vec<String>,
}

/// Builds a case folder.
pub(crate) fn build_case(
    program: Program,
    patient: &Patient,
    out: &Path,
    built_in: Inputs,
) -> Result<BuiltCase, SessionError> {
    patient.check()?;
    if out.exists() {
        return Err(SessionError::Usage(format!(
            "--out {} exists already: name a folder that does not",
            out.display()
        )));
    }
    let recipe = recipe(patient);
    let case = import::open(program, &inputs(patient, built_in), &recipe, &cache(patient)?)?;
    let parent = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = out.file_name().and_then(|name| name.to_str()).unwrap_or("case");
    let written = Cache::at(parent.into()).keep(name, |place| folder::save(&case, place));
    written.map_err(|fault| {
        let remedy = "give --out in a folder that exists, may be written to and has room";
        SessionError::Usage(format!("cannot write {}: {fault}; {remedy}", out.display()))
    })?;
    Ok(BuiltCase { name: case.name, notes: case.notes })
}

/// Refuses a case without the skull or brain that the program needs.
fn fitting(program: Program, case: Case) -> Result<Case, SessionError> {
    let lacks = |what| Err(SessionError::Case(format!("{} needs {what}, which {} lacks", program.name(), case.name)));
    if program.has_bone() && case.skull.is_none() {
        return lacks("a skull from a CT");
    }
    if program.has_tissue() && case.brain.is_none() {
        return lacks("a brain from an MRI");
    }
    Ok(case)
}

/// Recipe from the flags; missing values are those of preset `usual`, so a folder is the same on
/// every machine.
pub(super) fn recipe(patient: &Patient) -> Recipe {
    let usual = models::usual();
    Recipe {
        spacing_mm: patient.spacing_mm.unwrap_or(usual.bone.spacing_mm as f32),
        tets: patient.tets.unwrap_or(usual.tissue.tets),
        halvings: patient.opening_refinement.unwrap_or(usual.tissue.halvings),
        isovalue_hu: patient.isovalue_hu,
        ct_series: patient.ct_series,
        mri_series: patient.mri_series,
        register: patient.register,
        opening: patient.opening,
    }
}

/// Cache in the folder that the flags name, else the user's.
pub(crate) fn cache(patient: &Patient) -> Result<Cache, SessionError> {
    Ok(Cache::of(patient.cache.clone())?)
}

/// Given input files; those of the built-in case if none is given.
pub(crate) fn inputs(patient: &Patient, built_in: Inputs) -> Inputs {
    let Patient { ct, mri, labels, tissues, tumour, .. } = patient.clone();
    if ct.is_none() && mri.is_none() && labels.is_none() && tissues.is_empty() {
        return Inputs { tumour, ..built_in };
    }
    Inputs { name: None, ct, mri, labels, tissues, tumour }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use std::collections::BTreeMap;
    use trepan_models::measure::CaseErrors;
    use trepan_models::measure::in_case::{ERRORS, SHIPPED, before_building, shipped};
    use trepan_patient::TissueSource;

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
            ..Inputs::default()
        };
        let patient = Options::try_parse_from(["x"]).unwrap().patient;
        let (cache, recipe) = (Cache::at(home.path().into()), recipe(&patient));
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
                        let errors = before_building(&mut import, scene, rows, element)?;
                        let about = CaseErrors::about(program.has_bone(), scene, rows, element);
                        for about in [about.bone, about.tissue, about.picture].into_iter().flatten() {
                            let key = cache.under(&import.key, &about);
                            let measured = || cache.read(&key, ERRORS).expect("it was measured");
                            all.insert(key.clone(), shipped(&key).unwrap_or_else(measured));
                        }
                        Ok(errors)
                    },
                );
                let measured = settled.unwrap().measured;
                assert_eq!((measured.bone, measured.tissue), (program.has_bone(), program.has_tissue()), "{program:?}");
            }
        }
        if keeps {
            let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../models/measured/built-in.json");
            std::fs::write(file, serde_json::to_string_pretty(&all).unwrap() + "\n").unwrap();
        }
        let shipped: BTreeMap<String, CaseErrors> = serde_json::from_str(SHIPPED).unwrap();
        assert!(keeps || shipped == all, "run this test with TREPAN_KEEP_MEASURED=1 and build again");
    }
}
