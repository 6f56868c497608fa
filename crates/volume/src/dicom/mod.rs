//! Reads DICOM series, with a file per slice or all slices in one.
//!
//! # Theory
//! Files are grouped by series, orientation and size; the stack module sorts and places the slices.
//! Values are `RescaleSlope · stored + RescaleIntercept`, which for CT gives HU.
//!
//! # Practice
//! Give a folder, or one file of the series in it. Reads explicit and implicit, little- and
//! big-endian, deflated, RLE, JPEG (8 bits lossy, or lossless), JPEG-LS, JPEG 2000; 8, 16 and 32
//! bits; enhanced multi-frame files; oblique and tilted stacks. Of several series in a folder the
//! one that makes the largest volume is read and a note reports it; [`series`] lists them. Doubled,
//! missing and uneven slices are rejected. Only the elements that place and scale voxels are read:
//! no name, date, identifier or free text of a patient is stored or shown.
//!
//! | what files do | what is read |
//! |---|---|
//! | places repeat, gaps are uneven | parts by acquisition, echo time, kind of image or phase |
//! | positions of few digits | even, if within half of the last digit of a line; a note |
//! | PixelSpacing differs by under a thousandth, or has one value | one series; both edges |
//! | directions of few digits | made of length 1 and upright to each other |
//! | decimal commas | points |
//! | PixelPaddingValue, its RangeLimit | air in a CT, 0 in other images; never tissue |
//! | rescale missing in some pictures | an error that names the file |
//! | one SOPInstanceUID, several places | pictures of their own |
//! | frames of several orientations or edges | an error |
//!
//! `dicom-object` 0.10 with `dicom-pixeldata` (its codecs in Rust) was tried in place of the parser
//! and the codecs here: it does not open a real MRI series that this reader reads, nor 13 of 22
//! files of a CT slice in all transfer syntaxes, and it has no JPEG-LS.
//!
//! # Sources
//! NEMA, "DICOM PS3.3 C.7.6.2, C.7.6.16; PS3.5; PS3.10", dicom.nema.org.
//!
//! # When not to use it
//! For colour, ultrasound, lossy 12-bit JPEG, and other compressed syntaxes: the error names the
//! syntax.

mod codec;
mod element;
mod pixels;
mod segments;
mod slice;
mod stack;

use crate::source::BYTES_PER_VOXEL;
use crate::{Format, Import, Note, ReadError, Segmentation, VoxelVolume, open_regular, room_for, room_for_voxels};
use glam::DVec3;
use rayon::prelude::*;
use slice::Slice;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Most files examined in a folder.
const MOST_FILES: usize = 20_000;

/// Depth of subfolders searched.
const DEEPEST: usize = 4;

/// Hint on choosing a series.
const LIST: &str =
    "`inspect FOLDER` and `case series FOLDER` list them with the numbers that --ct-series and --mri-series take";

/// Pictures decoded at a time, so that few files are in memory beside the volume.
const BATCH: usize = 16;

/// A stack of pictures of one size and orientation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// CT, MR or another modality's two letters.
    pub modality: String,
    /// The series' number at the scanner.
    pub number: Option<i64>,
    /// Pictures.
    pub slices: usize,
    /// Columns and rows of a picture.
    pub size: [usize; 2],
    /// Distinct places along the slices' normal.
    pub places: usize,
    /// Edges of a voxel along columns, rows and slices, mm; `None` if the pictures make no volume.
    pub spacing_mm: Option<[f64; 3]>,
    /// Axial, coronal, sagittal or oblique.
    pub direction: &'static str,
    /// Echo time, ms.
    pub echo_ms: Option<f64>,
    /// Repetition time, ms.
    pub repetition_ms: Option<f64>,
    /// Technical words of the descriptions of series and protocol; nothing else of them is read.
    pub description: String,
}

impl std::fmt::Display for Series {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [columns, rows] = self.size;
        write!(f, "{}, {} slices of {columns}x{rows} at {} places", self.modality, self.slices, self.places)?;
        match self.spacing_mm {
            Some([x, y, z]) => write!(f, ", {x:.3} x {y:.3} x {z:.3} mm, {}", self.direction)?,
            None => write!(f, ", no volume, {}", self.direction)?,
        }
        self.echo_ms.map_or(Ok(()), |ms| write!(f, ", TE {ms} ms"))?;
        self.repetition_ms.map_or(Ok(()), |ms| write!(f, ", TR {ms} ms"))?;
        self.number.map_or(Ok(()), |n| write!(f, ", number {n} at the scanner"))?;
        if self.description.is_empty() { Ok(()) } else { write!(f, ", {}", self.description) }
    }
}

/// The format.
pub const FORMAT: Format = Format { name: "DICOM", file: Path::to_path_buf, starts, import: import_number };

fn starts(bytes: &[u8]) -> bool {
    bytes.get(128..132) == Some(b"DICM") || matches!(bytes, [2 | 8, 0, _, 0, ..])
}

/// Reads the largest series of a folder, or the one that a file belongs to.
pub fn read(path: &Path) -> Result<VoxelVolume<f32>, ReadError> {
    import(path).map(|import| import.volume)
}

/// Reads the largest series of a folder, or the one of a file, with notes.
pub fn import(path: &Path) -> Result<Import, ReadError> {
    // A bare name lies in the current folder.
    let path = &if path.parent() == Some(Path::new("")) { Path::new(".").join(path) } else { path.into() };
    let groups = Groups::of(path)?;
    let wanted = match path.is_dir() {
        true => Some(groups.largest()),
        false => groups.of_file(path),
    };
    match wanted {
        Some(wanted) => groups.read(path, wanted),
        None => Err(no_picture(path)),
    }
}

fn import_number(path: &Path, number: Option<usize>) -> Result<Import, ReadError> {
    number.map_or_else(|| import(path), |number| import_series(path, number))
}

/// Reads the series at an index of [`series`]'s list, from 0.
pub fn import_series(folder: &Path, index: usize) -> Result<Import, ReadError> {
    if folder.is_file() {
        let found = format!("it is a file, and series {index} is asked for");
        let remedy = "series are numbered in a folder: give the folder, or the file without a number";
        return Err(ReadError::Series { folder: folder.into(), found, remedy });
    }
    Groups::of(folder)?.read(folder, index)
}

/// Lists the series in a folder and its subfolders, ordered by the names of their first files.
pub fn series(folder: &Path) -> Result<Vec<Series>, ReadError> {
    Ok(Groups::of(folder)?.groups.iter().map(|group| summary(group)).collect())
}

fn no_picture(path: &Path) -> ReadError {
    let found = "no DICOM picture lies in it".into();
    ReadError::Series { folder: path.into(), found, remedy: "give the folder that holds the slices, or an image file" }
}

/// Reads a segmentation (modality SEG), its segments by name.
pub(crate) fn segmentation(path: &Path) -> Result<Segmentation, ReadError> {
    let bytes = bytes_of(path)?;
    let slice = Slice::parse(path, &bytes)?.ok_or_else(|| no_picture(path))?;
    segments::read(&slice, &bytes)
}

/// Whether a file is a segmentation.
pub(crate) fn is_segmentation(path: &Path) -> bool {
    path.is_file() && looked_at(path).is_ok_and(|slice| slice.is_some_and(|slice| !slice.segments.is_empty()))
}

struct Groups {
    groups: Vec<Vec<Slice>>,
    passed_over: usize,
    twice: usize,
}

impl Groups {
    fn of(path: &Path) -> Result<Self, ReadError> {
        let folder = if path.is_dir() { path } else { path.parent().unwrap_or(Path::new(".")) };
        let mut files: Vec<PathBuf> = path.is_file().then(|| path.to_owned()).into_iter().collect();
        collect(folder, if path.is_dir() { DEEPEST } else { 0 }, &mut files)?;
        let mut found = Self { groups: Vec::new(), passed_over: 0, twice: 0 };
        let again = |(n, file): &(usize, PathBuf)| *n > 0 && file == path;
        for (_, file) in files.into_iter().enumerate().filter(|entry| !again(entry)) {
            match looked_at(&file) {
                Ok(Some(slice)) => found.add(slice),
                Err(error) if file == path => return Err(error),
                _ => found.passed_over += 1,
            }
        }
        found.groups = std::mem::take(&mut found.groups).into_iter().flat_map(split).collect();
        Ok(found)
    }

    /// Adds a picture; copies are ignored. A careless anonymiser gives all pictures one identifier.
    fn add(&mut self, slice: Slice) {
        let same = |known: &Slice| {
            !slice.instance.is_empty()
                && known.instance == slice.instance
                && (&known.positions, &known.part) == (&slice.positions, &slice.part)
        };
        if self.groups.iter().flatten().any(same) {
            self.twice += 1;
            return;
        }
        match self.groups.iter_mut().find(|group| belongs(&group[0], &slice)) {
            Some(group) => group.push(slice),
            None => self.groups.push(vec![slice]),
        }
    }

    /// The group that makes the volume with the most voxels, else the one with the most pictures.
    fn largest(&self) -> usize {
        let size = |n: &usize| {
            let Series { spacing_mm, places, size, slices, .. } = summary(&self.groups[*n]);
            (spacing_mm.map_or(0, |_| places * size[0] * size[1]), slices, std::cmp::Reverse(*n))
        };
        (0..self.groups.len()).max_by_key(size).unwrap_or(0)
    }

    fn of_file(&self, path: &Path) -> Option<usize> {
        self.groups.iter().position(|group| group.iter().any(|slice| slice.file == path))
    }

    fn read(&self, path: &Path, index: usize) -> Result<Import, ReadError> {
        let Some(group) = self.groups.get(index) else {
            let found = match self.groups.len() {
                0 => return Err(no_picture(path)),
                1 => format!("there is no series {index}: it holds one, number 0"),
                n => format!("there is no series {index}: it holds {n}, numbered 0 to {}", n - 1),
            };
            return Err(ReadError::Series { folder: path.into(), found, remedy: LIST });
        };
        let mut notes = Vec::new();
        if self.groups.len() > 1 {
            notes.push(Note::OneOf { what: "series", count: self.groups.len(), chosen: index });
        }
        if self.passed_over > 0 && path.is_dir() {
            notes.push(Note::Skipped { count: self.passed_over, why: "they are no DICOM pictures or cannot be read" });
        }
        if self.twice > 0 {
            notes.push(Note::Skipped { count: self.twice, why: "the same pictures lie there twice" });
        }
        let all =
            self.groups.iter().flatten().filter(|slice| slice.series == group[0].series).map(|slice| slice.frames);
        let (all, chosen) = (all.sum::<usize>(), group.iter().map(|slice| slice.frames).sum::<usize>());
        if 5 * chosen < 4 * all {
            notes.push(Note::PartOfSeries { chosen, all });
        }
        if !group[0].segments.is_empty() {
            let remedy = "give it with --tissue CLASS=PATH:NAME or --labels, and a CT or an MRI as image";
            let found = "SEG: it is a segmentation, no image".into();
            return Err(ReadError::Field { file: group[0].file.clone(), field: "Modality", found, remedy });
        }
        check_rescale(group)?;
        let stack = stack::stack(path, &group.iter().collect::<Vec<_>>()).map_err(|fault| self.with_others(fault))?;
        notes.extend(stack.notes.clone());
        crate::source::check_affine(
            path,
            "ImagePositionPatient, ImageOrientationPatient or PixelSpacing",
            stack.world_from_voxel,
        )?;
        let (volume, padded) = voxels(path, &stack)?;
        if padded > 0 {
            notes.push(Note::Padded { voxels: padded });
        }
        let modality = Some(group[0].modality.clone()).filter(|modality| !modality.is_empty());
        let first = &group[0];
        let signed = if first.signed { "signed" } else { "unsigned" };
        let mut facts = vec![
            ("transform", "position and orientation of the slices, LPS turned to RAS".into()),
            ("stored numbers", format!("{signed}, {} of {} bits", first.bits_stored, first.bits_allocated)),
            ("transfer syntax", first.syntax.clone()),
            ("series", summary(group).to_string()),
        ];
        facts.extend(first.rescale.first().map(|[slope, intercept]| ("rescale", format!("{slope} v + {intercept}"))));
        Ok(Import { modality, facts, ..Import::new(volume, notes) })
    }

    /// Adds what else lies in the folder to the error of a series.
    fn with_others(&self, fault: ReadError) -> ReadError {
        let ReadError::Series { folder, mut found, remedy } = fault else { return fault };
        if self.twice > 0 {
            found += &format!("; {} files were left out as copies of others", self.twice);
        }
        for (n, group) in self.groups.iter().enumerate().take(20).filter(|_| self.groups.len() > 1) {
            found += &format!("; series {n}: {}", summary(group));
        }
        ReadError::Series { folder, found, remedy: if self.groups.len() > 1 { LIST } else { remedy } }
    }
}

/// Rejects a series in which some pictures lack the slope or the intercept that others have.
fn check_rescale(group: &[Slice]) -> Result<(), ReadError> {
    let has = |slice: &Slice| slice.scaled.iter().filter(|has| **has).count();
    let most = group.iter().max_by_key(|slice| has(slice)).map_or([false; 2], |slice| slice.scaled);
    let lacking = group.iter().filter(|slice| slice.scaled != most);
    match lacking.clone().next() {
        None => Ok(()),
        Some(slice) => Err(ReadError::Field {
            file: slice.file.clone(),
            field: "RescaleSlope or RescaleIntercept",
            found: format!("missing here, as in {} of {} pictures", lacking.count(), group.len()),
            remedy: "without it those pictures have other values than the rest; export the series again",
        }),
    }
}

/// Splits pictures of one series that repeat places or lie unevenly.
///
/// They are told apart by acquisition, echo, kind of image or phase, whichever leaves the most
/// pictures in volumes.
fn split(group: Vec<Slice>) -> Vec<Vec<Slice>> {
    let Err(fault) = stack::stack(Path::new(""), &group.iter().collect::<Vec<_>>()) else { return vec![group] };
    // Where slices are missing, a part must not pass for the whole.
    let least = if fault.to_string().contains("are missing") { 0.8 } else { 0.4 } * summary(&group).places as f64;
    let reads = |part: &[&Slice]| part.len() as f64 >= least && stack::stack(Path::new(""), part).is_ok();
    let key = |slice: &Slice, by: usize| slice.part.get(by).map_or_else(|| slice.part.join("\\"), String::clone);
    let parts_by = |by: usize| {
        let mut parts: Vec<(String, Vec<&Slice>)> = Vec::new();
        for slice in &group {
            let key = key(slice, by);
            match parts.iter_mut().find(|part| part.0 == key) {
                Some(part) => part.1.push(slice),
                None => parts.push((key, vec![slice])),
            }
        }
        parts
    };
    // The last one is all four together.
    let in_volumes = |by: &usize| -> usize {
        let parts = parts_by(*by);
        parts.iter().filter(|part| part.1.len() > 1 && reads(&part.1)).map(|part| part.1.len()).sum()
    };
    let counts: Vec<usize> = (0..5).map(|by| in_volumes(&by)).collect();
    let most = counts.iter().copied().max().unwrap_or(0);
    let Some(by) = counts.iter().position(|&count| count == most && most > 0) else { return vec![group] };
    let keys: Vec<String> = parts_by(by).into_iter().map(|part| part.0).collect();
    let mut out: Vec<Vec<Slice>> = keys.iter().map(|_| Vec::new()).collect();
    for slice in group {
        let of = key(&slice, by);
        if let Some(at) = keys.iter().position(|key| *key == of) {
            out[at].push(slice);
        }
    }
    out
}

/// The voxels of a stack, and how many were padding.
fn voxels(path: &Path, stack: &stack::Stack) -> Result<(VoxelVolume<f32>, usize), ReadError> {
    let first = stack.pictures[0].slice;
    let count = (first.rows * first.columns) as u64 * stack.pictures.len() as u64;
    let too_large = |source| ReadError::TooLarge { file: path.into(), field: "Rows, Columns and slices", source };
    room_for_voxels(count, BYTES_PER_VOXEL).map_err(too_large)?;
    let several = stack.pictures.iter().filter(|p| p.frame == 0 && p.slice.frames > 1).map(|p| &p.slice.file);
    let open = several.map(|file| Ok((file, bytes_of(file)?))).collect::<Result<Vec<_>, ReadError>>()?;
    let decoded = |picture: &stack::Picture| {
        let mut values = Vec::new();
        let padded = match open.iter().find(|(file, _)| **file == picture.slice.file) {
            Some((_, bytes)) => pixels::frame(picture.slice, bytes, picture.frame, &mut values)?,
            None => pixels::frame(picture.slice, &bytes_of(&picture.slice.file)?, picture.frame, &mut values)?,
        };
        Ok((values, padded))
    };
    let (mut data, mut padded) = (Vec::new(), 0);
    for batch in stack.pictures.chunks(BATCH) {
        let pictures: Vec<(Vec<f32>, usize)> = batch.par_iter().map(decoded).collect::<Result<_, ReadError>>()?;
        for (values, of_picture) in &pictures {
            data.extend_from_slice(values);
            padded += of_picture;
        }
    }
    let dims = [first.columns, first.rows, stack.pictures.len()];
    Ok((VoxelVolume { dims, data, world_from_voxel: stack.world_from_voxel }, padded))
}

fn looked_at(file: &Path) -> Result<Option<Slice>, ReadError> {
    let mut source = crate::source::Source::open_plain(file)?;
    if !starts(source.peek(132)?) {
        return Ok(None);
    }
    Slice::parse(file, &bytes_of(file)?)
}

fn bytes_of(file: &Path) -> Result<Vec<u8>, ReadError> {
    let io = |source| ReadError::Io { file: file.into(), source };
    let mut stream = open_regular(file).map_err(io)?;
    let length = stream.metadata().map_err(io)?.len();
    let too_large = |source| ReadError::TooLarge { file: file.into(), field: "the file", source };
    room_for("bytes", length, 1).map_err(too_large)?;
    let mut bytes = Vec::new();
    std::io::Read::read_to_end(&mut stream, &mut bytes).map_err(io)?;
    slice::inflated(file, bytes)
}

/// Whether two slices have the same series, orientation, size and spacing.
fn belongs(a: &Slice, b: &Slice) -> bool {
    let turned = match (a.orientation, b.orientation) {
        (Some(a), Some(b)) => !slice::alike(a, b),
        (a, b) => a.is_some() != b.is_some(),
    };
    let resized = match (a.spacing, b.spacing) {
        (Some(a), Some(b)) => !slice::near(a, b),
        (a, b) => a.is_some() != b.is_some(),
    };
    a.series == b.series && !turned && !resized && (a.rows, a.columns) == (b.rows, b.columns)
}

fn summary(group: &[Slice]) -> Series {
    let first = &group[0];
    let stack = stack::stack(Path::new(""), &group.iter().collect::<Vec<_>>()).ok();
    let normal = first.orientation.map_or(DVec3::ZERO, |[row, column]| row.cross(column));
    let heights = group.iter().flat_map(|slice| &slice.positions).map(|p| (normal.dot(*p) * 1e3).round() as i64);
    let spacing_mm = stack.map(|stack| {
        let m = stack.world_from_voxel.matrix3;
        [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()]
    });
    Series {
        modality: first.modality.clone(),
        number: first.number,
        slices: group.iter().map(|slice| slice.frames).sum(),
        size: [first.columns, first.rows],
        places: heights.collect::<HashSet<_>>().len(),
        spacing_mm,
        direction: match normal.abs().to_array() {
            [_, _, z] if z > 0.9 => "axial",
            [_, y, _] if y > 0.9 => "coronal",
            [x, _, _] if x > 0.9 => "sagittal",
            _ => "oblique",
        },
        echo_ms: first.echo_ms,
        repetition_ms: first.repetition_ms,
        description: first.description.clone(),
    }
}

/// Collects the files of a folder by name, then those of its subfolders.
fn collect(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<(), ReadError> {
    let io = |source| ReadError::Io { file: folder.into(), source };
    let mut entries = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        entries.push((entry.file_type().map_err(io)?.is_dir(), entry.path()));
    }
    entries.sort();
    for (is_folder, path) in entries {
        if is_folder && depth > 0 {
            collect(&path, depth - 1, files)?;
        } else if !is_folder && files.len() < MOST_FILES {
            files.push(path);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
