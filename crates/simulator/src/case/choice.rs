//! Which case the options mean, and making one to keep.

use crate::case::cache::Cache;
use crate::case::{Case, Inputs, Recipe, folder, import};
use crate::error::SessionError;
use crate::options::{Options, Patient};
use crate::program::Program;
use std::path::Path;

/// The case folder that is named, the images that are given, or the built-in case.
pub fn open_case(program: Program, options: &Options, built_in: Inputs) -> Result<Case, SessionError> {
    match &options.case {
        Some(folder) => fitting(program, folder::load(folder)?),
        None => {
            let inputs = inputs(&options.patient, built_in);
            import::open(program, &inputs, &recipe(&options.patient), &Cache::of_user()?)
        }
    }
}

/// Makes a case folder; returns the case's name.
pub fn build_case(program: Program, patient: &Patient, out: &Path, built_in: Inputs) -> Result<String, SessionError> {
    patient.check().map_err(SessionError::Usage)?;
    if out.exists() {
        return Err(SessionError::Usage(format!(
            "--out {} exists already: name a folder that does not",
            out.display()
        )));
    }
    let recipe = recipe(patient);
    let case = import::open(program, &inputs(patient, built_in), &recipe, &Cache::of_user()?)?;
    let parent = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = out.file_name().and_then(|name| name.to_str()).unwrap_or("case");
    let written = Cache::at(parent.into()).keep(name, |place| folder::save(&case, &recipe, place));
    written.map_err(|fault| SessionError::Internal(format!("cannot write {}: {fault}", out.display())))?;
    Ok(case.name)
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

fn recipe(patient: &Patient) -> Recipe {
    Recipe {
        spacing_mm: patient.spacing_mm,
        tets: patient.tets,
        isovalue_hu: patient.isovalue_hu,
        ct_series: patient.ct_series,
        mri_series: patient.mri_series,
        register: patient.register,
        opening: patient.opening,
    }
}

fn inputs(patient: &Patient, built_in: Inputs) -> Inputs {
    let Patient { ct, mri, labels, tissues, .. } = patient.clone();
    if ct.is_none() && mri.is_none() && labels.is_none() && tissues.is_empty() {
        return built_in;
    }
    Inputs { name: None, ct, mri, labels, tissues }
}
