//! Writes files that appear whole or not at all.

use crate::ReportError;
use std::io::Write;
use std::path::Path;

/// Writes a file atomically.
pub fn whole(path: &Path, bytes: &[u8]) -> Result<(), ReportError> {
    let failed = ReportError::output(path);
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    file.persist(path).map(drop).map_err(|fault| failed(fault.error))
}
