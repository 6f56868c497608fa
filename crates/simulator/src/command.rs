//! What every program does with its command line: flags, session, exit code.

use crate::batch;
use crate::case::choice::plan_case;
use crate::compare::compare;
use crate::device_test;
use crate::models::Wish;
use crate::options::{CaseTask, DeviceTask, Patient, Task};
use crate::report::summary::{CutOff, slow};
use crate::show::driver;
use crate::{Ended, Inputs, Options, Program, Session, SessionError, build_case};
use clap::Parser;
use std::path::Path;
use std::process::ExitCode;
use tracing_subscriber::EnvFilter;

/// Runs a program. Exit code 0 for a session that ended, 2 for what the user can put right, 1 for the rest, 128 + n after
/// signal n.
///
/// `built_in` is the case that is taken when no image is given.
pub fn command(program: Program, built_in: Inputs) -> ExitCode {
    let options = Options::parse();
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn,trepan_simulator=info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
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
            let wish = tolerances.check().map_err(SessionError::Usage);
            let wish = wish.and_then(|()| Wish::to_plan(program, patient, *tolerances, *rate_hz, *picture));
            wish.and_then(|wish| planned(program, case.as_deref(), patient, built_in, wish))
        }
        Task::Case(CaseTask::Series { folder }) => list_series(folder),
        Task::Case(CaseTask::Build { patient, out }) => build_case(program, patient, out, built_in).map(|name| {
            println!("{name} is in {}; open it with --case {}", out.display(), out.display());
            ExitCode::SUCCESS
        }),
        Task::Compare { first, second, out } => compare([first, second], out).map(|page| {
            println!("side by side: {}", page.display());
            ExitCode::SUCCESS
        }),
        Task::Device(DeviceTask::Test { name, out, duration }) => device_test::run(name, out, *duration).map(ended_by),
    };
    done.unwrap_or_else(|fault| failed(program, &fault))
}

/// One line for each series of a folder.
fn list_series(folder: &Path) -> Result<ExitCode, SessionError> {
    let found = trepan_volume::dicom::series(folder)?;
    if found.is_empty() {
        let fault = format!("no DICOM series lies in {}: give a folder of slices", folder.display());
        return Err(SessionError::Usage(fault));
    }
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
    wish: Wish,
) -> Result<ExitCode, SessionError> {
    let card = || driver::open().is_ok_and(|gpu| !gpu.is_software());
    let models = plan_case(program, case, patient, built_in, wish, card)?;
    println!("{}", models.told());
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
        println!(
            "replay: {} of {} ticks gave the same force, bit for bit; largest difference {:.6} N",
            replay.identical, replay.ticks, replay.max_difference_n
        );
    }
    println!("report: {}", ended.out.join("report.html").display());
    ended_by(ended.signal)
}

fn ended_by(signal: Option<i32>) -> ExitCode {
    signal.map_or(ExitCode::SUCCESS, |signal| ExitCode::from(128 + signal as u8))
}

fn failed(program: Program, fault: &SessionError) -> ExitCode {
    eprintln!("{}: {fault}", program.name());
    ExitCode::from(fault.exit_code())
}
