//! NRRD: nearly raw raster data, a text header and the voxels, in one file or two.
//!
//! # Theory
//! Each axis has a direction vector (its length is the spacing) in a named space; the affine's
//! columns are these vectors and the origin, converted to RAS+ mm:
//! `world = diag(±units) · (space directions | space origin)`. Older files give `spacings`, or
//! `axis mins` and `axis maxs`, along the axes.
//!
//! # Practice
//! Reads attached and detached files; raw, text and gzip; both byte orders; line skip and byte skip
//! (also -1, voxels at the end); one volume of several by number. [`segments`] lists those of a
//! segmentation of 3D Slicer. Writes attached files with gzip and numbers in full length, so that
//! an f64 affine is preserved exactly, and a shear with it.
//!
//! # Sources
//! G. Kindlmann, "Definition of NRRD file format", teem.sourceforge.net/nrrd/format.html.
//!
//! # When not to use it
//! For tools that only know NIfTI: [`nifti`](crate::nifti) is the more common one.

mod segments;
mod write;

pub use segments::segments;
pub use write::write;

use crate::keys::{Keys, numbers};
use crate::sample::{ByteOrder, Number, Scale};
use crate::source::{Part, Source, shown};
use crate::{Format, Import, Note, ReadError, VoxelVolume};
use glam::{DAffine3, DMat3, DVec3};
use std::path::Path;

/// The format.
pub const FORMAT: Format = Format { name: "NRRD", file: Path::to_path_buf, starts, import: read_one };

fn starts(bytes: &[u8]) -> bool {
    bytes.starts_with(b"NRRD")
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

fn header(source: &mut Source) -> Result<Keys, ReadError> {
    let magic = source.line()?.unwrap_or_default();
    match magic.starts_with("NRRD000") {
        true => Keys::read(source, ":", str::is_empty),
        false => Err(source.field("magic", format!("{magic:.20?}"), "a NRRD file starts with NRRD000 and a digit")),
    }
}

/// Reads from a source that starts with the header.
fn import_source(mut source: Source, number: Option<usize>) -> Result<Import, ReadError> {
    let keys = header(&mut source)?;
    let axes = Axes::of(&source, &keys)?;
    let count = source.voxels("sizes", axes.dims)?;
    if number.is_none() && axes.of > 1 && keys.starting(":segment0_").next().is_some() {
        let found = format!("that of {} layers of a 3D Slicer segmentation", axes.of);
        let remedy = "it is no image; give it as labels, with a segment's name: --tissue CLASS=PATH:NAME";
        return Err(source.field("sizes", found, remedy));
    }
    let (part, note) = Part::numbered(source.file(), "sizes", (axes.run, axes.of), number)?;
    let mut notes: Vec<Note> = note.into_iter().collect();
    let (world_from_voxel, taken) = orientation(&source, &keys, &axes, &mut notes)?;
    let (data, stored) = voxels(&mut source, &keys, count, part)?;
    let volume = source.volume(axes.dims, data, "space directions", world_from_voxel)?;
    let unit = shown(keys.text(&["space units", "units"]).unwrap_or("mm"));
    let packing = keys.text(&["encoding"]).unwrap_or_default().into();
    let facts = vec![("stored numbers", stored), ("compression", packing), ("unit", unit), ("transform", taken)];
    Ok(Import { facts, ..Import::new(volume, notes) })
}

/// The sizes, which axes are those of the volume, and how volumes lie along a fourth.
struct Axes {
    dims: [i64; 3],
    /// Their indices among all axes.
    spatial: [usize; 3],
    /// Numbers before the volume changes.
    run: u64,
    /// How many volumes.
    of: u64,
}

impl Axes {
    fn of(source: &Source, keys: &Keys) -> Result<Self, ReadError> {
        let sizes: Vec<i64> = numbers(source, "sizes", keys.needed(source, "sizes")?)?;
        let dimension: Vec<usize> = numbers(source, "dimension", keys.needed(source, "dimension")?)?;
        if dimension != [sizes.len()] {
            return Err(source.field("dimension", format!("{dimension:?}"), "it must be the number of sizes"));
        }
        let wrong =
            || ReadError::Dimensions { file: source.file().into(), field: "sizes", found: format!("{sizes:?}") };
        let kinds: Vec<&str> = keys.text(&["kinds"]).unwrap_or_default().split_whitespace().collect();
        let directions: Option<Vec<&str>> = keys.text(&["space directions"]).map(|text| vectors(text).collect());
        // A time axis has a direction without a part in space.
        let in_space =
            |v: &str| v != "none" && v.split(',').take(3).any(|n| n.trim_matches(['(', ' ']).parse::<f64>() != Ok(0.0));
        let spatial = |axis: &usize| match &directions {
            Some(directions) => directions.get(*axis).is_some_and(|v| in_space(v)),
            None => kinds.get(*axis).is_none_or(|kind| ["domain", "space", "???", "none"].contains(kind)),
        };
        let spatial: Vec<usize> = match sizes.len() {
            3 => vec![0, 1, 2],
            count => (0..count).filter(spatial).take(3).collect(),
        };
        let spatial: [usize; 3] = spatial.try_into().map_err(|_| wrong())?;
        let others: Vec<usize> = (0..sizes.len()).filter(|axis| !spatial.contains(axis) && sizes[*axis] != 1).collect();
        let product = |of: &[i64]| of.iter().try_fold(1u64, |n, &size| u64::try_from(size).ok()?.checked_mul(n));
        let (run, of) = match others[..] {
            [] => (Some(u64::MAX), Some(1)),
            [axis] => (product(&sizes[..axis]), product(&sizes[axis..=axis])),
            [..] => (None, None),
        };
        match (run, of) {
            (Some(run @ 1..), Some(of @ 1..)) => Ok(Self { dims: spatial.map(|axis| sizes[axis]), spatial, run, of }),
            _ => Err(wrong()),
        }
    }
}

fn orientation(
    source: &Source,
    keys: &Keys,
    axes: &Axes,
    notes: &mut Vec<Note>,
) -> Result<(DAffine3, String), ReadError> {
    let (signs, space) = signs(source, keys, notes)?;
    let vector = |field: &'static str, text: &str| {
        let found: Vec<f64> = numbers(source, field, text)?;
        let wrong = || source.field(field, format!("{text:?}"), "vectors of three numbers must stand there");
        match found[..] {
            [x, y, z] | [x, y, z, _] => Ok(DVec3::new(x, y, z)),
            _ => Err(wrong()),
        }
    };
    let origin = keys.text(&["space origin"]).map(|text| vector("space origin", text)).transpose()?;
    let Some(directions) = keys.text(&["space directions"]) else {
        if notes.iter().all(|note| !matches!(note, Note::NoOrientation { .. })) {
            notes.push(Note::NoOrientation { field: "no space directions" });
        }
        let (edges, start) = along_axes(source, keys, axes, notes)?;
        let file = DAffine3 { matrix3: DMat3::from_diagonal(edges), translation: origin.unwrap_or(start) };
        return Ok((DAffine3::from_scale(signs) * file, format!("spacings along the axes in {space}")));
    };
    let directions: Vec<&str> = vectors(directions).collect();
    let column = |axis: usize| vector("space directions", directions.get(axes.spatial[axis]).copied().unwrap_or(""));
    let matrix3 = DMat3::from_cols(column(0)?, column(1)?, column(2)?);
    let translation = origin.unwrap_or(DVec3::ZERO);
    let mm = [0, 1, 2].map(|row| millimetres("space units", keys, row, notes));
    let turn = DAffine3::from_scale(signs * DVec3::from_array(mm));
    Ok((turn * DAffine3 { matrix3, translation }, format!("space directions in {space}")))
}

/// The edges and the first voxel's centre along the file's axes, mm, where it has no directions.
fn along_axes(source: &Source, keys: &Keys, axes: &Axes, notes: &mut Vec<Note>) -> Result<(DVec3, DVec3), ReadError> {
    let given = |field: &'static str| numbers::<f64>(source, field, keys.text(&[field]).unwrap_or_default());
    let (spacings, mins, maxs) = (given("spacings")?, given("axis mins")?, given("axis maxs")?);
    let centers: Vec<&str> = keys.text(&["centers", "centerings"]).unwrap_or_default().split_whitespace().collect();
    if spacings.is_empty() && (mins.is_empty() || maxs.is_empty()) {
        let taken = "cubes of 1 mm are taken, so check the size";
        notes.push(Note::Unusual { field: "spacings", found: "missing".into(), taken });
    }
    let (mut edges, mut start) = (DVec3::ONE, DVec3::ZERO);
    for axis in 0..3 {
        let of = |values: &[f64]| values.get(axes.spatial[axis]).copied().filter(|v| v.is_finite());
        let is_node = centers.get(axes.spatial[axis]).is_some_and(|centre| centre.eq_ignore_ascii_case("node"));
        let steps = axes.dims[axis] as f64 - if is_node { 1.0 } else { 0.0 };
        let edge = match (of(&spacings), of(&mins), of(&maxs)) {
            (Some(edge), ..) => edge,
            (None, Some(min), Some(max)) => (max - min) / steps,
            _ if spacings.is_empty() => 1.0,
            _ => f64::NAN,
        };
        let mm = millimetres("units", keys, axes.spatial[axis], notes);
        edges[axis] = mm * edge;
        start[axis] = mm * of(&mins).map_or(0.0, |min| min + if is_node { 0.0 } else { edge / 2.0 });
    }
    Ok((edges, start))
}

/// Millimetres in the unit that a field gives for an axis; an unknown one is taken as mm.
fn millimetres(field: &'static str, keys: &Keys, axis: usize, notes: &mut Vec<Note>) -> f64 {
    let text = keys.text(&[field]).unwrap_or_default();
    let unit = match text.contains('"') {
        true => text.split('"').skip(1).step_by(2).nth(axis),
        false => text.split_whitespace().nth(axis),
    };
    match unit.unwrap_or_default().trim().to_lowercase().trim_end_matches('s') {
        "m" | "meter" | "metre" => 1e3,
        "cm" | "centimeter" | "centimetre" => 10.0,
        "um" | "\u{b5}m" | "\u{3bc}m" | "micron" | "micrometer" | "micrometre" => 1e-3,
        "nm" | "nanometer" | "nanometre" => 1e-6,
        "" | "mm" | "millimeter" | "millimetre" | "???" | "none" => 1.0,
        other => {
            let found = other.chars().take(20).collect();
            notes.push(Note::Unusual { field, found, taken: "mm are taken, so check the size" });
            1.0
        }
    }
}

/// Signs that convert the file's space to RAS+, and the space.
fn signs(source: &Source, keys: &Keys, notes: &mut Vec<Note>) -> Result<(DVec3, &'static str), ReadError> {
    let mut unknown = |field| {
        notes.push(Note::NoOrientation { field });
        Ok((DVec3::ONE, "no patient's space"))
    };
    let Some(space) = keys.text(&["space"]) else { return unknown("no space") };
    match space.to_ascii_lowercase().trim_end_matches("-time") {
        "right-anterior-superior" | "ras" | "rast" => Ok((DVec3::ONE, "RAS")),
        "left-anterior-superior" | "las" | "last" => Ok((DVec3::new(-1.0, 1.0, 1.0), "LAS")),
        "left-posterior-superior" | "lps" | "lpst" => Ok((DVec3::new(-1.0, -1.0, 1.0), "LPS")),
        "scanner-xyz" | "3d-right-handed" | "3d-left-handed" => unknown("space is no patient's"),
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

/// The voxels and how they are stored.
fn voxels(source: &mut Source, keys: &Keys, count: u64, part: Part) -> Result<(Vec<f32>, String), ReadError> {
    let total = count.saturating_mul(part.of);
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
        "txt" | "text" | "ascii" => {
            let mut values = from.written_samples(total)?;
            part.keep(&mut values, 0);
            return Ok((values, "text".into()));
        }
        "gz" | "gzip" => {
            unpacked = from.take_rest().gunzipped();
            &mut unpacked
        }
        other => {
            let remedy = "raw, gzip or text is read; convert the file (unu save -e gzip)";
            return Err(from.field("encoding", format!("{other:?}"), remedy));
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
        Err(_) => from.skip_to_last(total.saturating_mul(number.bytes() as u64))?,
    }
    let data = from.samples(part, count, number, order, Scale::NONE)?;
    from.check_end()?;
    Ok((data, number.stored(order)))
}

/// Opens the voxels' file next to a header.
fn beside(header: &Source, name: &str) -> Result<Source, ReadError> {
    if name.starts_with("LIST") || name.contains('%') {
        let remedy = "one file must hold all voxels; convert it to an attached .nrrd";
        return Err(header.field("data file", format!("{name:?}"), remedy));
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
            let remedy = "a number type of NRRD is right, such as short or float";
            return Err(source.field("type", format!("{name:?}"), remedy));
        }
    })
}

#[cfg(test)]
mod tests;
