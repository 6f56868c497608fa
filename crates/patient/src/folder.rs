//! Stores a case as a folder: volumes, mesh, numbers and the hash of each file, checked on opening.
//!
//! ```text
//! CASE/case.json   form, name, hash of the images, version, isovalue, planned opening, recipe,
//!                  remarks, file hashes
//!      skull.nii   densities in HU, cubic voxels, largest piece of bone only
//!      mri.nii     the MRI around the brain      mask.nii   1 in the brain
//!      fit.png     the bone's contour over the MRI
//!      brain.vtk   tetrahedra, with their classes
//! ```
//!
//! # Practice
//! All coordinates are patient RAS+ mm. No file contains a patient's name: images are rewritten
//! from their voxels, and the case is named by a hash.

use crate::PatientError;
use crate::Recipe;
use crate::cache::digest;
use crate::identity::Identity;
use crate::mixture::Shares;
use crate::opening::Opening;
use crate::progress::DraftSkull;
use crate::{Brain, Case};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;
use std::{fs, io};
use trepan_mesh::{lattice::LabelledMesh, vtk};
use trepan_volume::{Sample, VoxelVolume, nifti, read_regular};

/// Version of the folder's format.
const FORM: u32 = 7;
const SKULL: &str = "skull.nii";
const MRI: &str = "mri.nii";
const MASK: &str = "mask.nii";
const MESH: &str = "brain.vtk";
const FIT: &str = "fit.png";
const CARD: &str = "case.json";

/// Contents of `case.json`.
#[derive(Serialize, Deserialize)]
struct Card {
    form: u32,
    name: String,
    hash: String,
    #[serde(default)]
    images: BTreeMap<String, String>,
    /// Program version that built the case.
    version: String,
    isovalue_hu: i16,
    opening: Option<Opening>,
    recipe: Option<Recipe>,
    /// Shares of the tissue classes in each mixture of the mesh.
    #[serde(default)]
    mixtures: Vec<Shares>,
    notes: Vec<String>,
    /// Each file and its SHA-256.
    files: BTreeMap<String, String>,
}

/// Writes a case into an empty folder.
pub fn save(case: &Case, folder: &Path) -> Result<(), Box<dyn Error>> {
    let mut names = Vec::new();
    let write_skull = || match &case.skull {
        Some(skull) => nifti::write(&folder.join(SKULL), skull),
        None => Ok(()),
    };
    let write_brain = || match &case.brain {
        Some(brain) => write_brain(brain, folder),
        None => Ok(()),
    };
    let (skull, brain) = rayon::join(write_skull, write_brain);
    skull?;
    brain.map_err(|fault| -> Box<dyn Error> { fault })?;
    names.extend(case.skull.iter().map(|_| SKULL));
    names.extend(case.brain.iter().flat_map(|_| [MASK, MRI, MESH]));
    if let Some(png) = &case.fit_png {
        fs::write(folder.join(FIT), png)?;
        names.push(FIT);
    }
    let hashed = |name: &&str| Ok(((*name).to_string(), digest(&folder.join(name))?));
    let card = Card {
        form: FORM,
        name: case.name.clone(),
        hash: case.hash.clone(),
        images: case.images.clone(),
        version: env!("CARGO_PKG_VERSION").into(),
        isovalue_hu: case.isovalue_hu,
        opening: case.opening,
        recipe: case.recipe,
        mixtures: case.brain.as_ref().map(|brain| brain.mixtures.clone()).unwrap_or_default(),
        notes: case.notes.clone(),
        files: names.par_iter().map(hashed).collect::<io::Result<_>>()?,
    };
    Ok(fs::write(folder.join(CARD), serde_json::to_vec_pretty(&card)?)?)
}

/// Writes the brain's files.
fn write_brain(brain: &Brain, folder: &Path) -> Result<(), Box<dyn Error + Send + Sync>> {
    nifti::write(&folder.join(MASK), &brain.classes)?;
    nifti::write(&folder.join(MRI), &brain.mri)?;
    let label_of_tet = brain.class_of_tet.iter().map(|&class| class.into()).collect();
    let labelled = LabelledMesh { mesh: brain.mesh.clone(), label_of_tet, ..LabelledMesh::default() };
    Ok(vtk::write_labelled(&folder.join(MESH), &labelled)?)
}

/// Reads the patient's identity from a case folder, without the volumes.
pub fn identity(folder: &Path) -> Result<Identity, PatientError> {
    card(folder).map(|Card { name, hash, images, .. }| Identity { name, case: Some(hash), images })
}

/// Reads the skull of a case folder for a draft, and where it is opened; `None` without a skull. It
/// is not checked.
pub fn draft_skull(folder: &Path) -> Result<Option<(DraftSkull, Opening)>, PatientError> {
    let card = card(folder)?;
    let Some(opening) = card.opening.filter(|_| card.files.contains_key(SKULL)) else { return Ok(None) };
    Ok(Some((in_draft(&volume(folder, SKULL)?, card.isovalue_hu), opening)))
}

/// Thins a CT to voxels of about 1.5 mm.
pub fn in_draft(hu: &VoxelVolume<i16>, isovalue_hu: i16) -> DraftSkull {
    let every = hu.spacing_mm().to_array().map(|mm| (DRAFT_MM / mm).round().max(1.0) as usize);
    DraftSkull { hu: thinned(hu, every), isovalue_hu }
}

/// Edge of a draft's voxels, mm, numerical.
const DRAFT_MM: f64 = 1.5;

/// Takes every nth voxel along each edge.
fn thinned(volume: &VoxelVolume<i16>, every: [usize; 3]) -> VoxelVolume<i16> {
    let dims = [0, 1, 2].map(|n| volume.dims[n].div_ceil(every[n]));
    let scale = DAffine3::from_scale(DVec3::from_array(every.map(|n| n as f64)));
    let mut thin = VoxelVolume::filled(dims, volume.world_from_voxel * scale, 0i16);
    for at in 0..thin.data.len() {
        let voxel = [at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])];
        let voxel = [0, 1, 2].map(|n| voxel[n] * every[n]);
        thin.data[at] = volume.data[volume.index(voxel)];
    }
    thin
}

/// Reads `case.json`; refuses an unknown format version.
fn card(folder: &Path) -> Result<Card, PatientError> {
    let json = read_regular(&folder.join(CARD)).map_err(|fault| broken(folder, CARD, &fault))?;
    let card: Card = serde_json::from_slice(&json).map_err(|fault| broken(folder, CARD, &fault))?;
    if card.form != FORM {
        let fault = format!("form {} is not known, this program knows {FORM}", card.form);
        return Err(broken(folder, CARD, &fault));
    }
    Ok(card)
}

fn broken(folder: &Path, file: &str, fault: &dyn std::fmt::Display) -> PatientError {
    PatientError::Case(format!("{}: {fault}; build the case again with `case build`", folder.join(file).display()))
}

fn volume<T: Sample>(folder: &Path, name: &str) -> Result<VoxelVolume<T>, PatientError> {
    nifti::read_as(&folder.join(name)).map_err(|fault| broken(folder, name, &fault))
}

/// Opens a case folder; every file must exist and match its hash.
pub fn load(folder: &Path) -> Result<Case, PatientError> {
    let card = card(folder)?;
    let broken = |file: &str, fault: &dyn std::fmt::Display| broken(folder, file, fault);
    for (name, hash) in &card.files {
        let found = digest(&folder.join(name)).map_err(|fault| broken(name, &fault))?;
        if found != *hash {
            return Err(broken(name, &"the file is not what it was when the case was built"));
        }
    }
    let skull = card.files.contains_key(SKULL).then(|| volume(folder, SKULL)).transpose()?;
    let brain = match card.files.contains_key(MESH) {
        true => {
            let classes = volume(folder, MASK)?;
            let labelled = vtk::read_labelled(&folder.join(MESH)).map_err(|fault| broken(MESH, &fault))?;
            let class_of_tet = labelled.label_of_tet.iter().map(|&label| label as u8).collect();
            Some(Brain {
                classes,
                mri: volume(folder, MRI)?,
                mesh: labelled.mesh,
                class_of_tet,
                mixtures: card.mixtures.clone(),
            })
        }
        false => None,
    };
    let fit_png = card.files.contains_key(FIT).then(|| fs::read(folder.join(FIT))).transpose();
    let fit_png = fit_png.map_err(|fault| broken(FIT, &fault))?;
    let Card { name, hash, images, isovalue_hu, opening, recipe, notes, .. } = card;
    Ok(Case { name, hash, images, recipe, skull, isovalue_hu, brain, opening, fit_png, notes })
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    #[test]
    fn a_thinned_volume_keeps_its_place() {
        let mut volume = VoxelVolume::isotropic([5, 4, 4], Vec3::new(1.0, 2.0, 3.0), 0.5, 7i16);
        let at = volume.index([4, 2, 0]);
        volume.data[at] = 9;
        let thin = thinned(&volume, [2; 3]);
        assert_eq!((thin.dims, thin.get([2, 1, 0])), ([3, 2, 2], Some(9)));
        assert_eq!(thin.centre_of([2, 1, 0]), volume.centre_of([4, 2, 0]));
    }

    #[test]
    fn a_case_is_read_as_written_and_a_changed_file_is_an_error() {
        let home = tempfile::tempdir().expect("a temporary folder");
        let mut skull = VoxelVolume::isotropic([6, 5, 4], Vec3::new(1.0, -2.0, 3.5), 0.75, -1000i16);
        skull.data[17] = 1234;
        let recipe = Recipe { spacing_mm: 0.75, tets: 500, halvings: 1, ..Recipe::default() };
        let case = Case {
            name: "case-1".into(),
            hash: "ab".into(),
            skull: Some(skull.clone()),
            isovalue_hu: 350,
            opening: Some(Opening { entry_mm: [1.0, 2.0, 3.0], inward: [0.0, 0.0, -1.0], bone_mm: 6.5, brain_mm: 8.0 }),
            fit_png: Some(vec![1, 2, 3]),
            notes: vec!["a remark".into()],
            recipe: Some(recipe),
            ..Case::default()
        };
        save(&case, home.path()).expect("the case is written");
        let back = load(home.path()).expect("the case is read");
        assert_eq!((back.skull.as_ref(), back.isovalue_hu, back.notes.len()), (Some(&skull), 350, 1));
        assert_eq!((back.opening, back.fit_png, back.recipe), (case.opening, case.fit_png, case.recipe));
        let mut bytes = fs::read(home.path().join(SKULL)).expect("a skull");
        bytes[400] ^= 1;
        fs::write(home.path().join(SKULL), bytes).expect("written");
        let fault = load(home.path()).expect_err("a changed file").to_string();
        assert!(fault.contains("skull.nii") && fault.contains("case build"), "{fault}");
        fs::remove_file(home.path().join(CARD)).expect("removed");
        assert!(load(home.path()).expect_err("no card").to_string().contains("case.json"));
    }
}
