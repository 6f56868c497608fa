//! Property tests again and again with fresh random numbers, for a time.
//!
//! # Theory
//! `cargo xtask test` fixes the seed, so that a failure comes from the change; a case that only
//! other numbers find is found here. Each round has a new seed and prints it.

use crate::layers::rust_files;
use anyhow::{Context, Result, bail, ensure};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant, SystemTime};

/// The builds of `cargo xtask test`, so that nothing is compiled for this alone.
const TESTS: [&str; 6] = ["test", "--workspace", "--all-targets", crate::FEATURES[0], crate::FEATURES[1], "--quiet"];

/// Runs every property test of the workspace for about so many minutes, one round at least.
pub fn run(root: &Path, minutes: f64) -> Result<()> {
    ensure!(minutes > 0.0 && minutes.is_finite(), "--minutes {minutes}: give a number over 0");
    let names = names(root)?;
    crate::cargo(&[&TESTS[..], &["--no-run"]].concat(), &[])?;
    let end = Instant::now() + Duration::from_secs_f64(60.0 * minutes);
    let mut rounds = 0;
    while rounds == 0 || Instant::now() < end {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).context("the clock is before 1970")?;
        let seed = now.as_nanos() as u64;
        println!("xtask: {} property tests, {}={seed}", names.len(), crate::DRAWS[0]);
        let status = Command::new("cargo")
            .args(TESTS)
            .arg("--")
            .args(&names)
            .env(crate::DRAWS[0], seed.to_string())
            .env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "1")
            .current_dir(root)
            .status()
            .context("cannot start cargo")?;
        if !status.success() {
            bail!("a property does not hold; {}={seed} cargo test NAME repeats it", crate::DRAWS[0]);
        }
        rounds += 1;
    }
    println!("xtask fuzz: {rounds} round(s), all properties held");
    Ok(())
}

/// Names of the tests in `proptest!`.
fn names(root: &Path) -> Result<BTreeSet<String>> {
    let mut names = BTreeSet::new();
    for file in rust_files(&root.join("crates"))? {
        names.extend(names_in(&std::fs::read_to_string(&file)?));
    }
    ensure!(!names.is_empty(), "there are no property tests below {}", root.display());
    Ok(names)
}

/// The same of one file: functions after `#[test]` in a block that `proptest! {` opens.
fn names_in(text: &str) -> Vec<String> {
    let (mut names, mut indent, mut is_test) = (Vec::new(), None, false);
    for line in text.lines() {
        let depth = line.len() - line.trim_start().len();
        match indent {
            None if line.trim() == "proptest! {" => indent = Some(depth),
            Some(opened) if line.trim() == "}" && depth == opened => indent = None,
            Some(_) if line.trim() == "#[test]" => is_test = true,
            Some(_) if is_test => {
                is_test = false;
                names.extend(line.trim().strip_prefix("fn ").and_then(|rest| rest.split('(').next()).map(String::from));
            }
            _ => {}
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn property_tests_are_found_by_name() {
        let text = "    proptest! {\n        #[test]\n        fn holds(x in 0..9u32) {\n        }\n    }\n    #[test]\n    fn plain() {}\n";
        assert_eq!(names_in(text), ["holds"]);
        let root = crate::root();
        let all = names(&root).unwrap();
        assert!(all.len() > 20 && all.contains("no_motion_of_the_corners_is_stiffer_than_the_bound"), "{all:?}");
    }
}
