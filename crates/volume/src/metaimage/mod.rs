//! MetaImage: a text header of "Key = value" lines and the voxels, in one file (.mha) or two (.mhd
//! with .raw or .zraw).
//!
//! # Theory
//! `TransformMatrix` lists the direction of each axis one after the other, `ElementSpacing` the
//! edges, `Offset` the centre of the first voxel, all in LPS; so
//! `world = diag(-1, -1, 1) · (direction · spacing | offset)`.
//!
//! # Practice
//! Reads raw, zlib and text voxels, both byte orders, `HeaderSize` (also -1) and the intensity
//! function, and one volume or channel of several by number. `AnatomicalOrientation` is ignored:
//! writers disagree about it, and the matrix holds the same information.
//!
//! # Sources
//! Kitware, "MetaIO/Documentation", itk.org/Wiki/ITK/MetaIO/Documentation.
//!
//! # When not to use it
//! For new files: NIfTI and NRRD describe the space more fully.

use crate::keys::{Keys, numbers};
use crate::sample::{ByteOrder, Number, Scale};
use crate::source::{Part, Source};
use crate::{Format, Import, Note, ReadError, VoxelVolume};
use glam::{DAffine3, DMat3, DVec3};
use std::path::Path;

/// The format.
pub const FORMAT: Format = Format { name: "MetaImage", file: Path::to_path_buf, starts, import: read_one };

fn starts(bytes: &[u8]) -> bool {
    let key: Vec<u8> = bytes.iter().take_while(|&&b| b != b'=').map(u8::to_ascii_lowercase).collect();
    [&b"objecttype"[..], b"ndims", b"comment", b"objectsubtype"].contains(&key.trim_ascii())
}

/// Reads the volume of a file.
pub fn read(path: &Path) -> Result<VoxelVolume<f32>, ReadError> {
    import(path).map(|import| import.volume)
}

/// Reads the volume of a file, with notes.
pub fn import(path: &Path) -> Result<Import, ReadError> {
    read_one(path, None)
}

fn read_one(path: &Path, number: Option<usize>) -> Result<Import, ReadError> {
    import_source(Source::open(path)?, number)
}

/// Reads from a source that starts with the header.
fn import_source(mut source: Source, index: Option<usize>) -> Result<Import, ReadError> {
    let keys = Keys::read(&mut source, "=", |line| line.trim_start().starts_with("ElementDataFile"))?;
    let file = keys.needed(&source, "ElementDataFile")?;
    let (dims, (run, of)) = dims(&source, &keys)?;
    let count = source.voxels("DimSize", dims)?;
    let field = "DimSize or ElementNumberOfChannels";
    let (part, several) = Part::numbered(source.file(), field, (if run == 1 { 1 } else { count }, of), index)?;
    let (world_from_voxel, note) = orientation(&source, &keys)?;
    let scale = scale(&source, &keys)?;
    let data = match file.to_ascii_uppercase().as_str() {
        "LOCAL" => voxels(&mut source, &keys, count, part)?,
        "LIST" => {
            return Err(source.field("ElementDataFile", "LIST", "one file must hold all voxels; convert it to .mha"));
        }
        name if name.contains('%') => {
            let remedy = "one file must hold all voxels; convert it to .mha";
            return Err(source.field("ElementDataFile", format!("{file:?}"), remedy));
        }
        _ => {
            let beside = source.file().parent().unwrap_or(Path::new("")).join(file);
            voxels(&mut Source::open_plain(&beside)?, &keys, count, part)?
        }
    };
    let volume = source.volume(dims, data, "TransformMatrix", world_from_voxel)?;
    let taken = if note.is_some() { "axes in LPS" } else { "TransformMatrix in LPS" };
    let scaled = (scale != Scale::NONE).then(|| Note::Unusual {
        field: "ElementToIntensityFunction",
        found: scale.to_string(),
        taken: "applied, as the format defines; ITK programs leave it out, so their values differ",
    });
    let facts = vec![
        ("stored numbers", number(&source, keys.needed(&source, "ElementType")?)?.stored(order(&keys))),
        ("compression", if yes(&keys, &["CompressedData"]) { "zlib" } else { "none" }.into()),
        ("unit", "mm".into()),
        ("transform", taken.into()),
        ("scale", scale.to_string()),
    ];
    Ok(Import { facts, ..Import::new(volume, several.into_iter().chain(note).chain(scaled).collect()) })
}

/// The sizes, and the runs and number of volumes or channels.
fn dims(source: &Source, keys: &Keys) -> Result<([i64; 3], (u64, u64)), ReadError> {
    if let Some(kind) = keys.text(&["ObjectType"]).filter(|kind| !kind.eq_ignore_ascii_case("image")) {
        return Err(source.field("ObjectType", format!("{kind:?}"), "only Image is read"));
    }
    let sizes: Vec<i64> = numbers(source, "DimSize", keys.needed(source, "DimSize")?)?;
    let channels: Vec<u64> =
        numbers(source, "ElementNumberOfChannels", keys.text(&["ElementNumberOfChannels"]).unwrap_or("1"))?;
    let wrong = || ReadError::Dimensions { file: source.file().into(), field: "DimSize", found: format!("{sizes:?}") };
    let (first, rest) = sizes.split_first_chunk::<3>().ok_or_else(wrong)?;
    let volumes = rest.iter().try_fold(1u64, |n, &size| u64::try_from(size).ok()?.checked_mul(n));
    match (channels[..].first().copied().unwrap_or(1), volumes) {
        (1, Some(volumes @ 1..)) => Ok((*first, (u64::MAX, volumes))),
        (channels @ 1.., Some(1)) => Ok((*first, (1, channels))),
        _ => Err(wrong()),
    }
}

fn orientation(source: &Source, keys: &Keys) -> Result<(DAffine3, Option<Note>), ReadError> {
    let vector = |field: &'static str, text: &str, least: usize| {
        let found: Vec<f64> = numbers(source, field, text)?;
        match found.len() >= least {
            true => Ok(found),
            false => Err(source.field(field, format!("{text:?}"), "a number for each dimension must stand there")),
        }
    };
    let rank = numbers::<i64>(source, "DimSize", keys.needed(source, "DimSize")?)?.len();
    let spacing = vector("ElementSpacing", keys.text(&["ElementSpacing", "ElementSize"]).unwrap_or("1 1 1"), 3)?;
    let offset = vector("Offset", keys.text(&["Offset", "Position", "Origin"]).unwrap_or("0 0 0"), 3)?;
    let spacing = DVec3::new(spacing[0], spacing[1], spacing[2]);
    let (matrix3, note) = match keys.text(&["TransformMatrix", "Orientation", "Rotation"]) {
        None => (DMat3::IDENTITY, Some(Note::NoOrientation { field: "no TransformMatrix" })),
        Some(text) => {
            let m = vector("TransformMatrix", text, rank * rank)?;
            let column = |axis: usize| DVec3::new(m[axis * rank], m[axis * rank + 1], m[axis * rank + 2]);
            (DMat3::from_cols(column(0), column(1), column(2)), None)
        }
    };
    let lps = DAffine3 {
        matrix3: matrix3 * DMat3::from_diagonal(spacing),
        translation: DVec3::new(offset[0], offset[1], offset[2]),
    };
    Ok((DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0)) * lps, note))
}

fn yes(keys: &Keys, names: &[&str]) -> bool {
    keys.text(names).is_some_and(|v| v.eq_ignore_ascii_case("true") || v == "1")
}

fn order(keys: &Keys) -> ByteOrder {
    match yes(keys, &["BinaryDataByteOrderMSB", "ElementByteOrderMSB"]) {
        true => ByteOrder::Big,
        false => ByteOrder::Little,
    }
}

fn voxels(source: &mut Source, keys: &Keys, count: u64, part: Part) -> Result<Vec<f32>, ReadError> {
    let number = number(source, keys.needed(source, "ElementType")?)?;
    let (total, scale) = (count.saturating_mul(part.of), scale(source, keys)?);
    if keys.text(&["BinaryData"]).is_some_and(|v| v.eq_ignore_ascii_case("false")) {
        let mut values = source.written_samples(total)?;
        part.keep(&mut values, 0);
        values.iter_mut().for_each(|v| *v = (scale.slope * f64::from(*v) + scale.intercept) as f32);
        return Ok(values);
    }
    let before: Vec<i64> = numbers(source, "HeaderSize", keys.text(&["HeaderSize"]).unwrap_or("0"))?;
    let mut unpacked;
    let from = match yes(keys, &["CompressedData"]) {
        false => source,
        true => {
            let rest = source.take_rest();
            unpacked = rest.unpacked_by_content()?;
            &mut unpacked
        }
    };
    match before.first().map(|&n| u64::try_from(n)) {
        None | Some(Ok(0)) => {}
        Some(Ok(bytes)) => from.skip(bytes, "HeaderSize")?,
        Some(Err(_)) => from.skip_to_last(total.saturating_mul(number.bytes() as u64))?,
    }
    let data = from.samples(part, count, number, order(keys), scale)?;
    from.check_end()?;
    Ok(data)
}

fn scale(source: &Source, keys: &Keys) -> Result<Scale, ReadError> {
    let of = |field: &'static str, default: f64| {
        let Some(text) = keys.text(&[field]) else { return Ok(default) };
        let found: Option<f64> = text.parse().ok().filter(|v: &f64| v.is_finite());
        found.ok_or_else(|| source.field(field, format!("{text:?}"), "a number must stand there"))
    };
    let slope = of("ElementToIntensityFunctionSlope", 1.0)?;
    Ok(Scale { slope, intercept: of("ElementToIntensityFunctionOffset", 0.0)? })
}

fn number(source: &Source, name: &str) -> Result<Number, ReadError> {
    Ok(match name.to_ascii_uppercase().as_str() {
        "MET_UCHAR" => Number::U8,
        "MET_CHAR" => Number::I8,
        "MET_USHORT" => Number::U16,
        "MET_SHORT" => Number::I16,
        "MET_UINT" | "MET_ULONG" => Number::U32,
        "MET_INT" | "MET_LONG" => Number::I32,
        "MET_ULONG_LONG" => Number::U64,
        "MET_LONG_LONG" => Number::I64,
        "MET_FLOAT" => Number::F32,
        "MET_DOUBLE" => Number::F64,
        _ => {
            let remedy = "a number type of MetaImage is right, such as MET_SHORT";
            return Err(source.field("ElementType", format!("{name:?}"), remedy));
        }
    })
}

#[cfg(test)]
mod tests;
