//! An image format in one file, of another crate.

use glam::{DAffine3, DVec3};
use std::path::Path;
use trepan_volume::{FORMATS, Format, Import, ReadError, VoxelVolume, import_among};

/// Eight voxels of 1 mm, all of the value of the file's one byte after its magic.
const TOY: Format = Format {
    name: "toy (.toy)",
    file: Path::to_path_buf,
    starts: |bytes| bytes.starts_with(b"TOY"),
    import: |path, _| {
        let bytes = std::fs::read(path).map_err(|source| ReadError::Io { file: path.into(), source })?;
        let value = f32::from(bytes.get(3).copied().unwrap_or_default());
        let volume = VoxelVolume::filled([2; 3], DAffine3::from_scale(DVec3::ONE), value);
        Ok(Import { volume, notes: Vec::new(), modality: None, facts: Vec::new() })
    },
};

#[test]
fn a_format_of_one_file_is_recognised_and_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.nii");
    std::fs::write(&path, b"TOY\x07").unwrap();
    let import = import_among(&[TOY], &path, None).unwrap();
    assert_eq!(import.volume.data, [7.0; 8]);
    let unknown = import_among(FORMATS, &path, None).unwrap_err().to_string();
    assert!(unknown.contains("NIfTI") && unknown.contains("DICOM"), "{unknown}");
}
