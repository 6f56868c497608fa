//! Errors in reading and writing files, with their remedies.

use crate::TooLarge;
use std::io;
use std::path::PathBuf;

/// Why a file was not read. Names the file, the header field and the remedy; never a patient.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file does not exist.
    #[error("{}: no such file; check the spelling of the path", file.display())]
    Missing {
        /// The file.
        file: PathBuf,
    },
    /// The system cannot read the file.
    #[error("{}: cannot be read ({source}); give a file or folder that may be read", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The format is not supported.
    #[error("{}: {found}; readable are {readable}", file.display())]
    Format {
        /// The file.
        file: PathBuf,
        /// The detected content.
        found: String,
        /// The formats that can be read.
        readable: String,
    },
    /// A header field is invalid.
    #[error("{}: {field} is {found}; {remedy}", file.display())]
    Field {
        /// The file.
        file: PathBuf,
        /// The field's name in the format's standard.
        field: &'static str,
        /// Its value.
        found: String,
        /// The remedy.
        remedy: &'static str,
    },
    /// Invalid volume sizes.
    #[error("{}: {field} is {found}; a volume with at least 2 voxels along each of three axes is needed, not a single picture", file.display())]
    Dimensions {
        /// The file.
        file: PathBuf,
        /// The field.
        field: &'static str,
        /// The sizes.
        found: String,
    },
    /// Voxel edges that are zero, negative, not a number, or implausible.
    #[error("{}: {field} gives voxel edges of {found} mm; edges between 0.0001 and 1000 mm are right", file.display())]
    Spacing {
        /// The file.
        file: PathBuf,
        /// The field.
        field: &'static str,
        /// The edges.
        found: String,
    },
    /// The axes are coplanar or not finite.
    #[error("{}: {field} is {found}, which turns the volume into something flat; correct the orientation where the file was made", file.display())]
    Orientation {
        /// The file.
        file: PathBuf,
        /// The field.
        field: &'static str,
        /// The affine.
        found: String,
    },
    /// Fewer bytes than the header states.
    #[error("{}: ends after {found} bytes of the {expected} that its header announces ({what}); the copy is incomplete, fetch the file again", file.display())]
    Truncated {
        /// The file.
        file: PathBuf,
        /// Which part ends early.
        what: &'static str,
        /// Bytes that the part needs.
        expected: u64,
        /// Bytes available (at most).
        found: u64,
    },
    /// Compressed data that cannot be decompressed.
    #[error("{}: the compressed data are damaged ({source}); fetch the file again", file.display())]
    Compression {
        /// The file.
        file: PathBuf,
        /// The decompressor's error.
        source: io::Error,
    },
    /// The volume does not fit into memory.
    #[error("{}: {field}: {source}; crop or resample the volume, or use a machine with more memory", file.display())]
    TooLarge {
        /// The file.
        file: PathBuf,
        /// The field that gives the size.
        field: &'static str,
        /// The size and the limit.
        source: TooLarge,
    },
    /// Slices that do not form a volume.
    #[error("{}: {found}; {remedy}", folder.display())]
    Series {
        /// The folder or file.
        folder: PathBuf,
        /// What is wrong with the slices.
        found: String,
        /// The remedy.
        remedy: &'static str,
    },
    /// Several volumes in one file.
    #[error("{}: {field} announces {found} volumes and {remedy}", file.display())]
    Volumes {
        /// The file.
        file: PathBuf,
        /// The field.
        field: &'static str,
        /// How many.
        found: u64,
        /// How to choose.
        remedy: &'static str,
    },
}

impl ReadError {
    /// The file concerned.
    pub fn file(&self) -> &std::path::Path {
        match self {
            Self::Missing { file }
            | Self::Io { file, .. }
            | Self::Format { file, .. }
            | Self::Field { file, .. }
            | Self::Dimensions { file, .. }
            | Self::Spacing { file, .. }
            | Self::Orientation { file, .. }
            | Self::Truncated { file, .. }
            | Self::Compression { file, .. }
            | Self::TooLarge { file, .. }
            | Self::Series { folder: file, .. }
            | Self::Volumes { file, .. } => file,
        }
    }
}

/// Why a file was not written; an existing file is unchanged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The file name's extension is not supported.
    #[error("{}: the name must end in {expected}", file.display())]
    Name {
        /// The file.
        file: PathBuf,
        /// The supported extensions.
        expected: &'static str,
    },
    /// The volume does not fit the format.
    #[error("{}: {found} voxels do not fit the format; crop or resample the volume", file.display())]
    Dimensions {
        /// The file.
        file: PathBuf,
        /// The sizes.
        found: String,
    },
    /// The system cannot write the file.
    #[error("{}: cannot be written ({source}); check that the folder exists, may be written to and has room", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
}
