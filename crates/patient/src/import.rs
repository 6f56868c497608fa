//! Imports a scanner's files as a case: skull grid, brain mask, brain mesh and opening, cached by
//! content.
//!
//! # Practice
//! A case depends only on the bytes of the inputs and the numbers in [`Recipe`]; their hash names
//! the folder in the user's cache. The folder is filled under a temporary name and then moved, so
//! an interrupted import leaves nothing. A case is named by the first digits of that hash, because
//! file names may contain a patient's name. Properties of the images ([`Facts`]) are cached too, so
//! that the numbers can be chosen without reading the images again.

use crate::PatientError;
use crate::Recipe;
use crate::anatomy::{
    cropped, find_brain, make_brain, make_classes, make_skull, read_ct, read_labels, read_mri, registered, scale_doubt,
};
use crate::cache::Cache;
use crate::fineness::Fineness;
use crate::fit::Fit;
use crate::folder as case_folder;
use crate::identity;
use crate::opening::{Inside, Opening, REFERENCE_MM, bone_of, middle, over};
use crate::preview::Preview;
use crate::progress::Progress;
use crate::remark::WELL;
use crate::space::Space;
use crate::stages::ImportStages;
use crate::tissue_class::{TissueSource, make_tumour};
use crate::{Case, Inputs, MadeTumour};
use glam::DAffine3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use trepan_geometry::Vec3;
use trepan_stages::program::Program;
use trepan_volume::{Islands, VoxelVolume, bone_isovalue, leans, overlap, skull_only};

/// Opens a case: from the cache if it was built before, else from the files, with a progress bar.
pub fn open(program: Program, inputs: &Inputs, recipe: &Recipe, cache: &Cache) -> Result<Case, PatientError> {
    Import::begin(program, (inputs, recipe), cache, &Progress::default())?.build(*recipe)
}

/// An import that has begun: the properties of its images are known, the case is not built.
pub struct Import<'a> {
    /// Properties of its images, from the cache if they were read before.
    pub facts: Facts,
    /// Remarks on them.
    pub notes: Vec<String>,
    /// Which program the case is for.
    pub program: Program,
    /// Its input files.
    pub inputs: &'a Inputs,
    /// Parameters that were asked for.
    pub requested: &'a Recipe,
    /// Where the case is cached.
    pub cache: &'a Cache,
    /// Cache key of the images.
    pub key: String,
    images: Option<Images>,
    /// Where the skull is opened, on coarse voxels, if that was looked for.
    opening: Option<Opening>,
    /// Progress of the import.
    pub stages: ImportStages,
}

impl<'a> Import<'a> {
    /// Reads the images unless their properties are cached.
    pub fn begin(
        program: Program,
        (inputs, requested): (&'a Inputs, &'a Recipe),
        cache: &'a Cache,
        progress: &Progress,
    ) -> Result<Self, PatientError> {
        let key = key_of_images(program, inputs, requested, cache)?;
        let mut stages = ImportStages::new(7, progress);
        let (CachedFacts { facts, notes }, images) = match cache.read(&key, FACTS) {
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
            let notes = self.notes.clone();
            self.cache.write(&CachedFacts { facts: self.facts, notes }, &self.key, FACTS);
        }
    }

    /// Opening, skull and brain before the case is built; the images are read now if their
    /// properties came from the cache. `None` if no opening is found.
    pub fn preview(&mut self, stage: &'static str) -> Result<Option<Preview>, PatientError> {
        let images = self.images.take().map_or_else(|| read(self.inputs, self.requested, &mut self.stages), Ok)?;
        let images = self.images.insert(images);
        self.stages.next(stage)?;
        let preview = images.preview(self.program, self.inputs, self.requested)?;
        // Other tissues may change what counts as brain.
        let holds = self.inputs.tissues.is_empty() && self.program.has_bone();
        self.opening = preview.as_ref().map(|preview| preview.opening).filter(|_| holds);
        Ok(preview)
    }

    /// Builds the case with these parameters, or opens it from the cache.
    pub fn build(self, recipe: Recipe) -> Result<Case, PatientError> {
        let Self { facts, notes, program, inputs, requested, cache, key, images, opening, mut stages } = self;
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
            Ok(()) if cache.read::<CachedFacts>(&key, FACTS).is_none() => {
                cache.write(&CachedFacts { facts, notes }, &key, FACTS)
            }
            Ok(()) => {}
            Err(fault) => case.notes.push(format!("the case could not be cached for the next start: {fault}")),
        }
        let took = stages.finish();
        tracing::info!("case {} imported in {took}", case.name);
        Ok(case)
    }
}

/// Properties of the images that the choice of voxel size and mesh depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Facts {
    /// Mean edge of the CT's voxels, mm. `None` without a CT.
    pub ct_voxel_mm: Option<f64>,
    /// Volume of the brain, mm³; `None` without an MRI.
    pub brain_mm3: Option<f64>,
}

/// Cached properties of images.
#[derive(Serialize, Deserialize)]
struct CachedFacts {
    facts: Facts,
    notes: Vec<String>,
}

/// Cache key of the images and of the recipe's numbers for reading them.
fn key_of_images(program: Program, inputs: &Inputs, requested: &Recipe, cache: &Cache) -> Result<String, PatientError> {
    needs(program, inputs, requested)?;
    let images = [&inputs.ct, &inputs.mri, &inputs.labels];
    let tissues = inputs.tissues.iter().map(|source| &source.path);
    let files: Vec<&Path> = images.into_iter().flatten().chain(tissues).map(PathBuf::as_path).collect();
    let given = images.map(Option::is_some);
    let meant: Vec<_> = inputs.tissues.iter().map(|source| (source.class, &source.codes, &source.names)).collect();
    let of_images = Recipe { spacing_mm: 0.0, tets: 0, halvings: 0, ..*requested };
    let tumour = inputs.tumour.map_or_else(String::new, |tumour| format!(" tumour {tumour:?}"));
    cache.key(&files, &format!("{of_images:?} {given:?} {meant:?}{tumour}"))
}

fn needs(program: Program, inputs: &Inputs, requested: &Recipe) -> Result<(), PatientError> {
    let lacks = |flag: &str, what: &str| {
        Err(PatientError::Usage(format!(
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
        ("--tumour", inputs.tumour.is_some() && inputs.mri.is_none(), "--mri PATH"),
        ("--register", requested.register && (inputs.ct.is_none() || inputs.mri.is_none()), "both --ct and --mri"),
        ("--opening", requested.opening.is_some() && inputs.ct.is_none(), "--ct PATH"),
    ];
    match idle.into_iter().find(|(_, idle, _)| *idle) {
        Some((flag, _, needed)) => {
            Err(PatientError::Usage(format!("{flag} does nothing here: give {needed} too, or leave {flag} out")))
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

impl Images {
    /// Opening on coarse voxels, skull and brain there; `None` if no opening is found.
    fn preview(&self, program: Program, inputs: &Inputs, recipe: &Recipe) -> Result<Option<Preview>, PatientError> {
        let mask = self.mask.as_ref().map(cropped).transpose()?;
        let inside = mask.as_ref().map(Inside::of);
        let tumour = inputs.tumour.and_then(|tumour| tumour.centre);
        let over = tumour.zip(inside.as_ref()).map(|(tumour, inside)| over(tumour, inside.middle));
        let recipe = &Recipe { opening: recipe.opening.or(over), ..*recipe };
        let isovalue_hu = self.isovalue_hu;
        let of_bone = |ct: &VoxelVolume<i16>| {
            let (coarse, _) = make_skull(ct, &Recipe { spacing_mm: REFERENCE_MM, ..*recipe }, isovalue_hu)?;
            let bone = bone_of(coarse, isovalue_hu)?;
            let opening = Opening::of_patient(&bone, inside.as_ref(), recipe.opening)?;
            let mut ct = ct.clone();
            skull_only(&mut ct, isovalue_hu);
            Ok::<_, PatientError>((opening, (ct, bone)))
        };
        let with_bone = self.ct.as_ref().filter(|_| program.has_bone()).map(of_bone).transpose()?;
        let (opening, skull) = match with_bone {
            Some((opening, skull)) => (Some(opening), Some(skull)),
            None => (inside.as_ref().and_then(Opening::on_bare_brain), None),
        };
        let brain = mask.zip(inside.map(|inside| inside.field));
        Ok(opening.map(|opening| Preview { opening, skull, isovalue_hu, brain }))
    }
}

fn read(inputs: &Inputs, recipe: &Recipe, stages: &mut ImportStages) -> Result<Images, PatientError> {
    let [mut notes, mut of_ct, mut of_mri] = [const { Vec::new() }; 3];
    stages.next("reading the CT")?;
    let labels = || {
        let labels = inputs.labels.as_deref().map(read_labels).transpose()?;
        Ok::<_, PatientError>((labels, TissueSource::read_all(&inputs.tissues, &mut notes)?))
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
        overlap(ct, mri).map_err(|fault| PatientError::Case(fault.to_string()))?;
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

/// Depth of a tumour's centre below the brain's surface over its radius, numerical: its top shows.
const TUMOUR_DEPTH: f32 = 0.8;

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
        "{pieces} loose piece{} of bone left out, {loose:.2} cm³ beside a skull of {skull:.0} cm³{WELL}",
        if pieces == 1 { "" } else { "s" }
    ))
}

fn build(
    program: Program,
    inputs: &Inputs,
    (images, known): (Images, Option<Opening>),
    recipe: &Recipe,
    stages: &mut ImportStages,
) -> Result<Case, PatientError> {
    let Images { ct, mri, mask, tissues, ct_from_mri, isovalue_hu, fit_png, mut notes } = images;
    stages.next("resampling the skull")?;
    let mut of_classes = Vec::new();
    let make_skull = || ct.as_ref().map(|ct| make_skull(ct, recipe, isovalue_hu)).transpose();
    let make_classes =
        || mask.map(|mask| make_classes((inputs, tissues), &mask, ct_from_mri, &mut of_classes)).transpose();
    let (made, classes) = rayon::join(make_skull, make_classes);
    let (made, mut classes) = (made?, classes?);
    notes.extend(made.as_ref().and_then(|(_, islands)| loose(islands)));
    notes.append(&mut of_classes);
    let tumour = inputs.tumour.and_then(|tumour| tumour.centre);
    let over = tumour.zip(classes.as_ref()).map(|(tumour, classes)| over(tumour, middle(classes)));
    let recipe = &Recipe { opening: recipe.opening.or(over), ..*recipe };
    stages.next("planning the opening")?;
    let on_skull = |(ct, (skull, _)): (_, (VoxelVolume<i16>, _))| {
        let world_from_voxel = skull.world_from_voxel;
        // The skull is bone for as long as the opening is planned: no second copy of it.
        let bone = bone_of(skull, isovalue_hu)?;
        let opening = match known {
            Some(opening) => opening.on(&bone, classes.is_some()),
            None => Opening::planned(ct, &bone, isovalue_hu, classes.as_ref(), recipe),
        };
        let opening = match opening {
            // A program that does not drill needs no opening.
            Err(_) if !program.has_bone() && recipe.opening.is_none() => None,
            found => Some(found?),
        };
        Ok::<_, PatientError>((VoxelVolume { world_from_voxel, ..bone.into_scanned() }, opening))
    };
    let (skull, opening) = ct.as_ref().zip(made).map(on_skull).transpose()?.unzip();
    let opening = opening.flatten();
    drop(ct);
    stages.next("meshing the brain")?;
    let bare = || Opening::on_bare_brain(&Inside::of(classes.as_ref()?));
    let fineness = Fineness::stepped(recipe.tets, recipe.halvings);
    let place = opening.or_else(bare);
    let fine = match (inputs.tumour, classes.as_mut()) {
        (Some(MadeTumour { centre, radius_mm }), Some(classes)) => {
            let below = |place: Opening| (place.brain() + TUMOUR_DEPTH * radius_mm * Vec3::from(place.inward)).into();
            let centre = centre.or(place.map(below)).unwrap_or_default();
            notes.push(make_tumour(centre, radius_mm, classes)?);
            Fineness::around(centre.into(), radius_mm, recipe.halvings)
        }
        _ => place.and_then(|place| fineness.fine(place.brain(), -Vec3::from(place.inward))),
    };
    let brain = mri.zip(classes).map(|(mri, classes)| make_brain(mri, classes, fine, recipe)).transpose()?;
    Ok(Case { recipe: Some(*recipe), fit_png, skull, isovalue_hu, brain, opening, notes, ..Case::default() })
}

/// Volume of the nonzero voxels, mm³.
pub(crate) fn volume_mm3(mask: &VoxelVolume<u8>) -> f64 {
    mask.data.iter().filter(|&&v| v != 0).count() as f64 * mask.spacing_mm().element_product()
}

/// Cache file of the facts.
const FACTS: &str = "facts.json";

fn facts_of(images: &Images) -> Facts {
    Facts {
        ct_voxel_mm: images.ct.as_ref().map(|ct| ct.spacing_mm().element_sum() / 3.0),
        brain_mm3: images.mask.as_ref().map(volume_mm3),
    }
}
