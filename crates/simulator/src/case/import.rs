//! From the scanner's files to a case: skull grid, brain mask, brain mesh, each made once and kept by content.
//!
//! # Practice
//! What is made depends only on the bytes of the inputs and the numbers in [`Recipe`]; its hash names the folder in the user's
//! cache. The folder is made beside its final place and moved there whole, so an interrupted import leaves nothing.
//! A case goes by the first digits of that hash: file names may hold a patient's name.

use crate::case::cache::Cache;
use crate::case::folder as case_folder;
use crate::error::SessionError;
use crate::program::Program;
use glam::DAffine3;
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use trepan_mesh::{TetMesh, lattice};
use trepan_volume::{
    AIR_HU, BrainConfig, Grid, Interpolation, MaskError, RegistrationConfig, VoxelVolume, bone_isovalue, brain_mask,
    check_brain_mask, hounsfield, largest_component, overlap, register, resample, skull_only,
};

/// Air around the brain that its grids keep, mm.
const MARGIN_MM: f32 = 12.0;
/// Most voxels of a skull grid.
const MOST_VOXELS: usize = 600_000_000;

/// The files of a case.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inputs {
    /// A name that may be shown; `None` for a user's own files.
    pub name: Option<&'static str>,
    /// CT, where there is one.
    pub ct: Option<PathBuf>,
    /// MRI, where there is one.
    pub mri: Option<PathBuf>,
    /// Labels, where there are some.
    pub labels: Option<PathBuf>,
}

/// The numbers that a case depends on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recipe {
    /// Edge of a skull voxel, mm.
    pub spacing_mm: f32,
    /// Tetrahedra of the brain.
    pub tets: usize,
    /// Threshold of bone, HU; `None` for the histogram's.
    pub isovalue_hu: Option<i16>,
    /// Whether the MRI, and labels with it, are moved to where they fit the CT.
    pub register: bool,
}

/// What a session needs of the patient.
#[derive(Clone, Debug)]
pub struct Case {
    /// A name without a patient in it.
    pub name: String,
    /// Hash of inputs and recipe, hexadecimal.
    pub hash: String,
    /// Skull densities in HU on a grid of cubes, largest piece only; `None` without a CT.
    pub skull: Option<VoxelVolume<i16>>,
    /// Threshold of bone, HU.
    pub isovalue_hu: i16,
    /// The brain; `None` without an MRI.
    pub brain: Option<Brain>,
    /// Remarks of the import.
    pub notes: Vec<String>,
    /// Whether it came from the cache.
    pub cached: bool,
}

/// The brain of a case.
#[derive(Clone, Debug)]
pub struct Brain {
    /// 1 in the brain, on a grid of cubes around it.
    pub mask: VoxelVolume<u8>,
    /// The MRI on the same grid.
    pub mri: VoxelVolume<f32>,
    /// Tetrahedra.
    pub mesh: TetMesh,
}

/// Opens a case: from the cache if it was made before, else from the files, with a progress bar.
pub fn open(program: Program, inputs: &Inputs, recipe: &Recipe, cache: &Cache) -> Result<Case, SessionError> {
    needs(program, inputs)?;
    let files: Vec<&Path> =
        [&inputs.ct, &inputs.mri, &inputs.labels].into_iter().flatten().map(PathBuf::as_path).collect();
    let given = [&inputs.ct, &inputs.mri, &inputs.labels].map(Option::is_some);
    let hash = cache.key(&files, &format!("{recipe:?} {given:?}"))?;
    let name = inputs.name.map_or_else(|| format!("case-{}", &hash[..8]), String::from);
    if let Some(Ok(case)) = cache.find(&hash).map(|folder| case_folder::load(&folder)) {
        return Ok(case);
    }
    let bar = progress();
    let mut case = build(inputs, recipe, &bar)?;
    (case.name, case.hash) = (name, hash);
    bar.set_message("keeping the case for the next start");
    if let Err(fault) = cache.keep(&case.hash, |folder| case_folder::save(&case, recipe, folder)) {
        case.notes.push(format!("the case could not be kept for the next start: {fault}"));
    }
    bar.finish_and_clear();
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

fn progress() -> ProgressBar {
    let style = ProgressStyle::with_template("{spinner} [{bar:24}] {pos}/{len} {msg} {elapsed}");
    let bar = ProgressBar::new(6).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(std::time::Duration::from_millis(120));
    bar
}

fn stage(bar: &ProgressBar, what: &'static str) {
    bar.inc(1);
    bar.set_message(what);
}

fn build(inputs: &Inputs, recipe: &Recipe, bar: &ProgressBar) -> Result<Case, SessionError> {
    let mut notes = Vec::new();
    stage(bar, "reading the CT");
    let ct = inputs.ct.as_deref().map(|path| read_ct(path, &mut notes)).transpose()?;
    let isovalue_hu = recipe.isovalue_hu.or(ct.as_ref().map(bone_isovalue)).unwrap_or(400);
    stage(bar, "reading the MRI");
    let mut mri = inputs.mri.as_deref().map(|path| read_mri(path, &mut notes)).transpose()?;
    let ct_from_mri = match (&ct, &mut mri) {
        (Some(ct), Some(mri)) if recipe.register => registered(ct, mri, &mut notes)?,
        _ => DAffine3::IDENTITY,
    };
    if let (Some(ct), Some(mri)) = (&ct, &mri) {
        overlap(ct, mri).map_err(|fault| SessionError::Case(fault.to_string()))?;
    }
    stage(bar, "finding the brain");
    let mask = mri
        .as_ref()
        .map(|mri| find_brain(inputs, mri, ct_from_mri, ct.as_ref(), isovalue_hu, &mut notes))
        .transpose()?;
    stage(bar, "resampling the skull");
    let skull = ct.map(|ct| make_skull(&ct, recipe, isovalue_hu)).transpose()?;
    stage(bar, "meshing the brain");
    let brain = mri.zip(mask).map(|(mri, mask)| make_brain(&mri, &mask, recipe)).transpose()?;
    Ok(Case { name: String::new(), hash: String::new(), skull, isovalue_hu, brain, notes, cached: false })
}

fn read_ct(path: &Path, notes: &mut Vec<String>) -> Result<VoxelVolume<i16>, SessionError> {
    let import = trepan_volume::import(path)?;
    notes.extend(import.notes.iter().map(|note| format!("CT: {note}")));
    hounsfield(&import.volume).map_err(|fault| SessionError::Case(format!("{}: {fault}", path.display())))
}

fn read_mri(path: &Path, notes: &mut Vec<String>) -> Result<VoxelVolume<f32>, SessionError> {
    let import = trepan_volume::import(path)?;
    notes.extend(import.notes.iter().map(|note| format!("MRI: {note}")));
    let bad = import.volume.data.iter().filter(|v| !v.is_finite()).count();
    if bad > 0 {
        let fault = MaskError::NotANumber { count: bad };
        return Err(SessionError::Case(format!("{}: {fault}", path.display())));
    }
    Ok(import.volume)
}

/// Moves the MRI to where it fits the CT; returns the move.
fn registered(
    ct: &VoxelVolume<i16>,
    mri: &mut VoxelVolume<f32>,
    notes: &mut Vec<String>,
) -> Result<DAffine3, SessionError> {
    let found = register(&ct.map(f32::from), mri, &RegistrationConfig::default());
    let found = found.map_err(|fault| SessionError::Case(fault.to_string()))?;
    let (_, turn, _) = found.fixed_from_moving.to_scale_rotation_translation();
    let middle = mri.centre_of(mri.dims.map(|n| n / 2));
    let moved_mm = found.fixed_from_moving.transform_point3(middle).distance(middle);
    mri.world_from_voxel = found.fixed_from_moving * mri.world_from_voxel;
    notes.push(format!(
        "the MRI was moved by {moved_mm:.1} mm and turned by {:.1} degrees to fit the CT: shared information {:.3} to {:.3}, confidence {:.2}; look at the slices, a confident answer can still be wrong",
        turn.to_axis_angle().1.to_degrees(),
        found.start_metric,
        found.metric,
        found.confidence
    ));
    Ok(found.fixed_from_moving)
}

fn find_brain(
    inputs: &Inputs,
    mri: &VoxelVolume<f32>,
    ct_from_mri: DAffine3,
    ct: Option<&VoxelVolume<i16>>,
    isovalue_hu: i16,
    notes: &mut Vec<String>,
) -> Result<VoxelVolume<u8>, SessionError> {
    let config = BrainConfig { isovalue: Some(isovalue_hu), ..BrainConfig::default() };
    let Some(path) = &inputs.labels else {
        return brain_mask(mri, ct, &config).map_err(|fault| SessionError::Case(format!("{fault} (--labels PATH)")));
    };
    let case = |fault: String| SessionError::Case(format!("{}: {fault}", path.display()));
    let mut labels = trepan_volume::labels(path, &trepan_volume::read(path)?)?;
    labels.world_from_voxel = ct_from_mri * labels.world_from_voxel;
    let whole = labels.map(|label| u8::from(label != 0));
    let mask = largest_component(&whole);
    match check_brain_mask(&mask, &config) {
        Err(fault @ MaskError::Volume { .. }) => notes.push(format!("labels: {fault}")),
        Err(fault) => return Err(case(fault.to_string())),
        Ok(()) => {}
    }
    overlap(&mask.map(i16::from), mri).map_err(|fault| case(format!("labels (as CT) and MRI lie apart: {fault}")))?;
    Ok(mask)
}

fn make_skull(ct: &VoxelVolume<i16>, recipe: &Recipe, isovalue_hu: i16) -> Result<VoxelVolume<i16>, SessionError> {
    let grid = Grid::isotropic_over(ct, recipe.spacing_mm);
    if grid.voxels() > MOST_VOXELS {
        let text =
            format!("--spacing-mm {} asks for {} voxels, the limit is {MOST_VOXELS}", recipe.spacing_mm, grid.voxels());
        return Err(SessionError::Usage(text));
    }
    let mut skull = resample(ct, &grid, Interpolation::Trilinear, AIR_HU);
    skull_only(&mut skull, isovalue_hu);
    if !skull.data.iter().any(|&hu| hu >= isovalue_hu) {
        return Err(SessionError::Case(format!(
            "no voxel of the CT reaches {isovalue_hu} HU: there is no bone; give --isovalue-hu"
        )));
    }
    Ok(skull)
}

fn make_brain(mri: &VoxelVolume<f32>, mask: &VoxelVolume<u8>, recipe: &Recipe) -> Result<Brain, SessionError> {
    let mask = cropped(mask);
    let mri = resample(mri, &Grid::of(&mask), Interpolation::Trilinear, 0.0);
    let config = lattice::Config { target_tets: recipe.tets, ..lattice::Config::default() };
    let mesh = lattice::tetrahedra(&mask, &config)
        .map_err(|fault| SessionError::Case(format!("meshing the brain: {fault}")))?;
    mesh.check().map_err(|fault| SessionError::Internal(format!("the mesher made a bad mesh: {fault}")))?;
    Ok(Brain { mask, mri, mesh })
}

/// The mask on a grid of 1 mm cubes, cut to its content and a margin.
fn cropped(mask: &VoxelVolume<u8>) -> VoxelVolume<u8> {
    let spacing = mask.spacing_mm().min_element().clamp(0.8, 1.5) as f32;
    let whole = resample(mask, &Grid::isotropic_over(mask, spacing), Interpolation::Nearest, 0);
    let [nx, ny, _] = whole.dims;
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for (at, _) in whole.data.iter().enumerate().filter(|(_, v)| **v != 0) {
        for (axis, v) in [at % nx, at / nx % ny, at / (nx * ny)].into_iter().enumerate() {
            (low[axis], high[axis]) = (low[axis].min(v), high[axis].max(v));
        }
    }
    let margin = (MARGIN_MM / spacing).ceil() as i64;
    let dims = [0, 1, 2].map(|axis| (high[axis] - low[axis] + 1) + 2 * margin as usize);
    let offset = [0, 1, 2].map(|axis| (low[axis] as i64 - margin) as f64);
    let world_from_voxel = whole.world_from_voxel * DAffine3::from_translation(offset.into());
    resample(&whole, &Grid { dims, world_from_voxel }, Interpolation::Nearest, 0)
}
