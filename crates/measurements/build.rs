//! Turns the tables of `fixtures/measurements` into constants.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Columns of every table.
const COLUMNS: [&str; 8] = ["key", "at", "value", "spread", "unit", "condition", "source", "mark"];
/// Values of the column `mark`, each with its variant of `Mark`.
const MARKS: [(&str, &str); 7] = [
    ("table", "Table"),
    ("abstract", "Abstract"),
    ("secondary", "Secondary"),
    ("derived", "Derived"),
    ("memory", "Memory"),
    ("fit", "Fit"),
    ("uncalibrated", "Uncalibrated"),
];

fn main() {
    let folder =
        PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo says where")).join("../../fixtures/measurements");
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut tables: Vec<PathBuf> = fs::read_dir(&folder)
        .unwrap_or_else(|fault| panic!("{}: {fault}", folder.display()))
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "csv"))
        .collect();
    tables.sort();
    let (mut code, mut all) = (String::new(), String::new());
    for path in tables {
        println!("cargo::rerun-if-changed={}", path.display());
        let name = path.file_stem().expect("a file name").to_string_lossy().replace('-', "_");
        let rows = rows(&path, &name).unwrap_or_else(|fault| panic!("{}: {fault}", path.display()));
        let _ =
            writeln!(code, "/// Rows of `fixtures/measurements/{}.csv`.\npub mod {name} {{", name.replace('_', "-"));
        let _ = writeln!(code, "    use crate::{{Mark, Row}};");
        for (key, (unit, of_key)) in &rows {
            let (constant, list) = (key.replace('-', "_").to_uppercase(), of_key.join(",\n        "));
            let unit = if unit.is_empty() { "without unit" } else { unit };
            let _ = match of_key.as_slice() {
                [one] => writeln!(code, "    /// {key}, {unit}.\n    pub const {constant}: Row = {one};"),
                _ => writeln!(
                    code,
                    "    /// {key}, {unit}, a curve.\n    pub const {constant}: &[Row] = &[\n        {list},\n    ];"
                ),
            };
            let _ = match of_key.len() {
                1 => writeln!(all, "    &[{name}::{constant}],"),
                _ => writeln!(all, "    {name}::{constant},"),
            };
        }
        code.push_str("}\n");
    }
    let _ =
        writeln!(code, "/// Every row, by key: one row, or those of a curve.\npub const ALL: &[&[Row]] = &[\n{all}];");
    fs::write(Path::new(&env::var("OUT_DIR").expect("a build script has OUT_DIR")).join("tables.rs"), code)
        .expect("the output folder can be written");
}

/// Unit and rows, as Rust, of each key.
type Keys = BTreeMap<String, (String, Vec<String>)>;

fn rows(path: &Path, table: &str) -> Result<Keys, String> {
    let mut reader = csv::Reader::from_path(path).map_err(|fault| fault.to_string())?;
    let header: Vec<String> = reader.headers().map_err(|fault| fault.to_string())?.iter().map(Into::into).collect();
    if header != COLUMNS {
        return Err(format!("its columns are {header:?}, expected {COLUMNS:?}"));
    }
    let (mut keys, mut seen) = (Keys::new(), BTreeSet::new());
    for record in reader.records() {
        let record = record.map_err(|fault| fault.to_string())?;
        let line = record.position().map_or(0, csv::Position::line);
        let fault = |what: &str| format!("line {line}: {what}");
        let [key, at, value, spread, unit, condition, source, mark] =
            [0, 1, 2, 3, 4, 5, 6, 7].map(|column| record[column].trim().to_string());
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if !key.starts_with(|c: char| c.is_ascii_lowercase()) || !key.chars().all(plain) {
            return Err(fault("key: expected lower-case letters, digits and hyphens, a letter first"));
        }
        let number = |name: &str, text: &str, needed: bool| match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(format!("{number:?}")),
            Err(_) if text.is_empty() && !needed => Ok("f64::NAN".into()),
            _ => Err(fault(&format!("{name} is {text:?}, expected a number"))),
        };
        let (at, value) = (number("at", &at, false)?, number("value", &value, true)?);
        let spread = number("spread", &spread, false)?;
        let (_, mark) = MARKS
            .iter()
            .find(|(name, _)| *name == mark)
            .ok_or_else(|| fault(&format!("mark is {mark:?}, expected one of {:?}", MARKS.map(|(name, _)| name))))?;
        if source.is_empty() {
            return Err(fault("source is empty"));
        }
        if !seen.insert((key.clone(), at.clone())) {
            return Err(fault("key and `at` stand in the table twice"));
        }
        let row = format!(
            "Row {{ table: {table:?}, key: {key:?}, at: {at}, value: {value}, spread: {spread}, unit: {unit:?}, condition: {condition:?}, source: {source:?}, mark: Mark::{mark} }}"
        );
        let (kept, list) = keys.entry(key).or_insert_with(|| (unit.clone(), Vec::new()));
        if *kept != unit {
            return Err(fault("the rows of a key have different units"));
        }
        list.push(row);
    }
    Ok(keys)
}
