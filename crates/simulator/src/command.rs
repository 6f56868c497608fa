//! What every program does with its command line: flags, session, exit code.

use crate::batch;
use crate::case::choice::{Built, PlannedCase, plan_case};
use crate::compare::compare;
use crate::device_test;
use crate::models::ModelRequest;
use crate::options::{CaseTask, DeviceTask, Patient, RecordingTask, Task, rate};
use crate::recordings;
use crate::report::summary::{CutOff, slow};
use crate::show::driver;
use crate::{Ended, Inputs, Options, Program, Session, SessionError, build_case};
use clap::Parser;
use std::io::IsTerminal;
use std::path::Path;
use std::process::ExitCode;
use tracing_subscriber::EnvFilter;

/// Runs a program. Exit code 0 for a session that ended, 2 for what the user can put right, 1 for
/// the rest and for the replay of a recording that is not whole, 128 + n after signal n.
///
/// `built_in` is the case that is taken when no image is given.
pub fn command(program: Program, built_in: Inputs) -> ExitCode {
    guard_files();
    let options = match Options::try_parse() {
        Ok(options) => options,
        // On a terminal clap would show them as they are.
        Err(fault) if std::env::args_os().any(|word| word.to_string_lossy().contains(char::is_control)) => {
            eprint!("{}", printable(&fault.to_string()));
            return ExitCode::from(2);
        }
        Err(fault) => fault.exit(),
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn,trepan_simulator=info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(false)
        .without_time()
        .init();
    if options.list_devices {
        trepan_haptics::list().iter().for_each(|device| println!("{:31} {}", device.name, device.state));
        return ExitCode::SUCCESS;
    }
    if let Some(task) = &options.task {
        return perform(program, task, built_in);
    }
    match batch::recordings(&options) {
        Ok(Some(files)) => return batched(batch::run(program, &options, &built_in, &files), files.len()),
        Ok(None) => {}
        Err(fault) => return failed(program, &fault),
    }
    match Session::open(program, options, built_in).and_then(Session::run) {
        Ok(ended) => told(&ended),
        Err(fault) => failed(program, &fault),
    }
}

fn batched(failures: usize, files: usize) -> ExitCode {
    println!("{} of {files} recordings run again", files - failures);
    if failures == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Does something else than a session.
fn perform(program: Program, task: &Task, built_in: Inputs) -> ExitCode {
    let done = match task {
        Task::Plan { case, patient, tolerances, rate_hz, picture } => {
            let wish = tolerances.check().and_then(|()| rate((*rate_hz).into())).map_err(SessionError::Usage);
            let wish = wish.and_then(|()| ModelRequest::to_plan(program, patient, *tolerances, *rate_hz, *picture));
            wish.and_then(|wish| planned(program, case.as_deref(), patient, built_in, wish))
        }
        Task::Case(CaseTask::Series { folder }) => list_series(folder),
        Task::Case(CaseTask::Build { patient, out }) => {
            build_case(program, patient, out, built_in).map(|Built { name, notes }| {
                notes.iter().for_each(|note| println!("note: {}", printable(note)));
                let folder = printable(&out.display().to_string());
                println!("{name} is in {folder}; open it with --case {folder}");
                ExitCode::SUCCESS
            })
        }
        Task::Compare { first, second, out } => compare([first, second], out).map(|page| {
            println!("side by side: {}", printable(&page.display().to_string()));
            ExitCode::SUCCESS
        }),
        Task::Recording(RecordingTask::Check { file }) => recordings::check(program, file),
        Task::Recording(RecordingTask::Repair { file, out }) => recordings::mend(file, out),
        Task::Device(DeviceTask::Test { name, out, duration }) => device_test::run(name, out, *duration).map(ended_by),
    };
    done.unwrap_or_else(|fault| failed(program, &fault))
}

/// One line for each series of a folder.
fn list_series(folder: &Path) -> Result<ExitCode, SessionError> {
    if !folder.is_dir() {
        let fault = format!("{} is no folder: give the one that holds the slices", folder.display());
        return Err(SessionError::Usage(fault));
    }
    let found = trepan_volume::dicom::series(folder)?;
    if found.is_empty() {
        let fault = format!("no DICOM series lies in {}: give a folder of slices", folder.display());
        return Err(SessionError::Usage(fault));
    }
    println!("the first number is the one that --ct-series and --mri-series take; it counts from 0");
    for (number, series) in found.iter().enumerate() {
        let [columns, rows] = series.size;
        let scanner = series.number.map_or_else(String::new, |n| format!(", number {n} at the scanner"));
        println!("{number}: {}, {} slices of {columns}x{rows}{scanner}", series.modality, series.slices);
    }
    Ok(ExitCode::SUCCESS)
}

/// What a case needs on this machine.
fn planned(
    program: Program,
    case: Option<&Path>,
    patient: &Patient,
    built_in: Inputs,
    wish: ModelRequest,
) -> Result<ExitCode, SessionError> {
    let card = || driver::open().is_ok_and(|gpu| !gpu.is_software());
    let PlannedCase { models, notes } = plan_case(program, case, patient, built_in, wish, card)?;
    println!("{}", models.told());
    notes.iter().for_each(|note| println!("note: {note}"));
    Ok(ExitCode::SUCCESS)
}

fn told(ended: &Ended) -> ExitCode {
    let summary = &ended.summary;
    println!(
        "{} ticks at {:.1} Hz (compute p50 {:.1}, p99 {:.1} us; {} late), force up to {:.2} N, {:.1} mm3 of bone removed, {} warnings, {} pictures",
        summary.ticks,
        summary.rate_hz,
        summary.tick_us.p50,
        summary.tick_us.p99,
        summary.late_ticks,
        summary.force_n.max,
        summary.bone_removed_mm3,
        summary.warnings.len(),
        summary.frames
    );
    if summary.replay.is_none() {
        slow(summary.rate_hz, summary.asked_hz).iter().for_each(|slow| println!("{slow}"));
    }
    if summary.cut_off.pieces > 0 {
        let CutOff { pieces, largest_mm3 } = summary.cut_off;
        println!("cut off the skull: {pieces} piece(s) of bone, the largest of {largest_mm3:.0} mm3");
    }
    if let Some(replay) = &summary.replay {
        println!("replay: {}", replay.told());
    }
    println!("report: {}", printable(&ended.out.join("report.html").display().to_string()));
    if let Some(lack) = &ended.lack {
        println!("{}", printable(lack));
        return ended.signal.map_or(ExitCode::FAILURE, |_| ended_by(ended.signal));
    }
    ended_by(ended.signal)
}

fn ended_by(signal: Option<i32>) -> ExitCode {
    signal.map_or(ExitCode::SUCCESS, |signal| ExitCode::from(128 + signal as u8))
}

fn failed(program: Program, fault: &SessionError) -> ExitCode {
    eprintln!("{}: {}", program.name(), printable(&fault.to_string()));
    ExitCode::from(fault.exit_code())
}

/// Text without what moves or colours a terminal: a file's name may hold such codes.
pub fn printable(text: &str) -> String {
    let shown = |c: char| match c {
        '\n' | '\t' => c.to_string(),
        c if c.is_control() => c.escape_default().to_string(),
        // Marks that turn the direction of writing hide a name's end.
        '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => c.escape_unicode().to_string(),
        c => c.to_string(),
    };
    text.chars().map(shown).collect()
}

/// Lets only the user read what this process writes, and makes a limit of file size (`ulimit -f`) a
/// failed write, as a full disk is one, where it would end the process.
#[cfg(unix)]
fn guard_files() {
    rustix::process::umask(rustix::fs::Mode::from_raw_mode(0o077));
    let passed = std::sync::Arc::default();
    if let Err(fault) = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, passed) {
        tracing::debug!("a limit of file size will end the process: {fault}");
    }
}

#[cfg(not(unix))]
fn guard_files() {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_move_no_terminal() {
        assert_eq!(printable("a\u{1b}[31mb\u{7}\r\n\u{9b}2J"), "a\\u{1b}[31mb\\u{7}\\r\n\\u{9b}2J");
        assert_eq!(printable("Kopf-Müller \u{202e}gpj.nii"), "Kopf-Müller \\u{202e}gpj.nii");
    }
}
