//! Notes of a reader about a file that it could read.

use crate::{Sample, VoxelVolume};

/// A volume with its reader's notes.
#[derive(Clone, Debug)]
pub struct Import<T = f32> {
    /// The volume.
    pub volume: VoxelVolume<T>,
    /// Notes for the user; empty for an ordinary file.
    pub notes: Vec<Note>,
    /// CT, MR or another modality's two letters, where the format says it (DICOM).
    pub modality: Option<String>,
    /// What the reader saw, by name: format, stored numbers, unit, which transform was taken.
    pub facts: Vec<(&'static str, String)>,
}

/// A property of a file that is not an error but matters to the user.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Note {
    /// Voxels that are not finite.
    #[error("{count} voxels hold no number (NaN or infinite)")]
    NotANumber {
        /// How many.
        count: usize,
    },
    /// Left and right are a guess.
    #[error(
        "the file does not say how the patient lies ({field}); the format's default is taken, so check left and right"
    )]
    NoOrientation {
        /// The field that would define it.
        field: &'static str,
    },
    /// Two orientations that differ.
    #[error("{used} and {ignored} differ by up to {by_mm:.2} mm at the corners; {used} is used")]
    TwoOrientations {
        /// The field that is used.
        used: &'static str,
        /// The field that is not.
        ignored: &'static str,
        /// Largest distance between where the two put a corner.
        by_mm: f64,
    },
    /// A field that is not as it should be, and what was done.
    #[error("{field} is {found}: {taken}")]
    Unusual {
        /// The field.
        field: &'static str,
        /// Its value.
        found: String,
        /// What was done instead, and what to check.
        taken: &'static str,
    },
    /// One of several was read.
    #[error("{count} {what} are in there; number {chosen} (from 0) is read")]
    OneOf {
        /// What there are several of.
        what: &'static str,
        /// How many.
        count: usize,
        /// The index read.
        chosen: usize,
    },
    /// The stack is tilted.
    #[error("the gantry was tilted: the stack leans by {degrees:.1} degrees, which is kept as it is")]
    Tilt {
        /// Angle between the stack and the slices' normal.
        degrees: f64,
    },
    /// Padding of the scanner was replaced.
    #[error("{voxels} voxels outside the scanner's field of view (PixelPaddingValue) are taken as air")]
    Padded {
        /// How many.
        voxels: usize,
    },
    /// Positions were rounded by their writer.
    #[error(
        "the slices' positions are rounded to the digits they are written with: up to {by_mm:.3} mm off an even line, which is taken"
    )]
    Rounded {
        /// Largest distance from the even line, mm.
        by_mm: f64,
    },
    /// A series was split.
    #[error(
        "{chosen} of the {all} pictures of this series are read: the others differ in size, edges, orientation, acquisition, echo, kind or phase, or repeat a place"
    )]
    PartOfSeries {
        /// Pictures that are read.
        chosen: usize,
        /// Pictures of the scanner's series.
        all: usize,
    },
    /// Files that were skipped.
    #[error("{count} files were passed over: {why}")]
    Skipped {
        /// How many.
        count: usize,
        /// Why.
        why: &'static str,
    },
}

impl<T: Sample> Import<T> {
    pub(crate) fn new(volume: VoxelVolume<T>, mut notes: Vec<Note>) -> Self {
        let count = volume.data.iter().filter(|v| !v.to_f32().is_finite()).count();
        if count > 0 {
            notes.push(Note::NotANumber { count });
        }
        Self { volume, notes, modality: None, facts: Vec::new() }
    }
}
