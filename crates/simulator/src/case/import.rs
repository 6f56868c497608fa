//! Imports a scanner's files as a case: skull grid, brain mask, brain mesh and opening, cached by
//! content.
//!
//! # Practice
//! A case depends only on the bytes of the inputs and the numbers in [`Recipe`]; their hash names
//! the folder in the user's cache. The folder is filled under a temporary name and then moved, so
//! an interrupted import leaves nothing. A case is named by the first digits of that hash, because
//! file names may contain a patient's name. Properties of the images ([`Facts`]) are cached too, so
//! that the numbers can be chosen without reading the images again.

use crate::case::anatomy::{
    cropped, find_brain, make_brain, make_classes, make_skull, read_ct, read_labels, read_mri, registered, scale_doubt,
};
use crate::case::cache::Cache;
use crate::case::fit::Fit;
use crate::case::folder as case_folder;
use crate::case::identity;
use crate::case::opening::{Inside, Opening, REFERENCE_MM, bone_of, eye};
use crate::case::space::Space;
use crate::case::stages::ImportStages;
use crate::case::{Case, Inputs};
use crate::error::SessionError;
use crate::ingredients::Element;
use crate::measure::bone::Skull;
use crate::measure::tissue::{Fineness, Shape};
use crate::measure::{CaseErrors, Sight};
use crate::models::Facts;
use crate::printable::count;
use crate::progress::Progress;
use crate::recipe::Recipe;
use crate::remark::WELL;
use crate::tissue_class::TissueSource;
use glam::DAffine3;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use trepan_budget::{Rows, Scene};
use trepan_geometry::Vec3;
use trepan_haptics::script::Site;
use trepan_stages::program::Program;
use trepan_volume::{Islands, VoxelVolume, bone_isovalue, leans, overlap, skull_only};

/// Opens a case: from the cache if it was built before, else from the files, with a progress bar.
pub fn open(program: Program, inputs: &Inputs, recipe: &Recipe, cache: &Cache) -> Result<Case, SessionError> {
    open_by(program, (inputs, recipe), cache, &Progress::default(), |_| Ok(*recipe))
}

/// Opens a case whose voxel size and tetrahedra are chosen by `choose` when the images are known.
pub(super) fn open_by(
    program: Program,
    (inputs, requested): (&Inputs, &Recipe),
    cache: &Cache,
    progress: &Progress,
    choose: impl FnOnce(&mut PendingCase) -> Result<Recipe, SessionError>,
) -> Result<Case, SessionError> {
    let mut pending = PendingCase::of(program, (inputs, requested), cache, progress)?;
    let recipe = choose(&mut pending)?;
    let PendingCase { facts, notes, key, images, opening, mut stages, .. } = pending;
    let hash = cache.under(&key, &format!("{} {} {}", recipe.spacing_mm, recipe.tets, recipe.halvings));
    let name = inputs.name.map_or_else(|| format!("case-{}", &hash[..8]), String::from);
    let hashes = identity::images(inputs, requested)?;
    if let Some(Ok(case)) = cache.find(&hash).map(|folder| case_folder::load(&folder)) {
        stages.finish();
        tracing::info!("case {name} from the cache");
        return Ok(Case { images: hashes, ..case });
    }
    let images = images.map_or_else(|| read(inputs, requested, &mut stages), Ok)?;
    let mut case = build(program, inputs, (images, opening), &recipe, &mut stages)?;
    (case.name, case.hash, case.images) = (name, hash, hashes);
    stages.next("caching the case")?;
    // The facts are cached only now: images from which no case can be built leave nothing.
    match cache.keep(&case.hash, |folder| case_folder::save(&case, folder)) {
        Ok(()) if cached::<CachedFacts>(cache, &key, FACTS).is_none() => {
            store(&CachedFacts { facts, notes }, cache, &key, FACTS)
        }
        Ok(()) => {}
        Err(fault) => case.notes.push(format!("the case could not be cached for the next start: {fault}")),
    }
    let took = stages.finish();
    tracing::info!("case {} imported in {took}", case.name);
    Ok(case)
}

/// Cached properties of images.
#[derive(Serialize, Deserialize)]
struct CachedFacts {
    facts: Facts,
    notes: Vec<String>,
}

/// A case before it is built: its inputs and properties.
pub(super) struct PendingCase<'a> {
    /// Properties of its images, from the cache if they were read before.
    pub facts: Facts,
    /// Remarks on them.
    pub notes: Vec<String>,
    program: Program,
    inputs: &'a Inputs,
    requested: &'a Recipe,
    cache: &'a Cache,
    key: String,
    images: Option<Images>,
    /// Where a skull is opened, on voxels of 1 mm, if that was looked for.
    opening: Option<Opening>,
    /// Progress of the import.
    pub stages: ImportStages,
}

impl<'a> PendingCase<'a> {
    /// Reads the images unless their properties are cached.
    pub fn of(
        program: Program,
        (inputs, requested): (&'a Inputs, &'a Recipe),
        cache: &'a Cache,
        progress: &Progress,
    ) -> Result<Self, SessionError> {
        let key = key_of_images(program, inputs, requested, cache)?;
        let mut stages = ImportStages::new(7, progress);
        let (CachedFacts { facts, notes }, images) = match cached(cache, &key, FACTS) {
            Some(cached) => (cached, None),
            None => {
                let images = read(inputs, requested, &mut stages)?;
                (CachedFacts { facts: facts_of(&images), notes: images.notes.clone() }, Some(images))
            }
        };
        Ok(Self { facts, notes, program, inputs, requested, cache, key, images, opening: None, stages })
    }

    /// Caches the facts unless they are cached already.
    pub fn store(&self) {
        if self.images.is_some() {
            store(&CachedFacts { facts: self.facts, notes: self.notes.clone() }, self.cache, &self.key, FACTS);
        }
    }

    /// Errors of these choices in this case, with that element, from the cache if measured before.
    /// Empty if no opening is found.
    pub fn case_errors(&mut self, scene: &Scene, rows: &Rows, element: Element) -> Result<CaseErrors, SessionError> {
        let key = self.cache.under(&self.key, &CaseErrors::about(scene, rows, element));
        if let Some(errors) = cached(self.cache, &key, ERRORS).or_else(|| shipped(&key)) {
            return Ok(errors);
        }
        if self.images.is_none() {
            self.images = Some(read(self.inputs, self.requested, &mut self.stages)?);
        }
        self.stages.next("measuring model errors in this case")?;
        let sight =
            self.images.as_ref().map(|images| sight(self.program, images, self.requested, scene)).transpose()?;
        let (opening, sight) = sight.flatten().unzip();
        // Other tissues may change what counts as brain.
        self.opening = opening.filter(|_| self.inputs.tissues.is_empty() && self.program.has_bone());
        let errors = sight.map_or_else(CaseErrors::default, |sight| measured(&sight, scene, rows, element));
        store(&errors, self.cache, &key, ERRORS);
        Ok(errors)
    }
}

/// Errors that were measured in the built-in case before it was shipped, by cache key.
const SHIPPED: &str = include_str!("../../measured/built-in.json");

/// Errors that come with the program; `None` for other images, choices or versions of the
/// measurement.
fn shipped(key: &str) -> Option<CaseErrors> {
    let mut all: BTreeMap<String, CaseErrors> = serde_json::from_str(SHIPPED).ok()?;
    all.remove(key)
}

fn measured(sight: &Sight, scene: &Scene, rows: &Rows, element: Element) -> CaseErrors {
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    CaseErrors::of(sight, scene, rows, element, threads)
}

/// Errors of these choices in the case of a folder, from the cache if measured before. Its skull
/// stands in for the CT, so that what resampling lost is not counted.
pub(super) fn errors_in(
    case: &Case,
    cache: &Cache,
    scene: &Scene,
    rows: &Rows,
    element: Element,
) -> Result<CaseErrors, SessionError> {
    let Some(opening) = case.opening else { return Ok(CaseErrors::default()) };
    let key = cache.under(&case.hash, &CaseErrors::about(scene, rows, element));
    if let Some(errors) = cached(cache, &key, ERRORS) {
        return Ok(errors);
    }
    let of_bone = |ct: &VoxelVolume<i16>| {
        let bone = Arc::new(bone_of(ct.clone(), case.isovalue_hu)?);
        Ok::<_, SessionError>((Skull { ct: ct.clone(), isovalue: case.isovalue_hu }, bone))
    };
    let skull = case.skull.as_ref().map(of_bone).transpose()?;
    let shape =
        |mask: &VoxelVolume<u8>| Shape { field: Inside::of(mask).field, mask: mask.clone(), material: scene.material };
    let brain = case.brain.as_ref().map(|brain| (shape(&brain.classes), opening.brain()));
    let site = Site::from(opening);
    let sight = Sight { skull, entry: site.entry, outward: -site.inward, eye: eye(&site), brain };
    let errors = measured(&sight, scene, rows, element);
    store(&errors, cache, &key, ERRORS);
    Ok(errors)
}

/// The opening on voxels of 1 mm, and skull, brain and first view there, to measure errors on;
/// `None` if no opening is found.
fn sight(
    program: Program,
    images: &Images,
    recipe: &Recipe,
    scene: &Scene,
) -> Result<Option<(Opening, Sight)>, SessionError> {
    let classes = images.mask.as_ref().map(cropped).transpose()?;
    let inside = classes.as_ref().map(Inside::of);
    let of_bone = |ct: &VoxelVolume<i16>| {
        let (drawn, _) = make_skull(ct, &Recipe { spacing_mm: REFERENCE_MM, ..*recipe }, images.isovalue_hu)?;
        let bone = bone_of(drawn, images.isovalue_hu)?;
        let opening = Opening::of_patient(&bone, inside.as_ref(), recipe.opening)?;
        let mut skull = Skull { ct: ct.clone(), isovalue: images.isovalue_hu };
        skull_only(&mut skull.ct, skull.isovalue);
        Ok::<_, SessionError>((opening, (skull, Arc::new(bone))))
    };
    let with_bone = images.ct.as_ref().filter(|_| program.has_bone()).map(of_bone).transpose()?;
    let (opening, skull) = match with_bone {
        Some((opening, skull)) => (Some(opening), Some(skull)),
        None => (inside.as_ref().and_then(Opening::on_bare_brain), None),
    };
    let brain = classes.zip(inside);
    let brain = brain.map(|(mask, inside)| Shape { field: inside.field, mask, material: scene.material });
    Ok(opening.map(|opening| {
        let site = Site::from(opening);
        let brain = brain.map(|shape| (shape, opening.brain()));
        (opening, Sight { skull, entry: site.entry, outward: -site.inward, eye: eye(&site), brain })
    }))
}

/// Cache key of the images and of the recipe's numbers for reading them.
fn key_of_images(program: Program, inputs: &Inputs, requested: &Recipe, cache: &Cache) -> Result<String, SessionError> {
    needs(program, inputs, requested)?;
    let images = [&inputs.ct, &inputs.mri, &inputs.labels];
    let tissues = inputs.tissues.iter().map(|source| &source.path);
    let files: Vec<&Path> = images.into_iter().flatten().chain(tissues).map(PathBuf::as_path).collect();
    let given = images.map(Option::is_some);
    let meant: Vec<_> = inputs.tissues.iter().map(|source| (source.class, &source.codes, &source.names)).collect();
    let of_images = Recipe { spacing_mm: 0.0, tets: 0, halvings: 0, ..*requested };
    cache.key(&files, &format!("{of_images:?} {given:?} {meant:?}"))
}

fn needs(program: Program, inputs: &Inputs, requested: &Recipe) -> Result<(), SessionError> {
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
    let idle = [
        ("--labels", inputs.labels.is_some() && inputs.mri.is_none(), "--mri PATH"),
        ("--tissue", !inputs.tissues.is_empty() && inputs.mri.is_none(), "--mri PATH"),
        ("--register", requested.register && (inputs.ct.is_none() || inputs.mri.is_none()), "both --ct and --mri"),
        ("--opening", requested.opening.is_some() && inputs.ct.is_none(), "--ct PATH"),
    ];
    match idle.into_iter().find(|(_, idle, _)| *idle) {
        Some((flag, _, needed)) => {
            Err(SessionError::Usage(format!("{flag} does nothing here: give {needed} too, or leave {flag} out")))
        }
        None => Ok(()),
    }
}

/// The images as read, and the brain segmented from them.
struct Images {
    ct: Option<VoxelVolume<i16>>,
    mri: Option<VoxelVolume<f32>>,
    mask: Option<VoxelVolume<u8>>,
    /// Mask of each tissue source, in its order.
    tissues: Vec<VoxelVolume<u8>>,
    ct_from_mri: DAffine3,
    isovalue_hu: i16,
    fit_png: Option<Vec<u8>>,
    notes: Vec<String>,
}

fn read(inputs: &Inputs, recipe: &Recipe, stages: &mut ImportStages) -> Result<Images, SessionError> {
    let [mut notes, mut of_ct, mut of_mri] = [const { Vec::new() }; 3];
    stages.next("reading the CT")?;
    let labels = || {
        let labels = inputs.labels.as_deref().map(read_labels).transpose()?;
        Ok::<_, SessionError>((labels, TissueSource::read_all(&inputs.tissues, &mut notes)?))
    };
    // CT and MRI in turn: memory that reading the one took serves the other.
    let images = || {
        let ct = inputs.ct.as_deref().map(|path| read_ct(path, recipe.ct_series, &mut of_ct)).transpose();
        (ct, inputs.mri.as_deref().map(|path| read_mri(path, recipe.mri_series, &mut of_mri)).transpose())
    };
    let (labels, (ct, mri)) = rayon::join(labels, images);
    // What is wrong with labels is said before segmentation begins.
    let ((labels, tissues), ct) = (labels?, ct?);
    notes.append(&mut of_ct);
    let isovalue_hu = recipe.isovalue_hu.or(ct.as_ref().map(bone_isovalue)).unwrap_or(400);
    if let Some(ct) = ct.as_ref().filter(|_| recipe.isovalue_hu.is_none()) {
        notes.extend(scale_doubt(ct, isovalue_hu, inputs.mri.is_some())?);
    }
    stages.offer_skull(ct.as_ref().map(|ct| || case_folder::in_draft(ct, isovalue_hu)));
    stages.next("reading the MRI")?;
    let mut mri = mri?;
    notes.append(&mut of_mri);
    let (mut fit, mut ct_from_mri) = (Fit::new(), DAffine3::IDENTITY);
    if let (Some(ct), Some(mri)) = (&ct, &mut mri) {
        if recipe.register {
            stages.next("registering the MRI to the CT")?;
            fit.add(ct, mri, isovalue_hu);
            ct_from_mri = registered(ct, mri, &mut notes)?;
        }
        overlap(ct, mri).map_err(|fault| SessionError::Case(fault.to_string()))?;
        fit.add(ct, mri, isovalue_hu);
    }
    stages.next("segmenting the brain")?;
    let space = ct.as_ref().map(|ct| Space { ct, isovalue_hu, registered: recipe.register });
    let given = inputs.labels.as_deref().zip(labels);
    let found_in = if given.is_some() { "the labels" } else { "the brain found in the skull" };
    let is_given = given.is_some();
    let mut of_brain = Vec::new();
    let check = || match space.as_ref().zip(mri.as_ref()) {
        Some((space, mri)) => space.check_mri(mri, &mut notes),
        None => Ok(true),
    };
    let find = || {
        let find = |mri| find_brain(given, mri, ct_from_mri, ct.as_ref(), isovalue_hu, &mut of_brain);
        mri.as_ref().map(find).transpose()
    };
    let (is_checked, mask) = rayon::join(check, find);
    let is_checked = is_checked? && !is_given;
    let mask = mask?;
    notes.append(&mut of_brain);
    let check = || match (&space, &mri, &mask) {
        (Some(space), Some(mri), Some(mask)) if !is_checked => space.check(found_in, mask, mri, &mut notes),
        _ => Ok(()),
    };
    let stray = || space.as_ref().zip(mask.as_ref()).map_or_else(|| Ok(Vec::new()), |(space, mask)| space.stray(mask));
    let (checked, (stray, leans)) = rayon::join(check, || rayon::join(stray, || mask.as_ref().is_some_and(leans)));
    checked?;
    notes.extend(stray?);
    if leans {
        notes.push("the head may not lie as its image says: its brain is not longest from back to front, or not alike left and right; check the planes in the slices".into());
    }
    Ok(Images { ct, mri, mask, tissues, ct_from_mri, isovalue_hu, fit_png: fit.png(), notes })
}

/// A numerical parameter: loose bone over the skull's, up to which it is specks and the table.
const FEW_LOOSE: f64 = 0.01;

/// Remark on bone that was left out because it is loose.
fn loose(islands: &Islands) -> Option<String> {
    let Islands { pieces, mm3, skull_mm3 } = *islands;
    if pieces == 0 || mm3 >= FEW_LOOSE * skull_mm3 {
        return islands.note();
    }
    let [loose, skull] = [mm3, skull_mm3].map(|mm3| 1e-3 * mm3);
    Some(format!(
        "{} of bone left out, {loose:.2} cm³ beside a skull of {skull:.0} cm³{WELL}",
        count(pieces, "loose piece")
    ))
}

fn build(
    program: Program,
    inputs: &Inputs,
    (images, known): (Images, Option<Opening>),
    recipe: &Recipe,
    stages: &mut ImportStages,
) -> Result<Case, SessionError> {
    let Images { ct, mri, mask, tissues, ct_from_mri, isovalue_hu, fit_png, mut notes } = images;
    stages.next("resampling the skull")?;
    let mut of_classes = Vec::new();
    let make_skull = || ct.as_ref().map(|ct| make_skull(ct, recipe, isovalue_hu)).transpose();
    let make_classes =
        || mask.map(|mask| make_classes((inputs, tissues), &mask, ct_from_mri, &mut of_classes)).transpose();
    let (made, classes) = rayon::join(make_skull, make_classes);
    let (made, classes) = (made?, classes?);
    notes.extend(made.as_ref().and_then(|(_, islands)| loose(islands)));
    notes.append(&mut of_classes);
    let skull = made.map(|(skull, _)| skull);
    stages.next("planning the opening")?;
    let on_skull = |(ct, skull): (_, &VoxelVolume<i16>)| match known {
        Some(opening) => opening.on(&bone_of(skull.clone(), isovalue_hu)?, classes.is_some()),
        None => Opening::planned(ct, skull, isovalue_hu, classes.as_ref(), recipe),
    };
    let opening = match ct.as_ref().zip(skull.as_ref()).map(on_skull).transpose() {
        // A program that does not drill needs no opening.
        Err(_) if !program.has_bone() && recipe.opening.is_none() => None,
        found => found?,
    };
    drop(ct);
    stages.next("meshing the brain")?;
    let bare = || Opening::on_bare_brain(&Inside::of(classes.as_ref()?));
    let fineness = Fineness::stepped(recipe.tets, recipe.halvings);
    let at = |opening: Opening| fineness.fine(opening.brain(), -Vec3::from(opening.inward));
    let fine = opening.or_else(bare).and_then(at);
    let brain = mri.zip(classes).map(|(mri, classes)| make_brain(mri, classes, fine, recipe)).transpose()?;
    Ok(Case { recipe: Some(*recipe), fit_png, skull, isovalue_hu, brain, opening, notes, ..Case::default() })
}

/// Volume of the nonzero voxels, mm³.
pub(super) fn volume_mm3(mask: &VoxelVolume<u8>) -> f64 {
    mask.data.iter().filter(|&&v| v != 0).count() as f64 * mask.spacing_mm().element_product()
}

/// Cache file of the facts.
const FACTS: &str = "facts.json";
/// Cache file of the errors measured in this case.
const ERRORS: &str = "own.json";

fn facts_of(images: &Images) -> Facts {
    Facts {
        ct_voxel_mm: images.ct.as_ref().map(|ct| ct.spacing_mm().element_sum() / 3.0),
        brain_mm3: images.mask.as_ref().map(volume_mm3),
    }
}

fn cached<T: DeserializeOwned>(cache: &Cache, key: &str, file: &str) -> Option<T> {
    serde_json::from_slice(&std::fs::read(cache.find(key)?.join(file)).ok()?).ok()
}

/// Caches a value; if that fails, it is computed again next time.
fn store(value: &impl Serialize, cache: &Cache, key: &str, file: &str) {
    let write = |folder: &Path| Ok(std::fs::write(folder.join(file), serde_json::to_vec(value)?)?);
    cache.keep(key, write).err().into_iter().for_each(|fault| tracing::debug!("{file} not cached: {fault}"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TissueSource;
    use crate::case::choice;
    use crate::models::ModelRequest;
    use crate::options::Options;
    use clap::Parser;

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
            let mut pending = PendingCase::of(program, (&inputs, &recipe), &cache, &progress).unwrap();
            pending.store();
            let request = ModelRequest::to_plan(program, &patient, Default::default(), 1000.0, [960, 600]).unwrap();
            for card in [false, true] {
                let facts = pending.facts;
                let settled = request.settle(
                    &facts,
                    || card,
                    |scene, rows, element| {
                        let key = cache.under(&pending.key, &CaseErrors::about(scene, rows, element));
                        let errors = if keeps {
                            pending.case_errors(scene, rows, element)?
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
