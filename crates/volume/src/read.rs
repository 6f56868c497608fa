//! Reads any image file; the format is detected by content.

use crate::source::Source;
use crate::{Import, ReadError, VoxelVolume, dicom, metaimage, nifti, nrrd};
use std::path::Path;

/// Reads a volume in any supported format, whatever its name; a folder is a DICOM series.
pub fn read(path: &Path) -> Result<VoxelVolume<f32>, ReadError> {
    import(path).map(|import| import.volume)
}

/// Reads a volume in any format, with notes about the file.
pub fn import(path: &Path) -> Result<Import, ReadError> {
    if path.is_dir() {
        return dicom::import(path);
    }
    let mut source = Source::open(&nifti::header_of_pair(path))?;
    match Format::of(source.peek(512)?) {
        Ok(Format::Nifti) => nifti::import_source(source, None),
        Ok(Format::Nrrd) => nrrd::import_source(source),
        Ok(Format::Dicom) => dicom::import(path),
        Ok(Format::MetaImage) => metaimage::import_source(source),
        Err(found) => Err(ReadError::Format { file: path.into(), found: found.into() }),
    }
}

/// The supported formats.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Format {
    Nifti,
    Nrrd,
    MetaImage,
    Dicom,
}

impl Format {
    /// Detects the format from a file's first bytes, or names an unsupported one.
    fn of(start: &[u8]) -> Result<Self, &'static str> {
        let word = |at: usize| start.get(at..at + 4).and_then(|b| <[u8; 4]>::try_from(b).ok()).unwrap_or_default();
        let nifti = [348, 540].iter().any(|&n| word(0) == i32::to_le_bytes(n) || word(0) == i32::to_be_bytes(n));
        let key = start.iter().take_while(|&&b| b != b'=').map(u8::to_ascii_lowercase).collect::<Vec<_>>();
        let meta = [&b"objecttype"[..], b"ndims", b"comment", b"objectsubtype"].contains(&key.trim_ascii());
        match start {
            [] => Err("it is empty"),
            _ if nifti => Ok(Self::Nifti),
            [b'N', b'R', b'R', b'D', ..] => Ok(Self::Nrrd),
            _ if dicom::starts(start) => Ok(Self::Dicom),
            _ if meta => Ok(Self::MetaImage),
            [0x89, b'P', b'N', b'G', ..] => Err("it is a PNG picture"),
            [0xff, 0xd8, 0xff, ..] => Err("it is a JPEG picture"),
            [b'P', b'K', 3, 4, ..] => Err("it is a ZIP archive; unpack it first"),
            [b'%', b'P', b'D', b'F', ..] => Err("it is a PDF document"),
            [0, 0, 0, 1, ..] => Err("it looks like MGH (FreeSurfer); convert it with mri_convert to .nii.gz"),
            _ if start.iter().all(|&b| b == b'\n' || b == b'\r' || b == b'\t' || (32..127).contains(&b)) => {
                Err("it is a text")
            }
            _ => Err("its first bytes are of no known format"),
        }
    }
}
