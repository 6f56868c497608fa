//! A head as files, as a user gives them.

use super::head::Head;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use trepan_volume::nifti;

/// Where a head was written to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Files {
    /// CT, HU.
    pub ct: PathBuf,
    /// MRI.
    pub mri: PathBuf,
    /// The true brain on the MRI's grid.
    pub brain: PathBuf,
    /// The tumour on the MRI's grid, if there is one.
    pub tumour: Option<PathBuf>,
}

impl Head {
    /// Writes the images as uncompressed NIfTI into a folder, which is made where it is missing.
    pub fn write(&self, folder: &Path) -> Result<Files> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let files = Files {
            ct: folder.join("ct.nii"),
            mri: folder.join("mri.nii"),
            brain: folder.join("brain.nii"),
            tumour: self.tumour.as_ref().map(|_| folder.join("tumour.nii")),
        };
        nifti::write(&files.ct, &self.ct)?;
        nifti::write(&files.mri, &self.mri)?;
        nifti::write(&files.brain, &self.brain)?;
        if let (Some(path), Some(labels)) = (&files.tumour, &self.tumour) {
            nifti::write(path, labels)?;
        }
        Ok(files)
    }
}
