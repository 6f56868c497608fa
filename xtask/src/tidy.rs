//! Checks the house style that a compiler does not: module docs, lengths, READMEs, examples, shader pairs.

use crate::layers::{files, rust_files};
use anyhow::Result;
use std::fs;
use std::path::Path;

/// Longest source file, lines.
const FILE_LINES: usize = 700;
/// Longest example, lines.
const EXAMPLE_LINES: usize = 80;
/// Longest app, lines.
const APP_LINES: usize = 150;

/// All faults found, each one line.
pub fn check(root: &Path) -> Result<Vec<String>> {
    let mut faults = Vec::new();
    for folder in ["crates", "apps", "shaders", "fixtures", "xtask"] {
        for file in rust_files(&root.join(folder))? {
            faults.extend(source(root, &file)?);
        }
    }
    for entry in fs::read_dir(root.join("crates"))? {
        let folder = entry?.path();
        if folder.is_dir() {
            faults.extend(crate_folder(root, &folder)?);
        }
    }
    for file in files(&root.join("apps"), "rs")?.iter().filter(|f| !f.iter().any(|part| part == "tests")) {
        faults.extend(too_long(root, file, APP_LINES)?);
    }
    faults.extend(shaders(root)?);
    faults.sort();
    Ok(faults)
}

fn source(root: &Path, file: &Path) -> Result<Option<String>> {
    let text = fs::read_to_string(file)?;
    if !text.starts_with("//!") {
        return Ok(Some(format!("{} does not begin with a module doc", shown(root, file))));
    }
    too_long(root, file, FILE_LINES)
}

fn too_long(root: &Path, file: &Path, limit: usize) -> Result<Option<String>> {
    let lines = fs::read_to_string(file)?.lines().count();
    Ok((lines > limit).then(|| format!("{} has {lines} lines, the limit is {limit}", shown(root, file))))
}

fn crate_folder(root: &Path, folder: &Path) -> Result<Vec<String>> {
    let mut faults = Vec::new();
    if !folder.join("README.md").is_file() {
        faults.push(format!("{} has no README.md", shown(root, folder)));
    }
    let examples = rust_files(&folder.join("examples"))?;
    if examples.is_empty() {
        faults.push(format!("{} has no examples/*.rs", shown(root, folder)));
    }
    for example in examples {
        faults.extend(too_long(root, &example, EXAMPLE_LINES)?);
    }
    Ok(faults)
}

/// Each `shaders/CRATE/PASS.wgsl` needs a Rust file in that crate that names the pass, and a line in the shader crate.
fn shaders(root: &Path) -> Result<Vec<String>> {
    let handed_out = fs::read_to_string(root.join("shaders/src/lib.rs"))?;
    let mut faults = Vec::new();
    for shader in files(&root.join("shaders"), "wgsl")? {
        let inside = shader.strip_prefix(root.join("shaders"))?;
        let name = inside.display().to_string();
        if !handed_out.contains(&name) {
            faults.push(format!("shaders/{name} is not handed out by shaders/src/lib.rs"));
        }
        let user = inside.iter().next().map(|c| root.join("crates").join(c).join("src")).unwrap_or_default();
        let constant = inside.with_extension("").display().to_string().replace(['/', '-'], "_").to_uppercase();
        let mut used = false;
        for file in rust_files(&user)? {
            used |= fs::read_to_string(file)?.contains(&constant);
        }
        if !used {
            faults.push(format!("shaders/{name} has no Rust user: nothing in {} names {constant}", shown(root, &user)));
        }
    }
    Ok(faults)
}

fn shown(root: &Path, path: &Path) -> String {
    path.strip_prefix(root).unwrap_or(path).display().to_string()
}
