//! Checks the floors of the crates and what each crate keeps away from.
//!
//! A crate may use only crates on lower floors, and inside floors 1 and 2 the two arrows that the
//! map names. Some packages and some parts of the standard library belong to a few crates only.

use crate::modules;
use anyhow::{Context, Result};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Crates by floor, lowest first.
const FLOORS: [&[&str]; 12] = [
    &["geometry", "measurements", "shaders", "fixtures", "emulators"],
    &["volume", "bone", "mesh", "contact", "gpu"],
    &["rigid", "deformable", "bleeding", "dura", "soft", "tled", "render", "haptics", "link"],
    &["voxel-size", "budget", "window", "evidence", "stages", "rivals"],
    &["patient", "runtime"],
    &["models"],
    &["report"],
    &["simulator"],
    &["craniotomy", "brain", "integrated", "trials-scenes", "analysis", "python"],
    &["trials-bone", "trials-tissue"],
    &["trials-sessions"],
    &["trials"],
];

/// Arrows within one floor, from user to used.
const SIDEWAYS: [(&str, &str); 3] = [("mesh", "volume"), ("bone", "volume"), ("tled", "soft")];

/// Packages that only some crates may depend on.
const KEPT: [(&str, &[&str]); 8] = [
    ("wgpu", &["gpu"]),
    ("eframe", &["window"]),
    ("mcap", &["link"]),
    ("iceoryx2", &["link"]),
    ("clap", &["simulator", "trials", "analysis"]),
    ("tracing", &["stages", "simulator", "craniotomy", "brain", "integrated"]),
    ("anyhow", &["evidence", "simulator", "craniotomy", "brain", "integrated", "trials", "analysis"]),
    ("trepan-trials", &[]),
];

/// Words in the sources that only some crates may use (tests and examples are free).
const WORDS: [(&str, &[&str]); 6] = [
    ("Instant::now", &["simulator", "evidence", "trials", "gpu", "window", "render", "emulators", "analysis"]),
    ("SystemTime", &["link", "simulator", "evidence", "trials"]),
    ("thread::sleep", &["stages", "simulator", "trials", "emulators"]),
    ("thread::spawn", &["simulator", "trials", "tled", "haptics", "emulators"]),
    (
        "std::fs",
        &[
            "volume",
            "mesh",
            "link",
            "haptics",
            "render",
            "window",
            "simulator",
            "evidence",
            "trials",
            "emulators",
            "analysis",
        ],
    ),
    ("unsafe {", &["haptics", "soft", "simulator", "emulators"]),
];

/// Crates that are a workspace of their own, each with its script `check`.
pub const APART: [&str; 2] = ["crates/analysis", "crates/python"];

/// All faults found, each one line.
pub fn check(root: &Path) -> Result<Vec<String>> {
    let mut faults = Vec::new();
    let mut all = packages(root)?;
    for folder in APART {
        all.extend(packages(&root.join(folder))?);
    }
    for package in all {
        let name = short(package["name"].as_str().unwrap_or_default());
        if name == "xtask" {
            continue;
        }
        let Some(floor) = floor_of(name) else {
            faults.push(format!("{name} stands on no floor: add it to the map in xtask/src/layers.rs"));
            continue;
        };
        for dependency in package["dependencies"].as_array().into_iter().flatten() {
            let dev = dependency["kind"].as_str() == Some("dev");
            faults.extend(arrow(name, floor, dependency["name"].as_str().unwrap_or_default(), dev));
        }
        let manifest = PathBuf::from(package["manifest_path"].as_str().unwrap_or_default());
        faults.extend(words(name, &manifest.with_file_name("src"))?);
        faults.extend(modules::circles(name, &manifest.with_file_name("src"))?);
    }
    Ok(faults)
}

/// The packages of the workspace in a folder.
fn packages(folder: &Path) -> Result<Vec<Value>> {
    let out = Command::new("cargo")
        .args(["metadata", "--no-deps", "--format-version", "1", "--offline"])
        .current_dir(folder)
        .output()
        .context("cannot run cargo metadata")?;
    let metadata: Value = serde_json::from_slice(&out.stdout).context("cargo metadata gave no JSON")?;
    Ok(metadata["packages"].as_array().cloned().unwrap_or_default())
}

fn short(package: &str) -> &str {
    package.strip_prefix("trepan-").unwrap_or(package)
}

/// The crates of trials, and those that a session consists of, are kept to the same as one.
fn group(name: &str) -> &str {
    match name {
        "patient" | "models" | "report" | "runtime" => "simulator",
        _ if name.starts_with("trials-") => "trials",
        _ => name,
    }
}

fn floor_of(name: &str) -> Option<usize> {
    FLOORS.iter().position(|floor| floor.contains(&name))
}

fn arrow(name: &str, floor: usize, dependency: &str, dev: bool) -> Option<String> {
    if let Some((_, users)) = KEPT.iter().find(|(kept, _)| *kept == dependency)
        && !users.contains(&group(name))
        && !dev
    {
        return Some(format!("{name} depends on {dependency}, which is kept to {users:?}"));
    }
    let used = dependency.strip_prefix("trepan-")?;
    let below = floor_of(used).is_some_and(|f| f < floor) || SIDEWAYS.contains(&(name, used));
    (!below).then(|| format!("{name} (floor {floor}) uses {used}, which is not on a lower floor"))
}

fn words(name: &str, folder: &Path) -> Result<Vec<String>> {
    let mut faults = Vec::new();
    for file in rust_files(folder)? {
        let code = modules::without_tests(&fs::read_to_string(&file)?);
        let stray = WORDS.iter().filter(|(word, users)| code.contains(word) && !users.contains(&group(name)));
        faults.extend(stray.map(|(word, users)| format!("{}: `{word}` is kept to {users:?}", file.display())));
    }
    Ok(faults)
}

/// Every `.rs` file under a folder, sorted.
pub fn rust_files(folder: &Path) -> Result<Vec<PathBuf>> {
    files(folder, "rs")
}

/// Every file with an extension under a folder, sorted; none when the folder is missing. What cargo
/// builds there, `target`, is passed over.
pub fn files(folder: &Path, extension: &str) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop().filter(|f| f.is_dir()) {
        for entry in fs::read_dir(&next).with_context(|| format!("cannot list {}", next.display()))? {
            let path = entry?.path();
            if path.is_dir() {
                folders.extend(Some(path).filter(|path| !path.ends_with("target")));
            } else if path.extension().is_some_and(|e| e == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arrow_up_or_sideways_is_a_fault() {
        assert!(arrow("mesh", 1, "trepan-rigid", false).is_some());
        assert!(arrow("rigid", 2, "trepan-soft", false).is_some());
        assert!(arrow("link", 2, "wgpu", false).is_some());
        assert!(arrow("tled", 2, "trepan-soft", false).is_none());
        assert!(arrow("rigid", 2, "trepan-volume", false).is_none());
        assert!(arrow("simulator", 4, "trepan-trials", false).is_some());
        assert!(arrow("gpu", 1, "wgpu", false).is_none());
    }
}
