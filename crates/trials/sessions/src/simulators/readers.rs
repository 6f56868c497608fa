//! Can others read a recording: the `mcap` package with its schemas, and Rerun, in a throw-away
//! Python environment.

use super::sessions;
use std::time::{Duration, Instant};
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_link::Recording;
use trepan_trials_scenes::python::Workshop;

/// What is fetched.
const PACKAGES: [(&str, &str); 3] =
    [("mcap", "mcap"), ("mcap_protobuf", "mcap-protobuf-support"), ("rerun", "rerun-sdk")];
/// Topics with schemas that Foxglove and Rerun know by themselves.
const KNOWN: [(&str, &str); 2] = [("/tool", "foxglove.FrameTransform"), ("/log", "foxglove.Log")];

/// Records a session and has it read.
pub fn parts(_: Scope) -> Vec<Part> {
    vec![Part::new("all", |scope, findings| findings.append(run(scope)))]
}

fn run(_: Scope) -> Findings {
    let mut findings = Findings::default();
    match read() {
        Ok(found) => findings = found,
        Err(fault) => println!("  left out: {fault:#}"),
    }
    findings
}

fn read() -> anyhow::Result<Findings> {
    let workshop = Workshop::with(&PACKAGES, include_str!("readers.py"))?;
    let out = workshop.at("session");
    sessions::run(&out, &["--duration", "4"])?;
    let file = out.join("session.mcap");
    let own = Recording::open(&file)?;
    let rerun = workshop.at("session.rrd");
    let output = workshop.run([&file, &rerun])?;
    let facts: Vec<Vec<&str>> = output.lines().map(|line| line.split(' ').collect()).collect();
    let count = |kind: &str, topic: &str| {
        let fact = facts.iter().find(|fact| fact[0] == kind && fact.get(1) == Some(&topic));
        fact.and_then(|fact| fact.last()?.parse::<f64>().ok()).unwrap_or(f64::NAN)
    };
    let known = |(topic, schema): (&str, &str)| {
        facts.iter().any(|fact| fact[0] == "channel" && fact[1] == topic && fact[2] == schema)
    };
    let mut findings = Findings::default();
    findings.rows.push(
        Row::new("a recorded session", "mcap package")
            .metric("ticks_written", own.ticks.len() as f64)
            .metric("ticks_decoded", count("decoded", "/tick"))
            .metric("events_decoded", count("decoded", "/event")),
    );
    // Rerun reads the file on threads of its own.
    let began = Instant::now();
    let mut bytes = 0;
    while bytes < 100_000 && began.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(200));
        bytes = std::fs::metadata(&rerun).map_or(0, |m| m.len());
    }
    findings.rows.push(Row::new("a recorded session", "Rerun").metric("converted_mb", bytes as f64 * 1e-6));
    let ticks = own.ticks.len() as f64;
    findings.gates.extend([
        Gate::at_most(
            "readers: ticks that the mcap package does not decode",
            (ticks - count("decoded", "/tick")).abs(),
            0.0,
        ),
        Gate::at_least(
            "readers: topics with schemas that viewers know, of 2",
            KNOWN.into_iter().filter(|k| known(*k)).count() as f64,
            2.0,
        ),
        Gate::at_least("readers: bytes that Rerun makes of the file", bytes as f64, 100_000.0),
    ]);
    Ok(findings)
}
