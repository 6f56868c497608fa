//! Segments skull and brain: `brain MRI [CT or -] [LABELS or -] [OUT.nii.gz]` prints sizes,
//! thresholds, volume and Dice.

use std::path::Path;
use std::time::Instant;
use trepan_volume::{BrainConfig, Grid, Interpolation, bone_isovalue, brain_mask, hounsfield, nifti, read, resample};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let Some(mri) = paths.first() else { return Err("usage: brain MRI [CT or -] [LABELS or -] [OUT.nii.gz]".into()) };
    let mri = read(Path::new(mri))?;
    println!("MRI {:?} voxels of {:.3} mm, {:?}", mri.dims, mri.spacing_mm(), mri.world_box());
    let ct = paths.get(1).filter(|p| *p != "-").map(|p| read(Path::new(p))).transpose()?;
    let ct = ct.map(|ct| hounsfield(&ct)).transpose()?;
    if let Some(ct) = &ct {
        println!("CT {:?} voxels of {:.3} mm, bone over {} HU", ct.dims, ct.spacing_mm(), bone_isovalue(ct));
    }
    let start = Instant::now();
    let mask = brain_mask(&mri, ct.as_ref(), &BrainConfig::default())?;
    let voxels = mask.data.iter().filter(|&&v| v != 0).count();
    println!("brain {:.0} ml in {:.2} s", voxels as f64 * mask.voxel_mm3() * 1e-3, start.elapsed().as_secs_f64());
    if let Some(labels) = paths.get(2).filter(|p| *p != "-") {
        let truth = resample(&read(Path::new(labels))?, &Grid::of(&mask), Interpolation::Nearest, 0.0);
        let both = mask.data.iter().zip(&truth.data).filter(|&(&m, &t)| m != 0 && t != 0.0).count();
        let known = truth.data.iter().filter(|&&t| t != 0.0).count();
        println!("Dice {:.3} against {known} labelled voxels", 2.0 * both as f64 / (voxels + known) as f64);
    }
    if let Some(out) = paths.get(3) {
        nifti::write(Path::new(out), &mask)?;
    }
    Ok(())
}
