//! The files of a session: each appears whole or not at all.

use crate::error::SessionError;
use crate::report::page::{self, Shot};
use crate::report::summary::Summary;
use crate::run::Outcome;
use std::fmt::Write as _;
use std::fs;
use std::io::Write;
use std::path::Path;
use trepan_link::Recording;
use trepan_mesh::{isosurface, stl};
use trepan_volume::{BoneVolume, VoxelVolume, nifti};

/// Makes the output folder and its place for pictures, empty of older ones.
pub fn folder(out: &Path) -> Result<(), SessionError> {
    let frames = out.join("frames");
    fs::create_dir_all(&frames).map_err(|fault| SessionError::Output { path: out.into(), fault })?;
    let old = fs::read_dir(&frames).map_err(|fault| SessionError::Output { path: frames.clone(), fault })?;
    for entry in old.flatten().filter(|entry| entry.file_name().to_string_lossy().starts_with("frame-")) {
        fs::remove_file(entry.path()).map_err(|fault| SessionError::Output { path: entry.path(), fault })?;
    }
    Ok(())
}

/// Writes the drilled skull's densities, and with `surface` the triangles of the bone as it was carved.
pub fn drilled(out: &Path, densities: &VoxelVolume<i16>, bone: &BoneVolume, surface: bool) -> Result<(), SessionError> {
    let internal = |fault: &dyn std::fmt::Display| SessionError::Internal(fault.to_string());
    nifti::write(&out.join("drilled.nii.gz"), densities).map_err(|fault| internal(&fault))?;
    if surface {
        let triangles = isosurface(&bone.snapshot(), bone.isovalue());
        stl::write(&out.join("drilled.stl"), &triangles).map_err(|fault| internal(&fault))?;
    }
    Ok(())
}

/// Writes summary, scores and report.
pub fn write(
    out: &Path,
    recording: &Recording,
    summary: &Summary,
    outcome: &Outcome,
    shots: &[Shot],
) -> Result<(), SessionError> {
    let json =
        serde_json::to_vec_pretty(summary).map_err(|fault| SessionError::Internal(format!("summary: {fault}")))?;
    whole(&out.join("summary.json"), &json)?;
    whole(&out.join("scores.csv"), scores(summary).as_bytes())?;
    let page = page::html(summary, outcome, recording, shots).map_err(SessionError::Internal)?;
    whole(&out.join("report.html"), page.as_bytes())
}

/// The scores as lines of name and value; each name ends with its unit.
fn scores(summary: &Summary) -> String {
    let parts = [
        ("scores", serde_json::to_value(summary.scores)),
        ("plan", serde_json::to_value(summary.plan)),
        ("cut_off", serde_json::to_value(summary.cut_off)),
    ];
    let mut csv = String::from("name,value\n");
    for (part, value) in parts {
        for (name, value) in value.ok().as_ref().and_then(|value| value.as_object()).into_iter().flatten() {
            _ = writeln!(csv, "{part}.{name},{value}");
        }
    }
    for region in &summary.regions {
        let name = region.name.replace(' ', "_");
        _ = writeln!(csv, "regions.{name}.seconds,{}", region.seconds);
        _ = writeln!(csv, "regions.{name}.impulse_n_s,{}", region.impulse_n_s);
        _ = writeln!(csv, "regions.{name}.peak_n,{}", region.peak_n);
    }
    for raised in &summary.warnings {
        _ = writeln!(csv, "warnings.{}_s,{}", raised.name, raised.time_s);
    }
    csv
}

/// A file that appears whole or not at all.
pub fn whole(path: &Path, bytes: &[u8]) -> Result<(), SessionError> {
    let failed = |fault| SessionError::Output { path: path.into(), fault };
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    file.persist(path).map(drop).map_err(|fault| failed(fault.error))
}
