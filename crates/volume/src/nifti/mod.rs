//! NIfTI-1 and NIfTI-2, the usual format of brain imaging.
//!
//! # Theory
//! A header of 348 (version 1) or 540 bytes (version 2), then voxels with i fastest. The header's
//! `sform` is the affine to RAS+ mm; the older `qform` gives it as a quaternion, spacings and an
//! offset. Stored numbers become values by `scl_slope · stored + scl_inter`, unless the slope is 0.
//!
//! # Practice
//! Reads both versions, both byte orders, gzip detected by content, `.nii` or `.hdr` with `.img`,
//! and every real number type. Which transform counts stands in the [crate's](crate) geometry. NaN
//! voxels stay NaN: [`import`] counts them and [`hounsfield`](crate::hounsfield) rejects them.
//! Writes version 1, single file, little-endian, both forms, atomically; a sheared volume has no
//! qform, and [`write_beside`](crate::write_beside) gives it another format.
//!
//! # Sources
//! R. W. Cox et al., "A (sort of) new image data format standard: NIfTI-1", 2004; the NIfTI-1 and
//! NIfTI-2 C headers, nifti.nimh.nih.gov.
//!
//! # When not to use it
//! Version 1 stores the affine in f32: to preserve an f64 affine exactly, write
//! [`nrrd`](crate::nrrd).

mod header;
mod write;

pub(crate) use write::is_sheared;
pub use write::write;

use crate::source::{Part, Source};
use crate::{Format, Import, ReadError, Sample, VoxelVolume};
use header::Header;
use std::path::{Path, PathBuf};

/// The format.
pub const FORMAT: Format = Format {
    name: "NIfTI-1 and NIfTI-2 (.nii, .nii.gz, .hdr with .img)",
    file: header_of_pair,
    starts,
    import: read_one,
};

fn starts(bytes: &[u8]) -> bool {
    let size = bytes.first_chunk::<4>().copied().unwrap_or_default();
    [348, 540].iter().any(|&header| size == i32::to_le_bytes(header) || size == i32::to_be_bytes(header))
}

/// Reads the one volume of a file.
pub fn read(path: &Path) -> Result<VoxelVolume<f32>, ReadError> {
    import(path).map(|import| import.volume)
}

/// Reads the one volume of a file, with notes.
pub fn import(path: &Path) -> Result<Import, ReadError> {
    read_one(path, None)
}

/// Reads the one volume of a file as numbers of another type, rounded, in no more memory than
/// they need.
pub fn read_as<T: Sample>(path: &Path) -> Result<VoxelVolume<T>, ReadError> {
    read_one(path, None).map(|import| import.volume)
}

fn read_one<T: Sample>(path: &Path, index: Option<usize>) -> Result<Import<T>, ReadError> {
    import_source(Source::open(&header_of_pair(path))?, index)
}

/// Reads from a source that starts with the header.
fn import_source<T: Sample>(mut source: Source, index: Option<usize>) -> Result<Import<T>, ReadError> {
    let header = Header::read(&mut source)?;
    match header.voxels_elsewhere {
        false => voxels(source, &header, index),
        true => voxels(Source::open(&voxels_of_pair(source.file())?)?, &header, index),
    }
}

fn voxels<T: Sample>(mut source: Source, header: &Header, index: Option<usize>) -> Result<Import<T>, ReadError> {
    let count = source.voxels("dim", header.dims)?;
    let (part, note) = Part::numbered(source.file(), "dim", (count, header.volumes), index)?;
    let ahead = header.vox_offset.checked_sub(source.taken()).ok_or_else(|| {
        source.field(
            "vox_offset",
            header.vox_offset,
            "voxels must start after the header (352 for NIfTI-1, 544 for NIfTI-2)",
        )
    })?;
    if ahead > source.left() {
        return Err(source.field("vox_offset", header.vox_offset, "voxels must start before the end of the file"));
    }
    source.skip(ahead, "bytes before the voxels")?;
    let data = source.samples(part, count, header.number, header.order, header.scale)?;
    source.check_end()?;
    let orientation = header.orientation(&source)?;
    let notes = note.into_iter().chain(header.note.clone()).chain(orientation.notes);
    let volume = source.volume(header.dims, data, orientation.field, orientation.world_from_voxel)?;
    let facts = vec![
        ("stored numbers", header.number.stored(header.order)),
        ("compression", source.packing()),
        ("unit", format!("{} mm", header.mm_per_unit)),
        ("transform", orientation.taken),
        ("scale", header.scale.to_string()),
    ];
    Ok(Import { facts, ..Import::new(volume, notes.collect()) })
}

/// The header's path if the user named the voxel file of a pair.
fn header_of_pair(path: &Path) -> PathBuf {
    let plain = if ends(path, "gz") { path.with_extension("") } else { path.into() };
    let other = [plain.with_extension("hdr"), plain.with_extension("HDR"), plain.with_extension("hdr.gz")];
    match ends(&plain, "img") {
        true => other.into_iter().find(|p| p.exists()).unwrap_or_else(|| path.into()),
        false => path.into(),
    }
}

/// The path of the voxel file next to a header.
fn voxels_of_pair(header: &Path) -> Result<PathBuf, ReadError> {
    let plain = if ends(header, "gz") { header.with_extension("") } else { header.into() };
    let places = ["img", "IMG", "img.gz"].map(|end| plain.with_extension(end));
    places.into_iter().find(|p| p.exists()).ok_or_else(|| ReadError::Field {
        file: header.into(),
        field: "magic",
        found: "that of a pair of files".into(),
        remedy: "the voxels must lie beside it in a file of the same name that ends in .img",
    })
}

fn ends(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::survives_mutations;
    use trepan_geometry::Vec3;

    #[test]
    fn damaged_files_give_errors_and_no_panic() {
        let folder = tempfile::tempdir().unwrap();
        let mut volume = VoxelVolume::isotropic([5, 4, 3], Vec3::ZERO, 1.0, 0i16);
        volume.data.iter_mut().enumerate().for_each(|(at, v)| *v = at as i16);
        let seeds: Vec<Vec<u8>> = ["a.nii", "a.nii.gz"]
            .map(|name| {
                let path = folder.path().join(name);
                write(&path, &volume).unwrap();
                std::fs::read(path).unwrap()
            })
            .into();
        survives_mutations(&seeds, |bytes| import_source(Source::of_bytes(Path::new("a.nii"), bytes), None));
    }
}
