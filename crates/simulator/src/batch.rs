//! Replays a folder of recordings as one job: `--device replay:FOLDER`; `--shard I/N` takes every
//! Nth.
//!
//! # Practice
//! Each recording gets its own folder under `--out`, named after it. A recording that fails or is
//! incomplete is reported and does not stop the others. Cluster jobs take one shard each and are
//! independent; `cargo xtask merge` merges their summaries into one table.

use crate::error::SessionError;
use crate::session::{Place, Session, SessionResult};
use crate::{Inputs, Options, Program};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use trepan_haptics::DeviceName;
use trepan_report::output::dated;
use trepan_report::printable::printable;

/// Lists the recordings of this shard in the order of their names. `None` if `--device` is not a
/// folder of recordings.
pub(crate) fn recordings(options: &Options) -> Result<Option<Vec<PathBuf>>, SessionError> {
    let named = options.device.as_deref().and_then(|name| name.parse::<DeviceName>().ok());
    let folder = match named.as_ref().and_then(DeviceName::recording) {
        Some(path) if path.is_dir() => path,
        _ if options.shard.is_some() => {
            let fault = "--shard needs a folder of recordings: give --device replay:FOLDER";
            return Err(SessionError::Usage(fault.into()));
        }
        _ => return Ok(None),
    };
    let read = |fault| SessionError::Usage(format!("--device replay:{}: {fault}", folder.display()));
    let entries = std::fs::read_dir(folder).map_err(|fault| read(fault.to_string()))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|file| file.extension() == Some(OsStr::new("mcap")));
    if files.is_empty() {
        return Err(read("there is no .mcap in this folder".into()));
    }
    files.sort();
    let (shard, of) = options.shard.unwrap_or((0, 1));
    Ok(Some(files.into_iter().enumerate().filter(|(at, _)| at % of == shard).map(|(_, file)| file).collect()))
}

/// Replays recordings one after the other; returns the number of failures.
pub(crate) fn run(program: Program, options: &Options, built_in: &Inputs, files: &[PathBuf], place: &Place) -> usize {
    let out = options.out.clone().unwrap_or_else(|| dated(program, None, options.name.as_deref()));
    let failed = |file: &&PathBuf| match one(program, options, built_in, file, (&out, place)) {
        Ok(line) => {
            println!("{}: {line}", printable(&file.display().to_string()));
            false
        }
        Err(fault) => {
            eprintln!("{}", printable(&format!("{}: {fault}", file.display())));
            true
        }
    };
    files.iter().filter(failed).count()
}

fn one(
    program: Program,
    options: &Options,
    built_in: &Inputs,
    file: &Path,
    (out, place): (&Path, &Place),
) -> Result<String, SessionError> {
    let options = Options {
        device: Some(format!("replay:{}", file.display())),
        out: Some(out.join(file.file_stem().unwrap_or_default())),
        shard: None,
        record: None,
        ..options.clone()
    };
    let SessionResult { summary, lack, .. } =
        Session::open_in(program, options, built_in.clone(), place.clone())?.run()?;
    let replay = summary.replay.unwrap_or_default();
    let text = format!("{}, {:.1} mm3 removed", replay.describe(), summary.bone_removed_mm3);
    match lack {
        Some(lack) => Err(SessionError::Usage(format!("{text}; {lack}"))),
        None => Ok(text),
    }
}
