//! Checks that every physical constant of the program names a row of the register of measurements.
//!
//! # Practice
//! A constant or field with the name of a physical quantity ([`QUANTITIES`]) must not be a number
//! in the source: it is written in terms of a row of `trepan-measurements`. Zero and one say that
//! something is absent or unchanged and stand as they are. A parameter of the method, not of
//! nature, says so: the comment above it, or behind it, holds the word "numerical", or "by
//! definition" where a unit is defined so. Tests, the rivals, whose numbers are those of their
//! papers, and the independent truths are free.

use crate::layers::rust_files;
use anyhow::Result;
use std::fs;
use std::path::Path;

/// Crates whose constants are those of the program.
const CRATES: &str = "bleeding bone budget contact deformable dura haptics models patient report rigid runtime simulator soft stages tled volume";

/// Last words of the names of physical quantities.
const QUANTITIES: [&str; 24] = [
    "mpa",
    "kpa",
    "g_mm3",
    "rpm",
    "power_w",
    "mmhg",
    "hu",
    "force_n",
    "load_n",
    "friction_n",
    "nmm",
    "mass_g",
    "hz",
    "poisson",
    "stiffness",
    "damping",
    "friction",
    "sticking",
    "slipping",
    "exponent",
    "cutting_ratio",
    "share",
    "amplitude",
    "young",
];

/// Parts of paths that are free.
const FREE: [&str; 5] = ["rivals", "truth", "tests", "emulators", "tests.rs"];

/// How far above a constant its comment may end, lines.
const REACH: usize = 12;

/// All faults found, each one line.
pub fn check(root: &Path) -> Result<Vec<String>> {
    let mut faults = Vec::new();
    for name in CRATES.split(' ') {
        for file in rust_files(&root.join("crates").join(name).join("src"))? {
            if file.iter().any(|part| FREE.iter().any(|free| part == *free)) {
                continue;
            }
            let text = fs::read_to_string(&file)?;
            let shown = file.strip_prefix(root).unwrap_or(&file).display().to_string();
            faults.extend(in_source(&text).into_iter().map(|fault| format!("{shown}:{fault}")));
        }
    }
    Ok(faults)
}

/// Faults in one source, each with its line.
fn in_source(text: &str) -> Vec<String> {
    let text = text.split("#[cfg(test)]").next().unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    let mut faults = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let code = line.split("//").next().unwrap_or_default();
        let next = lines.get(at + 1).map_or("", |line| line.trim());
        let named: Vec<(&str, &str)> = match constant(code) {
            Some((name, "")) => vec![(name, next)],
            Some(named) => vec![named],
            None => vec![],
        };
        let found = named.into_iter().chain(fields(code)).find(|(name, value)| is_quantity(name) && is_number(value));
        if let Some((name, value)) = found
            && !says_numerical(&lines, at)
        {
            let value: String = value.chars().take(20).collect();
            faults.push(format!(
                "{}: {name} is {value}: write it in terms of a row of trepan-measurements (fixtures/measurements), \
                 or say in its comment that it is a numerical parameter",
                at + 1
            ));
        }
    }
    faults
}

/// Whether the comment behind a line, or the nearest above it, says that its number is numerical.
fn says_numerical(lines: &[&str], at: usize) -> bool {
    let says = |line: &str| {
        let words = line.split_once("//").map_or(String::new(), |(_, words)| words.to_lowercase());
        ["numerical", "by definition"].iter().any(|word| words.contains(word))
    };
    let is_comment = |line: &&&str| line.trim_start().starts_with("//");
    let above = &lines[at.saturating_sub(REACH)..at];
    let block = above.iter().rev().skip_while(|line| !is_comment(line)).take_while(is_comment);
    says(lines[at]) || block.into_iter().any(|line| says(line))
}

/// Name and value of `const NAME: TYPE = VALUE`.
fn constant(code: &str) -> Option<(&str, &str)> {
    let (_, rest) = code.split_once("const ")?;
    let (name, rest) = rest.split_once(':')?;
    let (_, value) = rest.split_once('=')?;
    let upper = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_';
    name.chars().all(upper).then(|| (name, value.trim()))
}

/// Names and values of the fields that a line sets.
fn fields(code: &str) -> Vec<(&str, &str)> {
    code.match_indices(": ")
        .filter_map(|(at, _)| {
            let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
            let name = code[..at].rsplit(|c: char| !is_name(c)).next().unwrap_or_default();
            name.starts_with(|c: char| c.is_ascii_lowercase()).then(|| (name, code[at + 2..].trim_start()))
        })
        .collect()
}

fn is_quantity(name: &str) -> bool {
    let name = name.to_lowercase();
    QUANTITIES.iter().any(|last| name.strip_suffix(last).is_some_and(|rest| rest.is_empty() || rest.ends_with('_')))
}

/// Whether a value begins with a number other than 0 and 1, in brackets or not.
fn is_number(value: &str) -> bool {
    let value = value.trim_start_matches(['[', '(', '-', ' ']);
    let digits: String =
        value.chars().take_while(|c| c.is_ascii_digit() || *c == '.' || *c == '_').filter(|c| *c != '_').collect();
    let rest = &value[value.len().min(digits.len())..];
    let plain = matches!(digits.trim_end_matches('.'), "0" | "1" | "0.0" | "1.0") && !rest.starts_with('e');
    digits.starts_with(|c: char| c.is_ascii_digit()) && !plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_physical_quantities_are_found_in_constants_and_fields() {
        let found = |text: &str| in_source(text).len();
        assert_eq!(found("pub const YOUNG_MPA: f32 = 0.003;"), 1);
        assert_eq!(found("const SHARE: [f32; 2] = [0.45, 0.3];"), 1);
        assert_eq!(found("    Self { stiffness: 2.0, damping: 1.0 }"), 1);
        assert_eq!(found("    max_load_n: 20.0,"), 1);
        assert_eq!(found("const YOUNG_MPA: f32 =\n    1e-3;"), 1);
    }

    #[test]
    fn rows_zero_one_numerical_parameters_and_tests_are_free() {
        let found = |text: &str| in_source(text).len();
        assert_eq!(found("pub const YOUNG_MPA: f32 = brain::YOUNG.f32();"), 0);
        assert_eq!(found("    Self { stiffness: 0.0, damping: 1.0, poisson: row::NU.f32() }"), 0);
        assert_eq!(found("/// A numerical parameter: where the ramp ends.\nconst RAMP_HU: f32 = 1000.0;"), 0);
        assert_eq!(found("    damping: 3.0, // numerical"), 0);
        assert_eq!(found("fn f(stiffness: f32) {}\n#[cfg(test)]\nconst YOUNG_MPA: f32 = 3.0;"), 0);
        assert_eq!(found("const STEP_MM: f32 = 3.0;"), 0);
    }
}
