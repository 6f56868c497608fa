//! `cargo xtask validate`, `merge` and `compare`: runs suites, puts shards together, sets two runs side by side.

use anyhow::{Context, Result, bail};
use clap::{Args, Parser, Subcommand};
use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};
use trepan_trials::part::{Part, Scope, Suite};
use trepan_trials::report::Report;
use trepan_trials::store::{self, Store, whole};
use trepan_trials::suite::shown;
use trepan_trials::suites::{ALL, ON_REQUEST};
use trepan_trials::timer::Control;
use trepan_trials::{borders, compare, families, page};

#[derive(Parser)]
#[command(name = "cargo xtask validate", about = "Run validation suites", max_term_width = 120)]
#[command(args_conflicts_with_subcommands = true)]
struct Arguments {
    #[command(subcommand)]
    task: Option<Task>,
    #[command(flatten)]
    run: Run,
}

#[derive(Args)]
struct Run {
    /// The suites to run, or one's parts that begin so, as in rigid/walls [default: all but those that fetch programs of others]
    suites: Vec<String>,
    /// Fewer and smaller scenes
    #[arg(long)]
    quick: bool,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    seed: u64,
    /// Only every Nth part, from the Ith on, as in 2/8; `cargo xtask merge` puts the shards' folders together
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<(usize, usize)>,
    /// Keep the borders of this run's maps as those that later runs are held against (in the sources)
    #[arg(long, conflicts_with = "shard")]
    keep_borders: bool,
    /// Name the parts instead of running them
    #[arg(long)]
    list: bool,
    /// Where SUITE.json and index.html go
    #[arg(long, value_name = "DIR", default_value = "target/validation")]
    out: PathBuf,
}

#[derive(Subcommand)]
enum Task {
    /// Put the parts of several shards together
    Merge {
        /// Folders that shards wrote with --out
        #[arg(required = true)]
        folders: Vec<PathBuf>,
        /// Where SUITE.json and index.html go
        #[arg(long, value_name = "DIR", default_value = "target/validation")]
        out: PathBuf,
        /// Keep the borders of the merged maps as those that later runs are held against (in the sources)
        #[arg(long)]
        keep_borders: bool,
    },
    /// What got faster, slower, more or less accurate from one run to another
    Compare {
        /// A folder with SUITE.json files
        old: PathBuf,
        /// Another one
        new: PathBuf,
    },
}

fn shard(text: &str) -> Result<(usize, usize), String> {
    let remedy = "expected I/N with 1 <= I <= N, as in 2/8";
    let (i, n) = text.split_once('/').ok_or(remedy)?;
    let (i, n): (usize, usize) = (i.parse().map_err(|_| remedy)?, n.parse().map_err(|_| remedy)?);
    if i >= 1 && i <= n { Ok((i - 1, n)) } else { Err(remedy.into()) }
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let passed = match arguments.task {
        None => run(&arguments.run),
        Some(Task::Merge { folders, out, keep_borders }) => merge(&folders, &out, keep_borders),
        Some(Task::Compare { old, new }) => compare::folders(&old, &new).map(|text| {
            println!("{text}");
            true
        }),
    };
    match passed {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(fault) => {
            eprintln!("validate: {fault:#}");
            ExitCode::from(2)
        }
    }
}

/// A part to run.
struct Job {
    suite: &'static Suite,
    part: Part,
    /// Its name in files and durations.
    key: String,
}

fn run(asked: &Run) -> Result<bool> {
    let scope = Scope { quick: asked.quick, seed: asked.seed };
    let (mut jobs, whole_suites) = jobs(&asked.suites, scope)?;
    if let Some((number, of)) = asked.shard {
        let mut at = 0..;
        jobs.retain(|_| at.next().is_some_and(|at: usize| at % of == number));
    }
    if asked.list {
        jobs.iter().for_each(|job| println!("{}", job.key));
        return Ok(true);
    }
    let store = Store::open(&asked.out, scope)?;
    let kept = perform(jobs, &store, scope)?;
    if asked.shard.is_some() || whole_suites.is_empty() {
        println!("parts: {}", asked.out.join("parts").display());
        return Ok(kept);
    }
    let mut passed = true;
    for suite in whole_suites {
        let report = store::merged(suite, std::slice::from_ref(&asked.out))?.context("no part was made")?;
        passed &= write(suite, &report, &asked.out)?;
        keep(asked.keep_borders, suite, &report)?;
        store.forget(suite.name);
    }
    Ok(paged(&asked.out)? && passed)
}

/// The parts that are asked for, and the suites that are asked for as a whole.
fn jobs(names: &[String], scope: Scope) -> Result<(Vec<Job>, Vec<&'static Suite>)> {
    let job = |suite: &'static Suite, part: Part| Job { suite, key: format!("{}/{}", suite.name, part.slug()), part };
    let of = |suite: &'static Suite| (suite.parts)(scope).into_iter().map(move |part| job(suite, part));
    if names.is_empty() {
        return Ok((ALL.iter().flat_map(of).collect(), ALL.iter().collect()));
    }
    let (mut jobs, mut suites) = (Vec::new(), Vec::new());
    for name in names {
        let (wanted, part) = name.split_once('/').map_or((name.as_str(), None), |(suite, part)| (suite, Some(part)));
        let all = ALL.iter().chain(ON_REQUEST);
        let Some(suite) = all.clone().find(|suite| suite.name == wanted) else {
            let known: Vec<_> = all.map(|suite| suite.name).collect();
            bail!("there is no suite {wanted:?}; known are {}", known.join(", "));
        };
        let begins = |job: &Job| job.key.starts_with(name.as_str());
        let before = jobs.len();
        jobs.extend(of(suite).filter(begins));
        match part {
            None => suites.push(suite),
            Some(part) if jobs.len() == before => bail!("{wanted} has no part {part:?}; --list names them"),
            Some(_) => {}
        }
    }
    Ok((jobs, suites))
}

/// Runs what is not there yet; gives whether every promise of every part was kept.
fn perform(jobs: Vec<Job>, store: &Store, scope: Scope) -> Result<bool> {
    let mut durations = store.durations();
    let usual = durations.values().sum::<f64>() / durations.len().max(1) as f64;
    let expected = |key: &str, known: &BTreeMap<String, f64>| known.get(key).copied().unwrap_or(usual);
    let mut left_s: f64 = jobs.iter().map(|job| expected(&job.key, &durations)).sum();
    let bar = ProgressBar::new(jobs.len() as u64);
    bar.set_style(ProgressStyle::with_template("{bar:30} {pos}/{len} parts, {msg}")?);
    bar.enable_steady_tick(Duration::from_millis(250));
    let mut passed = true;
    for Job { suite, part, key } in jobs {
        let left = if left_s > 0.0 {
            format!("about {} left", HumanDuration(Duration::from_secs_f64(left_s)))
        } else {
            "".into()
        };
        bar.set_message(format!("{key} {left}"));
        left_s -= expected(&key, &durations);
        let slug = part.slug();
        if let Some(stored) = store.found(suite.name, &slug) {
            say(&bar, &format!("{key}: there already"));
            passed &= stored.findings.gates.iter().all(|gate| gate.pass);
        } else {
            let (before, began) = (Control::now(), Instant::now());
            let (findings, ended) = part.run(scope);
            let seconds = began.elapsed().as_secs_f64();
            let broken = findings.gates.iter().filter(|gate| !gate.pass).count();
            let word = if broken == 0 { String::new() } else { format!(", {broken} promise(s) BROKEN") };
            say(&bar, &format!("{key}: {seconds:.1} s{word}"));
            passed &= broken == 0;
            store.keep(suite.name, &slug, (seconds, before.or(Control::now())), (findings, ended))?;
            if ended {
                durations.insert(key, seconds);
                store.remember(&durations)?;
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(passed)
}

/// Above the bar, or plainly where there is none.
fn say(bar: &ProgressBar, line: &str) {
    if bar.is_hidden() {
        println!("{line}");
    } else {
        bar.println(line);
    }
}

fn merge(folders: &[PathBuf], out: &Path, keep_borders: bool) -> Result<bool> {
    let (mut passed, mut any) = (true, false);
    for suite in ALL.iter().chain(ON_REQUEST) {
        if let Some(report) = store::merged(suite, folders)? {
            passed &= write(suite, &report, out)?;
            keep(keep_borders, suite, &report)?;
            any = true;
        }
    }
    if !any {
        bail!("no parts lie in {folders:?}: give the folders that shards wrote with --out");
    }
    Ok(paged(out)? && passed)
}

/// Keeps the borders of a suite that has maps, where that is asked for.
fn keep(asked: bool, suite: &Suite, report: &Report) -> Result<()> {
    if asked && !report.findings.maps.is_empty() {
        borders::keep(suite.name, report.making.scope(), &report.findings.maps)?;
    }
    Ok(())
}

/// A suite's file, and its gates for the eye.
fn write(suite: &Suite, report: &Report, out: &Path) -> Result<bool> {
    println!("{}: {}?", suite.name, suite.question);
    for gate in &report.findings.gates {
        let word = if gate.pass { "kept  " } else { "BROKEN" };
        println!("  {word} {}: {} {} {}", gate.name, shown(gate.value), gate.op, gate.limit);
    }
    report.findings.regressions.iter().for_each(|line| println!("  {line}"));
    whole(&out.join(format!("{}.json", suite.name)), &serde_json::to_vec_pretty(report)?)?;
    Ok(report.passed())
}

/// The page of every report that lies in the folder; whether every method of every family is in it.
fn paged(out: &Path) -> Result<bool> {
    let mut reports = Vec::new();
    for suite in ALL.iter().chain(ON_REQUEST) {
        reports.extend(store::report(out, suite.name)?.map(|report| (suite, report)));
    }
    let page = out.join("index.html");
    whole(&page, page::html(&reports).as_bytes())?;
    println!("page: {}", page.display());
    let holes = families::holes(&reports);
    holes.iter().for_each(|hole| println!("  HOLE {hole}"));
    Ok(holes.is_empty())
}
