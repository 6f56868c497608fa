//! `cargo xtask validate`: runs suites and writes what they found.

use anyhow::{Context, Result, bail};
use clap::Parser;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use trepan_trials::page;
use trepan_trials::suite::{Report, shown};
use trepan_trials::suites::{ALL, ON_REQUEST, Scope, Suite};

#[derive(Parser)]
#[command(name = "cargo xtask validate", about = "Run validation suites", max_term_width = 120)]
struct Arguments {
    /// The suites to run [default: all but mesh-rivals]
    suites: Vec<String>,
    /// Fewer and smaller scenes
    #[arg(long)]
    quick: bool,
    /// This run's part of the rows, from 1, as in 2/8
    #[arg(long, value_name = "I/N", default_value = "1/1", value_parser = shard)]
    shard: (usize, usize),
    /// Where SUITE.json and index.html go
    #[arg(long, value_name = "DIR", default_value = "target/validation")]
    out: PathBuf,
}

fn shard(text: &str) -> Result<(usize, usize), String> {
    let remedy = "expected I/N with 1 <= I <= N, as in 2/8";
    let (i, n) = text.split_once('/').ok_or(remedy)?;
    let (i, n): (usize, usize) = (i.parse().map_err(|_| remedy)?, n.parse().map_err(|_| remedy)?);
    if i >= 1 && i <= n { Ok((i - 1, n)) } else { Err(remedy.into()) }
}

fn main() -> Result<ExitCode> {
    let arguments = Arguments::parse();
    let chosen = chosen(&arguments.suites)?;
    let scope = Scope { quick: arguments.quick, shard: arguments.shard };
    std::fs::create_dir_all(&arguments.out).with_context(|| format!("cannot make {}", arguments.out.display()))?;
    let mut reports = Vec::new();
    for suite in chosen {
        println!("{}: {}?", suite.name, suite.question);
        let report = Report::new(suite.name, (suite.run)(scope));
        for gate in &report.findings.gates {
            let word = if gate.pass { "kept  " } else { "BROKEN" };
            println!("  {word} {}: {} {} {}", gate.name, shown(gate.value), gate.op, gate.limit);
        }
        whole(&arguments.out.join(format!("{}.json", suite.name)), &serde_json::to_vec_pretty(&report)?)?;
        reports.push((suite, report));
    }
    let page = arguments.out.join("index.html");
    whole(&page, page::html(&reports).as_bytes())?;
    println!("page: {}", page.display());
    let passed = reports.iter().all(|(_, report)| report.passed());
    Ok(if passed { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn chosen(names: &[String]) -> Result<Vec<&'static Suite>> {
    let mut suites = Vec::new();
    for name in names {
        let all = ALL.iter().chain(ON_REQUEST);
        let Some(suite) = all.clone().find(|suite| suite.name == name) else {
            let known: Vec<_> = all.map(|suite| suite.name).collect();
            bail!("there is no suite {name:?}; known are {}", known.join(", "));
        };
        suites.push(suite);
    }
    Ok(if suites.is_empty() { ALL.iter().collect() } else { suites })
}

/// Writes a file whole or not at all.
fn whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = tempfile::NamedTempFile::new_in(path.parent().unwrap_or(Path::new(".")))?;
    file.write_all(bytes)?;
    file.persist(path).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(())
}
