//! Descriptor of an image format: what it is called, how it is recognised and read.

use crate::{Import, ReadError};
use std::path::{Path, PathBuf};

/// A file format of volumes.
#[derive(Debug)]
pub struct Format {
    /// Its name with the endings, as an error lists it.
    pub name: &'static str,
    /// The file to look into if this one is named, such as the header beside the voxels.
    pub file: fn(&Path) -> PathBuf,
    /// Whether a file that starts with these bytes (512, decompressed) is of this format.
    pub starts: fn(&[u8]) -> bool,
    /// Reads the named file, with notes; of several volumes in it, the one of a number (from 0).
    pub import: fn(&Path, Option<usize>) -> Result<Import, ReadError>,
}
