//! Lines of Rust by crate, held against the budget in `crates/README.md`.
//!
//! # Practice
//! Source is what stands in `src` outside `#[cfg(test)]`; tests are the rest, with `tests`,
//! `benches` and `examples`. A crate over its budget is a fault: make it smaller, part it, or raise
//! the budget in the commit that says why.

use crate::{layers, modules};
use anyhow::{Context, Result};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Row of the table of budgets: `| size of NAME | LINES |`.
const ROW: &str = "| size of ";

/// Prints the sizes and returns what is over its budget.
pub fn check(root: &Path) -> Result<Vec<String>> {
    let budgets = budgets(&fs::read_to_string(root.join("crates/README.md")).context("crates/README.md")?);
    let mut faults = Vec::new();
    let mut sum = [0; 2];
    println!("{:<17} {:>7} {:>7} {:>7}", "crate", "source", "budget", "tests");
    for (name, folder) in crates(root)? {
        let [source, tests] = lines(&folder)?;
        sum = [sum[0] + source, sum[1] + tests];
        let budget = budgets.get(&name).copied();
        let shown = budget.map_or_else(|| "-".into(), |budget| budget.to_string());
        println!("{name:<17} {source:>7} {shown:>7} {tests:>7}");
        match budget {
            Some(budget) if source <= budget => {}
            Some(budget) => faults.push(format!("{name} has {source} lines of source, its budget is {budget}")),
            None => faults.push(format!("{name} has no budget in crates/README.md")),
        }
    }
    println!("{:<17} {:>7} {:>7} {:>7}", "all", sum[0], "", sum[1]);
    Ok(faults)
}

/// Budgets by crate.
fn budgets(readme: &str) -> BTreeMap<String, usize> {
    let row = |line: &str| {
        let (name, lines) = line.strip_prefix(ROW)?.split_once(" | ")?;
        Some((name.to_string(), lines.trim_end_matches(" |").replace(',', "").parse().ok()?))
    };
    readme.lines().filter_map(row).collect()
}

/// Every crate by name, with its folder; one within another by both names.
fn crates(root: &Path) -> Result<BTreeMap<String, std::path::PathBuf>> {
    let mut found = BTreeMap::from([("xtask".to_string(), root.join("xtask"))]);
    for home in ["crates", "apps"] {
        for folder in with_manifest(&root.join(home))? {
            let within = with_manifest(&folder)?;
            let inner = within.into_iter().map(|inner| (format!("{}-{}", name(&folder), name(&inner)), inner));
            found.extend(inner);
            found.insert(name(&folder), folder);
        }
    }
    Ok(found)
}

/// The folders in a folder that hold a crate.
fn with_manifest(home: &Path) -> Result<Vec<std::path::PathBuf>> {
    let entries = fs::read_dir(home).with_context(|| home.display().to_string())?;
    let folders: Vec<_> = entries.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    Ok(folders.into_iter().filter(|folder| folder.join("Cargo.toml").is_file()).collect())
}

fn name(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Lines of source and of tests in a crate; a crate within it counts for itself.
fn lines(folder: &Path) -> Result<[usize; 2]> {
    let mut sum = [0; 2];
    let files = layers::rust_files(&folder.join("src"))?.into_iter();
    for (file, text) in files.map(|file| Ok((file.clone(), fs::read_to_string(file)?))).collect::<Result<Vec<_>>>()? {
        let all = text.lines().count();
        let tests = if is_test(&file)? { all } else { modules::test_lines(&text) };
        sum = [sum[0] + all - tests, sum[1] + tests];
    }
    for beside in ["tests", "benches", "examples"] {
        for file in layers::rust_files(&folder.join(beside))? {
            sum[1] += fs::read_to_string(file)?.lines().count();
        }
    }
    Ok(sum)
}

/// Whether a file's module, or one that holds it, is declared for tests only.
fn is_test(file: &Path) -> Result<bool> {
    for at in file.ancestors().take_while(|at| at.file_name().is_some_and(|name| name != "src")) {
        let name = at.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let folder = at.parent().unwrap_or(Path::new("."));
        for parent in [folder.join("mod.rs"), folder.join("lib.rs"), folder.with_extension("rs")] {
            let text = if parent != file && parent.is_file() { fs::read_to_string(&parent)? } else { String::new() };
            if modules::of_tests(&text).any(|module| module == name) {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crate_over_its_budget_is_a_fault_and_tests_do_not_count() {
        let home = tempfile::tempdir().unwrap();
        let root = home.path();
        let write = |path: &str, text: &str| {
            let path = root.join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        for name in ["crates/a", "crates/b", "xtask"] {
            write(&format!("{name}/Cargo.toml"), "");
        }
        fs::create_dir_all(root.join("apps")).unwrap();
        fs::create_dir_all(root.join("crates/haptics")).unwrap();
        let source = "fn one() {}\n// two\n#[cfg(test)]\nmod tests;\n";
        write("crates/a/src/lib.rs", source);
        write("crates/a/src/tests/mod.rs", "1\n2\n");
        write("crates/a/src/tests/more.rs", "3\n");
        write("crates/b/src/lib.rs", "fn one() {}\n\n#[cfg(test)]\nmod tests {\n    fn x() {}\n}\n");
        write("crates/b/examples/e.rs", "1\n2\n");
        assert_eq!(lines(&root.join("crates/a")).unwrap(), [2, 5]);
        assert_eq!(lines(&root.join("crates/b")).unwrap(), [2, 6]);
        let table = "| size of a | 2 |\n| size of b | 1 |\n| size of xtask | 1,000 |\n";
        write("crates/README.md", table);
        assert_eq!(check(root).unwrap(), ["b has 2 lines of source, its budget is 1"]);
        write("crates/README.md", "| size of a | 2 |\n| size of xtask | 0 |\n");
        assert_eq!(check(root).unwrap(), ["b has no budget in crates/README.md"]);
    }
}
