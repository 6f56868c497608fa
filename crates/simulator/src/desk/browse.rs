//! The page on which files and folders are chosen.
//!
//! # Practice
//! It lists one folder at a time: subfolders, and files of the wanted kinds. Portals of the desktop
//! are not used, because they are missing on many systems and under test.

use std::fs;
use std::path::{Path, PathBuf};

/// What a file or folder is chosen for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Goal {
    /// CT of the patient.
    Ct,
    /// MRI of the patient.
    Mri,
    /// Label volume of the brain.
    Labels,
    /// Label volume of a tumour.
    Tumour,
    /// A folder that `case build` made.
    Case,
    /// A recording.
    Recording,
}

impl Goal {
    /// The title of the page.
    pub fn title(self) -> &'static str {
        match self {
            Self::Ct => "Open a CT",
            Self::Mri => "Open an MRI",
            Self::Labels => "Open labels of the brain",
            Self::Tumour => "Open labels of a tumour",
            Self::Case => "Open a case folder",
            Self::Recording => "Open a recording",
        }
    }

    /// What can be chosen, in a line.
    pub fn line(self) -> &'static str {
        match self {
            Self::Ct | Self::Mri => "Choose the folder of a DICOM series, or a file: NIfTI, NRRD, MetaImage, DICOM",
            Self::Labels => "Choose a label volume: every voxel that is not zero is brain",
            Self::Tumour => "Choose a label volume: every voxel that is not zero is tumour",
            Self::Case => "Choose a folder that holds a case.json",
            Self::Recording => "Choose a recording: a file that ends in .mcap",
        }
    }

    /// What a folder without such files means.
    pub fn none(self) -> &'static str {
        match self {
            Self::Ct | Self::Mri | Self::Labels | Self::Tumour => "no images here: open a folder on the left",
            Self::Case => "a case is a folder: open it on the left",
            Self::Recording => "no recordings here: open a folder on the left",
        }
    }

    /// Whether the folder itself may be chosen.
    pub fn takes(self, folder: &Path, files: usize) -> bool {
        match self {
            Self::Ct | Self::Mri => files > 0,
            Self::Labels | Self::Tumour => false,
            Self::Case => folder.join("case.json").is_file(),
            Self::Recording => false,
        }
    }

    /// Whether a file of this name may be chosen.
    fn fits(self, name: &str) -> bool {
        let name = name.to_lowercase();
        let ends = |all: &[&str]| all.iter().any(|end| name.ends_with(end));
        match self {
            // Slices of a DICOM series often have no extension.
            Self::Ct | Self::Mri | Self::Labels | Self::Tumour => {
                ends(&[".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd", ".dcm", ".ima", ".mgz", ".mgh"])
                    || !name.contains('.')
            }
            Self::Case => false,
            Self::Recording => ends(&[".mcap"]),
        }
    }
}

/// The purpose that a file or folder names itself; `None` where the user must say it.
pub(crate) fn purpose(path: &Path) -> Option<Goal> {
    if path.extension().is_some_and(|end| end == "mcap") {
        return Some(Goal::Recording);
    }
    if path.join("case.json").is_file() {
        return Some(Goal::Case);
    }
    let first = || fs::read_dir(path).ok()?.flatten().map(|entry| entry.path()).filter(|path| path.is_file()).min();
    let slice = if path.is_dir() { first()? } else { path.into() };
    match trepan_volume::dicom::series(&slice).ok()?.first()?.modality.as_str() {
        "CT" => Some(Goal::Ct),
        "MR" => Some(Goal::Mri),
        _ => None,
    }
}

/// Dropped files as they are opened: slices of one folder stand for that folder.
pub(crate) fn together(mut paths: Vec<PathBuf>) -> Vec<PathBuf> {
    let is_slice = |path: &PathBuf| path.is_file() && trepan_volume::dicom::series(path).is_ok();
    if paths.len() > 1 {
        paths.iter_mut().filter(|path| is_slice(path)).for_each(|path| _ = path.pop());
        paths.dedup();
    }
    paths
}

/// Largest number of entries that are listed.
const MOST: usize = 400;

/// A folder that is looked into.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Folder {
    /// Its path.
    pub path: PathBuf,
    /// Names of its subfolders.
    pub folders: Vec<String>,
    /// Names of its files of the wanted kinds.
    pub files: Vec<String>,
    /// Why it cannot be read, or what is left out.
    pub fault: Option<String>,
}

impl Folder {
    /// Lists a folder.
    pub fn list(path: &Path, goal: Goal) -> Self {
        let mut listed = Self { path: path.into(), ..Self::default() };
        let entries = match fs::read_dir(path) {
            Ok(entries) => entries,
            Err(fault) => {
                listed.fault = Some(format!("this folder cannot be read: {fault}"));
                return listed;
            }
        };
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            match entry.path().is_dir() {
                _ if name.starts_with('.') => {}
                true => listed.folders.push(name),
                false if goal.fits(&name) => listed.files.push(name),
                false => {}
            }
        }
        for names in [&mut listed.folders, &mut listed.files] {
            names.sort_by_key(|name| name.to_lowercase());
            if names.len() > MOST {
                listed.fault = Some(format!("only the first {MOST} are listed: write the path above"));
                names.truncate(MOST);
            }
        }
        listed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_lists_what_can_be_chosen() {
        let home = tempfile::tempdir().unwrap();
        for folder in ["b", "A", ".hidden"] {
            fs::create_dir(home.path().join(folder)).unwrap();
        }
        for file in ["IM0001", "head.NII.gz", "notes.txt", "session.mcap"] {
            fs::write(home.path().join(file), "x").unwrap();
        }
        let list = |goal| Folder::list(home.path(), goal);
        assert_eq!((list(Goal::Ct).folders, list(Goal::Ct).files.len()), (vec!["A".into(), "b".into()], 2));
        assert_eq!(list(Goal::Recording).files, ["session.mcap"]);
        assert!(Goal::Ct.takes(home.path(), 2) && !Goal::Case.takes(home.path(), 0));
        fs::write(home.path().join("case.json"), "{}").unwrap();
        assert!(Goal::Case.takes(home.path(), 0));
        assert!(Folder::list(&home.path().join("missing"), Goal::Ct).fault.is_some());
    }
}
