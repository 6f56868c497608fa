//! Writes files atomically.

use crate::Sample;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes next to `path` and renames at the end, so that a crash or a full disk cannot damage the
/// old file.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut std::fs::File>) -> io::Result<()>,
) -> io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".trepan-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    let mut buffered = BufWriter::with_capacity(1 << 16, file.as_file_mut());
    write(&mut buffered).and_then(|()| buffered.flush())?;
    drop(buffered);
    file.as_file().sync_all()?;
    file.persist(path).map(drop).map_err(|fault| fault.error)
}

/// Writes little-endian voxels in chunks.
pub(crate) fn write_voxels<T: Sample>(to: &mut impl Write, data: &[T]) -> io::Result<()> {
    let mut bytes = Vec::with_capacity(1 << 16);
    for part in data.chunks(1 << 13) {
        bytes.clear();
        T::write_le(part, &mut bytes);
        to.write_all(&bytes)?;
    }
    Ok(())
}
