//! Errors of writing a session's files.

use std::path::{Path, PathBuf};

/// Error that keeps files from being written. All but an internal one can be corrected by the user.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// Invalid request, or files that cannot be read.
    #[error("{0}")]
    Usage(String),
    /// Output file or folder that cannot be written.
    #[error("cannot write {}: {fault}; give another folder with --out", path.display())]
    Output {
        /// Path of the file or folder.
        path: PathBuf,
        /// Cause.
        fault: std::io::Error,
    },
    /// Internal error, which the user cannot correct.
    #[error("{0}")]
    Internal(String),
}

impl ReportError {
    /// Returns the constructor of the error of an output file at `path`.
    pub fn output(path: &Path) -> impl Fn(std::io::Error) -> Self + Copy {
        move |fault| Self::Output { path: path.into(), fault }
    }
}
