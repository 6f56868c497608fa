//! What can go wrong before and around a session, and the exit code that says so.

use std::path::PathBuf;

/// A session that could not begin or end. Everything that the user can put right exits with 2, the
/// rest with 1.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// A flag or a combination of flags.
    #[error("{0}")]
    Usage(String),
    /// An image that cannot be read.
    #[error(transparent)]
    Read(#[from] trepan_volume::ReadError),
    /// Images that do not make a case.
    #[error("{0}")]
    Case(String),
    /// A device that is not known or not there.
    #[error("--device: {0}")]
    Device(String),
    /// A recording that cannot be read or begun.
    #[error(transparent)]
    Recording(#[from] trepan_link::LinkError),
    /// A file or folder of the output.
    #[error("cannot write {}: {fault}; give another folder with --out", path.display())]
    Output {
        /// Which.
        path: PathBuf,
        /// Why.
        fault: std::io::Error,
    },
    /// Anything that is not the user's to mend.
    #[error("{0}")]
    Internal(String),
}

impl SessionError {
    /// 2 for what the user can put right, 1 for the rest.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Internal(_) => 1,
            _ => 2,
        }
    }
}
