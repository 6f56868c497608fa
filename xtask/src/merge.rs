//! `cargo xtask merge`: the summaries of many sessions, from any number of shards, as one table.
//!
//! Rows stand in the order of the sessions' folders' names, so that shards merged give the table of
//! one run.

use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Writes `sessions.json` and `sessions.csv` of all `summary.json` below the folders.
pub fn run(folders: &[PathBuf], out: &Path) -> Result<()> {
    let mut sessions: BTreeMap<String, Value> = BTreeMap::new();
    for folder in folders {
        for file in summaries(folder)? {
            let text = fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
            let summary: Value = serde_json::from_str(&text)
                .with_context(|| format!("{} is no summary of a session", file.display()))?;
            let place = file.parent().unwrap_or(folder);
            let name = place.strip_prefix(folder).unwrap_or(place).display().to_string();
            let name =
                if name.is_empty() { folder.file_name().unwrap_or_default().to_string_lossy().into() } else { name };
            if sessions.insert(name.clone(), summary).is_some() {
                bail!("{} and another folder both hold a session {name:?}: give each its own name", folder.display());
            }
        }
    }
    if sessions.is_empty() {
        bail!("no summary.json lies below {folders:?}: give the folders that sessions wrote with --out");
    }
    fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    let (json, csv) = (out.join("sessions.json"), out.join("sessions.csv"));
    fs::write(&json, serde_json::to_string_pretty(&sessions)?)
        .with_context(|| format!("cannot write {}", json.display()))?;
    fs::write(&csv, table(&sessions)).with_context(|| format!("cannot write {}", csv.display()))?;
    println!("{} sessions: {} and {}", sessions.len(), json.display(), csv.display());
    Ok(())
}

/// Every `summary.json` at or below a folder.
fn summaries(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(summaries(&path)?);
        } else if path.file_name().is_some_and(|name| name == "summary.json") {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// One line a session, one column for each number that any of them has.
fn table(sessions: &BTreeMap<String, Value>) -> String {
    let rows: Vec<(&String, BTreeMap<String, String>)> =
        sessions.iter().map(|(name, of)| (name, numbers(of))).collect();
    let columns: BTreeSet<&String> = rows.iter().flat_map(|(_, row)| row.keys()).collect();
    let header = columns.iter().map(|column| format!(",{column}")).collect::<String>();
    let line = |(name, row): &(&String, BTreeMap<String, String>)| {
        let quoted = format!("\"{}\"", name.replace('"', "\"\""));
        columns.iter().fold(quoted, |line, column| line + "," + row.get(*column).map_or("", String::as_str)) + "\n"
    };
    format!("session{header}\n") + &rows.iter().map(line).collect::<String>()
}

/// The numbers of a summary by their paths; lists are left out.
fn numbers(value: &Value) -> BTreeMap<String, String> {
    let mut flat = BTreeMap::new();
    let mut open = vec![(String::new(), value)];
    while let Some((path, value)) = open.pop() {
        match value {
            Value::Object(map) => open.extend(
                map.iter()
                    .map(|(key, value)| (if path.is_empty() { key.clone() } else { format!("{path}.{key}") }, value)),
            ),
            Value::Number(number) => _ = flat.insert(path, number.to_string()),
            _ => {}
        }
    }
    flat
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_give_the_table_of_one_run_and_a_name_twice_is_refused() {
        let all = std::env::temp_dir().join(format!("trepan-merge-{}", std::process::id()));
        let put = |place: &str, ticks: u32| {
            let folder = all.join(place);
            fs::create_dir_all(&folder).expect("a folder");
            let text = format!("{{\"ticks\":{ticks},\"force_n\":{{\"max\":1.5}},\"warnings\":[],\"case\":\"x\"}}");
            fs::write(folder.join("summary.json"), text).expect("a file");
        };
        for (place, ticks) in [("one/a", 1), ("one/b", 2), ("s1/a", 1), ("s2/b", 2)] {
            put(place, ticks);
        }
        let merged = |folders: &[&str], out: &str| {
            let folders: Vec<PathBuf> = folders.iter().map(|folder| all.join(folder)).collect();
            run(&folders, &all.join(out))
                .map(|()| fs::read_to_string(all.join(out).join("sessions.csv")).expect("a table"))
        };
        let whole = merged(&["one"], "m1").expect("merged");
        assert_eq!(whole, "session,force_n.max,ticks\n\"a\",1.5,1\n\"b\",1.5,2\n");
        assert_eq!(merged(&["s2", "s1"], "m2").expect("merged"), whole);
        assert!(merged(&["s1", "one"], "m3").is_err() && merged(&["m1"], "m4").is_err());
        fs::remove_dir_all(&all).expect("removed");
    }
}
