//! Writes files atomically.

use crate::{Sample, WriteError};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes next to `path` and renames at the end, so that a crash or a full disk cannot damage the
/// old file.
pub(crate) fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut std::fs::File>) -> io::Result<()>,
) -> Result<(), WriteError> {
    let io = |source| WriteError::Io { file: path.into(), source };
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".trepan-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(io)?;
    let mut buffered = BufWriter::with_capacity(1 << 16, file.as_file_mut());
    write(&mut buffered).and_then(|()| buffered.flush()).map_err(io)?;
    drop(buffered);
    file.as_file().sync_all().map_err(io)?;
    file.persist(path).map_err(|e| io(e.error))?;
    Ok(())
}

/// Writes little-endian voxels in chunks.
pub(crate) fn write_voxels<T: Sample>(to: &mut impl Write, data: &[T]) -> io::Result<()> {
    let mut bytes = Vec::with_capacity(1 << 16);
    for part in data.chunks(1 << 13) {
        bytes.clear();
        part.iter().for_each(|v| v.write_le(&mut bytes));
        to.write_all(&bytes)?;
    }
    Ok(())
}
