//! `device test` works without hardware, reports what is missing and ends without force.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

fn test(name: &str, out: &Path, seconds: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_integrated"));
    command.args(["device", "test", name, "--duration", seconds, "--out"]).arg(out);
    command
}

fn report(out: &Path) -> Value {
    serde_json::from_slice(&fs::read(out.join("device.json")).unwrap()).unwrap()
}

#[test]
fn a_simulated_device_is_measured_and_pressed() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("new");
    let done = test("simulated:craniotomy", &out, "9").output().unwrap();
    let log = String::from_utf8_lossy(&done.stdout).to_string();
    assert!(done.status.success(), "{log}");
    for words in ["move the tool", "light taps", "press down", "report:"] {
        assert!(log.contains(words), "{words}: {log}");
    }
    let report = report(&out);
    let (floor, timing) = (&report["floor"], &report["timing"]);
    assert_eq!(report["ended"], "done");
    assert!(floor["force_n"].as_f64().unwrap() > 0.3 && floor["force_n"].as_f64().unwrap() <= 1.0, "{floor}");
    assert!(timing["fresh_hz"].as_f64().unwrap() > 0.0 && timing["jitter_us"]["p99"].as_f64().is_some(), "{timing}");
    assert!(report["explored_mm"][1][1].as_f64().unwrap() > 30.0, "{}", report["explored_mm"]);
    let page = fs::read_to_string(out.join("device.html")).unwrap();
    assert!(page.matches("<svg").count() == 6 && !page.contains("NaN"));
}

#[test]
fn a_script_is_tested_without_motors() {
    let out = tempfile::tempdir().unwrap();
    assert!(test("script:probe", out.path(), "8").stdout(Stdio::null()).status().unwrap().success());
    let report = report(out.path());
    assert_eq!((&report["delay_ms"], &report["workspace_mm"]), (&Value::Null, &Value::Null));
    assert!(report["findings"].to_string().contains("no motors"));
}

#[test]
fn missing_software_is_named_and_no_file_is_left() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    for (name, words) in [
        ("openhaptics", ["libHD", "install"]),
        ("force-dimension", ["libdrd", "install"]),
        ("haply", ["haply", "install and start"]),
        ("telepathy", ["telepathy", "known are"]),
        ("mouse", ["mouse", "--list-devices"]),
    ] {
        let done = test(name, &out, "8").output().unwrap();
        let log = String::from_utf8_lossy(&done.stderr).to_string();
        assert_eq!(done.status.code(), Some(2), "{name}: {log}");
        assert!(words.iter().all(|word| log.contains(word)) && !log.contains("panicked"), "{name}: {log}");
        assert!(!out.exists(), "{name} left a folder");
    }
    assert_eq!(test("script:probe", &out, "2").output().unwrap().status.code(), Some(2), "too short");
}

#[test]
fn a_signal_ends_it_without_force_and_with_a_report() {
    let out = tempfile::tempdir().unwrap();
    let mut child = test("simulated:craniotomy", out.path(), "60").stdout(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_secs(2));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let patience = Instant::now() + Duration::from_secs(60);
    while child.try_wait().unwrap().is_none() {
        assert!(Instant::now() < patience, "it goes on after Ctrl-C");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let report = report(out.path());
    assert_eq!((&report["ended"], &report["end_force_n"]), (&Value::from("stopped"), &Value::from(0.0)));
}
