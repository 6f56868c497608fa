//! Records the touch and drill paths of the rigid suite into the fixtures.
//!
//! `cargo run -p trepan-trials --example record_paths [FOLDER]`

use std::path::PathBuf;
use trepan_trials::suites::rigid;

fn main() -> anyhow::Result<()> {
    let fixtures = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/paths");
    let folder = std::env::args_os().nth(1).map_or_else(fixtures, PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    for file in rigid::record_all(&folder)? {
        println!("{} {} bytes", file.display(), std::fs::metadata(&file)?.len());
    }
    Ok(())
}
