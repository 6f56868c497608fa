//! Command line of the three programs: parses flags, runs a session or subcommand, returns the exit
//! code.

use crate::batch;
use crate::choice::{BuiltCase, PlannedCase, build_case, plan_case};
use crate::compare::compare;
use crate::desk::{self, Done};
use crate::inspect::inspect;
use crate::models::ModelRequest;
use crate::options::{CaseTask, DeviceTask, Patient, RecordingTask, SessionsTask, Task, rate};
use crate::recordings;
use crate::session::{Place, Session, SessionResult};
use crate::setting_paths;
use crate::show::driver;
use crate::{Inputs, Options, Program, SessionError};
use crate::{sessions, ticks};
use std::io::IsTerminal;
use std::path::Path;
use std::process::ExitCode;
use tracing_subscriber::EnvFilter;
use trepan_models::ingredients::table;
use trepan_report::constants;
use trepan_report::printable::{columns, count, printable};
use trepan_report::summary::{CutOff, behind, slow};
use trepan_report::{device_test, film};
use trepan_runtime::Quantiles;
use trepan_volume::dicom::Series;
use trepan_window::display;

/// What is logged unless `RUST_LOG` says otherwise: `trepan` is how the name of each crate begins.
/// The toolkit of windows warns of settings of the desktop that do not concern a user.
const LOGGED: &str = "warn,winit=error,trepan=info";

/// Runs a program and returns its exit code.
///
/// | code | meaning |
/// |---|---|
/// | 0 | the session or subcommand is complete |
/// | 1 | internal error, or replay of an incomplete recording |
/// | 2 | error that the user can correct |
/// | 128 + n | ended by signal n |
///
/// `built_in` is the case that is used if no image is given.
pub fn command(program: Program, built_in: Inputs) -> ExitCode {
    guard_files();
    return_freed_memory();
    let options = match Options::of_program(program, std::env::args_os()) {
        Ok(options) => options,
        // clap prints control characters of an argument unescaped.
        Err(fault) if std::env::args_os().any(|word| word.to_string_lossy().contains(char::is_control)) => {
            eprint!("{}", printable(&fault.to_string()));
            return ExitCode::from(2);
        }
        Err(fault) => fault.exit(),
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(LOGGED));
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
    if options.list_constants {
        print!("{}", constants::table());
        return ExitCode::SUCCESS;
    }
    if options.lists_keys() {
        print!("{}\nPaths of other settings\n{}", table(), setting_paths::table());
        return ExitCode::SUCCESS;
    }
    if let Some(task) = &options.task {
        return perform(program, task, built_in);
    }
    if !options.headless && display().is_ok() {
        return match desk::run(program, options, built_in) {
            None | Some(Ok(Done::Case(_) | Done::Viewed)) => ExitCode::SUCCESS,
            Some(Ok(Done::Session(ended))) => report(&ended),
            Some(Ok(Done::Batch(counts))) => replayed(counts),
            Some(Err(fault)) => failed(program, &fault),
        };
    }
    if !options.headless {
        tracing::info!("no display here: running the scripted operation headless");
    }
    match batch::recordings(&options) {
        Ok(Some(files)) => {
            let failures = batch::run(program, &options, &built_in, &files, &Place::default());
            return replayed([failures, files.len()]);
        }
        Ok(None) => {}
        Err(fault) => return failed(program, &fault),
    }
    match Session::open(program, options, built_in).and_then(Session::run) {
        Ok(ended) => report(&ended),
        Err(fault) => failed(program, &fault),
    }
}

/// Reports on a batch of replays: how many failed, how many there were.
fn replayed([failures, all]: [usize; 2]) -> ExitCode {
    println!("{} of {all} recordings replayed", all - failures);
    if failures == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Runs a subcommand.
fn perform(program: Program, task: &Task, built_in: Inputs) -> ExitCode {
    let done = match task {
        Task::Plan { case, patient, tolerances, rate_hz, picture } => {
            let checked = tolerances.check().and_then(|()| rate((*rate_hz).into()));
            checked
                .and_then(|()| ModelRequest::to_plan(program, patient, *tolerances, *rate_hz, *picture))
                .and_then(|request| planned(program, case.as_deref(), patient, built_in, request))
        }
        Task::Case(CaseTask::Series { folder }) => list_series(folder),
        Task::Case(CaseTask::Build { patient, out }) => {
            build_case(program, patient, out, built_in).map(|BuiltCase { name, notes }| {
                notes.iter().for_each(|note| println!("note: {}", printable(note)));
                let folder = printable(&out.display().to_string());
                println!("{name} is in {folder}; open it with --case {folder}");
                ExitCode::SUCCESS
            })
        }
        Task::Inspect { path, number, json } => inspect(path, *number, *json),
        Task::Compare { first, second, out } => compare([first, second], out).map(|page| {
            println!("side by side: {}", printable(&page.display().to_string()));
            ExitCode::SUCCESS
        }),
        Task::Recording(RecordingTask::Check { file }) => recordings::check(program, file),
        Task::Recording(RecordingTask::Settings { file }) => recordings::settings(file),
        Task::Recording(RecordingTask::Repair { file, out }) => recordings::repair_file(file, out),
        Task::Recording(RecordingTask::Film { folder, out }) => film::make(folder, out).map_err(SessionError::from),
        Task::Recording(RecordingTask::Export { file, csv, every_ms }) => ticks::export(file, csv, *every_ms),
        Task::Sessions(SessionsTask::List(wanted)) => sessions::list(wanted),
        Task::Sessions(SessionsTask::Export { csv, wanted }) => sessions::export(wanted, csv),
        Task::Device(DeviceTask::Test { name, out, duration }) => {
            device_test::run(name, out, *duration).map(ended_by).map_err(SessionError::from)
        }
    };
    done.unwrap_or_else(|fault| failed(program, &fault))
}

/// Prints one line for each DICOM series of a folder.
fn list_series(folder: &Path) -> Result<ExitCode, SessionError> {
    if !folder.is_dir() {
        let fault = format!("{} is not a folder: give the one that holds the slices", folder.display());
        return Err(SessionError::Usage(fault));
    }
    let found = trepan_volume::dicom::series(folder)?;
    if found.is_empty() {
        let fault = format!("no DICOM series lies in {}: give a folder of slices", folder.display());
        return Err(SessionError::Usage(fault));
    }
    println!("--ct-series and --mri-series take the first number");
    print!("{}", printable(&series_table(&found)));
    Ok(ExitCode::SUCCESS)
}

/// The series as a PACS lists them, one a line. The thickness is the distance of two slices.
fn series_table(found: &[Series]) -> String {
    let heading =
        ["number", "kind", "description", "slices", "thickness, mm", "pixels", "pixel, mm", "plane", "series"];
    let row = |(number, series): (usize, &Series)| {
        let [columns, rows] = series.size;
        let text = |text: &str| if text.is_empty() { "-".into() } else { text.to_string() };
        let [pixel, thick] = series.spacing_mm.map_or_else(
            || ["-".to_string(), "no volume".into()],
            |[x, y, z]| [format!("{x:.2} x {y:.2}"), format!("{z:.2}")],
        );
        [
            number.to_string(),
            text(&series.modality),
            text(&series.description),
            series.slices.to_string(),
            thick,
            format!("{columns} x {rows}"),
            pixel,
            series.direction.into(),
            series.number.map_or("-".into(), |number| number.to_string()),
        ]
    };
    columns([heading.map(String::from)].into_iter().chain(found.iter().enumerate().map(row)))
}

/// Prints the models planned for a case on this machine.
fn planned(
    program: Program,
    case: Option<&Path>,
    patient: &Patient,
    built_in: Inputs,
    request: ModelRequest,
) -> Result<ExitCode, SessionError> {
    let card = || driver::open().is_ok_and(|gpu| !gpu.is_software());
    let PlannedCase { models, notes } = plan_case(program, case, patient, built_in, request, card)?;
    println!("{}", models.describe());
    notes.iter().for_each(|note| println!("note: {note}"));
    Ok(ExitCode::SUCCESS)
}

fn report(ended: &SessionResult) -> ExitCode {
    let summary = &ended.summary;
    let Quantiles { p50, p99, .. } = summary.tick_us;
    println!(
        "{} ticks at {:.1} Hz (compute p50 {p50:.1}, p99 {p99:.1} us; {} late)",
        summary.ticks, summary.rate_hz, summary.late_ticks
    );
    println!(
        "{:.1} mm3 of bone removed, {}, {}",
        summary.bone_removed_mm3,
        count(summary.warnings.len(), "warning"),
        count(summary.frames as usize, "picture")
    );
    if summary.replay.is_none() {
        let behind = summary.solver.as_ref().and_then(|solver| behind(solver.outcome.real_time_factor));
        slow(summary.rate_hz, summary.asked_hz).iter().chain(&behind).for_each(|slow| println!("{slow}"));
    }
    summary.bands.sentences().iter().for_each(|band| println!("{band}"));
    if summary.cut_off.pieces > 0 {
        let CutOff { pieces, largest_mm3 } = summary.cut_off;
        println!("cut off the skull: {} of bone, the largest of {largest_mm3:.0} mm3", count(pieces, "piece"));
    }
    if let Some(replay) = &summary.replay {
        println!("replay: {}", replay.describe());
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

/// Makes new files readable by the user only. It also turns an exceeded file size limit
/// (`ulimit -f`) into a failed write; by default its signal would end the process.
#[cfg(unix)]
fn guard_files() {
    rustix::process::umask(rustix::fs::Mode::from_raw_mode(0o077));
    let passed = std::sync::Arc::default();
    if let Err(fault) = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, passed) {
        tracing::debug!("cannot handle SIGXFSZ, so a file size limit will end the process: {fault}");
    }
}

#[cfg(not(unix))]
fn guard_files() {}

/// Returns freed blocks of 8 MiB and more to the system at once. By itself glibc raises that size
/// to the largest block that was ever freed, and keeps what lies between others.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(unsafe_code, reason = "the C library offers it only so")]
fn return_freed_memory() {
    // SAFETY: it takes two numbers and sets one of the allocator's, before any other thread begins.
    unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, 8 << 20) };
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn return_freed_memory() {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_are_listed_with_description_and_thickness() {
        let thick = Series {
            modality: "CT".into(),
            number: Some(4),
            slices: 36,
            size: [512, 512],
            places: 36,
            spacing_mm: Some([0.488, 0.488, 5.0]),
            direction: "axial",
            description: "head bone".into(),
            ..Series::default()
        };
        let scout = Series { spacing_mm: None, slices: 2, description: String::new(), ..thick.clone() };
        let table = series_table(&[thick, scout]);
        let lines: Vec<&str> = table.lines().collect();
        assert!(
            lines[1].contains("head bone") && lines[1].contains("5.00") && lines[2].contains("no volume"),
            "{table}"
        );
        assert_eq!(lines[0].find("thickness"), lines[1].find("5.00"), "{table}");
    }
}
