//! NRRD with the header attached.

use crate::atomic::{write_atomically, write_voxels};
use crate::{Sample, VoxelVolume, WriteError};
use flate2::{Compression, write::GzEncoder};
use std::io::Write;
use std::path::Path;

/// Writes a volume to a compressed `.nrrd` file, atomically.
pub fn write<T: Sample>(path: &Path, volume: &VoxelVolume<T>) -> Result<(), WriteError> {
    let named = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("nrrd"));
    if !named {
        return Err(WriteError::Name { file: path.into(), expected: ".nrrd" });
    }
    if volume.data.len() != volume.dims.iter().product::<usize>() {
        return Err(WriteError::Dimensions { file: path.into(), found: format!("{:?}", volume.dims) });
    }
    write_atomically(path, |file| {
        file.write_all(header(volume).as_bytes())?;
        let mut gzip = GzEncoder::new(file, Compression::new(4));
        write_voxels(&mut gzip, &volume.data)?;
        gzip.finish().map(drop)
    })
    .map_err(|source| WriteError::Io { file: path.into(), source })
}

fn header<T: Sample>(volume: &VoxelVolume<T>) -> String {
    let [nx, ny, nz] = volume.dims;
    let m = volume.world_from_voxel.matrix3;
    let vector = |v: glam::DVec3| format!("({},{},{})", v.x, v.y, v.z);
    format!(
        "NRRD0004\n# Written by Trepan\ntype: {}\ndimension: 3\nspace: right-anterior-superior\nsizes: {nx} {ny} {nz}\n\
         space directions: {} {} {}\nkinds: domain domain domain\nspace units: \"mm\" \"mm\" \"mm\"\nendian: little\nencoding: gzip\n\
         space origin: {}\n\n",
        T::NUMBER.name(),
        vector(m.x_axis),
        vector(m.y_axis),
        vector(m.z_axis),
        vector(volume.world_from_voxel.translation),
    )
}
