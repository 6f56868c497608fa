//! Descriptor of a mesh format: what it is called, how it is recognised, read and written.

use crate::file::{FileError, Import};
use std::path::Path;

/// A file format of tetrahedra or of a surface.
#[derive(Debug)]
pub struct Format<M> {
    /// Its name with the endings, as an error lists it.
    pub name: &'static str,
    /// Endings of its files' names: lower case, without the dot.
    pub endings: &'static [&'static str],
    /// The texts that its files may begin with. Without any, the ending decides.
    pub starts: &'static [&'static str],
    /// Reads a file, with notes. Only indices need to be checked.
    pub import: fn(&Path) -> Result<Import<M>, FileError>,
    /// Writes a file, atomically.
    pub write: fn(&Path, &M) -> Result<(), FileError>,
}
