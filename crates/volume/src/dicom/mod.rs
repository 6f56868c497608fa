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
//! one with the most slices is read and a note reports it; [`series`] lists them. Doubled, missing
//! and uneven slices are rejected. Only the elements that place and scale voxels are read: no name,
//! date, identifier or free text of a patient is stored or shown.
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
mod slice;
mod stack;

use crate::source::BYTES_PER_VOXEL;
use crate::{Format, Import, Note, ReadError, VoxelVolume, open_regular, room_for, room_for_voxels};
use rayon::prelude::*;
use slice::Slice;
use std::path::{Path, PathBuf};

/// Most files examined in a folder.
const MOST_FILES: usize = 20_000;

/// Depth of subfolders searched.
const DEEPEST: usize = 4;

/// Hint on choosing a series.
const LIST: &str = "`case series FOLDER` lists them with the numbers that --ct-series and --mri-series take";

/// Pictures decoded at a time, so that few files are in memory beside the volume.
const BATCH: usize = 16;

/// A stack of pictures of one size and orientation.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// CT, MR or another modality's two letters.
    pub modality: String,
    /// The series' number at the scanner.
    pub number: Option<i64>,
    /// Pictures.
    pub slices: usize,
    /// Columns and rows of a picture.
    pub size: [usize; 2],
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
        Ok(found)
    }

    /// Adds a picture; duplicates are ignored.
    fn add(&mut self, slice: Slice) {
        let same = |known: &Slice| !slice.instance.is_empty() && known.instance == slice.instance;
        if self.groups.iter().flatten().any(same) {
            self.twice += 1;
            return;
        }
        match self.groups.iter_mut().find(|group| belongs(&group[0], &slice)) {
            Some(group) => group.push(slice),
            None => self.groups.push(vec![slice]),
        }
    }

    fn largest(&self) -> usize {
        let size = |n: &usize| (summary(&self.groups[*n]).slices, std::cmp::Reverse(*n));
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
        let stack = stack::stack(path, &group.iter().collect::<Vec<_>>())?;
        notes.extend(stack.tilt.clone());
        crate::source::check_affine(
            path,
            "ImagePositionPatient, ImageOrientationPatient or PixelSpacing",
            stack.world_from_voxel,
        )?;
        let volume = voxels(path, &stack)?;
        let modality = Some(group[0].modality.clone()).filter(|modality| !modality.is_empty());
        let facts = vec![("transform", "position and orientation of the slices, LPS turned to RAS".into())];
        Ok(Import { modality, facts, ..Import::new(volume, notes) })
    }
}

fn voxels(path: &Path, stack: &stack::Stack) -> Result<VoxelVolume<f32>, ReadError> {
    let first = stack.pictures[0].slice;
    let count = (first.rows * first.columns) as u64 * stack.pictures.len() as u64;
    let too_large = |source| ReadError::TooLarge { file: path.into(), field: "Rows, Columns and slices", source };
    room_for_voxels(count, BYTES_PER_VOXEL).map_err(too_large)?;
    let several = stack.pictures.iter().filter(|p| p.frame == 0 && p.slice.frames > 1).map(|p| &p.slice.file);
    let open = several.map(|file| Ok((file, bytes_of(file)?))).collect::<Result<Vec<_>, ReadError>>()?;
    let decoded = |picture: &stack::Picture| {
        let mut values = Vec::new();
        match open.iter().find(|(file, _)| **file == picture.slice.file) {
            Some((_, bytes)) => pixels::frame(picture.slice, bytes, picture.frame, &mut values)?,
            None => pixels::frame(picture.slice, &bytes_of(&picture.slice.file)?, picture.frame, &mut values)?,
        }
        Ok(values)
    };
    let mut data = Vec::new();
    for batch in stack.pictures.chunks(BATCH) {
        let pictures: Vec<Vec<f32>> = batch.par_iter().map(decoded).collect::<Result<_, ReadError>>()?;
        pictures.iter().for_each(|values| data.extend_from_slice(values));
    }
    let dims = [first.columns, first.rows, stack.pictures.len()];
    Ok(VoxelVolume { dims, data, world_from_voxel: stack.world_from_voxel })
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
        (Some(a), Some(b)) => (0..2).any(|n| !a[n].abs_diff_eq(b[n], 1e-3)),
        (a, b) => a.is_some() != b.is_some(),
    };
    a.series == b.series && !turned && (a.rows, a.columns, a.spacing) == (b.rows, b.columns, b.spacing)
}

fn summary(group: &[Slice]) -> Series {
    let first = &group[0];
    Series {
        modality: first.modality.clone(),
        number: first.number,
        slices: group.iter().map(|slice| slice.frames).sum(),
        size: [first.columns, first.rows],
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
