//! The quick validation, in the profile of the tests.

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Runs every suite quickly. Some acceptance limits are ratios of times, which other work on the
/// machine can disturb: a suite that missed one runs once more, alone, and must then keep it.
pub fn check(root: &Path) -> Result<()> {
    let out = root.join("target/xtask-validation");
    if out.is_dir() {
        std::fs::remove_dir_all(&out).with_context(|| format!("cannot clear {}", out.display()))?;
    }
    if quick(&out, &[])? {
        return Ok(());
    }
    let broken = broken(&out)?;
    ensure!(!broken.is_empty(), "the quick validation failed, and not by a limit: see above");
    println!("xtask: once more, one at a time: {}", broken.join(", "));
    let kept = quick(&out, &[&broken[..], &["--jobs".into(), "1".into()]].concat())?;
    ensure!(kept, "the quick validation missed an acceptance limit");
    Ok(())
}

/// Whether every acceptance limit was kept. A run that failed otherwise is a fault.
fn quick(out: &Path, more: &[String]) -> Result<bool> {
    crate::cargo(&["build", "--workspace", "--bins", crate::FEATURES[0], crate::FEATURES[1]], &[])?;
    let program = std::env::current_exe()?.with_file_name("validate");
    println!("xtask: validate --quick {}", more.join(" "));
    let status = Command::new(&program).args(["--quick", "--out"]).arg(out).args(more).status();
    let status = status.with_context(|| format!("cannot start {}", program.display()))?;
    ensure!(matches!(status.code(), Some(0 | 1)), "the quick validation ended with {status}");
    Ok(status.success())
}

/// The suites that missed an acceptance limit.
fn broken(out: &Path) -> Result<Vec<String>> {
    let mut suites = Vec::new();
    for entry in std::fs::read_dir(out).with_context(|| format!("the validation left no {}", out.display()))? {
        let path = entry?.path();
        let Some(name) = path.file_stem().and_then(|name| name.to_str()).map(String::from) else { continue };
        if path.extension().is_none_or(|ending| ending != "json") {
            continue;
        }
        let report: Value = serde_json::from_slice(&std::fs::read(&path)?).with_context(|| format!("{name}.json"))?;
        let gates = report["gates"].as_array().into_iter().flatten();
        if gates.into_iter().any(|gate| gate["pass"] == false) {
            suites.push(name);
        }
    }
    suites.sort();
    Ok(suites)
}
