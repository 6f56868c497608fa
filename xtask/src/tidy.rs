//! Checks what a compiler does not: module docs, lengths, prose, READMEs, examples, shader pairs.

use crate::layers::{files, rust_files};
use crate::prose;
use anyhow::{Context, Result};
use std::fs;
use std::path::Path;

/// Longest source file, lines.
const FILE_LINES: usize = 700;
/// Longest example, lines.
const EXAMPLE_LINES: usize = 80;
/// Longest app, lines.
const APP_LINES: usize = 150;

/// A choice on nothing, by guards alone: an `if` says the same.
const ON_NOTHING: &str = concat!("match", " ()");

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
    faults.extend(words(root)?);
    faults.sort();
    Ok(faults)
}

fn source(root: &Path, file: &Path) -> Result<Option<String>> {
    let text = fs::read_to_string(file)?;
    let is_test = file.ends_with("tests.rs") || file.iter().any(|part| part == "tests");
    if !is_test && !text.starts_with("//!") {
        return Ok(Some(format!("{} does not begin with a module doc", shown(root, file))));
    }
    if let Some(line) = text.lines().position(|line| line.contains(ON_NOTHING)) {
        return Ok(Some(format!("{}:{}: `{ON_NOTHING}`: write `if` and `else if`", shown(root, file), line + 1)));
    }
    if file.with_extension("").is_dir() {
        return Ok(Some(format!(
            "{0}.rs lies beside {0}: move it to {0}/mod.rs",
            shown(root, &file.with_extension(""))
        )));
    }
    too_long(root, file, FILE_LINES)
}

fn too_long(root: &Path, file: &Path, limit: usize) -> Result<Option<String>> {
    let lines = fs::read_to_string(file)?.lines().count();
    Ok((lines > limit).then(|| format!("{} has {lines} lines, the limit is {limit}", shown(root, file))))
}

/// Faults of prose in every source, shader and README.
fn words(root: &Path) -> Result<Vec<String>> {
    let folders = ["crates", "apps", "shaders", "fixtures", "xtask"].map(|folder| root.join(folder));
    let mut found = Vec::new();
    for folder in &folders {
        for extension in ["rs", "wgsl", "md"] {
            found.extend(files(folder, extension)?);
        }
    }
    found.extend(["README.md", "CHANGELOG.md", "CONTRIBUTING.md"].map(|name| root.join(name)));
    let mut faults = Vec::new();
    for file in found {
        let text = fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
        let check = if file.extension().is_some_and(|e| e == "md") { prose::in_markdown } else { prose::in_source };
        faults.extend(check(&text).into_iter().map(|fault| format!("{}:{fault}", shown(root, &file))));
    }
    Ok(faults)
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

/// Every WGSL file is handed out by the shader crate; every constant `CRATE_PASS` there is run by
/// `crates/CRATE/src/**/PASS.rs`.
fn shaders(root: &Path) -> Result<Vec<String>> {
    let handed_out = fs::read_to_string(root.join("shaders/src/lib.rs"))?;
    let mut faults = Vec::new();
    for shader in files(&root.join("shaders"), "wgsl")? {
        let name = shader.file_name().unwrap_or_default().to_string_lossy();
        if !handed_out.contains(&*name) {
            faults.push(format!("{} is not handed out by shaders/src/lib.rs", shown(root, &shader)));
        }
    }
    let constants = handed_out.lines().filter_map(|line| line.strip_prefix("pub const ")?.split_once(':'));
    for (constant, _) in constants {
        let Some((folder, pass)) = constant.split_once('_') else { continue };
        let (folder, pass) = (folder.to_lowercase(), format!("{}.rs", pass.to_lowercase()));
        let mut run = false;
        for file in rust_files(&root.join("crates").join(&folder).join("src"))? {
            run |= file.ends_with(&pass) && fs::read_to_string(&file)?.contains(constant);
        }
        if !run {
            faults.push(format!("no crates/{folder}/src/**/{pass} runs the shader {constant}"));
        }
    }
    Ok(faults)
}

fn shown(root: &Path, path: &Path) -> String {
    path.strip_prefix(root).unwrap_or(path).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_module_has_one_place_and_no_choice_on_nothing() {
        let root = tempfile::tempdir().unwrap();
        let (file, folder) = (root.path().join("a.rs"), root.path().join("a"));
        fs::write(&file, "//! A module.\n").unwrap();
        assert_eq!(source(root.path(), &file).unwrap(), None);
        fs::write(&file, format!("//! A module.\nfn f() {{ {ON_NOTHING} {{ () => () }} }}\n")).unwrap();
        assert!(source(root.path(), &file).unwrap().unwrap().starts_with("a.rs:2: "));
        fs::write(&file, "//! A module.\n").unwrap();
        fs::create_dir(&folder).unwrap();
        assert_eq!(source(root.path(), &file).unwrap().unwrap(), "a.rs lies beside a: move it to a/mod.rs");
    }
}
