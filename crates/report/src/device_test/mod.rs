//! `device test NAME`: measures rate, jitter, delay, workspace and a soft virtual wall of a haptic
//! device.
//!
//! # Practice
//! The device is opened first, so a missing device is reported before any file is written. The loop
//! is that of a session: its own thread, real-time priority where permitted, absolute deadlines.
//! However the test ends, the device is closed, which sets its force to zero.

mod delay;
mod findings;
mod measured;
mod page;
mod trial;

use crate::ReportError;
use crate::summary::Machine;
use crate::whole::whole;
use measured::{Ending, Floor, Measured, Sample, TestRun, Timing};
use std::fmt::Display;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;
use trepan_geometry::Vec3;
use trepan_haptics::script::{Script, Site};
use trepan_haptics::{
    Capabilities, DeviceName, HapticDevice, Motion, NameError, OpenedDevice, Setting, Status, Watch, Workspace,
};
use trepan_runtime::clock::{Clock, Schedule, Waits};
use trepan_runtime::stop::Stop;
use trepan_runtime::threads::{HapticDeviceOwner, real_time};
use trial::{Part, Trial};

/// Largest number of ticks in which the force fades at the end.
const FADE_TICKS: u32 = 200;

/// A device to test.
struct Subject {
    name: DeviceName,
    device: Box<dyn HapticDevice>,
    watch: Option<Watch>,
}

/// Tests a device for some seconds and writes `device.json` and `device.html` to `out`. Returns the
/// signal that ended the test, if any.
pub fn run(name: &str, out: &Path, seconds: f64) -> Result<Option<i32>, ReportError> {
    if !(8.0..=600.0).contains(&seconds) {
        return Err(ReportError::Usage(format!("--duration {seconds} is out of range: give 8 to 600")));
    }
    if out.exists() && !out.is_dir() {
        return Err(ReportError::Usage(format!("--out {} is a file: name a folder, new or old", out.display())));
    }
    let stop = Stop::on_signals().map_err(|fault| ReportError::Internal(format!("signals: {fault}")))?;
    let subject = open(name, 1e3 * seconds)?;
    let (found, samples) = test(subject, 1e3 * seconds, &stop);
    write(&found, &samples, out)?;
    for finding in &found.findings {
        println!("{} {}", if finding.good { "good " } else { "LOOK:" }, finding.text);
    }
    println!("report: {}", out.join("device.html").display());
    if found.ended == Ending::Lost {
        return Err(ReportError::Usage(format!("{name} was lost during the test; see the report")));
    }
    Ok(stop.signal())
}

fn open(name: &str, end_ms: f64) -> Result<Subject, ReportError> {
    let usage = |fault: &dyn Display| ReportError::Usage(fault.to_string());
    let name: DeviceName = name.parse().map_err(|fault: NameError| usage(&fault))?;
    if !matches!(name.kind().motion, Motion::Hardware | Motion::Script) {
        return Err(usage(&format!("{name} cannot be tested; `--list-devices` shows the devices that can")));
    }
    let script = |script: Option<&str>| {
        let site = Site { entry: Vec3::ZERO, inward: Vec3::NEG_Y, bone_mm: 6.0, brain_mm: 8.0 };
        Script::named(script.unwrap_or_default(), &site, end_ms)
    };
    let opened = name.open(&Setting { workspace: Workspace::default(), script: &script });
    let OpenedDevice { device, watch, .. } = opened.map_err(|fault| usage(&fault))?;
    Ok(Subject { name, device, watch })
}

/// Runs the haptic loop on its own thread; this thread prints the instructions.
fn test(subject: Subject, end_ms: f64, stop: &Stop) -> (Measured, Vec<Sample>) {
    let Subject { name, device, watch } = subject;
    let able = device.capabilities();
    let tick_ms = 1e3 / f64::from(able.rate_hz.clamp(100.0, 4000.0));
    let over = Stop::default();
    let hand = HapticDeviceOwner { device, stop: over.clone() };
    let trial = Trial::new(&able, tick_ms as f32, end_ms);
    let part = AtomicU8::new(Part::Over as u8);
    println!(
        "testing {name} ({}) for {:.0} s; Ctrl-C ends the test and sets the force to zero",
        able.name,
        1e-3 * end_ms
    );
    let result = std::thread::scope(|scope| {
        let worker = scope.spawn(|| run_loop(hand, trial, tick_ms, end_ms, stop, &part));
        print_instructions(&part, &over);
        worker.join().ok()
    });
    let result = result.unwrap_or_else(|| TestRun {
        samples: Vec::new(),
        tick_ms,
        late: 0,
        ended: Ending::Lost,
        trial: Trial::new(&able, tick_ms as f32, end_ms),
        remarks: vec!["the haptic thread panicked; the device was closed".to_string()],
    });
    let found = measured(name.to_string(), &able, &result, watch.as_ref());
    (found, result.samples)
}

/// Prints the instruction of each part as it begins.
fn print_instructions(part: &AtomicU8, over: &Stop) {
    let mut printed = Part::Over;
    while !over.asked() {
        let now = Part::of(part.load(Ordering::Relaxed));
        if now != printed && now != Part::Over {
            println!("-> {}", now.instruction());
        }
        printed = now;
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// The haptic loop: wait, read, step, apply, record.
fn run_loop(
    mut hand: HapticDeviceOwner,
    mut trial: Trial,
    tick_ms: f64,
    end_ms: f64,
    stop: &Stop,
    current: &AtomicU8,
) -> TestRun {
    let remarks = real_time(80, "haptic").into_iter().collect();
    let mut samples = Vec::with_capacity((1.1 * end_ms / tick_ms) as usize + FADE_TICKS as usize);
    let (mut waits, mut late, mut ending, mut fade) = (Waits::default(), 0, None, FADE_TICKS);
    let clock = Clock::start();
    let mut schedule = Schedule::new(tick_ms, clock.now_ms());
    loop {
        waits.until(schedule.next_ms(), &clock);
        let time_ms = clock.now_ms();
        let reading = hand.device.read(time_ms);
        let read_ms = clock.now_ms();
        let (part, wrench) = trial.step(&reading, time_ms);
        let before_ms = clock.now_ms();
        hand.device.apply(wrench);
        let done_ms = clock.now_ms();
        current.store(part as u8, Ordering::Relaxed);
        late += u64::from(schedule.advance(done_ms));
        if samples.len() < samples.capacity() {
            samples.push(Sample {
                time_ms,
                read_us: ((read_ms - time_ms) * 1e3) as f32,
                apply_us: ((done_ms - before_ms) * 1e3) as f32,
                fresh: reading.status == Status::Fresh,
                part,
                tip: reading.tool.tip(),
                force: wrench.force(),
            });
        }
        if let Some(ended) = ending.or_else(|| ends(reading.status, time_ms >= end_ms, stop)) {
            ending = Some(ended);
            trial.release();
            fade -= 1;
            if wrench.force() == Vec3::ZERO || fade == 0 {
                return TestRun { samples, tick_ms, late, ended, trial, remarks };
            }
        }
    }
}

fn ends(status: Status, over: bool, stop: &Stop) -> Option<Ending> {
    match status {
        _ if stop.asked() => Some(Ending::Stopped),
        Status::Lost => Some(Ending::Lost),
        _ if over => Some(Ending::Done),
        Status::Finished => Some(Ending::Finished),
        Status::Fresh | Status::Stale => None,
    }
}

fn measured(device: String, able: &Capabilities, run: &TestRun, watch: Option<&Watch>) -> Measured {
    let samples = &run.samples;
    let mut found = Measured {
        device,
        model: able.name.clone(),
        ended: run.ended,
        fault: watch.and_then(Watch::fault).map(|fault| fault.to_string()),
        faults: watch.map_or(0, Watch::count),
        findings: Vec::new(),
        timing: Timing::of(run),
        delay_ms: delay::median_ms(samples),
        stated_delay_ticks: able.delay_ticks,
        explored_mm: measured::explored(samples).map(|corner| corner.to_array()),
        workspace_mm: able.workspace_mm.is_finite().then(|| able.workspace_mm.to_array()),
        resolution_mm: able.position_resolution_mm,
        forces_n: [able.peak_force_n, able.continuous_force_n],
        floor: Floor::of(run),
        end_force_n: samples.last().map_or(0.0, |last| last.force.length()),
        remarks: run.remarks.clone(),
        machine: Machine::here(None),
    };
    found.findings = findings::of(&found, able);
    found
}

fn write(found: &Measured, samples: &[Sample], out: &Path) -> Result<(), ReportError> {
    let json = serde_json::to_vec_pretty(found);
    let json = json.map_err(|fault| ReportError::Internal(format!("device.json: {fault}")))?;
    let page = page::html(found, samples)?;
    fs::create_dir_all(out).map_err(ReportError::output(out))?;
    whole(&out.join("device.json"), &json)?;
    whole(&out.join("device.html"), page.as_bytes())
}
