//! Finds circles of sibling modules: of two modules in one folder at most one may use the other.
//!
//! A use of a name that a module re-exports counts as a use of the module that it comes from.

use crate::layers::rust_files;
use anyhow::{Context, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Where a module stands in its crate: the names from the root down.
type ModulePath = Vec<String>;

/// The modules of one crate.
#[derive(Default)]
struct Modules {
    /// The code of each module, without tests.
    code: BTreeMap<ModulePath, String>,
    /// Names that a module re-exports, each with the path that it stands for.
    exports: BTreeMap<(ModulePath, String), ModulePath>,
}

/// Circles of sibling modules under a crate's `src`, each one line.
pub fn circles(name: &str, src: &Path) -> Result<Vec<String>> {
    let mut modules = Modules::default();
    let mut tests = Vec::new();
    for file in rust_files(src)? {
        let inside = file.strip_prefix(src)?.with_extension("");
        let mut path: ModulePath = inside.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        if path.first().is_some_and(|first| first == "bin") || path == ["main"] {
            continue;
        }
        if path.last().is_some_and(|last| last == "mod" || last == "lib") {
            path.pop();
        }
        let text = fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
        tests.extend(of_tests(&text).map(|name| [&path[..], &[name.to_owned()]].concat()));
        modules.code.insert(path, without_tests(&text));
    }
    modules.code.retain(|path, _| !tests.iter().any(|test| path.starts_with(test)));
    Ok(modules.circles().into_iter().map(|circle| format!("{name}: {circle}")).collect())
}

impl Modules {
    fn circles(mut self) -> Vec<String> {
        for (module, code) in &self.code {
            for path in uses(code, true) {
                let (Some(target), Some(name)) = (absolute(module, &path), path.last()) else { continue };
                self.exports.insert((module.clone(), name.clone()), target);
            }
        }
        let mut edges: BTreeMap<(ModulePath, String), BTreeSet<String>> = BTreeMap::new();
        for (module, code) in &self.code {
            for path in uses(code, false).into_iter().filter_map(|path| absolute(module, &path)) {
                let target = self.home(&path);
                let shared = module.iter().zip(&target).take_while(|(a, b)| a == b).count();
                if let (Some(user), Some(used)) = (module.get(shared), target.get(shared)) {
                    edges.entry((module[..shared].to_vec(), user.clone())).or_default().insert(used.clone());
                }
            }
        }
        let mut found = Vec::new();
        let mut listed = BTreeSet::new();
        for (parent, user) in edges.keys().filter(|(parent, user)| reaches(&edges, parent, user, user)) {
            let others = edges.keys().filter(|(other, _)| other == parent).map(|(_, name)| name);
            let both = |name: &&String| reaches(&edges, parent, user, name) && reaches(&edges, parent, name, user);
            let circle: Vec<&str> = others.filter(both).map(String::as_str).collect();
            let place = parent.iter().map(|part| format!("{part}::")).collect::<String>();
            if listed.insert((parent, circle.clone())) {
                found.push(format!("{place}{{{}}} use each other", circle.join(", ")));
            }
        }
        found
    }

    /// The module in which the item of a path is written.
    fn home(&self, path: &[String]) -> ModulePath {
        let mut module = ModulePath::new();
        for (at, part) in path.iter().enumerate() {
            module.push(part.clone());
            if self.code.contains_key(&module) {
                continue;
            }
            module.pop();
            return match self.exports.get(&(module.clone(), part.clone())) {
                Some(target) if target[..] != path[..=at] => self.home(&[target, &path[at + 1..]].concat()),
                _ => module,
            };
        }
        module
    }
}

/// Whether one sibling uses another directly or through others.
fn reaches(
    edges: &BTreeMap<(ModulePath, String), BTreeSet<String>>,
    parent: &ModulePath,
    from: &str,
    to: &str,
) -> bool {
    let used_by = |name: &str| edges.get(&(parent.clone(), name.to_owned())).into_iter().flatten();
    let (mut seen, mut next) = (BTreeSet::new(), vec![from]);
    while let Some(at) = next.pop() {
        for used in used_by(at) {
            if used == to {
                return true;
            }
            if seen.insert(used) {
                next.push(used);
            }
        }
    }
    false
}

/// A path from the crate's root; `None` for what comes from elsewhere.
fn absolute(module: &[String], path: &[String]) -> Option<ModulePath> {
    let mut base = module.to_vec();
    let mut rest = path;
    match path.first()?.as_str() {
        "crate" => (base, rest) = (Vec::new(), &path[1..]),
        "self" => rest = &path[1..],
        "super" => {
            while rest.first().is_some_and(|part| part == "super") {
                base.pop();
                rest = &rest[1..];
            }
        }
        _ => {}
    }
    base.extend(rest.iter().cloned());
    Some(base)
}

/// The paths that code uses: of `pub use` alone, or of every `use` and every path from `crate` or
/// `super`.
fn uses(code: &str, public: bool) -> Vec<ModulePath> {
    let mut paths = Vec::new();
    for statement in code.split_inclusive(';') {
        let begins = statement.match_indices("use ").find(|(at, _)| {
            let line = statement[..*at].rsplit('\n').next().unwrap_or_default().trim();
            line.is_empty() || line.starts_with("pub")
        });
        let is_public = begins.is_some_and(|(at, _)| statement[..at].trim_end().ends_with(['b', ')']));
        match begins {
            Some((at, word)) if is_public || !public => {
                expand(statement[at + word.len()..].trim_end_matches(';'), &[], &mut paths);
            }
            _ => {}
        }
    }
    if !public {
        for word in ["crate::", "super::"] {
            paths.extend(code.match_indices(word).map(|(at, _)| {
                let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
                let path = code[at..].split(|c| !is_part(c)).next().unwrap_or_default();
                path.split("::").filter(|part| !part.is_empty()).map(String::from).collect()
            }));
        }
    }
    paths
}

/// The paths of a tree such as `a::{b, c::{d, e}}`.
fn expand(tree: &str, before: &[String], paths: &mut Vec<ModulePath>) {
    let tree = tree.trim();
    let (head, group) = match tree.split_once('{') {
        Some((head, rest)) => (head, rest.trim_end().strip_suffix('}')),
        None => (tree, None),
    };
    let names = head.split(" as ").next().unwrap_or_default();
    let mut path = before.to_vec();
    path.extend(names.split("::").map(str::trim).filter(|part| !part.is_empty()).map(String::from));
    let Some(group) = group else {
        if path.len() > before.len() {
            paths.push(path);
        }
        return;
    };
    let (mut depth, mut start) = (0, 0);
    for (at, c) in group.char_indices().chain([(group.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                expand(&group[start..at], &path, paths);
                start = (at + 1).min(group.len());
            }
            _ => {}
        }
    }
}

/// Names of the modules that a file declares for its tests, each in a file of its own.
pub fn of_tests(text: &str) -> impl Iterator<Item = &str> {
    let lines = text.lines().map(str::trim);
    let pairs = lines.clone().zip(lines.skip(1)).filter(|(above, _)| *above == "#[cfg(test)]");
    pairs.filter_map(|(_, line)| line.strip_suffix(';')?.rsplit_once("mod ").map(|(_, name)| name))
}

/// The code of a file without comments and without what `#[cfg(test)]` stands before.
pub fn without_tests(text: &str) -> String {
    let code = outside_tests(text).into_iter().filter(|line| !line.trim_start().starts_with("//"));
    code.flat_map(|line| [line, "\n"]).collect()
}

/// Number of lines that `#[cfg(test)]` stands before, with it.
pub fn test_lines(text: &str) -> usize {
    text.lines().count() - outside_tests(text).len()
}

fn outside_tests(text: &str) -> Vec<&str> {
    let mut outside = Vec::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let trimmed = line.trim_start();
        if trimmed == "#[cfg(test)]" {
            let end = format!("{}}}", &line[..line.len() - trimmed.len()]);
            let item = lines.by_ref().find(|line| !line.trim_start().starts_with("#[")).unwrap_or_default();
            if !item.trim_end().ends_with([';', '}']) {
                lines.by_ref().find(|line| line.starts_with(&end));
            }
        } else {
            outside.push(line);
        }
    }
    outside
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(files: &[(&str, &str)]) -> Vec<String> {
        let path = |path: &str| path.split("::").filter(|part| !part.is_empty()).map(String::from).collect();
        let code = files.iter().map(|(name, text)| (path(name), without_tests(text))).collect();
        Modules { code, ..Modules::default() }.circles()
    }

    #[test]
    fn a_circle_of_siblings_is_found_directly_and_through_a_third_one() {
        let lib = ("", "mod a;\nmod b;\npub use b::B;\n");
        assert_eq!(found(&[lib, ("a", "use crate::b::B;\n"), ("b", "use super::a::A;\n")]), ["{a, b} use each other"]);
        assert!(found(&[lib, ("a", "use crate::b::B;\n"), ("b", "pub struct B;\n")]).is_empty());
        let exported = [lib, ("a", "use crate::{B, b::{self, C}};\n"), ("b", "fn f(a: crate::a::A) {}\n")];
        assert_eq!(found(&exported), ["{a, b} use each other"]);
        let third = [("a", "use crate::b::B;\n"), ("b", "use crate::c::C;\n"), ("c", "use crate::a::A;\n")];
        assert_eq!(found(&third), ["{a, b, c} use each other"]);
        let deep = [("x::a", "use super::b::B;\n"), ("x::b", "use crate::x::a::A;\n"), ("x", "mod a;\nmod b;\n")];
        assert_eq!(found(&deep), ["x::{a, b} use each other"]);
    }

    #[test]
    fn tests_comments_and_parents_make_no_circle() {
        let test = "use crate::b::B;\n#[cfg(test)]\nmod tests {\n    use super::*;\n}\nfn f() {}\n";
        assert!(without_tests(test).ends_with("fn f() {}\n") && !without_tests(test).contains("super"));
        let b = "// crate::a::A\npub struct B;\n#[cfg(test)]\nmod tests {\n    use crate::a::A;\n}\n";
        assert!(found(&[("a", test), ("b", b), ("", "mod a;\nmod b;\n")]).is_empty());
        assert_eq!(of_tests("mod a;\n#[cfg(test)]\nmod tests;\nmod b;\n").collect::<Vec<_>>(), ["tests"]);
        assert_eq!(of_tests("#[cfg(test)]\npub(super) mod tests {\n").count(), 0);
        assert!(found(&[("a", "mod c;\nuse c::C;\n"), ("a::c", "use super::D;\n")]).is_empty(), "child and parent");
    }
}
