//! NRRD: nearly raw raster data, a text header and the voxels, in one file or two.
//!
//! # Theory
//! Each axis has a direction vector (its length is the spacing) in a named space; the affine's
//! columns are these vectors and the origin, converted to RAS+:
//! `world = diag(±1) · (space directions | space origin)`.
//!
//! # Practice
//! Reads attached and detached files; raw, text and gzip; both byte orders; line skip and byte skip
//! (also -1, voxels at the end); further axes of size 1. Without a space, i, j, k are taken as
//! right, front, head and a note reports it. Writes attached files with gzip and numbers in full
//! length, so that an f64 affine is preserved exactly.
//!
//! # Sources
//! G. Kindlmann, "Definition of NRRD file format", teem.sourceforge.net/nrrd/format.html.
//!
//! # When not to use it
//! For tools that only know NIfTI: [`nifti`](crate::nifti) is the more common one.

mod write;

pub use write::write;

use crate::keys::{Keys, numbers};
use crate::sample::{ByteOrder, Number, Scale};
use crate::source::{Source, only};
use crate::{Format, Import, Note, ReadError, VoxelVolume};
use glam::{DAffine3, DMat3, DVec3};
use std::path::Path;

/// The format.
pub const FORMAT: Format =
    Format { name: "NRRD", file: Path::to_path_buf, starts: |bytes| bytes.starts_with(b"NRRD"), import: import_only };

/// Reads the volume of a file.
pub fn read(path: &Path) -> Result<VoxelVolume<f32>, ReadError> {
    import(path).map(|import| import.volume)
}

/// Reads the volume of a file, with notes.
pub fn import(path: &Path) -> Result<Import, ReadError> {
    import_source(Source::open(path)?)
}

fn import_only(path: &Path, number: Option<usize>) -> Result<Import, ReadError> {
    only(path, number)?;
    import(path)
}

/// Reads from a source that starts with the header.
fn import_source(mut source: Source) -> Result<Import, ReadError> {
    let magic = source.line()?.unwrap_or_default();
    if !magic.starts_with("NRRD000") {
        return Err(source.field("magic", format!("{magic:.20?}"), "a NRRD file starts with NRRD000 and a digit"));
    }
    let keys = Keys::read(&mut source, ":", str::is_empty)?;
    let sizes = Sizes::of(&source, &keys)?;
    let count = source.voxels("sizes", sizes.dims)?;
    let (world_from_voxel, note) = orientation(&source, &keys, &sizes)?;
    let data = voxels(&mut source, &keys, count)?;
    let volume = source.volume(sizes.dims, data, "space directions", world_from_voxel)?;
    Ok(Import::new(volume, note.into_iter().collect()))
}

/// The sizes and which axes are those of the volume.
struct Sizes {
    dims: [i64; 3],
    /// Their indices among all axes.
    axes: [usize; 3],
    count: usize,
}

impl Sizes {
    fn of(source: &Source, keys: &Keys) -> Result<Self, ReadError> {
        let text = keys.needed(source, "sizes")?;
        let sizes: Vec<i64> = numbers(source, "sizes", text)?;
        let dimension: Vec<usize> = numbers(source, "dimension", keys.needed(source, "dimension")?)?;
        if dimension != [sizes.len()] {
            return Err(source.field("dimension", format!("{dimension:?}"), "it must be the number of sizes"));
        }
        let wrong =
            || ReadError::Dimensions { file: source.file().into(), field: "sizes", found: format!("{sizes:?}") };
        let directed: Option<Vec<bool>> =
            keys.text(&["space directions"]).map(|d| vectors(d).map(|v| v != "none").collect());
        let spatial = |axis: usize| match &directed {
            Some(directed) if sizes.len() > 3 => directed.get(axis).copied().unwrap_or(false),
            _ => axis < 3,
        };
        let axes: Vec<usize> = (0..sizes.len()).filter(|&axis| spatial(axis)).collect();
        let axes: [usize; 3] = axes.try_into().map_err(|_| wrong())?;
        let others = (0..sizes.len()).filter(|axis| !axes.contains(axis)).map(|axis| sizes[axis]);
        match others.clone().find(|&n| n != 1) {
            None => Ok(Self { dims: axes.map(|axis| sizes[axis]), axes, count: sizes.len() }),
            Some(several) => Err(ReadError::Volumes {
                file: source.file().into(),
                field: "sizes",
                found: several.unsigned_abs(),
                remedy: "one must be cut out first: time series and vectors are not read",
            }),
        }
    }
}

fn orientation(source: &Source, keys: &Keys, sizes: &Sizes) -> Result<(DAffine3, Option<Note>), ReadError> {
    let Some(directions) = keys.text(&["space directions"]) else {
        let spacing: Vec<f64> = match keys.text(&["spacings"]) {
            Some(text) => numbers(source, "spacings", text)?,
            None => vec![1.0; sizes.count],
        };
        let of = |axis: usize| spacing.get(sizes.axes[axis]).copied().unwrap_or(f64::NAN);
        let affine = DAffine3::from_scale(DVec3::new(of(0), of(1), of(2)));
        return Ok((affine, Some(Note::NoOrientation { field: "no space directions" })));
    };
    let vectors: Vec<&str> = vectors(directions).collect();
    let vector = |field: &'static str, text: &str| {
        let found: Vec<f64> = numbers(source, field, text)?;
        let wrong = || source.field(field, format!("{text:?}"), "vectors of three numbers must stand there");
        <[f64; 3]>::try_from(found).map(DVec3::from_array).map_err(|_| wrong())
    };
    let column = |axis: usize| vector("space directions", vectors.get(sizes.axes[axis]).copied().unwrap_or(""));
    let matrix3 = DMat3::from_cols(column(0)?, column(1)?, column(2)?);
    let translation = match keys.text(&["space origin"]) {
        Some(text) => vector("space origin", text)?,
        None => DVec3::ZERO,
    };
    let (signs, note) = signs(source, keys)?;
    let units = keys.text(&["space units"]).unwrap_or_default();
    let mm = if units.contains("\"m\"") {
        1e3
    } else if units.contains("um") {
        1e-3
    } else {
        1.0
    };
    let turn = DAffine3::from_scale(signs * mm);
    Ok((turn * DAffine3 { matrix3, translation }, note))
}

/// Signs that convert the file's space to RAS+.
fn signs(source: &Source, keys: &Keys) -> Result<(DVec3, Option<Note>), ReadError> {
    let Some(space) = keys.text(&["space"]) else {
        return Ok((DVec3::ONE, Some(Note::NoOrientation { field: "no space" })));
    };
    match space.to_ascii_lowercase().as_str() {
        "right-anterior-superior" | "ras" => Ok((DVec3::ONE, None)),
        "left-anterior-superior" | "las" => Ok((DVec3::new(-1.0, 1.0, 1.0), None)),
        "left-posterior-superior" | "lps" => Ok((DVec3::new(-1.0, -1.0, 1.0), None)),
        "scanner-xyz" | "3d-right-handed" => {
            Ok((DVec3::ONE, Some(Note::NoOrientation { field: "space is no patient's" })))
        }
        _ => Err(source.field("space", format!("{space:?}"), "RAS, LAS or LPS (also written out) is right")),
    }
}

/// Splits a list such as "(1,0,0) none (0,1,0)".
fn vectors(text: &str) -> impl Iterator<Item = &str> {
    let ends = |c: char| c == ')' || c.is_whitespace();
    let mut rest = text.trim();
    std::iter::from_fn(move || {
        rest = rest.trim_start();
        let open = rest.starts_with('(');
        let end = rest.find(|c: char| if open { c == ')' } else { ends(c) }).unwrap_or(rest.len());
        let (part, after) = rest.split_at(end);
        rest = after.strip_prefix(')').unwrap_or(after);
        (!part.is_empty()).then_some(part)
    })
}

fn voxels(source: &mut Source, keys: &Keys, count: u64) -> Result<Vec<f32>, ReadError> {
    let number = number(source, keys.needed(source, "type")?)?;
    let encoding = keys.needed(source, "encoding")?.to_ascii_lowercase();
    let skip = |field: &'static str| keys.text(&[field]).map_or(Ok(0), |text| one::<i64>(source, field, text));
    let (line_skip, byte_skip) = (skip("line skip")?, skip("byte skip")?);
    let mut detached;
    let from = match keys.text(&["data file"]) {
        None => source,
        Some(name) => {
            detached = beside(source, name)?;
            &mut detached
        }
    };
    for _ in 0..line_skip {
        if from.line()?.is_none() {
            return Err(from.field("line skip", line_skip, "the file has fewer lines"));
        }
    }
    let mut unpacked;
    let from = match encoding.as_str() {
        "raw" => from,
        "txt" | "text" | "ascii" => return from.written_samples(count),
        "gz" | "gzip" => {
            unpacked = from.take_rest().gunzipped();
            &mut unpacked
        }
        other => {
            return Err(from.field(
                "encoding",
                format!("{other:?}"),
                "raw, gzip or text is read; convert the file (unu save -e gzip)",
            ));
        }
    };
    let order = match (keys.text(&["endian"]).map(str::to_ascii_lowercase).as_deref(), number.bytes()) {
        (Some("little"), _) | (None, 1) => ByteOrder::Little,
        (Some("big"), _) => ByteOrder::Big,
        (Some(_), 1) => ByteOrder::Little,
        (found, _) => return Err(from.field("endian", format!("{found:?}"), "little or big is right")),
    };
    match u64::try_from(byte_skip) {
        Ok(bytes) => from.skip(bytes, "bytes before the voxels")?,
        Err(_) => from.skip_to_last(count.saturating_mul(number.bytes() as u64))?,
    }
    let data = from.samples(count, number, order, Scale::NONE)?;
    from.check_end()?;
    Ok(data)
}

/// Opens the voxels' file next to a header.
fn beside(header: &Source, name: &str) -> Result<Source, ReadError> {
    if name.starts_with("LIST") || name.contains('%') {
        return Err(header.field(
            "data file",
            format!("{name:?}"),
            "one file must hold all voxels; convert it to an attached .nrrd",
        ));
    }
    let folder = header.file().parent().unwrap_or(Path::new(""));
    Source::open_plain(&folder.join(name))
}

fn one<T: std::str::FromStr>(source: &Source, field: &'static str, text: &str) -> Result<T, ReadError> {
    text.parse().map_err(|_| source.field(field, format!("{text:?}"), "a whole number must stand there"))
}

fn number(source: &Source, name: &str) -> Result<Number, ReadError> {
    Ok(match name.to_ascii_lowercase().as_str() {
        "signed char" | "int8" | "int8_t" => Number::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Number::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Number::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Number::U16,
        "int" | "signed int" | "int32" | "int32_t" => Number::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Number::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Number::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Number::U64,
        "float" => Number::F32,
        "double" => Number::F64,
        _ => {
            return Err(source.field(
                "type",
                format!("{name:?}"),
                "a number type of NRRD is right, such as short or float",
            ));
        }
    })
}

#[cfg(test)]
mod tests;
