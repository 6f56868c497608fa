//! The quick validation, in the profile of the tests.

use anyhow::{Context, Result, ensure};
use std::path::Path;
use std::process::Command;

/// Runs every suite quickly, once. Limits on ratios of times carry their spread as a known gap in
/// the register of limits, so nothing is run again.
pub fn check(root: &Path) -> Result<()> {
    let out = root.join("target/xtask-validation");
    if out.is_dir() {
        std::fs::remove_dir_all(&out).with_context(|| format!("cannot clear {}", out.display()))?;
    }
    let program = std::env::current_exe()?.with_file_name("validate");
    println!("xtask: validate --quick");
    let status = Command::new(&program).args(["--quick", "--out"]).arg(&out).status();
    let status = status.with_context(|| format!("cannot start {}", program.display()))?;
    ensure!(status.code() != Some(1), "the quick validation missed an acceptance limit");
    ensure!(status.success(), "the quick validation ended with {status}");
    Ok(())
}
