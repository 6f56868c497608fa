//! Errors of choosing, measuring and making models.

use trepan_patient::PatientError;

/// Error that keeps models from being measured or made.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// Ingredients that do not go together.
    #[error("{0}")]
    Usage(String),
    /// A case that cannot be opened.
    #[error(transparent)]
    Patient(#[from] PatientError),
    /// Internal error, which the user cannot correct.
    #[error("{0}")]
    Internal(String),
}

impl ModelError {
    /// Whether the user cannot correct it.
    pub fn is_internal(&self) -> bool {
        matches!(self, Self::Internal(_) | Self::Patient(PatientError::Internal(_)))
    }
}
