//! Runs scripts in the lessons of a program.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// Runs a script, with its flags, in a lesson of a program, and returns the marks that it fails.
fn failed(program: &str, script: &str, lesson: (&str, &str)) -> Vec<String> {
    let out = tempfile::tempdir().unwrap();
    let (name, json) = lesson;
    let ended = Command::new(program)
        .args(["--headless", "--frames-per-second", "0", "--quality", "draft"])
        .arg("--device")
        .args(script.split(' '))
        .args(["--lesson", name, "--out"])
        .arg(out.path())
        .env("TREPAN_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cases"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .unwrap();
    assert!(ended.success(), "{name}: {ended}");
    let summary: Value = serde_json::from_slice(&std::fs::read(out.path().join("summary.json")).unwrap()).unwrap();
    let lesson: Value = serde_json::from_str(json).unwrap();
    let marks = lesson["marks"].as_array().unwrap();
    let value = |mark: &Value| mark["path"].as_str().unwrap().split('.').fold(&summary, |v, key| &v[key]).as_f64();
    let passes = |mark: &&Value| {
        let within = |x: f64| x >= mark["least"].as_f64().unwrap_or(x) && x <= mark["most"].as_f64().unwrap_or(x);
        value(mark).is_some_and(within)
    };
    let fails = marks.iter().filter(|mark| !passes(mark));
    fails.map(|mark| format!("{name}: {} is {:?}", mark["path"], value(mark))).collect()
}

/// Checks that each script passes its lesson, given by name and file, in a program.
pub fn all_pass(program: &'static str, lessons: &[(&'static str, (&'static str, &'static str))]) {
    let runs =
        lessons.iter().copied().map(|(script, lesson)| std::thread::spawn(move || failed(program, script, lesson)));
    let runs: Vec<_> = runs.collect();
    let failed: Vec<String> = runs.into_iter().flat_map(|run| run.join().unwrap()).collect();
    assert_eq!(failed, Vec::<String>::new());
}
