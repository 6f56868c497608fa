//! Files that appear whole or not at all, recordings of a folder, and names safe on a terminal.

use anyhow::{Context, Result, bail};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes a file atomically; its folder is made if it is missing.
pub fn whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = || format!("cannot write {}; choose a folder that you may write to", shown(path));
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(folder).with_context(failed)?;
    let mut file = tempfile::NamedTempFile::new_in(folder).with_context(failed)?;
    file.write_all(bytes).with_context(failed)?;
    file.persist(path).map(drop).with_context(failed)
}

/// A path for messages, without characters that could control a terminal.
pub fn shown(path: &Path) -> String {
    path.display().to_string().chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}

/// The recordings (`*.mcap`) in a folder and below, sorted; `runs` may also be one recording.
/// Links to folders are not followed. An error where there is none.
pub fn recordings(runs: &Path) -> Result<Vec<PathBuf>> {
    let is_recording = |path: &Path| path.extension().is_some_and(|extension| extension == "mcap");
    let kind = fs::metadata(runs).with_context(|| format!("cannot read {}; check the name", shown(runs)))?;
    if kind.is_file() && is_recording(runs) {
        return Ok(vec![runs.to_owned()]);
    }
    let (mut found, mut folders) = (Vec::new(), vec![runs.to_owned()]);
    while let Some(folder) = folders.pop() {
        let failed = || format!("cannot list {}; give a folder of sessions", shown(&folder));
        for entry in fs::read_dir(&folder).with_context(failed)? {
            let entry = entry.with_context(failed)?;
            let kind = entry.file_type().with_context(failed)?;
            if kind.is_dir() {
                folders.push(entry.path());
            } else if is_recording(&entry.path()) {
                found.push(entry.path());
            }
        }
    }
    if found.is_empty() {
        bail!("{} holds no recording (*.mcap); give the folder that holds the sessions' folders", shown(runs));
    }
    found.sort();
    Ok(found)
}
