//! The project's own commands, `cargo xtask COMMAND`; `--help` lists them.

mod bundle;
mod constants;
mod fuzz;
mod gallery;
mod layers;
mod merge;
mod modules;
mod operation;
mod prose;
mod size;
mod tidy;
mod validation;

use anyhow::{Context, Result, bail};
use clap::{Parser, Subcommand};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

/// What is off by default and still checked: the solver on the graphics device.
const FEATURES: [&str; 2] = ["--features", "trepan-tled/gpu"];

/// The programs as the tests have built them: other flags would build crates again.
const BINS: [&str; 4] = ["--workspace", "--bins", FEATURES[0], FEATURES[1]];

#[derive(Parser)]
#[command(about = "Trepan's project commands", max_term_width = 120)]
struct Arguments {
    #[command(subcommand)]
    command: Task,
}

#[derive(Subcommand)]
enum Task {
    /// What a change must pass: fmt, layers, tidy, clippy, tests, doc tests, docs. Needs a Vulkan
    /// driver; Mesa's software driver will do
    Test,
    /// Everything that CI runs: `test`, a short headless operation, the quick validation, the
    /// bundle for a graphics card, the Python package
    Ci,
    /// Run the property tests again and again, each round with a fresh, printed seed
    Fuzz {
        /// For so long; at least one round
        #[arg(long, value_name = "N", default_value_t = 10.0)]
        minutes: f64,
    },
    /// Run validation suites in release mode; writes SUITE.json and index.html
    Validate {
        /// Passed on: SUITE, --quick, --shard I/N, --out DIR
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Put shards together: those of `validate` into SUITE.json and index.html, those of sessions
    /// into sessions.csv and sessions.json
    Merge {
        /// Folders that `validate --shard`, sessions, or batches of sessions wrote with --out
        #[arg(required = true)]
        folders: Vec<PathBuf>,
        /// Where the result goes
        #[arg(long, value_name = "DIR", default_value = "trepan-out/merged")]
        out: PathBuf,
    },
    /// Say what got faster, slower, more or less accurate from one validation to another, and how
    /// sure that is
    Compare {
        /// A folder that `validate` wrote
        old: PathBuf,
        /// Another one
        new: PathBuf,
    },
    /// Fit laws to published curves, report what they predict, draw curves over data
    Calibrate {
        /// Passed on: --write to write fixtures/measurements/fits.csv, --out DIR
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Make a folder that measures a graphics card on any x86-64 Linux with a Vulkan driver
    Bundle {
        /// What is bundled
        #[arg(value_parser = ["gpu"])]
        what: String,
        /// The folder, which must not exist yet
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Draw fixed views of the programs and show them beside the kept ones, on one page
    Gallery {
        /// Where page and pictures go
        #[arg(long, value_name = "DIR", default_value = "target/gallery")]
        out: PathBuf,
        /// Keep these pictures, in fixtures/pictures/gallery: look at them before
        #[arg(long)]
        keep: bool,
    },
    /// Check that every arrow between crates points down and that each crate does only what is its
    /// to do
    Layers,
    /// Check module docs, file lengths, READMEs, examples, shader and Rust pairs, and that physical
    /// constants name a row of the register of measurements
    Tidy,
    /// Print lines of source and tests by crate, held against the budget in crates/README.md
    Size,
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(fault) => {
            eprintln!("xtask: {fault:#}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<()> {
    match Arguments::parse().command {
        Task::Test => {
            test()?;
            println!("xtask test: all passed");
            Ok(())
        }
        Task::Ci => ci(),
        Task::Fuzz { minutes } => fuzz::run(&root(), minutes),
        Task::Validate { arguments } => validate(&arguments),
        Task::Merge { folders, out } if folders.iter().any(|folder| folder.join("parts").is_dir()) => {
            let mut arguments = vec!["merge".into()];
            arguments.extend(folders.iter().map(|folder| folder.display().to_string()));
            arguments.extend(["--out".into(), out.display().to_string()]);
            validate(&arguments)
        }
        Task::Merge { folders, out } => merge::run(&folders, &out),
        Task::Compare { old, new } => {
            validate(&["compare".into(), old.display().to_string(), new.display().to_string()])
        }
        Task::Calibrate { arguments } => {
            let arguments = std::iter::once("calibrate".into()).chain(arguments);
            validate(&arguments.collect::<Vec<String>>())
        }
        Task::Bundle { out, .. } => bundle::gpu(&root(), &out),
        Task::Gallery { out, keep } => gallery::run(&root(), &out, keep),
        Task::Layers => report("layers", layers::check(&root())?),
        Task::Tidy => report("tidy", tidy(&root())?),
        Task::Size => report("size", size::check(&root())?),
    }
}

/// Faults of prose and lengths, and physical constants without a row.
fn tidy(root: &Path) -> Result<Vec<String>> {
    let mut faults = tidy::check(root)?;
    faults.extend(constants::check(root)?);
    Ok(faults)
}

/// Starts the program of all suites, in release mode. Not quietly: cargo reports that it builds or
/// waits for another build.
const VALIDATE: [&str; 7] = ["run", "--release", "--package", "trepan-trials", "--bin", "validate", "--"];

fn validate(arguments: &[String]) -> Result<()> {
    cargo(&VALIDATE, arguments)
}

/// The steps of CI in the order in which they fail fastest.
fn ci() -> Result<()> {
    test()?;
    cargo(&[&["build"][..], &BINS].concat(), &[])?;
    operation::check(&root())?;
    validation::check(&root())?;
    bundle::check(&root())?;
    layers::APART.iter().try_for_each(|folder| apart(&root(), folder))?;
    println!("xtask ci: all passed");
    Ok(())
}

/// A crate that is a workspace of its own, by its script `check`.
fn apart(root: &Path, folder: &str) -> Result<()> {
    println!("{folder}/check");
    let begin = Instant::now();
    let status = Command::new(root.join(folder).join("check")).status()?;
    println!("xtask: {folder}/check took {:.0} s", begin.elapsed().as_secs_f64());
    match status.code() {
        Some(0) => Ok(()),
        Some(75) => {
            println!("not all checked: there is no Python with venv here, or its packages cannot be fetched");
            Ok(())
        }
        _ => bail!("{folder}/check failed"),
    }
}

/// The steps that every change must pass.
fn test() -> Result<()> {
    cargo(&["fmt", "--all", "--check"], &[])?;
    report("layers", layers::check(&root())?)?;
    report("tidy", tidy(&root())?)?;
    report("size", size::check(&root())?)?;
    cargo(
        &["clippy", "--workspace", "--all-targets", FEATURES[0], FEATURES[1], "--quiet", "--", "--deny", "warnings"],
        &[],
    )?;
    cargo(&["check", "--package", "trepan-models", "--no-default-features", "--quiet"], &[])?;
    tests()?;
    cargo(&["test", "--workspace", "--doc", "--quiet"], &[])?;
    documentation()
}

/// Nextest where it is installed, for its timeouts and its clear failures; else cargo's own runner.
/// Examples are compiled by the lints and not linked here.
fn tests() -> Result<()> {
    let nextest = Command::new("cargo").args(["nextest", "--version"]).output().is_ok_and(|out| out.status.success());
    if nextest {
        cargo(
            &[
                "nextest",
                "run",
                "--workspace",
                "--tests",
                FEATURES[0],
                FEATURES[1],
                "--no-fail-fast",
                "--status-level",
                "slow",
            ],
            &[],
        )
    } else {
        cargo(&["test", "--workspace", "--tests", FEATURES[0], FEATURES[1], "--quiet"], &[])
    }
}

fn documentation() -> Result<()> {
    println!("xtask: cargo doc");
    let status = Command::new("cargo")
        .args(["doc", "--workspace", "--no-deps", "--quiet"])
        .env("RUSTDOCFLAGS", "--deny warnings")
        .current_dir(root())
        .status()
        .context("cannot start cargo doc")?;
    if !status.success() {
        bail!("cargo doc failed");
    }
    Ok(())
}

/// Fixes the seed of the property tests, so that a failure comes from the change. The environment
/// may name another seed.
const DRAWS: [&str; 2] = ["PROPTEST_RNG_SEED", "2026"];

fn cargo(arguments: &[&str], more: &[String]) -> Result<()> {
    println!("xtask: cargo {} {}", arguments.join(" "), more.join(" "));
    let begin = Instant::now();
    let status = Command::new("cargo")
        .args(arguments)
        .args(more)
        .env(DRAWS[0], std::env::var(DRAWS[0]).unwrap_or_else(|_| DRAWS[1].into()))
        .env("TREPAN_REQUIRE_GPU", "1")
        .current_dir(root())
        .status()
        .with_context(|| format!("cannot start cargo {}", arguments[0]))?;
    println!("xtask: cargo {} took {:.0} s", arguments[0], begin.elapsed().as_secs_f64());
    if !status.success() {
        bail!("cargo {} failed", arguments[0]);
    }
    Ok(())
}

/// Runs a program that the tests have built.
fn built(name: &str, arguments: &[&str]) -> Result<()> {
    println!("xtask: {name} {}", arguments.join(" "));
    let program = std::env::current_exe()?.with_file_name(name);
    let status = Command::new(&program).args(arguments).current_dir(root()).status();
    let status = status.with_context(|| format!("cannot start {}", program.display()))?;
    if !status.success() {
        bail!("{name} failed");
    }
    Ok(())
}

fn report(name: &str, faults: Vec<String>) -> Result<()> {
    if faults.is_empty() {
        println!("xtask {name}: clean");
        return Ok(());
    }
    faults.iter().for_each(|fault| eprintln!("{name}: {fault}"));
    bail!("{} fault(s) in {name}", faults.len());
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace").to_path_buf()
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_validation_that_waits_for_another_build_reports_it() {
        assert!(super::VALIDATE.iter().all(|argument| !["--quiet", "-q"].contains(argument)));
    }
}
