//! From the scanner's files to a case: skull grid, brain mask, brain mesh, opening, each made once and kept by content.
//!
//! # Practice
//! What is made depends only on the bytes of the inputs and the numbers in [`Recipe`]; its hash names the folder in the user's
//! cache. The folder is made beside its final place and moved there whole, so an interrupted import leaves nothing.
//! A case goes by the first digits of that hash: file names may hold a patient's name.

use crate::case::anatomy::{find_brain, make_brain, make_skull, read_ct, read_mri, registered};
use crate::case::cache::Cache;
use crate::case::fit::Fit;
use crate::case::folder as case_folder;
use crate::case::opening::Opening;
use crate::case::stages::ImportStages;
use crate::case::{Case, Inputs, Recipe};
use crate::error::SessionError;
use crate::program::Program;
use glam::DAffine3;
use std::path::{Path, PathBuf};
use trepan_volume::{bone_isovalue, overlap};

/// Opens a case: from the cache if it was made before, else from the files, with a progress bar.
pub fn open(program: Program, inputs: &Inputs, recipe: &Recipe, cache: &Cache) -> Result<Case, SessionError> {
    needs(program, inputs)?;
    let images = [&inputs.ct, &inputs.mri, &inputs.labels];
    let tissues = inputs.tissues.iter().map(|source| &source.path);
    let files: Vec<&Path> = images.into_iter().flatten().chain(tissues).map(PathBuf::as_path).collect();
    let given = images.map(Option::is_some);
    let meant: Vec<_> = inputs.tissues.iter().map(|source| (source.class, &source.codes)).collect();
    let hash = cache.key(&files, &format!("{recipe:?} {given:?} {meant:?}"))?;
    let name = inputs.name.map_or_else(|| format!("case-{}", &hash[..8]), String::from);
    if let Some(Ok(case)) = cache.find(&hash).map(|folder| case_folder::load(&folder)) {
        tracing::info!("case {name} from the cache");
        return Ok(case);
    }
    let mut stages = ImportStages::new(7);
    let mut case = build(inputs, recipe, &mut stages)?;
    (case.name, case.hash) = (name, hash);
    stages.next("keeping the case");
    if let Err(fault) = cache.keep(&case.hash, |folder| case_folder::save(&case, recipe, folder)) {
        case.notes.push(format!("the case could not be kept for the next start: {fault}"));
    }
    tracing::info!("case {} imported in {}", case.name, stages.finish());
    Ok(case)
}

fn needs(program: Program, inputs: &Inputs) -> Result<(), SessionError> {
    let lacks = |flag: &str, what: &str| {
        Err(SessionError::Usage(format!(
            "{} needs {what}: give {flag}, or no image at all for the built-in case",
            program.name()
        )))
    };
    if program.has_bone() && inputs.ct.is_none() {
        return lacks("--ct PATH", "a CT");
    }
    if program.has_tissue() && inputs.mri.is_none() {
        return lacks("--mri PATH", "an MRI");
    }
    Ok(())
}

fn build(inputs: &Inputs, recipe: &Recipe, stages: &mut ImportStages) -> Result<Case, SessionError> {
    let mut notes = Vec::new();
    stages.next("reading the CT");
    let ct = inputs.ct.as_deref().map(|path| read_ct(path, recipe.ct_series, &mut notes)).transpose()?;
    let isovalue_hu = recipe.isovalue_hu.or(ct.as_ref().map(bone_isovalue)).unwrap_or(400);
    stages.next("reading the MRI");
    let mut mri = inputs.mri.as_deref().map(|path| read_mri(path, recipe.mri_series, &mut notes)).transpose()?;
    let (mut fit, mut ct_from_mri) = (Fit::new(), DAffine3::IDENTITY);
    if let (Some(ct), Some(mri)) = (&ct, &mut mri) {
        if recipe.register {
            stages.next("fitting the MRI to the CT");
            fit.look(ct, mri, isovalue_hu);
            ct_from_mri = registered(ct, mri, &mut notes)?;
        }
        overlap(ct, mri).map_err(|fault| SessionError::Case(fault.to_string()))?;
        fit.look(ct, mri, isovalue_hu);
    }
    stages.next("finding the brain");
    let mask = mri
        .as_ref()
        .map(|mri| find_brain(inputs, mri, ct_from_mri, ct.as_ref(), isovalue_hu, &mut notes))
        .transpose()?;
    stages.next("resampling the skull");
    let skull = ct.map(|ct| make_skull(&ct, recipe, isovalue_hu)).transpose()?;
    stages.next("meshing the brain");
    let brain = mri.zip(mask);
    let brain =
        brain.map(|(mri, mask)| make_brain(inputs, &mri, &mask, ct_from_mri, recipe, &mut notes)).transpose()?;
    stages.next("planning the opening");
    let opening = skull.as_ref().map(|skull| Opening::on(skull, isovalue_hu, brain.as_ref(), recipe.opening));
    let fit_png = fit.png();
    Ok(Case { fit_png, skull, isovalue_hu, brain, opening: opening.transpose()?.flatten(), notes, ..Case::default() })
}
