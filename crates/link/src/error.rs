//! Recording errors, with the file's name and the remedy.

use std::path::PathBuf;

/// A recording could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The file could not be created.
    #[error("cannot create the recording {}: {source}; choose a folder that exists and that you may write to", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// Writing failed. Later calls fail too; flushed data stay readable.
    #[error("cannot write to the recording {}: {reason}; free some disk space or record elsewhere; what was flushed before can still be opened", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// The file could not be opened or read.
    #[error("cannot read the recording {}: {source}; check the name and the rights to read it", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The file is not an MCAP file.
    #[error("{} is not a recording: it does not begin as an MCAP file does; give a file that --record wrote", path.display())]
    NotARecording {
        /// The file.
        path: PathBuf,
    },
    /// The file ends, or is damaged, before the session header.
    #[error("{} holds no session header: it was cut in its first bytes or another program wrote it; give a file that --record wrote", path.display())]
    NoHeader {
        /// The file.
        path: PathBuf,
    },
    /// A chunk is compressed in a way that is not read.
    #[error("{}: its chunks are compressed by {found:?}, which is not read; write it again with lz4, zstd or no compression, as `mcap compress` does", path.display())]
    Compression {
        /// The file.
        path: PathBuf,
        /// The name of the compression.
        found: String,
    },
    /// No tick of a file can be saved.
    #[error("no tick of {} can be saved, so nothing was written; fetch the file again, or a copy of it", path.display())]
    NothingToSave {
        /// The file.
        path: PathBuf,
    },
    /// A repair would overwrite its input.
    #[error("cannot repair {} onto itself; give the repaired file another name", path.display())]
    SameFile {
        /// The file.
        path: PathBuf,
    },
    /// The file was made by a later version.
    #[error("{} has recording format {found}, this program reads up to {known}; open it with a newer version", path.display())]
    TooNew {
        /// The file.
        path: PathBuf,
        /// Its format.
        found: u32,
        /// The newest format that this version reads.
        known: u32,
    },
}
