//! Opens regular files only: no pipe, device, socket or folder.

use std::fs::{self, File, FileType};
use std::io;
use std::path::Path;

/// Opens a regular file. Other kinds are rejected before opening, since opening a named pipe waits
/// for its writer.
pub fn open_regular(path: &Path) -> io::Result<File> {
    let kind = fs::metadata(path)?.file_type();
    match kind.is_file() {
        true => File::open(path),
        false => Err(io::Error::other(format!("it is {}, not a regular file", name_of(kind)))),
    }
}

/// Reads a whole regular file.
pub fn read_regular(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    io::Read::read_to_end(&mut open_regular(path)?, &mut bytes)?;
    Ok(bytes)
}

#[cfg(unix)]
fn name_of(kind: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    match kind {
        _ if kind.is_dir() => "a folder",
        _ if kind.is_fifo() => "a named pipe",
        _ if kind.is_socket() => "a socket",
        _ => "a device",
    }
}

#[cfg(not(unix))]
fn name_of(kind: FileType) -> &'static str {
    if kind.is_dir() { "a folder" } else { "a device" }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn pipes_devices_and_folders_are_refused_by_name() {
        let home = tempfile::tempdir().unwrap();
        let pipe = home.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let fault = |path: &Path| open_regular(path).unwrap_err().to_string();
        assert!(fault(&pipe).contains("a named pipe"), "{}", fault(&pipe));
        assert!(fault(Path::new("/dev/null")).contains("a device"));
        assert!(fault(home.path()).contains("a folder"));
    }
}
