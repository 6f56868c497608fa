//! A short headless operation of the integrated simulator, judged by its `summary.json`.

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use std::path::Path;

/// Fields that every summary has, as paths.
const FIELDS: [&str; 26] = [
    "/case",
    "/device",
    "/phases",
    "/ticks",
    "/rate_hz",
    "/late_ticks",
    "/held_ticks",
    "/tick_us/p50",
    "/tick_us/p99",
    "/tick_us/p999",
    "/tick_us/max",
    "/solver/name",
    "/solver/tets",
    "/solver/dt_ms",
    "/solver/step_us",
    "/solver/real_time_factor",
    "/hand_force_n/max",
    "/hand_force_n/max_step",
    "/bone_removed_mm3",
    "/warnings",
    "/scores",
    "/plan/dice",
    "/regions/0/peak_n",
    "/frames",
    "/fps",
    "/machine",
];

/// Runs the operation in the profile of the tests and checks what must hold on any machine.
pub fn check(root: &Path) -> Result<()> {
    let out = root.join("target/xtask-operation");
    let out_text = out.display().to_string();
    // With all its fluid the brain comes back to where it was, but for pulse and breath.
    let arguments =
        ["--headless", "--quality", "usual", "--duration", "8", "--csf-loss", "0", "--overwrite", "--out", &out_text];
    crate::built("integrated", &arguments)?;
    let text = std::fs::read_to_string(out.join("summary.json")).context("the operation left no summary.json")?;
    let summary: Value = serde_json::from_str(&text).context("summary.json is not JSON")?;
    for field in FIELDS {
        ensure!(summary.pointer(field).is_some_and(|v| !v.is_null()), "summary.json lacks {field}");
    }
    let number = |field: &str| summary.pointer(field).and_then(Value::as_f64).unwrap_or(f64::NAN);
    ensure!(number("/bone_removed_mm3") > 0.0, "the operation removed no bone");
    let greatest_n = number("/hand_force_n/max");
    ensure!(greatest_n <= 3.3 + 1e-6, "a force over the device's limit: {greatest_n} N");
    ensure!(number("/ticks") > 0.0, "no tick ran");
    ensure!(number("/hand_force_n/end") == 0.0, "the force did not end at zero");
    ensure!(number("/solver/max_displacement_mm") > 1.0, "the probe did not move the brain");
    let left = number("/solver/end_displacement_mm");
    ensure!(left < 0.2 * number("/solver/max_displacement_mm"), "the brain did not come back: {left} mm are left");
    ensure!(number("/scores/plunge_mm") <= 1.0, "the burr went {} mm into the brain", number("/scores/plunge_mm"));
    let warned = summary["warnings"].as_array().is_some_and(|all| all.iter().any(|w| w["name"] == "brain-near"));
    ensure!(warned, "nothing warned before the burr reached the brain");
    for file in ["report.html", "scores.csv", "session.mcap", "drilled.nii.gz"] {
        if !out.join(file).is_file() {
            bail!("the operation left no {file}");
        }
    }
    println!("xtask: a headless operation ran and its summary holds");
    Ok(())
}
