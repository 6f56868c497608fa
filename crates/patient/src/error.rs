//! Errors of importing and opening a case.

/// Error that keeps a case from being opened. All but an internal one can be corrected by the
/// user.
#[derive(Debug, thiserror::Error)]
pub enum PatientError {
    /// Invalid request, or files that cannot be found.
    #[error("{0}")]
    Usage(String),
    /// Import that the user cancelled.
    #[error("loading was cancelled")]
    Cancelled,
    /// Unreadable image.
    #[error(transparent)]
    Read(#[from] trepan_volume::ReadError),
    /// Images from which no case can be built.
    #[error("{0}")]
    Case(String),
    /// Internal error, which the user cannot correct.
    #[error("{0}")]
    Internal(String),
}
