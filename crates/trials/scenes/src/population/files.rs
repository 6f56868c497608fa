//! Writes a head as image files, as a user provides them.

use super::head::Head;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use trepan_volume::nifti;

/// Paths of a written head.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Files {
    /// CT image, HU.
    pub ct: PathBuf,
    /// MRI image.
    pub mri: PathBuf,
    /// True brain mask on the MRI's grid.
    pub brain: PathBuf,
    /// True FreeSurfer labels on the MRI's grid.
    pub labels: PathBuf,
    /// Tumour mask on the MRI's grid, if there is a tumour.
    pub tumour: Option<PathBuf>,
}

impl Head {
    /// Writes the images as uncompressed NIfTI into a folder, created if missing.
    pub fn write(&self, folder: &Path) -> Result<Files> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let files = Files {
            ct: folder.join("ct.nii"),
            mri: folder.join("mri.nii"),
            brain: folder.join("brain.nii"),
            labels: folder.join("labels.nii"),
            tumour: self.tumour.as_ref().map(|_| folder.join("tumour.nii")),
        };
        nifti::write(&files.ct, &self.ct)?;
        nifti::write(&files.mri, &self.mri)?;
        nifti::write(&files.brain, &self.brain)?;
        nifti::write(&files.labels, &self.labels)?;
        if let (Some(path), Some(labels)) = (&files.tumour, &self.tumour) {
            nifti::write(path, labels)?;
        }
        Ok(files)
    }
}
