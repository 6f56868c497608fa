//! What every program does with its command line: flags, session, exit code.

use crate::batch;
use crate::compare::compare;
use crate::device_test;
use crate::measure;
use crate::options::{CaseTask, DeviceTask, Task};
use crate::report::summary::CutOff;
use crate::{Ended, Inputs, Options, Program, Session, SessionError, build_case};
use clap::Parser;
use std::path::Path;
use std::process::ExitCode;
use tracing_subscriber::EnvFilter;
use trepan_budget::Scene;

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
        Task::Plan { force_error_n, displacement_mm } => return planned(*force_error_n, *displacement_mm),
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

/// What a scene needs on this machine.
fn planned(force_error_n: Option<f64>, displacement_mm: Option<f64>) -> ExitCode {
    let usual = Scene::default();
    let scene = Scene {
        force_error_n: force_error_n.unwrap_or(usual.force_error_n),
        displacement_mm: displacement_mm.unwrap_or(usual.displacement_mm),
        ..usual
    };
    let machine = measure::machine();
    println!(
        "this machine: {:.1} ns a tetrahedron and step, {:.1} us a tick on bone, {} threads",
        machine.ns_per_tet_step, machine.us_per_rigid_tick, machine.threads
    );
    match trepan_budget::plan(&machine, &scene) {
        Ok(plan) => {
            println!("{plan}");
            ExitCode::SUCCESS
        }
        Err(fault) => {
            eprintln!("plan: {fault}");
            ExitCode::from(2)
        }
    }
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
