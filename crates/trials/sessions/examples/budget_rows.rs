//! Makes the cost and error tables of the budget: runs every choice in the training scenes.
//!
//! The results of each part are stored, so that a stopped run resumes. The open heads take part
//! where `TREPAN_DATA` names their folder.

use anyhow::Result;
use clap::Parser;
use std::path::PathBuf;
use trepan_trials_sessions::budget::training::{Observed, TABLES, observe, parts, tables};

/// Makes the tables of the budget
#[derive(Parser)]
struct Arguments {
    /// Folder for the results of each part; all from the same tables
    work: PathBuf,
    /// Output folder of the tables
    out: PathBuf,
    /// Run only this part, from 0 on
    #[arg(long, value_name = "N")]
    part: Option<usize>,
    /// Make only these tables
    #[arg(long, value_name = "TABLE", value_parser = TABLES, default_values = TABLES)]
    only: Vec<String>,
}

fn main() -> Result<()> {
    let asked = Arguments::parse();
    std::fs::create_dir_all(&asked.work)?;
    let file = |part: usize| asked.work.join(format!("part-{part}.json"));
    for part in (0..parts()).filter(|part| asked.part.is_none_or(|only| only == *part)) {
        if !file(part).is_file() {
            println!("part {part} of {}", parts());
            let half = asked.work.join(format!("part-{part}.half"));
            std::fs::write(&half, serde_json::to_vec(&observe(part, &asked.only))?)?;
            std::fs::rename(half, file(part))?;
        }
    }
    let there: Vec<PathBuf> = (0..parts()).map(file).filter(|file| file.is_file()).collect();
    let read = |file: &PathBuf| Ok(serde_json::from_slice(&std::fs::read(file)?)?);
    let found: Vec<Observed> = there.iter().map(read).collect::<Result<_>>()?;
    for (name, text) in tables(&found) {
        std::fs::write(asked.out.join(name), text)?;
    }
    println!("{} of {} parts are in the tables", found.len(), parts());
    Ok(())
}
