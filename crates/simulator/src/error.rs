//! Errors before and after a session, and their exit codes.

use std::path::{Path, PathBuf};
use trepan_models::ModelError;
use trepan_patient::PatientError;
use trepan_report::ReportError;
use trepan_runtime::WatchError;

/// Error that keeps a session from starting or from writing its files. Errors that the user can
/// correct exit with 2, others with 1.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// Invalid flag or combination of flags.
    #[error("{0}")]
    Usage(String),
    /// A case that cannot be opened, or loading that the user cancelled.
    #[error(transparent)]
    Patient(#[from] PatientError),
    /// Models that cannot be measured or made.
    #[error(transparent)]
    Model(ModelError),
    /// Unreadable image.
    #[error(transparent)]
    Read(#[from] trepan_volume::ReadError),
    /// A case that a program cannot use.
    #[error("{0}")]
    Case(String),
    /// Unknown or missing device.
    #[error("--device: {0}")]
    Device(String),
    /// Recording that cannot be read or created.
    #[error(transparent)]
    Recording(#[from] trepan_link::LinkError),
    /// Output file or folder that cannot be written.
    #[error("cannot write {}: {fault}; give another folder with --out", path.display())]
    Output {
        /// Path of the file or folder.
        path: PathBuf,
        /// Cause.
        fault: std::io::Error,
    },
    /// Picture that cannot be rendered.
    #[error(transparent)]
    Picture(#[from] trepan_render::RenderError),
    /// Internal error, which the user cannot correct.
    #[error("{0}")]
    Internal(String),
}

impl SessionError {
    /// Returns the constructor of the error of an output file at `path`.
    pub(crate) fn output(path: &Path) -> impl Fn(std::io::Error) -> Self + Copy {
        move |fault| Self::Output { path: path.into(), fault }
    }

    /// Exit code: 2 for errors that the user can correct, else 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Picture(_) | Self::Internal(_) | Self::Patient(PatientError::Internal(_)) => 1,
            Self::Model(fault) if fault.is_internal() => 1,
            _ => 2,
        }
    }
}

impl From<ReportError> for SessionError {
    fn from(fault: ReportError) -> Self {
        match fault {
            ReportError::Usage(text) => Self::Usage(text),
            ReportError::Output { path, fault } => Self::Output { path, fault },
            ReportError::Internal(text) => Self::Internal(text),
        }
    }
}

impl From<WatchError> for SessionError {
    fn from(fault: WatchError) -> Self {
        Self::Usage(fault.to_string())
    }
}

impl From<ModelError> for SessionError {
    fn from(fault: ModelError) -> Self {
        match fault {
            ModelError::Patient(fault) => Self::Patient(fault),
            fault => Self::Model(fault),
        }
    }
}
