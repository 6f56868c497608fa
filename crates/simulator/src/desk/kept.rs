//! The sessions that were kept, as their summaries tell.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// A session in its folder.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Kept {
    /// Its folder.
    pub folder: PathBuf,
    /// Date, time and name, as in the name of the folder.
    pub title: String,
    /// The program.
    pub program: String,
    /// Name of the case.
    pub case: String,
    /// Name of the device.
    pub device: String,
    /// Who operated; empty if unknown.
    pub person: String,
    /// Its summary.
    pub summary: Value,
}

/// Largest number of sessions that are read.
const MOST: usize = 500;

impl Kept {
    /// Reads the session in a folder.
    pub fn of(folder: &Path) -> Option<Self> {
        let summary: Value = serde_json::from_slice(&fs::read(folder.join("summary.json")).ok()?).ok()?;
        let text = |key: &str| summary[key].as_str().unwrap_or_default().to_string();
        let title = folder.file_name()?.to_string_lossy().into_owned();
        let [program, case, device, person] = ["app", "case", "device", "person"].map(text);
        Some(Self { folder: folder.into(), title, program, case, device, person, summary })
    }

    /// Lists the sessions in the folders of programs below these folders, the newest first.
    pub fn list(roots: &[PathBuf]) -> Vec<Self> {
        let below = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let mut folders: Vec<PathBuf> = roots.iter().flat_map(|root| below(root)).flat_map(|program| below(&program)).collect();
        folders.sort_by_key(|folder| std::cmp::Reverse(folder.file_name().map(std::ffi::OsStr::to_os_string)));
        folders.iter().take(MOST).filter_map(|folder| Self::of(folder)).collect()
    }

    /// A number of the summary, by the keys on its path.
    pub fn number(&self, path: &[&str]) -> Option<f64> {
        path.iter().fold(&self.summary, |value, key| &value[*key]).as_f64()
    }
}
