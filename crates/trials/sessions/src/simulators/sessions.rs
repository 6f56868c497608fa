//! Whole sessions in this process: recorded, run again, run again by other methods and meshes, and
//! half an hour of it.

use anyhow::Result;
use clap::Parser;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_simulator::{Options, Session, Summary};
use trepan_stages::Program;
use trepan_trials_scenes::case;

/// Memory that a session may come to hold in half an hour, MB.
const GROWTH_MB: f64 = 20.0;

/// Runs a session of the built-in case.
pub fn run(out: &Path, arguments: &[&str]) -> Result<Summary> {
    let fixed = ["integrated", "--headless", "--frames-per-second", "0", "--out"].map(std::ffi::OsString::from);
    let arguments = arguments.iter().map(std::ffi::OsString::from);
    let options = Options::try_parse_from(fixed.into_iter().chain([out.into()]).chain(arguments))?;
    Ok(Session::open(Program::Integrated, options, case::inputs())?.run()?.summary)
}

/// A session, and the same again: alike to the last bit; by other methods and meshes: how far off.
pub fn replays(scope: Scope) -> Result<Findings> {
    let folder = tempfile::tempdir()?;
    let place = |name: &str| folder.path().join(name);
    let seconds = scope.pick("4", "20");
    let recorded = run(&place("recorded"), &["--quality", "usual", "--duration", seconds])?;
    let device = format!("replay:{}", place("recorded").join("session.mcap").display());
    let mut findings = Findings::default();
    findings.rows.push(
        Row::new("a recorded session", "live")
            .metric("ticks", recorded.ticks as f64)
            .metric("late_ticks", recorded.late_ticks as f64)
            .metric("dropped_records", recorded.dropped_records as f64),
    );
    let again: [(&str, &[&str]); 4] = [
        ("as recorded", &[]),
        ("rigid thesis", &["--rigid", "thesis"]),
        ("solver corotational", &["--solver", "corotational"]),
        ("half the tetrahedra", &["--tets", "4000"]),
    ];
    // The corotational solver is far from real time.
    for (name, how) in again.into_iter().filter(|(name, _)| !scope.quick || !name.contains("corotational")) {
        let summary = run(&place(name), &[&["--device", device.as_str()], how].concat())?;
        let replay = summary.replay.unwrap_or_default();
        findings.rows.push(
            Row::new("the session run again", name)
                .metric("ticks", replay.ticks as f64)
                .metric("differing_ticks", (replay.ticks - replay.identical) as f64)
                .metric("max_difference_n", replay.max_difference_n.into()),
        );
        let missing = recorded.ticks.abs_diff(replay.ticks) as f64;
        findings.gates.push(Gate::at_most(format!("replay, {name}: ticks that are missing"), missing, 0.0));
        if how.is_empty() {
            let differing = (replay.ticks - replay.identical) as f64;
            findings.gates.push(Gate::at_most(
                "replay, as recorded: ticks whose force differs in a bit",
                differing,
                0.0,
            ));
        }
    }
    Ok(findings)
}

/// A long session: memory while it runs, late ticks, one recording.
pub fn soak(minutes: f64) -> Result<Findings> {
    let folder = tempfile::tempdir()?;
    let seconds = format!("{}", 60.0 * minutes);
    let (over, held) = (AtomicBool::new(false), Mutex::new(Vec::<(f64, f64)>::new()));
    let recording = folder.path().join("session.mcap");
    let summary = std::thread::scope(|scope| {
        scope.spawn(|| {
            let began = Instant::now();
            while !over.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(500));
                if let (Some(mb), Ok(mut held)) = (memory_mb(), held.lock()) {
                    held.push((began.elapsed().as_secs_f64(), mb));
                }
            }
        });
        let summary = run(folder.path(), &["--quality", "usual", "--duration", &seconds]);
        over.store(true, Ordering::Relaxed);
        summary
    })?;
    // Between the first sixth and the last moments, when the recording is read back for the report.
    let held = held.into_inner().unwrap_or_default();
    let within = |from: f64, to: f64| {
        let mut all: Vec<f64> =
            held.iter().filter(|s| (from..to).contains(&(s.0 / (60.0 * minutes)))).map(|s| s.1).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let growth_mb = within(0.8, 0.95) - within(0.15, 0.3);
    let mut findings = Findings::default();
    findings.rows.push(
        Row::new("a long session", "live")
            .with("minutes", minutes)
            .metric("ticks", summary.ticks as f64)
            .metric("late_ticks", summary.late_ticks as f64)
            .metric("tick_p99_us", summary.tick_us.p99)
            .metric("memory_growth_mb", growth_mb)
            .metric("recording_mb", std::fs::metadata(&recording).map_or(f64::NAN, |m| m.len() as f64 * 1e-6))
            .metric("dropped_records", summary.dropped_records as f64),
    );
    findings.gates.push(Gate::at_most("long session: memory that it comes to hold, MB", growth_mb, GROWTH_MB));
    findings.gates.push(Gate::at_most("long session: records that were lost", summary.dropped_records as f64, 0.0));
    Ok(findings)
}

/// Memory that this process holds.
fn memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? * 1e-3)
}
