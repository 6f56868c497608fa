//! Which case the options mean, and making one to keep.

use crate::case::cache::Cache;
use crate::case::identity::{self, Identity, USERS};
use crate::case::import::{Known, volume_mm3};
use crate::case::tissue::TissueClass;
use crate::case::{Case, Inputs, Recipe, folder, import};
use crate::error::SessionError;
use crate::measure::CaseErrors;
use crate::models::{self, Facts, ModelRequest, Models};
use crate::options::{Options, Patient};
use crate::program::Program;
use std::path::Path;
use trepan_budget::Setup;

/// The case folder that is named, the images that are given, or the built-in case; with the models
/// that it is opened for. `card`: whether a graphics card draws.
pub fn open_case(
    program: Program,
    options: &Options,
    built_in: Inputs,
    wish: ModelRequest,
    card: impl FnOnce() -> bool,
) -> Result<(Case, Models), SessionError> {
    if let Some(folder) = &options.case {
        let case = fitting(program, folder::load(folder)?)?;
        let classes = case.brain.as_ref().map(|brain| &brain.classes.data);
        guarded(options, |class| classes.is_some_and(|classes| classes.contains(&class.code())))?;
        let models = on_case(wish, &case, card)?;
        models.say();
        return Ok((case, models));
    }
    let (inputs, mut models) = (inputs(&options.patient, built_in), None);
    guarded(options, |class| class == TissueClass::Brain || inputs.tissues.iter().any(|t| t.class == class))?;
    let wanted = recipe(&options.patient);
    let case = import::open_by(program, &inputs, &wanted, &Cache::of(&options.patient)?, |known| {
        let facts = known.facts;
        let settled = models.insert(wish.settle(&facts, card, |scene, rows| known.own(scene, rows))?);
        known.say(|| settled.say());
        let Setup { bone, tissue, .. } = settled.setup;
        Ok(Recipe { spacing_mm: bone.spacing_mm as f32, tets: tissue.tets, halvings: tissue.halvings, ..wanted })
    })?;
    let unsettled = || SessionError::Internal("a case without models".into());
    Ok((case, models.ok_or_else(unsettled)?))
}

/// Refuses to guard tissue that is not `there`.
fn guarded(options: &Options, there: impl Fn(TissueClass) -> bool) -> Result<(), SessionError> {
    match options.forbid.iter().flatten().find(|class| !there(**class)) {
        None => Ok(()),
        Some(class) => {
            let name = class.name();
            Err(SessionError::Usage(format!(
                "--forbid {name}: the case holds no {name}: give its labels with --tissue {name}=PATH, or leave it out"
            )))
        }
    }
}

/// Of which patient the case is that the options mean; nothing is made.
pub fn identity(options: &Options, built_in: &Inputs) -> Result<Identity, SessionError> {
    match &options.case {
        Some(folder) => folder::identity(folder),
        None => {
            let (inputs, recipe) = (inputs(&options.patient, built_in.clone()), recipe(&options.patient));
            let name = inputs.name.unwrap_or(USERS).to_string();
            Ok(Identity { name, case: None, images: identity::images(&inputs, &recipe)? })
        }
    }
}

/// The models for a case that is not made, and what is remarkable about its images.
pub struct PlannedCase {
    /// The models.
    pub models: Models,
    /// Remarks of the import.
    pub notes: Vec<String>,
}

/// The models for a case, which is not made.
pub fn plan_case(
    program: Program,
    case: Option<&Path>,
    patient: &Patient,
    built_in: Inputs,
    wish: ModelRequest,
    card: impl FnOnce() -> bool,
) -> Result<PlannedCase, SessionError> {
    patient.check().map_err(SessionError::Usage)?;
    match case {
        Some(folder) => {
            let case = fitting(program, folder::load(folder)?)?;
            Ok(PlannedCase { models: on_case(wish, &case, card)?, notes: case.notes })
        }
        None => {
            let (inputs, recipe, cache) = (inputs(patient, built_in), recipe(patient), Cache::of(patient)?);
            let mut known = Known::of(program, &inputs, &recipe, &cache)?;
            let (facts, notes) = (known.facts, known.notes.clone());
            let models = wish.settle(&facts, card, |scene, rows| known.own(scene, rows))?;
            known.keep();
            Ok(PlannedCase { models, notes })
        }
    }
}

/// The models for a case as it was built.
fn on_case(wish: ModelRequest, case: &Case, card: impl FnOnce() -> bool) -> Result<Models, SessionError> {
    let wish = case.recipe.iter().fold(wish, ModelRequest::on);
    let facts = Facts {
        ct_voxel_mm: case.skull.as_ref().map(|skull| skull.spacing_mm().element_sum() / 3.0),
        brain_mm3: case.brain.as_ref().map(|brain| volume_mm3(&brain.classes)),
    };
    // What the scanner saw is no longer there: the laws must do.
    wish.settle(&facts, card, |_, _| Ok(CaseErrors::default()))
}

/// A case that was made and kept in a folder.
pub struct Built {
    /// Its name.
    pub name: String,
    /// Remarks of the import.
    pub notes: Vec<String>,
}

/// Makes a case folder.
pub fn build_case(program: Program, patient: &Patient, out: &Path, built_in: Inputs) -> Result<Built, SessionError> {
    patient.check().map_err(SessionError::Usage)?;
    if out.exists() {
        return Err(SessionError::Usage(format!(
            "--out {} exists already: name a folder that does not",
            out.display()
        )));
    }
    let recipe = recipe(patient);
    let case = import::open(program, &inputs(patient, built_in), &recipe, &Cache::of(patient)?)?;
    let parent = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = out.file_name().and_then(|name| name.to_str()).unwrap_or("case");
    let written = Cache::at(parent.into()).keep(name, |place| folder::save(&case, place));
    written.map_err(|fault| {
        let remedy = "give --out in a folder that exists, may be written to and has room";
        SessionError::Usage(format!("cannot write {}: {fault}; {remedy}", out.display()))
    })?;
    Ok(Built { name: case.name, notes: case.notes })
}

/// A case that has what the program needs.
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

/// As the flags say; what they leave open as usual, so that a folder is the same wherever it is
/// built.
fn recipe(patient: &Patient) -> Recipe {
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

/// The files that are given; the built-in case's where none is.
pub fn inputs(patient: &Patient, built_in: Inputs) -> Inputs {
    let Patient { ct, mri, labels, tissues, .. } = patient.clone();
    if ct.is_none() && mri.is_none() && labels.is_none() && tissues.is_empty() {
        return built_in;
    }
    Inputs { name: None, ct, mri, labels, tissues }
}
