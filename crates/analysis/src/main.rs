//! The program `trepan-analysis`: recordings as tables, SQL, studies.

use anyhow::{Context, Result, bail};
use clap::{Parser, Subcommand};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trepan_analysis::export::{self, Exported};
use trepan_analysis::files;
use trepan_analysis::query::{self, Database, MOST_ROWS};
use trepan_analysis::study::{self, Answers, Protocol, Run};

/// Analyse recorded sessions with the tools that you know: Parquet, SQL, studies
#[derive(Parser)]
#[command(
    version,
    after_help = "Examples:
  trepan-analysis export trepan-out --parquet tables
  trepan-analysis query tables --sql \"select task, avg(duration_s) from cases group by task\""
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write recordings as Parquet tables ticks, events, scores and cases
    ///
    /// A folder tables/TABLE/session=ID for each session, as DuckDB, Polars, pandas and Spark read
    /// them. Sessions that are there are left as they are. No name, path or free text of a person
    /// goes into them.
    Export {
        /// Folder of sessions, or one recording (*.mcap)
        runs: PathBuf,
        /// Folder of the tables; it may hold sessions of earlier exports
        #[arg(long, value_name = "DIR")]
        parquet: PathBuf,
    },
    /// Run SQL over the tables
    Query {
        /// Folder that `export` wrote, or a folder of sessions, which is exported first
        runs: PathBuf,
        /// The query, over the tables ticks, events, scores and cases; `describe ticks` lists
        /// columns
        #[arg(long)]
        sql: String,
        /// Write the rows to this file instead of printing them
        #[arg(long, value_name = "FILE")]
        csv: Option<PathBuf>,
    },
    /// Print a study's participants, their orders and its power
    Plan {
        /// Protocol of the study (TOML); protocols/ of this crate has two
        protocol: PathBuf,
        /// Also write participants.csv, consent.txt, answers.csv to fill in, and of blinded
        /// conditions key.csv and condition-LETTER.txt for `--set @FILE`
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// List what a study lacks: sessions, scores, answers
    Check {
        /// Protocol of the study
        protocol: PathBuf,
        /// Folder of sessions, with answers.csv
        runs: PathBuf,
    },
    /// Compute a study's results: a page and CSV tables
    Study {
        /// Protocol of the study
        protocol: PathBuf,
        /// Folder of sessions, with answers.csv
        runs: PathBuf,
        /// Folder of the results; it may hold those of an earlier run
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Lift the blinding: show what is behind each letter
        #[arg(long)]
        unblind: bool,
    },
    /// Make sessions and answers of simulated participants, to try a protocol
    Simulate {
        /// Protocol of the study
        protocol: PathBuf,
        /// New folder of the sessions
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Seed of the participants
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
}

fn main() {
    if let Err(fault) = run(&Arguments::parse().command) {
        eprintln!("error: {fault:#}");
        std::process::exit(1);
    }
}

fn run(command: &Command) -> Result<()> {
    match command {
        Command::Export { runs, parquet } => export_tables(runs, parquet),
        Command::Query { runs, sql, csv } => run_query(runs, sql, csv.as_deref()),
        Command::Plan { protocol, out } => plan(protocol, out.as_deref()),
        Command::Check { protocol, runs } => check(protocol, runs),
        Command::Study { protocol, runs, out, unblind } => study(protocol, runs, out, *unblind),
        Command::Simulate { protocol, out, seed } => {
            let sessions = study::simulate::simulate(&Protocol::read(protocol)?, out, *seed)?;
            println!("{sessions} sessions of simulated participants in {}; nobody operated", files::shown(out));
            Ok(())
        }
    }
}

fn export_tables(runs: &Path, out: &Path) -> Result<()> {
    let begin = Instant::now();
    let exported = export::export(runs, out)?;
    let seconds = begin.elapsed().as_secs_f64();
    let Exported { written, skipped, ticks, .. } = exported;
    println!("{written} sessions exported, {skipped} were there already and unchanged");
    if written > 0 {
        let factor = exported.seconds / seconds.max(1e-9);
        println!("{ticks} ticks, {:.0} s of sessions in {seconds:.1} s: {factor:.0} times real time", exported.seconds);
    }
    tell(&exported)
}

/// Prints warnings; an error if a recording failed.
fn tell(exported: &Exported) -> Result<()> {
    exported.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    if exported.versions.len() > 1 {
        let versions: Vec<String> =
            exported.versions.iter().map(|(version, count)| format!("{version} ({count})")).collect();
        let remedy = "forces may differ between versions: `program` and `version` of cases tell them apart";
        eprintln!("warning: the sessions are of several programs or versions: {}; {remedy}", versions.join(", "));
    }
    exported.failed.iter().for_each(|failed| eprintln!("failed: {failed}"));
    if !exported.failed.is_empty() {
        bail!("{} recordings were not exported; the others are whole", exported.failed.len());
    }
    Ok(())
}

fn run_query(runs: &Path, sql: &str, csv: Option<&Path>) -> Result<()> {
    let database = Database::open(runs)?;
    match csv {
        Some(path) => {
            let rows = database.csv(sql, path)?;
            println!("{rows} rows in {}", files::shown(path));
        }
        None => {
            let (table, more) = database.table(sql)?;
            println!("{table}");
            if more {
                println!("only the first {MOST_ROWS} rows; --csv FILE writes all of them");
            }
        }
    }
    database.exported.as_ref().map_or(Ok(()), tell).context("the rows are those of the others")
}

fn plan(protocol: &Path, out: Option<&Path>) -> Result<()> {
    let protocol = Protocol::read(protocol)?;
    let plan = study::plan(&protocol);
    print!("{}\n{}", plan.participants_csv(&protocol), study::power_lines(&protocol));
    if let Some(out) = out {
        plan.write(&protocol, out)?;
        println!("written into {}", files::shown(out));
        if !plan.key.is_empty() {
            println!("key.csv says what is behind the letters: keep it from those who measure and those who analyse");
        }
    }
    Ok(())
}

/// Runs, answers and what is missing. `tables` is where recordings are exported to.
fn gather(protocol: &Protocol, runs: &Path, tables: &Path) -> Result<(Vec<Run>, Answers, Vec<String>)> {
    let (answers, wrong) = study::answers(protocol, &runs.join("answers.csv"))?;
    let tables = if query::is_tables(runs) { runs } else { tables };
    let (mut known, mut left) = (None, Vec::new());
    if tables != runs {
        let exported = export::export(runs, tables)?;
        tell(&exported)?;
        known = Some(exported.sessions);
    }
    let (mut runs, others) = study::runs(protocol, tables)?;
    if let Some(known) = known {
        let before = runs.len();
        runs.retain(|run| known.contains(&run.session));
        // Those of an earlier run that are no longer in RUNS.
        left.extend(
            (runs.len() < before).then(|| format!("{} sessions of the tables are left out", before - runs.len())),
        );
    }
    let missing = study::missing(protocol, &runs, &answers);
    Ok((runs, answers, [others, wrong, missing, left].concat()))
}

fn check(protocol: &Path, runs: &Path) -> Result<()> {
    let protocol = Protocol::read(protocol)?;
    let folder = tempfile::tempdir().context("cannot make a temporary folder; set TMPDIR to one with free space")?;
    let (runs, _, missing) = gather(&protocol, runs, folder.path())?;
    missing.iter().for_each(|line| println!("{line}"));
    if !missing.is_empty() {
        bail!("{} things are missing or wrong, {} sessions are there", missing.len(), runs.len());
    }
    println!("nothing is missing: {} sessions", runs.len());
    Ok(())
}

fn study(protocol: &Path, runs: &Path, out: &Path, unblind: bool) -> Result<()> {
    let protocol = Protocol::read(protocol)?;
    let names = if unblind { study::plan(&protocol).names(&protocol) } else { BTreeMap::new() };
    let (runs, answers, missing) = gather(&protocol, runs, &out.join("tables"))?;
    let results = study::analyse(&protocol, &runs, &answers);
    study::write(&protocol, &results, &missing, &names, out)?;
    let found = results.findings.iter().filter(|finding| finding.found).count();
    let simulated = if results.simulated { " of simulated participants" } else { "" };
    println!("{found} of {} comparisons{simulated} are findings", results.findings.len());
    if !missing.is_empty() {
        println!("{} things are missing; the page and `check` list them", missing.len());
    }
    println!("{}", files::shown(&out.join("study.html")));
    Ok(())
}
