//! `cargo xtask validate`, `merge`, `compare` and `calibrate`: runs suites, merges shards, compares
//! two runs, fits laws to published curves.

use anyhow::{Context, Result, bail};
use clap::{Args, Parser, Subcommand};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};
use trepan_evidence::files::whole;
use trepan_evidence::part::{Part, Scope, Suite};
use trepan_evidence::report::Report;
use trepan_evidence::store::{self, Store};
use trepan_evidence::suite::{Gate, shown};
use trepan_evidence::timer::Control;
use trepan_evidence::{borders, compare, limits, page, repeat};
use trepan_trials::suites::families;
use trepan_trials::suites::{ALL, ON_REQUEST};
use trepan_trials_sessions::calibration;

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
    /// Suites to run, or parts of a suite, as in rigid/walls [default: all suites except those that
    /// run only when named]. A part's name may be given by its beginning
    suites: Vec<String>,
    /// Fewer and smaller scenes
    #[arg(long)]
    quick: bool,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    seed: u64,
    /// Run only every Nth part, from the Ith on, as in 2/8; `cargo xtask merge` combines the
    /// folders
    /// of the shards
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<(usize, usize)>,
    /// Number of parallel processes, at most one per core: finishes sooner, but the timings disturb
    /// each other [default: 2 with --quick, else 1]
    #[arg(long, value_name = "N", conflicts_with = "shard", value_parser = clap::value_parser!(u8).range(1..))]
    jobs: Option<u8>,
    /// Run every part N times: times become medians with 95 % intervals, limits are judged on
    /// medians
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    repeat: u16,
    /// Store the stability boundaries of this run's maps in the sources, as the reference for later
    /// runs
    #[arg(long, conflicts_with = "shard")]
    keep_borders: bool,
    /// List the parts instead of running them
    #[arg(long)]
    list: bool,
    /// Output folder for SUITE.json and index.html
    #[arg(long, value_name = "DIR", default_value = "target/validation")]
    out: PathBuf,
}

#[derive(Subcommand)]
enum Task {
    /// Merge the parts of several shards
    Merge {
        /// Folders that shards wrote with --out
        #[arg(required = true)]
        folders: Vec<PathBuf>,
        /// Output folder for SUITE.json and index.html
        #[arg(long, value_name = "DIR", default_value = "target/validation")]
        out: PathBuf,
        /// Store the stability boundaries of the merged maps in the sources, as the reference for
        /// later
        /// runs
        #[arg(long)]
        keep_borders: bool,
    },
    /// Fit laws to published curves, report what they predict, draw curves over data
    Calibrate {
        /// Write fixtures/measurements/fits.csv
        #[arg(long)]
        write: bool,
        /// Folder for the curves
        #[arg(long, value_name = "DIR", default_value = "target/calibration")]
        out: PathBuf,
    },
    /// Report what got faster, slower, more or less accurate from one run to another
    Compare {
        /// Folder with the SUITE.json files of the old run
        old: PathBuf,
        /// Folder with the SUITE.json files of the new run
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
        Some(Task::Calibrate { write, out }) => calibration::run(&root(), &out, write).map(|()| true),
        Some(Task::Compare { old, new }) => compare::folders(ALL.iter().chain(ON_REQUEST), &old, &new).map(|text| {
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

/// The root of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A part to run.
struct Job {
    suite: &'static Suite,
    part: Part,
    /// Name in files and durations.
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
        let mut out = std::io::stdout().lock();
        // Whoever reads may have read enough.
        let _enough = jobs.iter().try_for_each(|job| writeln!(out, "{}", job.key));
        return Ok(true);
    }
    let store = Store::open(&asked.out, scope)?;
    let at_once = match asked.shard {
        Some(_) => 1,
        None => {
            thread::available_parallelism()?.get().min(jobs.len()).min(asked.jobs.unwrap_or(scope.pick(2, 1)).into())
        }
    };
    let reported = if at_once > 1 { beside(at_once, asked, &jobs, &store)? } else { BTreeSet::new() };
    let kept = perform(jobs, &store, scope, asked.repeat, &reported)?;
    if asked.shard.is_some() || whole_suites.is_empty() {
        println!("parts: {}", asked.out.join("parts").display());
        return Ok(kept);
    }
    let mut passed = kept;
    for suite in whole_suites {
        let report = store.merged(suite)?.context("no part was made")?;
        passed &= write(suite, &report, &asked.out)?;
        keep(asked.keep_borders, suite, &report)?;
        store.forget(suite);
    }
    Ok(paged(&asked.out)? && passed)
}

/// The requested parts, and the suites that are requested as a whole.
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
        let found: Vec<Job> = of(suite).filter(|job| job.key.starts_with(name.as_str())).collect();
        match part {
            Some(part) if found.is_empty() => bail!("{wanted} has no part {part:?}; --list names them"),
            None if suites.iter().all(|listed: &&Suite| listed.name != wanted) => suites.push(suite),
            _ => {}
        }
        for job in found {
            if jobs.iter().all(|listed: &Job| listed.key != job.key) {
                jobs.push(job);
            }
        }
    }
    Ok((jobs, suites))
}

/// Progress of a run: finished parts, and the remaining time estimated from the last run.
struct Progress {
    bar: ProgressBar,
    durations: BTreeMap<String, f64>,
    usual_s: f64,
    left_s: f64,
}

impl Progress {
    fn of(jobs: &[Job], store: &Store, at_once: usize) -> Result<Self> {
        let durations = store.durations();
        let usual_s = durations.values().sum::<f64>() / durations.len().max(1) as f64;
        let bar = ProgressBar::new(jobs.len() as u64);
        bar.set_style(ProgressStyle::with_template("{bar:30} {pos}/{len} parts, {msg}")?);
        // A bar would hide lines that go to a file or another process.
        if !std::io::stdout().is_terminal() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        bar.enable_steady_tick(Duration::from_millis(250));
        let mut progress = Self { bar, durations, usual_s, left_s: 0.0 };
        progress.left_s = jobs.iter().map(|job| progress.expected_s(&job.key)).sum::<f64>() / at_once as f64;
        Ok(progress)
    }

    fn expected_s(&self, key: &str) -> f64 {
        self.durations.get(key).copied().unwrap_or(self.usual_s)
    }

    /// Shows the current part and the remaining time.
    fn show(&self, key: &str) {
        let left = match self.left_s > 0.0 {
            true => format!(" about {} left", HumanDuration(Duration::from_secs_f64(self.left_s))),
            false => String::new(),
        };
        self.bar.set_message(format!("{key}{left}"));
    }
}

/// Runs the parts as shards in parallel processes, into one folder, and forwards their output
/// lines;
/// returns the parts that were reported.
fn beside(at_once: usize, asked: &Run, jobs: &[Job], store: &Store) -> Result<BTreeSet<String>> {
    let program = std::env::current_exe()?;
    let start = |number: usize| {
        let mut shard = Command::new(&program);
        shard.args(&asked.suites).args(asked.quick.then_some("--quick")).arg("--out").arg(&asked.out);
        shard.args(["--seed", &asked.seed.to_string(), "--shard", &format!("{}/{at_once}", number + 1)]);
        shard.args(["--repeat", &asked.repeat.to_string()]);
        shard.stdout(Stdio::piped()).spawn().context("cannot start a process for a shard")
    };
    let mut shards = (0..at_once).map(start).collect::<Result<Vec<Child>>>()?;
    let (mut progress, mut reported) = (Progress::of(jobs, store, at_once)?, BTreeSet::new());
    thread::scope(|scope| {
        let (forward, lines) = mpsc::channel();
        for out in shards.iter_mut().filter_map(|shard| shard.stdout.take()) {
            let forward = forward.clone();
            scope.spawn(move || {
                BufReader::new(out).lines().map_while(Result::ok).try_for_each(|line| forward.send(line))
            });
        }
        drop(forward);
        for line in lines {
            let Some(key) = line.split(": ").next().filter(|key| jobs.iter().any(|job| job.key == *key)) else {
                continue;
            };
            print(&progress.bar, &line);
            progress.left_s -= progress.expected_s(key) / at_once as f64;
            progress.bar.inc(1);
            progress.show(key);
            reported.insert(key.to_string());
        }
    });
    progress.bar.finish_and_clear();
    for mut shard in shards {
        shard.wait()?;
    }
    Ok(reported)
}

/// Runs the parts that are not stored yet; returns whether every acceptance limit of every part is
/// met. Parts in `reported` are not printed again.
fn perform(jobs: Vec<Job>, store: &Store, scope: Scope, repeats: u16, reported: &BTreeSet<String>) -> Result<bool> {
    let mut progress = Progress::of(&jobs, store, 1)?;
    let mut passed = true;
    for Job { suite, part, key } in jobs {
        progress.show(&key);
        progress.left_s -= progress.expected_s(&key);
        let slug = part.slug();
        if let Some(stored) = store.found(suite.name, &slug) {
            if !reported.contains(&key) {
                print(&progress.bar, &format!("{key}: already done"));
            }
            passed &= !stored.findings.gates.iter().any(Gate::breaks);
            progress.durations.insert(key, stored.seconds);
        } else {
            let (before, began) = (Control::now(), Instant::now());
            let (first, mut ended) = part.run(scope);
            let mut all = vec![first];
            for again in (1..repeats).filter_map(|_| (suite.parts)(scope).into_iter().find(|part| part.slug() == slug))
            {
                let (findings, whole) = again.run(scope);
                ended &= whole;
                all.push(findings);
            }
            let mut findings = repeat::combine(all);
            limits::mark(suite.name, scope, &mut findings.gates);
            let seconds = began.elapsed().as_secs_f64();
            let broken = findings.gates.iter().filter(|gate| gate.breaks()).count();
            let word = if broken == 0 { String::new() } else { format!(", {broken} acceptance limit(s) BROKEN") };
            print(&progress.bar, &format!("{key}: {seconds:.1} s{word}"));
            passed &= broken == 0;
            store.keep(suite.name, &slug, (seconds, before.or(Control::now())), (findings, ended))?;
            if ended {
                progress.durations.insert(key, seconds);
                store.remember(&progress.durations)?;
            }
        }
        progress.bar.inc(1);
    }
    store.remember(&progress.durations)?;
    progress.bar.finish_and_clear();
    Ok(passed)
}

/// Prints above the progress bar, or plainly if the bar is hidden.
fn print(bar: &ProgressBar, line: &str) {
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

/// Stores the boundaries of a suite that has maps, if requested.
fn keep(asked: bool, suite: &Suite, report: &Report) -> Result<()> {
    if asked && !report.findings.maps.is_empty() {
        borders::keep(suite.name, report.making.scope(), &report.findings.maps)?;
    }
    Ok(())
}

/// Writes a suite's file and prints its gates.
fn write(suite: &Suite, report: &Report, out: &Path) -> Result<bool> {
    println!("{}: {}?", suite.name, suite.question);
    for gate in &report.findings.gates {
        let word = match (gate.pass, gate.known_gap) {
            (true, _) => "kept  ",
            (_, true) => "known gap",
            _ => "BROKEN",
        };
        println!("  {word} {}: {} {} {}", gate.name, shown(gate.value), gate.op, gate.limit);
    }
    report.findings.conclusions.iter().chain(&report.findings.regressions).for_each(|line| println!("  {line}"));
    whole(&out.join(format!("{}.json", suite.name)), &serde_json::to_vec_pretty(report)?)?;
    Ok(report.passed())
}

/// Writes the page of every report in the folder; returns whether every method of every family is
/// in it. A report with lines over frames gets a page of its own besides.
fn paged(out: &Path) -> Result<bool> {
    let mut reports = Vec::new();
    for suite in ALL.iter().chain(ON_REQUEST) {
        reports.extend(store::report(out, suite.name)?.map(|report| (suite, report)));
    }
    let page = out.join("index.html");
    whole(&page, page::html(&reports, &families::measured(&reports))?.as_bytes())?;
    println!("page: {}", page.display());
    for (suite, report) in &reports {
        let gaps = limits::known_gaps(suite.name, report.making.scope(), &report.findings.gates);
        gaps.iter().for_each(|gap| println!("  KNOWN GAP {gap}"));
    }
    for (suite, report) in reports.iter().filter(|(_, report)| !report.findings.series.is_empty()) {
        let page = out.join(format!("{}.html", suite.name));
        let alone = [(*suite, report.clone())];
        whole(&page, page::html(&alone, &[(); 0])?.as_bytes())?;
        println!("page of {}: {}", suite.name, page.display());
    }
    let holes = families::holes(&reports);
    holes.iter().for_each(|hole| println!("  HOLE {hole}"));
    Ok(holes.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_named_twice_run_once() {
        let count = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(ToString::to_string).collect();
            let (jobs, suites) = jobs(&names, Scope { quick: true, seed: 1 }).unwrap();
            (jobs.len(), suites.len())
        };
        assert_eq!(count(&["rigid", "rigid"]), count(&["rigid"]));
        assert_eq!(count(&["rigid", "rigid/walls"]), count(&["rigid"]));
        assert_eq!(count(&["rigid/walls", "rigid"]), count(&["rigid"]));
        assert_eq!(count(&["rigid/walls"]).1, 0);
    }
}
