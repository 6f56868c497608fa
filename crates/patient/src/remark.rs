//! Remarks on a case: those that say that all is well end with [`WELL`], and are no warnings.

/// End of a remark on what is as it should be.
pub const WELL: &str = ", as it should be";

/// Logs a remark: as information if all is well, else as a warning.
pub fn log(remark: &str) {
    if remark.ends_with(WELL) { tracing::info!("{remark}") } else { tracing::warn!("{remark}") }
}
