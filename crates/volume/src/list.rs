//! Reads any image file; the format is detected by content.
//!
//! # Practice
//! A format is one file with a [`Format`]; its name in [`FORMATS`] brings it to the programs.
//! [`import_among`] uses it from any crate (`tests/toy_format.rs`).

use crate::format::Format;
use crate::source::Source;
use crate::{
    Import, ReadError, Sample, Segmentation, VoxelVolume, WriteError, dicom, labels, metaimage, mgh, nifti, nrrd,
};
use std::path::{Path, PathBuf};

/// The formats that are read.
pub const FORMATS: &[Format] = &[nifti::FORMAT, nrrd::FORMAT, metaimage::FORMAT, mgh::FORMAT, dicom::FORMAT];

/// Bytes of a file in which its format is recognised.
const START: usize = 512;

/// Reads a volume in any supported format, whatever its name; a folder is a DICOM series.
pub fn read(path: &Path) -> Result<VoxelVolume<f32>, ReadError> {
    import(path).map(|import| import.volume)
}

/// Reads a volume in any of the [`FORMATS`], with notes about the file.
pub fn import(path: &Path) -> Result<Import, ReadError> {
    import_among(FORMATS, path, None)
}

/// Reads the DICOM series of a folder or the volume of a file that has a number (from 0).
pub fn import_number(path: &Path, number: usize) -> Result<Import, ReadError> {
    import_among(FORMATS, path, Some(number))
}

/// Reads a volume in the first of `formats` that the content belongs to, with notes.
pub fn import_among(formats: &[Format], path: &Path, number: Option<usize>) -> Result<Import, ReadError> {
    if path.is_dir() {
        return (dicom::FORMAT.import)(path, number);
    }
    for format in formats {
        if (format.starts)(Source::open(&(format.file)(path))?.peek(START)?) {
            let mut import = (format.import)(path, number)?;
            import.facts.insert(0, ("format", format.name.into()));
            return Ok(import);
        }
    }
    let found = foreign(Source::open(path)?.peek(START)?).into();
    let readable = formats.iter().map(|format| format.name).collect::<Vec<_>>().join(", ");
    Err(ReadError::Format { file: path.into(), found, readable })
}

impl Segmentation {
    /// Reads a label file of any format, without trusting its sizes.
    ///
    /// Labels other than whole numbers from 0 to 65535 are an error.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        if dicom::is_segmentation(path) {
            return dicom::segmentation(path);
        }
        let (count, segments) = nrrd::segments(path)?;
        let layers: Result<_, ReadError> = match count {
            1 => labels(path, &read(path)?).map(|layer| vec![layer]),
            _ => (0..count).map(|layer| labels(path, &import_number(path, layer)?.volume)).collect(),
        };
        Ok(Self { layers: layers?, segments })
    }
}

/// Writes a volume that every common program opens: `NAME.nii.gz`, or `NAME.nrrd` if it is sheared
/// (tilted gantry). Returns the path.
///
/// ITK programs refuse a sheared NIfTI, and NRRD holds the same voxels without resampling.
pub fn write_beside<T: Sample>(folder: &Path, name: &str, volume: &VoxelVolume<T>) -> Result<PathBuf, WriteError> {
    let at = |end: &str| folder.join(format!("{name}.{end}"));
    match nifti::is_sheared(volume.world_from_voxel) {
        false => nifti::write(&at("nii.gz"), volume).map(|()| at("nii.gz")),
        true => nrrd::write(&at("nrrd"), volume).map(|()| at("nrrd")),
    }
}

/// Names a content that is not read.
fn foreign(start: &[u8]) -> &'static str {
    match start {
        [] => "it is empty",
        [0x89, b'P', b'N', b'G', ..] => "it is a PNG picture",
        [0xff, 0xd8, 0xff, ..] => "it is a JPEG picture",
        [b'P', b'K', 3, 4, ..] => "it is a ZIP archive; unpack it first",
        [b'%', b'P', b'D', b'F', ..] => "it is a PDF document",
        _ if start.iter().all(|&b| b == b'\n' || b == b'\r' || b == b'\t' || (32..127).contains(&b)) => "it is a text",
        _ => "its first bytes are of no known format",
    }
}
