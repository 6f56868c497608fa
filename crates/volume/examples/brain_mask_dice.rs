//! Compares brain masks with independent ones: prints a table of the heads present. `TREPAN_DATA`
//! names another folder than `../shared/data`.

use std::path::{Path, PathBuf};
use std::time::Instant;
use trepan_volume::{BrainConfig, Grid, Interpolation, VoxelVolume, find_brain, hounsfield, import, read, resample};

/// Name, MRI, independent mask or labels, CT; empty if missing.
const HEADS: [[&str; 4]; 7] = [
    ["case-head", "case-head/mri_t1.nii.gz", "case-head/brain_mask.nii.gz", ""],
    ["case-head, CT", "case-head/mri_t1.nii.gz", "case-head/brain_mask.nii.gz", "case-head/ct_hu.nii.gz"],
    ["mri-head-labelled", "mri-head-labelled/mri_t1.nii.gz", "mri-head-labelled/mri_t1_brain.nii.gz", ""],
    ["head-second", "head-second/mri/mri_t1_in_ct_grid.nii.gz", "head-second/mri/brainmask_in_ct_grid.nii.gz", ""],
    [
        "head-second, CT",
        "head-second/mri/mri_t1_in_ct_grid.nii.gz",
        "head-second/mri/brainmask_in_ct_grid.nii.gz",
        "head-second/ct/ct_head_hu.nii.gz",
    ],
    ["mri-tumour-labelled", "mri-tumour-labelled/brain1_image.nrrd", "", ""],
    ["dicom-mri-schwannoma", "dicom-mri-schwannoma", "", ""],
];
/// A misaligned pair; the MRI is registered to the CT.
const PAIR: [[&str; 4]; 2] = [
    ["ct-mri-pair-thick", "ct-mri-pair-thick/mri_t1.nii.gz", "", ""],
    ["ct-mri-pair-thick, CT", "ct-mri-pair-thick/mri_t1_registered_to_ct.nii.gz", "", "ct-mri-pair-thick/ct_hu.nii.gz"],
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let shared = std::env::var_os("TREPAN_DATA").map_or_else(|| here.join("../../../shared/data"), PathBuf::from);
    let only = std::env::args().nth(1).unwrap_or_default();
    println!("| head | ml | other's ml | Dice | s | confidence |\n|---|---|---|---|---|---|");
    for [name, mri, other, ct] in HEADS.iter().chain(&PAIR).filter(|head| head[0].contains(&only)) {
        let place = |path: &str| {
            let folder = if path.starts_with("case-head") { here.join("../../fixtures") } else { shared.clone() };
            folder.join(path)
        };
        if !place(mri).exists() {
            println!("| {name} | not there | | | | |");
            continue;
        }
        let mri = import(&place(mri))?.volume;
        let ct = (!ct.is_empty()).then(|| read(&place(ct))).transpose()?;
        let ct = ct.map(|ct| hounsfield(&ct)).transpose()?;
        let start = Instant::now();
        let found = find_brain(&mri, ct.as_ref(), &BrainConfig::default());
        let seconds = start.elapsed().as_secs_f64();
        let found = match found {
            Ok(found) => found,
            Err(fault) => {
                println!("| {name} | {fault} | | | {seconds:.1} | |");
                continue;
            }
        };
        let ml = |mask: &VoxelVolume<u8>| volume(mask, |v| v != 0);
        let (mut other_ml, mut dice) = (String::new(), String::new());
        if !other.is_empty() {
            let truth = read(&place(other))?.map(|v| u8::from(v != 0.0));
            let truth = resample(&truth, &Grid::of(&found.mask), Interpolation::Nearest, 0);
            let mut both = found.mask.clone();
            both.data.iter_mut().zip(&truth.data).for_each(|(a, b)| *a &= b);
            other_ml = format!("{:.0}", ml(&truth));
            dice = format!("{:.3}", 2.0 * ml(&both) / (ml(&found.mask) + ml(&truth)));
        }
        println!("| {name} | {:.0} | {other_ml} | {dice} | {seconds:.1} | {} |", ml(&found.mask), found.confidence);
    }
    Ok(())
}

fn volume(mask: &VoxelVolume<u8>, is: impl Fn(u8) -> bool) -> f64 {
    mask.data.iter().filter(|&&v| is(v)).count() as f64 * mask.voxel_mm3() * 1e-3
}
