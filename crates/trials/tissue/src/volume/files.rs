//! Real image files against what is written beside them: size, spacing, orientation and value
//! range.

use super::data_folder;
use glam::{DAffine3, DMat3, DVec3};
use serde_json::Value;
use std::path::Path;
use std::time::Instant;
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_volume::{VoxelVolume, read};

/// A file or folder, voxels, edges in mm, axes, lowest and highest value.
type Known = (&'static str, [usize; 3], [f64; 3], &'static str, [f32; 2]);

/// As the data sets' own READMEs say.
const KNOWN: [Known; 17] = [
    ("case-head/ct_hu.nii.gz", [187, 243, 113], [1.0, 1.0, 2.0], "RAS", [-1024.0, 2248.0]),
    ("case-head/mri_t1.nii.gz", [187, 243, 226], [1.0; 3], "RAS", [0.0, 255.0]),
    ("case-head/brain_mask.nii.gz", [187, 243, 226], [1.0; 3], "RAS", [0.0, 1.0]),
    ("case-head/tissue_labels.nii.gz", [187, 243, 226], [1.0; 3], "RAS", [0.0, 255.0]),
    ("ct-mri-pair-thick/ct_hu.nii.gz", [256, 256, 26], [1.25, 1.25, 4.0], "LPS", [-1024.0, 1945.0]),
    ("ct-mri-pair-thick/mri_t1.nii.gz", [256, 256, 26], [1.25, 1.25, 4.0], "LPS", [2.0, 1626.0]),
    ("ct-mri-pair-thick/mri_t1_registered_to_ct.nii.gz", [256, 256, 26], [1.25, 1.25, 4.0], "LPS", [0.0, 1438.0]),
    ("mri-head-labelled/mri_t1.nii.gz", [256; 3], [1.0; 3], "LIA", [0.0, 255.0]),
    ("mri-head-labelled/mri_t1_brain.nii.gz", [256; 3], [1.0; 3], "LIA", [0.0, 233.0]),
    ("mri-head-labelled/tissue_labels_aseg.nii.gz", [256; 3], [1.0; 3], "LIA", [0.0, 255.0]),
    ("mri-tumour-labelled/brain1_image.nrrd", [256, 256, 25], [0.7812, 0.7812, 6.5], "LAS", [0.0, 3057.0]),
    ("mri-tumour-labelled/brain1_label.nrrd", [256, 256, 25], [0.7812, 0.7812, 6.5], "LAS", [0.0, 1.0]),
    ("dicom-mri-schwannoma", [512, 512, 120], [0.410_156_25, 0.410_156_25, 1.5], "LPS", [0.0, 1826.0]),
    (
        "dicom-ct-skull-phantom/series202_1mm_jpegls",
        [512, 512, 140],
        [0.451_171_875, 0.451_171_875, 1.0],
        "LPS",
        [-1024.0, 1033.0],
    ),
    (
        "dicom-ct-skull-phantom/series201_5mm_explicit_le",
        [512, 512, 28],
        [0.451_171_875, 0.451_171_875, 5.0],
        "LPS",
        [-1024.0, 782.0],
    ),
    (
        // The slices' 2.3708 mm along their normal, leaning by 18.5 degrees.
        "dicom-ct-skull-phantom/series201_stereotaxis_tilt-18.5_jpegll",
        [512, 512, 54],
        [0.482_421_875, 0.482_421_875, 2.5],
        "LPS",
        [-1024.0, 793.0],
    ),
    ("nifti-odd/generated/int16_be_gz_nifti2.nii.gz", [48, 40, 32], [1.0, 1.0, 2.0], "LAS", [-875.0, 615.0]),
];

/// Files that hold the reference voxels of `nrrd-metaimage`, whole or in part.
const SAME_VOXELS: [&str; 11] = [
    "ct_crop.mha",
    "ct_crop.mhd",
    "ct_crop.nhdr",
    "ct_crop.nrrd",
    "ct_crop_ascii.nrrd",
    "ct_crop_be.mhd",
    "ct_crop_be_raw.nrrd",
    "ct_crop_compressed.mhd",
    "ct_crop_gzip.nrrd",
    "ct_crop_ras_permuted.nrrd",
    "ct_crop_raw.nrrd",
];

/// Every real file, where there are some.
pub fn files(scope: Scope, findings: &mut Findings) {
    let Some(data) = data_folder() else { return };
    let known = KNOWN.iter().filter(|known| !scope.quick || !known.0.starts_with("dicom-mri"));
    let wrong: usize = known.map(|known| usize::from(!is_as_written(&data, known, findings))).sum();
    findings.gates.push(Gate::at_most("real files that differ from what is written beside them", wrong as f64, 0.0));
    let (tried, wrong) = odd_nifti(&data.join("nifti-odd/generated"));
    findings.rows.push(Row::new("odd NIfTI files", "read").metric("files", tried as f64).metric("wrong", wrong as f64));
    findings.gates.push(Gate::at_most("odd NIfTI files read wrongly", wrong as f64, 0.0));
    let (tried, wrong) = same_voxels(&data.join("nrrd-metaimage/generated"));
    findings.rows.push(
        Row::new("NRRD and MetaImage variants", "read").metric("files", tried as f64).metric("wrong", wrong as f64),
    );
    findings.gates.push(Gate::at_most("NRRD and MetaImage variants read wrongly", wrong as f64, 0.0));
}

fn is_as_written(data: &Path, &(name, dims, edges, axes, range): &Known, findings: &mut Findings) -> bool {
    let start = Instant::now();
    let read = read(&data.join(name));
    let seconds = start.elapsed().as_secs_f64();
    let Ok(volume) = read.inspect_err(|error| eprintln!("volume: {error}")) else { return false };
    let (low, high) = volume.data.iter().fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
    let edge_mm = (volume.spacing_mm() - DVec3::from_array(edges)).abs().max_element();
    let right = volume.dims == dims && edge_mm < 1e-3 && axes_of(volume.world_from_voxel.matrix3) == axes;
    let right = right && [low, high] == range;
    if !right {
        eprintln!("volume: {name}: {:?} {} {low}..{high}", volume.dims, volume.world_from_voxel);
    }
    findings.rows.push(
        Row::new(name, "read")
            .with("voxels", volume.data.len())
            .with("axes", axes)
            .metric("cost_s", seconds)
            .metric("lowest", low.into())
            .metric("highest", high.into())
            .metric("wrong", f64::from(u8::from(!right))),
    );
    right
}

/// Where i, j and k mainly lead: right or left, front (anterior) or back, head (superior) or foot.
fn axes_of(m: DMat3) -> String {
    let letter = |axis: DVec3| {
        let most = axis.abs().max_position();
        ["RL", "AP", "SI"][most].as_bytes()[usize::from(axis[most] < 0.0)] as char
    };
    [m.x_axis, m.y_axis, m.z_axis].map(letter).iter().collect()
}

fn json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or(Value::Null)
}

fn affine_of(rows: &Value) -> Option<DAffine3> {
    let at = |row: usize, column: usize| rows.get(row)?.get(column)?.as_f64();
    let column = |c: usize| Some(DVec3::new(at(0, c)?, at(1, c)?, at(2, c)?));
    Some(DAffine3 { matrix3: DMat3::from_cols(column(0)?, column(1)?, column(2)?), translation: column(3)? })
}

/// Expected values by voxel, `"[1, 2, 3]"` or `"(1, 2, 3)"`.
fn values_of(entry: &Value) -> Vec<(DVec3, f64)> {
    let voxel = |text: &str| {
        let numbers: Vec<f64> =
            text.trim_matches(['[', ']', '(', ')']).split(',').filter_map(|n| n.trim().parse().ok()).collect();
        <[f64; 3]>::try_from(numbers).ok().map(DVec3::from_array)
    };
    let values = entry["values"].as_object().into_iter().flatten();
    values.filter_map(|(key, value)| Some((voxel(key)?, value.as_f64()?))).collect()
}

/// Whether the values stand in the volume where the affine puts their voxels; those that lie
/// outside it do not count.
fn holds(volume: &VoxelVolume<f32>, affine: DAffine3, values: &[(DVec3, f64)]) -> bool {
    let voxel_from_expected = volume.world_from_voxel.inverse() * affine;
    let mut seen = 0;
    let right = values.iter().all(|&(voxel, value)| {
        let at = voxel_from_expected.transform_point3(voxel);
        let near = at.round();
        if near.min_element() < 0.0 {
            return true;
        }
        let found = volume.get([near.x as usize, near.y as usize, near.z as usize]);
        seen += usize::from(found.is_some());
        found.is_none_or(|found| {
            at.distance(near) < 1e-2 && (f64::from(found) - value).abs() < 1e-3 * (1.0 + value.abs())
        })
    });
    right && seen > 0
}

/// How many files with expected values there are, and how many of them are read otherwise.
fn odd_nifti(folder: &Path) -> (usize, usize) {
    let expected = json(&folder.join("expected.json"));
    let (mut tried, mut wrong) = (0, 0);
    for (name, entry) in expected.as_object().into_iter().flatten() {
        let whole = entry["shape"].as_array().is_some_and(|shape| shape.len() == 3);
        let (Some(affine), values, true) = (affine_of(&entry["affine"]), values_of(entry), whole) else { continue };
        if values.is_empty() {
            continue;
        }
        tried += 1;
        // A file without sform and qform has no place in the world, and expected.json gives another
        // program's guess: voxels only.
        let placed = ["sform_code", "qform_code"].iter().any(|code| entry[code].as_i64() != Some(0));
        let place = |volume: &VoxelVolume<f32>| if placed { affine } else { volume.world_from_voxel };
        if !read(&folder.join(name)).is_ok_and(|volume| holds(&volume, place(&volume), &values)) {
            eprintln!("volume: {name} is not as expected.json says");
            wrong += 1;
        }
    }
    (tried, wrong)
}

fn same_voxels(folder: &Path) -> (usize, usize) {
    let expected = json(&folder.join("expected.json"));
    let (affine, values) = (affine_of(&expected["ras_affine"]).unwrap_or_default(), values_of(&expected));
    let is_wrong = |name: &&&str| {
        let right = read(&folder.join(name)).is_ok_and(|volume| holds(&volume, affine, &values));
        if !right {
            eprintln!("volume: {name} is not as expected.json says");
        }
        !right
    };
    (SAME_VOXELS.len(), SAME_VOXELS.iter().filter(is_wrong).count())
}
