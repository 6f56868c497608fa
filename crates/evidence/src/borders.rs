//! Kept stability boundaries: compares a run's maps with the stored ones and lists cells that got
//! worse.
//!
//! # Practice
//! `borders/` in the sources holds one text file per suite for quick runs and one for full runs.
//! Each
//! map cell is one character, so a changed boundary is a changed line in a review.
//! `validate --keep-borders` writes them from a run. A new or a removed row, column or map is not a
//! regression.

use crate::files::whole;
use crate::part::Scope;
use crate::picture::{Map, Outcome, describe_change};
use crate::suite::{Findings, Gate};
use anyhow::Result;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Characters for works, degrades, fails and refused.
const SIGNS: [char; 4] = ['.', '~', '#', 'x'];
const BETWEEN: &str = " | ";
const COLUMNS: &str = "columns: ";

/// Path of a suite's kept boundary file. Quick and full runs have separate files because a quick
/// run demands less of each cell.
fn place(suite: &str, scope: Scope) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("borders").join(scope.pick("quick", "full"));
    folder.join(format!("{suite}.txt"))
}

/// Adds limits on the number of cells worse than the kept boundary, which it lists, and on maps
/// without a kept boundary. Does nothing for a suite without maps.
pub fn judge(suite: &str, scope: Scope, findings: &mut Findings) {
    if findings.maps.is_empty() {
        return;
    }
    let text = std::fs::read_to_string(place(suite, scope)).unwrap_or_default();
    let worse = regressions(&text, &findings.maps);
    findings.gates.push(Gate::at_most("cells of maps that are worse than the kept border", worse.len() as f64, 0.0));
    findings.regressions.extend(worse);
    let kept = cells(&text);
    let has_border = |map: &Map| kept.keys().any(|(title, ..)| *title == line(&map.title));
    let bare: Vec<&Map> = findings.maps.iter().filter(|map| !has_border(map)).collect();
    findings.gates.push(Gate::at_most("maps without a kept border", bare.len() as f64, 0.0));
    let lines = bare.iter().map(|map| format!("NO BORDER kept: {} (validate --keep-borders keeps it)", map.title));
    findings.regressions.extend(lines.collect::<Vec<_>>());
}

/// Writes a suite's boundary file into the sources.
pub fn keep(suite: &str, scope: Scope, maps: &[Map]) -> Result<()> {
    let file = place(suite, scope);
    whole(&file, text(maps).as_bytes())?;
    println!("kept borders: {}", file.display());
    Ok(())
}

/// Text of a boundary file for some maps.
pub fn text(maps: &[Map]) -> String {
    let mut text = String::from("Where it works (.), degrades (~), fails (#), is refused (x).\n");
    for map in maps {
        _ = write!(text, "\n{}\n{COLUMNS}{}\n", line(&map.title), map.columns.join(BETWEEN));
        for (row, cells) in map.rows.iter().zip(&map.cells) {
            let signs: String = cells.iter().map(|cell| SIGNS[usize::from(cell.grade())]).collect();
            _ = writeln!(text, "{signs} {}", line(row));
        }
    }
    text
}

fn line(name: &str) -> String {
    name.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Names of all cells that are worse than in a kept file.
fn regressions(kept: &str, maps: &[Map]) -> Vec<String> {
    let kept = cells(kept);
    let mut worse = Vec::new();
    for map in maps {
        for (row, column, cell) in map.named_cells() {
            let key = (line(&map.title), line(row), column.to_string());
            if let Some(was) = kept.get(&key).filter(|was| cell.worse_than(was)) {
                worse.push(describe_change(map, row, column, was, cell));
            }
        }
    }
    worse
}

/// Kept outcomes by map title, row and column.
fn cells(kept: &str) -> BTreeMap<(String, String, String), Outcome> {
    let mut cells = BTreeMap::new();
    for block in kept.split("\n\n").skip(1) {
        let mut lines = block.lines();
        let (Some(title), Some(columns)) = (lines.next(), lines.next().and_then(|line| line.strip_prefix(COLUMNS)))
        else {
            continue;
        };
        let columns: Vec<&str> = columns.split(BETWEEN).collect();
        for (signs, row) in lines.filter_map(|line| line.split_once(' ')) {
            for (sign, column) in signs.chars().zip(&columns) {
                let of = [
                    Outcome::Works,
                    Outcome::Degrades(String::new()),
                    Outcome::Fails(String::new()),
                    Outcome::Refused(String::new()),
                ];
                if let Some(outcome) = SIGNS.iter().position(|known| *known == sign).map(|at| of[at].clone()) {
                    cells.insert((title.to_string(), row.to_string(), column.to_string()), outcome);
                }
            }
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(cells: [Outcome; 3]) -> Map {
        let names = |all: [&str; 3]| all.map(String::from).to_vec();
        Map {
            title: "walls".into(),
            rows: vec!["thin  one".into()],
            columns: names(["a", "b", "c"]),
            cells: vec![cells.to_vec()],
            ..Map::default()
        }
    }

    #[test]
    fn cells_worse_than_kept_are_named_and_better_ones_are_not() {
        let (fails, refused) = (Outcome::Fails("falls through".into()), Outcome::Refused("too thin".into()));
        let kept = text(&[map([Outcome::Works, fails.clone(), refused.clone()])]);
        assert!(kept.contains("\n.#x thin one\n"), "{kept}");
        assert!(regressions(&kept, &[map([Outcome::Works, refused.clone(), refused.clone()])]).is_empty());
        let worse = regressions(&kept, &[map([refused, Outcome::Works, fails])]);
        assert_eq!(worse.len(), 2);
        assert!(worse[0].contains("walls | thin  one | a: works -> refused (too thin)"), "{}", worse[0]);
        assert!(regressions("", &[map([Outcome::Works, Outcome::Works, Outcome::Works])]).is_empty());
    }
}
