//! MGH: the image format of FreeSurfer, `.mgh`, or `.mgz` with gzip.
//!
//! # Theory
//! A big-endian header of 284 bytes, then voxels with i fastest, frame after frame. `Mdc` holds the
//! directions of the axes, `delta` the edges and `Pxyz_c` the place of the voxel at half the sizes:
//! `world = (Mdc · delta) (voxel - sizes / 2) + Pxyz_c`, in RAS mm.
//!
//! # Practice
//! Reads bytes, shorts (signed or not), ints and floats, and one frame of several by number.
//! Without `goodRASFlag`, cubes of 1 mm lie left, foot, front, as FreeSurfer takes them, and notes
//! report it. The footer is ignored.
//!
//! # Sources
//! "The MGH/MGZ Volume Format", surfer.nmr.mgh.harvard.edu/fswiki/FsTutorial/MghFormat.
//!
//! # When not to use it
//! For new files: other programs than FreeSurfer's read NIfTI.

use crate::sample::{ByteOrder, Number, Scale};
use crate::source::{Part, Source};
use crate::{Format, Import, Note, ReadError};
use glam::{DAffine3, DMat3, DVec3};
use std::path::Path;

/// The format.
pub const FORMAT: Format = Format {
    name: "MGH (FreeSurfer, .mgz, .mgh)",
    file: Path::to_path_buf,
    starts: |bytes| bytes.starts_with(&[0, 0, 0, 1]),
    import: |path, number| import_source(Source::open(path)?, number),
};

/// Directions of the axes in a file without `goodRASFlag`: left, foot, front.
const DEFAULT: DMat3 = DMat3::from_cols(DVec3::NEG_X, DVec3::NEG_Z, DVec3::Y);

fn import_source(mut source: Source, frame: Option<usize>) -> Result<Import, ReadError> {
    let bytes: [u8; 284] = source.header()?;
    let raw = |at: usize| std::array::from_fn(|i| bytes[at + i]);
    let int = |at: usize| i64::from(i32::from_be_bytes(raw(at)));
    let vector = |at: usize| DVec3::from_array(std::array::from_fn(|i| f32::from_be_bytes(raw(at + 4 * i)).into()));
    if int(0) != 1 {
        return Err(source.field("version", int(0), "an MGH file starts with 1; is this another format?"));
    }
    let dims = [int(4), int(8), int(12)];
    let count = source.voxels("width, height and depth", dims)?;
    let Some(frames) = u64::try_from(int(16)).ok().filter(|&frames| frames > 0) else {
        return Err(source.field("nframes", int(16), "it must be at least 1; fetch the file again"));
    };
    let number = match int(20) {
        0 => Number::U8,
        1 => Number::I32,
        3 => Number::F32,
        4 => Number::I16,
        10 => Number::U16,
        other => return Err(source.field("type", other, "0, 1, 3, 4 or 10 (real numbers) is right")),
    };
    let (part, several) = Part::numbered(source.file(), "nframes", (count, frames), frame)?;
    let mut notes: Vec<Note> = several.into_iter().collect();
    let (axes, centre, taken) = match bytes[28..30] != [0, 0] {
        true => {
            let axes = DMat3::from_cols(vector(42), vector(54), vector(66));
            (axes * DMat3::from_diagonal(vector(30)), vector(78), "Mdc, delta and Pxyz_c")
        }
        false => {
            let taken = "cubes of 1 mm around the middle are taken, so check the size";
            notes.push(Note::Unusual { field: "goodRASFlag", found: "0".into(), taken });
            notes.push(Note::NoOrientation { field: "goodRASFlag is 0" });
            (DEFAULT, DVec3::ZERO, "none, so left, foot, front around the middle")
        }
    };
    let middle = DVec3::from_array(dims.map(|n| n as f64 / 2.0));
    let world_from_voxel = DAffine3 { matrix3: axes, translation: centre - axes * middle };
    let data = source.samples(part, count, number, ByteOrder::Big, Scale::NONE)?;
    source.check_end()?;
    let volume = source.volume(dims, data, "Mdc and delta", world_from_voxel)?;
    let facts = vec![
        ("stored numbers", number.stored(ByteOrder::Big)),
        ("compression", source.packing()),
        ("unit", "mm".into()),
        ("transform", taken.into()),
    ];
    Ok(Import { facts, ..Import::new(volume, notes) })
}

#[cfg(test)]
mod tests;
