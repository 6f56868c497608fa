//! NIfTI-1, single file, little-endian.

use crate::atomic::{write_atomically, write_voxels};
use crate::{Sample, VoxelVolume, WriteError};
use flate2::{Compression, write::GzEncoder};
use glam::{DAffine3, DMat3, DQuat};
use std::io::{self, Write};
use std::path::Path;

const HEADER: usize = 352;

/// Writes a volume atomically: `.nii` uncompressed, `.nii.gz` compressed.
///
/// ITK programs do not open a sheared volume (see [`write_beside`](crate::write_beside)).
pub fn write<T: Sample>(path: &Path, volume: &VoxelVolume<T>) -> Result<(), WriteError> {
    let name = path.file_name().map(|n| n.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let header = header(path, volume)?;
    let written = match (name.ends_with(".nii"), name.ends_with(".nii.gz")) {
        (true, _) => write_atomically(path, |file| body(file, &header, &volume.data)),
        (_, true) => write_atomically(path, |file| {
            let mut gzip = GzEncoder::new(file, Compression::new(4));
            body(&mut gzip, &header, &volume.data)?;
            gzip.finish().map(drop)
        }),
        _ => return Err(WriteError::Name { file: path.into(), expected: ".nii or .nii.gz" }),
    };
    written.map_err(|source| WriteError::Io { file: path.into(), source })
}

fn body<T: Sample>(to: &mut impl Write, header: &[u8], data: &[T]) -> io::Result<()> {
    to.write_all(header)?;
    write_voxels(to, data)
}

fn header<T: Sample>(path: &Path, volume: &VoxelVolume<T>) -> Result<[u8; HEADER], WriteError> {
    let dims: Option<Vec<i16>> = volume.dims.iter().map(|&n| i16::try_from(n).ok()).collect();
    let fits = dims.filter(|_| volume.data.len() == volume.dims.iter().product::<usize>());
    let wrong = || WriteError::Dimensions { file: path.into(), found: format!("{:?}", volume.dims) };
    let dims = fits.ok_or_else(wrong)?;
    let mut h = [0; HEADER];
    put(&mut h, 0, 348i32.to_le_bytes());
    for (n, &size) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].iter().enumerate() {
        put(&mut h, 40 + 2 * n, size.to_le_bytes());
    }
    put(&mut h, 70, code::<T>().to_le_bytes());
    put(&mut h, 72, (8 * T::NUMBER.bytes() as i16).to_le_bytes());
    put(&mut h, 108, (HEADER as f32).to_le_bytes());
    put(&mut h, 112, 1f32.to_le_bytes());
    h[123] = 2;
    put(&mut h, 148, *b"Trepan");
    put_orientation(&mut h, volume.world_from_voxel);
    put(&mut h, 344, *b"n+1\0");
    Ok(h)
}

/// Writes the sform; also the qform where it can represent the same affine.
fn put_orientation(h: &mut [u8; HEADER], affine: DAffine3) {
    let m = affine.matrix3;
    let (spacing, qfac, turn) = parts(m);
    for (n, size) in [qfac, spacing[0], spacing[1], spacing[2]].iter().enumerate() {
        put(h, 76 + 4 * n, (*size as f32).to_le_bytes());
    }
    put(h, 254, 1i16.to_le_bytes());
    for row in 0..3 {
        for (column, value) in m.row(row).to_array().into_iter().chain([affine.translation[row]]).enumerate() {
            put(h, 280 + 16 * row + 4 * column, (value as f32).to_le_bytes());
        }
    }
    if is_rotation(turn) {
        let q = DQuat::from_mat3(&turn);
        let q = if q.w < 0.0 { -q } else { q };
        put(h, 252, 1i16.to_le_bytes());
        for (n, value) in
            [q.x, q.y, q.z, affine.translation.x, affine.translation.y, affine.translation.z].iter().enumerate()
        {
            put(h, 256 + 4 * n, (*value as f32).to_le_bytes());
        }
    }
}

/// Edges, the sign of the third axis, and the rest of a matrix: a rotation unless it is sheared.
fn parts(m: DMat3) -> ([f64; 3], f64, DMat3) {
    let spacing = [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()];
    let qfac = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    (spacing, qfac, DMat3::from_cols(m.x_axis / spacing[0], m.y_axis / spacing[1], qfac * m.z_axis / spacing[2]))
}

fn is_rotation(turn: DMat3) -> bool {
    (turn * turn.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-6)
}

/// Whether the axes are not at right angles, as in a stack of a tilted gantry.
pub(crate) fn is_sheared(affine: DAffine3) -> bool {
    !is_rotation(parts(affine.matrix3).2)
}

fn put<const N: usize>(h: &mut [u8; HEADER], at: usize, bytes: [u8; N]) {
    h[at..at + N].copy_from_slice(&bytes);
}

fn code<T: Sample>() -> i16 {
    use crate::Number::*;
    match T::NUMBER {
        U8 => 2,
        I16 => 4,
        I32 => 8,
        F32 => 16,
        F64 => 64,
        I8 => 256,
        U16 => 512,
        U32 => 768,
        I64 => 1024,
        U64 => 1280,
    }
}
