//! Many recordings run again as one job: `--device replay:FOLDER`, of which `--shard I/N` takes
//! every Nth.
//!
//! # Practice
//! Each recording gets a folder of its own under `--out`, named after it; one that fails or is not
//! whole is told and does not stop the others. Jobs of a cluster take one shard each and need
//! nothing of one another; `cargo xtask merge` puts their summaries into one table.

use crate::command::printable;
use crate::error::SessionError;
use crate::report::output::dated;
use crate::{Ended, Inputs, Options, Program, Session};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use trepan_haptics::DeviceName;

/// The recordings of a folder that are this shard's, in the order of their names; `None` when the
/// device is not a folder of recordings.
pub fn recordings(options: &Options) -> Result<Option<Vec<PathBuf>>, SessionError> {
    let named = options.device.as_deref().and_then(|name| name.parse::<DeviceName>().ok());
    let folder = match named {
        Some(DeviceName::Replay(path)) if path.is_dir() => path,
        _ if options.shard.is_some() => {
            let fault = "--shard takes its part of a folder of recordings: give --device replay:FOLDER";
            return Err(SessionError::Usage(fault.into()));
        }
        _ => return Ok(None),
    };
    let read = |fault| SessionError::Usage(format!("--device replay:{}: {fault}", folder.display()));
    let entries = std::fs::read_dir(&folder).map_err(|fault| read(fault.to_string()))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|file| file.extension() == Some(OsStr::new("mcap")));
    if files.is_empty() {
        return Err(read("there is no .mcap in this folder".into()));
    }
    files.sort();
    let (shard, of) = options.shard.unwrap_or((0, 1));
    Ok(Some(files.into_iter().enumerate().filter(|(at, _)| at % of == shard).map(|(_, file)| file).collect()))
}

/// Runs recordings again, one after the other. Returns how many failed.
pub fn run(program: Program, options: &Options, built_in: &Inputs, files: &[PathBuf]) -> usize {
    let out = options.out.clone().unwrap_or_else(|| dated(program));
    let failed = |file: &&PathBuf| match one(program, options, built_in, file, &out) {
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
    out: &Path,
) -> Result<String, SessionError> {
    let options = Options {
        device: Some(format!("replay:{}", file.display())),
        out: Some(out.join(file.file_stem().unwrap_or_default())),
        shard: None,
        record: None,
        ..options.clone()
    };
    let Ended { summary, lack, .. } = Session::open(program, options, built_in.clone())?.run()?;
    let replay = summary.replay.unwrap_or_default();
    let told = format!("{}, {:.1} mm3 removed", replay.told(), summary.bone_removed_mm3);
    match lack {
        Some(lack) => Err(SessionError::Usage(format!("{told}; {lack}"))),
        None => Ok(told),
    }
}
