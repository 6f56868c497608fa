//! Makes the rows of the budget: runs every choice in scenes of training and writes the tables of what was found.
//!
//! `budget_rows WORK OUT` keeps what each part found in WORK, so that it goes on where it was stopped, and writes the tables to OUT. `budget_rows WORK OUT N`
//! makes part N only. The open heads take part where `TREPAN_DATA` says where they are.

use anyhow::{Context, Result};
use std::path::PathBuf;
use trepan_trials::suites::budget::training::{Observed, observe, parts, tables};

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let mut folder =
        || arguments.next().map(PathBuf::from).context("give two folders: WORK for what is found, OUT for the tables");
    let (work, out) = (folder()?, folder()?);
    let only: Option<usize> = arguments.next().map(|number| number.parse()).transpose()?;
    std::fs::create_dir_all(&work)?;
    let file = |part: usize| work.join(format!("part-{part}.json"));
    for part in (0..parts()).filter(|part| only.is_none_or(|only| only == *part)) {
        if !file(part).is_file() {
            println!("part {part} of {}", parts());
            let half = work.join(format!("part-{part}.half"));
            std::fs::write(&half, serde_json::to_vec(&observe(part))?)?;
            std::fs::rename(half, file(part))?;
        }
    }
    let there: Vec<PathBuf> = (0..parts()).map(file).filter(|file| file.is_file()).collect();
    let read = |file: &PathBuf| Ok(serde_json::from_slice(&std::fs::read(file)?)?);
    let found: Vec<Observed> = there.iter().map(read).collect::<Result<_>>()?;
    for (name, text) in tables(&found) {
        std::fs::write(out.join(name), text)?;
    }
    println!("{} of {} parts are in the tables", found.len(), parts());
    Ok(())
}
