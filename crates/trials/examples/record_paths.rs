//! Records the paths of the rigid and the deformable suite into the fixtures; name a suite to
//! record only its paths.
//!
//! New recordings have other bytes: figures before and after are not comparable.
//!
//! `cargo run -p trepan-trials --example record_paths [rigid|deformable] [FOLDER]`

use std::path::PathBuf;
use trepan_trials_bone::rigid;
use trepan_trials_tissue::deformable;

fn main() -> anyhow::Result<()> {
    let fixtures = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/paths");
    let mut args: Vec<_> = std::env::args_os().skip(1).collect();
    let only = args.first().filter(|arg| *arg == "rigid" || *arg == "deformable").cloned();
    args.drain(..usize::from(only.is_some()));
    let folder = args.first().map_or_else(fixtures, PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    let wanted = |suite: &str| only.as_ref().is_none_or(|only| only == suite);
    let mut files = if wanted("rigid") { rigid::record_all(&folder)? } else { Vec::new() };
    files.extend(if wanted("deformable") { deformable::record_all(&folder)? } else { Vec::new() });
    for file in files {
        println!("{} {} bytes", file.display(), std::fs::metadata(&file)?.len());
    }
    Ok(())
}
