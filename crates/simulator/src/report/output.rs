//! The files of a session: each appears whole or not at all.

use crate::error::SessionError;
use crate::report::page::{self, Shot};
use crate::report::summary::Summary;
use crate::run::Outcome;
use std::fs;
use std::io::Write;
use std::path::Path;
use trepan_link::Recording;
use trepan_volume::{VoxelVolume, nifti};

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

/// Writes summary, report and drilled volume.
pub fn write(
    out: &Path,
    record: &Path,
    summary: &Summary,
    outcome: &Outcome,
    shots: &[Shot],
    drilled: Option<VoxelVolume<i16>>,
) -> Result<(), SessionError> {
    let json =
        serde_json::to_vec_pretty(summary).map_err(|fault| SessionError::Internal(format!("summary: {fault}")))?;
    whole(&out.join("summary.json"), &json)?;
    if let Some(volume) = drilled {
        let path = out.join("drilled.nii.gz");
        nifti::write(&path, &volume).map_err(|fault| SessionError::Internal(fault.to_string()))?;
    }
    let recording = Recording::open(record)?;
    let page = page::html(summary, outcome, &recording, shots).map_err(SessionError::Internal)?;
    whole(&out.join("report.html"), page.as_bytes())
}

fn whole(path: &Path, bytes: &[u8]) -> Result<(), SessionError> {
    let failed = |fault| SessionError::Output { path: path.into(), fault };
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    file.persist(path).map(drop).map_err(|fault| failed(fault.error))
}
