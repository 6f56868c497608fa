//! Writes files that appear whole or not at all.

use crate::error::SessionError;
use std::io::Write;
use std::path::Path;

/// Writes a file atomically.
pub(crate) fn whole(path: &Path, bytes: &[u8]) -> Result<(), SessionError> {
    let failed = SessionError::output(path);
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    file.persist(path).map(drop).map_err(|fault| failed(fault.error))
}
