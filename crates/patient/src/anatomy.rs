//! Builds a skull on cubic voxels, a brain mask and tetrahedra from a patient's images.

use crate::PatientError;
use crate::Recipe;
use crate::mixture;
use crate::remark::WELL;
use crate::{Brain, Inputs};
use glam::{DAffine3, DVec3};
use std::path::Path;
use trepan_mesh::lattice::{self, Fine};
use trepan_volume::{
    AIR_HU, BrainConfidence, BrainConfig, Grid, Import, Interpolation, Islands, MaskError, ReadError,
    RegistrationConfig, Segmentation, VoxelVolume, check_brain_mask, flatness, hounsfield, is_ct, largest_component,
    overlap, register, resample, room_for, room_for_voxels, skull_only,
};

/// Margin of the brain's grids around the brain, mm.
const MARGIN_MM: f32 = 12.0;
/// Memory of a skull in a session, bytes per voxel: densities, their copies, pieces, picture.
const SKULL_BYTES: u64 = 12;

/// Memory of mesher and solver, bytes per tetrahedron.
const TET_BYTES: u64 = 4096;

/// Reads an image, or one DICOM series of a folder.
fn image(path: &Path, series: Option<usize>) -> Result<Import, ReadError> {
    series.map_or_else(|| trepan_volume::import(path), |number| trepan_volume::import_number(path, number))
}

/// Reads a CT in HU, and adds remarks on it.
pub(crate) fn read_ct(
    path: &Path,
    series: Option<usize>,
    notes: &mut Vec<String>,
) -> Result<VoxelVolume<i16>, PatientError> {
    let import = image(path, series)?;
    of_modality(path, &import, "CT")?;
    of_a_patient(path, &import.volume)?;
    notes.extend(import.notes.iter().map(|note| format!("CT: {note}")));
    hounsfield(&import.volume).map_err(|fault| PatientError::Case(format!("{}: {fault}", path.display())))
}

/// Reads the original CT of a case again; `None` for a case folder, which does not hold it.
pub fn scanned(inputs: &Inputs, series: Option<usize>) -> Option<Result<VoxelVolume<i16>, PatientError>> {
    inputs.ct.as_deref().map(|path| read_ct(path, series, &mut Vec::new()))
}

/// Reads an MRI, and adds remarks on it; refuses voxels that are not finite, and CTs.
pub(crate) fn read_mri(
    path: &Path,
    series: Option<usize>,
    notes: &mut Vec<String>,
) -> Result<VoxelVolume<f32>, PatientError> {
    let import = image(path, series)?;
    of_modality(path, &import, "MR")?;
    of_a_patient(path, &import.volume)?;
    notes.extend(import.notes.iter().map(|note| format!("MRI: {note}")));
    let bad = import.volume.data.iter().filter(|v| !v.is_finite()).count();
    if bad > 0 {
        let fault = MaskError::NotANumber { count: bad };
        return Err(PatientError::Case(format!("{}: {fault}", path.display())));
    }
    if is_ct(&import.volume) {
        return Err(PatientError::Case(format!(
            "{}: the values are a CT's (air near -1000, bone over 200): {GIVE}",
            path.display()
        )));
    }
    no_labels(path, &import.volume)?;
    Ok(import.volume)
}

/// A numerical parameter: flatness of an image from which it is a label volume.
const FLAT: f64 = 0.6;

/// Volume of the labels of a brain, ml; what is smaller or larger and flat may be a phantom.
const LABELS_ML: std::ops::RangeInclusive<f64> = 300.0..=2000.0;

/// Refuses a mask or a label volume given as an MRI.
fn no_labels(path: &Path, image: &VoxelVolume<f32>) -> Result<(), PatientError> {
    let (flat, shown_ml) = flatness(image);
    if flat < FLAT {
        return Ok(());
    }
    let mut values: Vec<f32> = image.data.clone();
    values.sort_unstable_by(f32::total_cmp);
    values.dedup();
    let is_head = shown_ml > *LABELS_ML.end() && values.len() > 2;
    if is_head || shown_ml < *LABELS_ML.start() {
        return Ok(());
    }
    Err(PatientError::Case(format!(
        "{}: {:.0} % of its neighbouring voxels have one value, and it has {} values: it is a mask or a label volume, no MRI; give it with --labels or --tissue, and a T1 MRI with --mri",
        path.display(),
        100.0 * flat,
        values.len()
    )))
}

/// A numerical parameter: density of the commonest tissue in HU, with room for fat.
const TISSUE_HU: std::ops::RangeInclusive<i16> = -200..=250;

/// Doubts that a CT is in HU, by its commonest tissue.
///
/// It is an error if a brain is to be found in it and much of what is not air passes for bone.
pub(crate) fn scale_doubt(
    ct: &VoxelVolume<i16>,
    isovalue_hu: i16,
    with_mri: bool,
) -> Result<Option<String>, PatientError> {
    const AIR: i16 = -500;
    const BIN: usize = 50;
    let mut counts = [0usize; 2000 / BIN];
    let (mut dense, mut shown) = (0usize, 0usize);
    for &hu in ct.data.iter().filter(|&&hu| hu > AIR) {
        shown += 1;
        dense += usize::from(hu >= isovalue_hu);
        if let Some(count) = counts.get_mut(i32::from(hu).abs_diff(AIR.into()) as usize / BIN) {
            *count += 1;
        }
    }
    let commonest = counts.iter().enumerate().max_by_key(|(_, count)| **count).map_or(0, |(bin, _)| bin);
    let tissue_hu = AIR + (BIN * commonest + BIN / 2) as i16;
    let dense = dense as f64 / shown.max(1) as f64;
    if TISSUE_HU.contains(&tissue_hu) {
        return Ok(None);
    }
    let found = format!(
        "the CT's values are no HU: its commonest tissue lies at {tissue_hu} (in HU near 40), and {:.0} % of what is not air is over {isovalue_hu}, as in a cone-beam CT; give the threshold of bone with --isovalue-hu, such as {}",
        100.0 * dense,
        tissue_hu + 400
    );
    match with_mri && dense > 1.0 / 3.0 {
        true => Err(PatientError::Case(found)),
        false => Ok(Some(found)),
    }
}

/// Largest accepted extent of an image, mm.
const LONGEST_MM: f64 = 3000.0;

/// Refuses an image larger than a patient, whose voxel edges are in a wrong unit.
fn of_a_patient(path: &Path, image: &VoxelVolume<f32>) -> Result<(), PatientError> {
    let (low, high) = image.world_corners();
    let span = (high - low).max_element();
    if span <= LONGEST_MM {
        return Ok(());
    }
    Err(PatientError::Case(format!(
        "{}: the image spans {span:.0} mm, its voxel edges are {:.3} mm: no patient is longer than {LONGEST_MM} mm; correct the voxel edges or their unit",
        path.display(),
        image.spacing_mm()
    )))
}

/// Remedy for images that were mixed up.
const GIVE: &str = "give the CT with --ct and a T1 MRI with --mri";

/// Refuses a series of another DICOM modality.
fn of_modality(path: &Path, import: &Import, expected: &str) -> Result<(), PatientError> {
    match import.modality.as_deref() {
        Some(found) if found != expected && found != "OT" => {
            let fault = format!("{}: its DICOM modality is {found}, not {expected}: {GIVE}", path.display());
            Err(PatientError::Case(fault))
        }
        _ => Ok(()),
    }
}

/// Registers the MRI to the CT in place; returns the transform.
pub(crate) fn registered(
    ct: &VoxelVolume<i16>,
    mri: &mut VoxelVolume<f32>,
    notes: &mut Vec<String>,
) -> Result<DAffine3, PatientError> {
    let found = register(ct, mri, &RegistrationConfig::default());
    let found = found.map_err(|fault| PatientError::Case(fault.to_string()))?;
    let (_, turn, _) = found.fixed_from_moving.to_scale_rotation_translation();
    let middle = mri.centre_of(mri.dims.map(|n| n / 2));
    let moved_mm = found.fixed_from_moving.transform_point3(middle).distance(middle);
    mri.world_from_voxel = found.fixed_from_moving * mri.world_from_voxel;
    notes.push(format!(
        "the MRI was moved by {moved_mm:.1} mm and turned by {:.1} degrees to fit the CT: mutual information {:.3} to {:.3}, confidence {:.2}; check it in the slices, a confident result can still be wrong",
        turn.to_axis_angle().1.to_degrees(),
        found.start_metric,
        found.metric,
        found.confidence
    ));
    Ok(found.fixed_from_moving)
}

/// Remark on a segmented brain.
fn brain_note(confidence: &BrainConfidence) -> String {
    match confidence.is_doubtful() {
        true => format!(
            "brain found in the MRI: {confidence}; DOUBTFUL: check its border in the slices, or give a label volume \
             with --labels PATH"
        ),
        false => {
            format!("brain found in the MRI: {:.0} ml, confidence {:.2}{WELL}", confidence.found_ml, confidence.value)
        }
    }
}

/// Reads a label volume as a mask of its nonzero voxels.
pub(crate) fn read_labels(path: &Path) -> Result<VoxelVolume<u8>, PatientError> {
    Ok(Segmentation::read(path)?.mask(|_, code| code != 0))
}

/// Brain mask: the labels given, with their file, else a segmentation of the MRI.
pub(crate) fn find_brain(
    given: Option<(&Path, VoxelVolume<u8>)>,
    mri: &VoxelVolume<f32>,
    ct_from_mri: DAffine3,
    ct: Option<&VoxelVolume<i16>>,
    isovalue_hu: i16,
    notes: &mut Vec<String>,
) -> Result<VoxelVolume<u8>, PatientError> {
    let config = BrainConfig { isovalue: Some(isovalue_hu), ..BrainConfig::default() };
    let Some((path, mut whole)) = given else {
        let found = trepan_volume::find_brain(mri, ct, &config);
        let found = found.map_err(|fault| PatientError::Case(format!("{fault} (--labels PATH)")))?;
        notes.push(brain_note(&found.confidence));
        if found.is_stripped {
            notes.push("the MRI shows the brain alone (skull-stripped): what it shows is the brain".into());
        }
        return Ok(found.mask);
    };
    let case = |fault: String| PatientError::Case(format!("{}: {fault}", path.display()));
    whole.world_from_voxel = ct_from_mri * whole.world_from_voxel;
    let mask = largest_component(&whole);
    match check_brain_mask(&mask, &config) {
        Err(fault @ MaskError::Volume { .. }) => notes.push(format!("labels: {fault}")),
        Err(fault) => return Err(case(fault.to_string())),
        Ok(()) => {}
    }
    overlap(&mask.map(i16::from), mri).map_err(|fault| case(format!("labels (as CT) and MRI lie apart: {fault}")))?;
    Ok(mask)
}

/// Resamples a CT around its bone to cubic voxels, by a spline whose isosurface has no creases, and
/// keeps the largest piece of bone. Also returns what was loose.
pub(crate) fn make_skull(
    ct: &VoxelVolume<i16>,
    recipe: &Recipe,
    isovalue_hu: i16,
) -> Result<(VoxelVolume<i16>, Islands), PatientError> {
    let is_bone = |hu: &i16| *hu >= isovalue_hu;
    let grid = around_bone(ct, recipe.spacing_mm, ct.box_where(is_bone));
    room_for_voxels(grid.voxels() as u64, SKULL_BYTES).map_err(|fault| {
        let text =
            format!("the skull at --spacing-mm {}: {fault}; give a larger spacing or crop the CT", recipe.spacing_mm);
        PatientError::Usage(text)
    })?;
    let mut skull = resample(ct, &grid, Interpolation::Cubic, AIR_HU);
    let islands = skull_only(&mut skull, isovalue_hu);
    // Beside a step the spline reaches above the CT: what is bone, the CT itself says.
    let bone = skull.box_where(is_bone).filter(|_| ct.data.iter().any(is_bone));
    let Some(bone) = bone else {
        return Err(PatientError::Case(format!(
            "no voxel of the CT reaches {isovalue_hu} HU: there is no bone; give --isovalue-hu"
        )));
    };
    let [low, dims] = with_room(bone, skull.dims);
    skull.crop(low, dims);
    Ok((skull, islands))
}

/// Voxels that stay around bone; the grid is cut at multiples of this.
const ROOM: usize = 8;

/// Lowest voxel and size of a box with room around it, within a grid of these dimensions.
fn with_room([low, high]: [[usize; 3]; 2], dims: [usize; 3]) -> [[usize; 3]; 2] {
    let first = low.map(|low| low.saturating_sub(ROOM) / ROOM * ROOM);
    [first, [0, 1, 2].map(|axis| ((high[axis] + 1).div_ceil(ROOM) * ROOM + ROOM).min(dims[axis]) - first[axis])]
}

/// The part around bone, in a box of the CT's voxels, of the cubes that cover the CT.
fn around_bone(ct: &VoxelVolume<i16>, spacing_mm: f32, bone: Option<[[usize; 3]; 2]>) -> Grid {
    let whole = Grid::isotropic_over(ct, spacing_mm);
    let Some(bone) = bone else { return whole };
    let inverse = whole.world_from_voxel.inverse();
    // Between voxels a spline's bone reaches no further than the next one.
    let [low, high] = [bone[0].map(|low| low as f64 - 1.0), bone[1].map(|high| high as f64 + 1.0)];
    let corners = (0..8usize).map(|bits| {
        let at = |axis: usize| if bits >> axis & 1 == 0 { low[axis] } else { high[axis] };
        inverse.transform_point3(ct.world_from_voxel.transform_point3([at(0), at(1), at(2)].into()))
    });
    let (low, high) = corners.fold((DVec3::MAX, DVec3::MIN), |(low, high), at| (low.min(at), high.max(at)));
    let voxels = |place: DVec3| [0, 1, 2].map(|axis| (place[axis].max(0.0) as usize).min(whole.dims[axis] - 1));
    let [first, dims] = with_room([voxels(low), voxels(high.ceil())], whole.dims);
    let world_from_voxel = whole.world_from_voxel * DAffine3::from_translation(first.map(|n| n as f64).into());
    Grid { dims, world_from_voxel }
}

/// Builds the tissue classes on a grid around the brain.
pub(crate) fn make_classes(
    (inputs, tissues): (&Inputs, Vec<VoxelVolume<u8>>),
    mask: &VoxelVolume<u8>,
    ct_from_mri: DAffine3,
    notes: &mut Vec<String>,
) -> Result<VoxelVolume<u8>, PatientError> {
    let mut classes = cropped(mask)?;
    for (source, here) in inputs.tissues.iter().zip(tissues) {
        notes.push(source.paint(here, ct_from_mri, &mut classes)?);
    }
    Ok(classes)
}

/// Builds the brain: the MRI on the grid of the classes, and tetrahedra, refined at the opening.
pub(crate) fn make_brain(
    whole: VoxelVolume<f32>,
    classes: VoxelVolume<u8>,
    fine: Option<Fine>,
    recipe: &Recipe,
) -> Result<Brain, PatientError> {
    room_for("tetrahedra", recipe.tets as u64, TET_BYTES)
        .map_err(|fault| PatientError::Usage(format!("--tets {}: {fault}; give fewer", recipe.tets)))?;
    let mri = resample(&whole, &Grid::of(&classes), Interpolation::Trilinear, 0.0);
    // The mesher takes the most memory of an import.
    drop(whole);
    let config = lattice::Config::with_opening(recipe.tets, fine);
    let labelled = lattice::labelled(&classes.map(u16::from), &config)
        .map_err(|fault| PatientError::Case(format!("meshing the brain: {fault}")))?;
    labelled.mesh.check().map_err(|fault| PatientError::Internal(format!("the mesher made a bad mesh: {fault}")))?;
    let (class_of_tet, mixtures) = mixture::codes(&labelled);
    Ok(Brain { classes, mri, mesh: labelled.mesh, class_of_tet, mixtures })
}

/// Resamples the mask to cubic voxels of 0.8 to 1.5 mm and crops it to its content with a margin.
pub(crate) fn cropped(mask: &VoxelVolume<u8>) -> Result<VoxelVolume<u8>, PatientError> {
    let spacing = mask.spacing_mm().min_element().clamp(0.8, 1.5) as f32;
    let grid = Grid::isotropic_over(mask, spacing);
    room_for_voxels(grid.voxels() as u64, 16).map_err(|fault| {
        PatientError::Case(format!("the brain mask on {spacing} mm cubes: {fault}; crop the MRI or the labels"))
    })?;
    let whole = resample(mask, &grid, Interpolation::Nearest, 0);
    let [low, high] = whole.box_where(|v| *v != 0).unwrap_or_default();
    let margin = (MARGIN_MM / spacing).ceil() as i64;
    let dims = [0, 1, 2].map(|axis| (high[axis] - low[axis] + 1) + 2 * margin as usize);
    let offset = [0, 1, 2].map(|axis| (low[axis] as i64 - margin) as f64);
    let world_from_voxel = whole.world_from_voxel * DAffine3::from_translation(offset.into());
    Ok(resample(&whole, &Grid { dims, world_from_voxel }, Interpolation::Nearest, 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_doubtful_brain_is_reported_with_the_remedy() {
        let sure = BrainConfidence {
            value: 0.9,
            found_ml: 1400.0,
            slice_mm: 1.0,
            volume: 1.0,
            border: 0.9,
            shape: 1.0,
            slices: 1.0,
            inside: None,
        };
        let note = brain_note(&sure);
        assert!(note.contains("1400 ml, confidence 0.90") && note.ends_with(WELL), "{note}");
        let leaking = BrainConfidence { value: 0.3, border: 0.3, ..sure };
        let note = brain_note(&leaking);
        assert!(note.contains("DOUBTFUL") && note.contains("--labels PATH") && !note.ends_with(WELL), "{note}");
    }
}
