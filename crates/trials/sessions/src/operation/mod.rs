//! Runs the whole operation by every setup: what voxels, tetrahedra and methods cost the processor,
//! and the errors of force, bone and brain.
//!
//! # Theory
//! The hand goes the same way in every run: poses and buttons of the scripted operation (drill,
//! open, press the brain), tick by tick at 1 kHz, as the finest setup's plan has them; forces do
//! not move it. Each run turns the bodies of the loops as if every loop kept pace: a tick, a
//! collision step, solver steps up to the tick's time. So a setup is blamed for its models and
//! never for the machine's lateness; what a slow one costs stands beside it, as CPU time.
//!
//! ```text
//! path (poses) ──> haptic tick ──> collision step ──> solver steps     every ms, each timed
//!                      │                                   │
//!                  force, bone                        shown surface ──> against the finest setup's
//! ```
//!
//! # When not to use it
//! To judge a method by itself: its own suite does so against closed forms. The truth of tissue and
//! picture is a finer run by the recommended methods; that of bone is `truth`, which shares nothing
//! with a method, on the CT as it was scanned.

mod bone;
mod error;
mod setups;

use crate::scripted::{Prepared, Ride, worst};
use anyhow::{Result, anyhow, ensure};
use bone::ProxyOffsets;
use error::Errors;
use setups::Candidate;
use std::sync::Mutex;
use trepan_budget::Scene;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::picture::{Chart, Mark};
use trepan_evidence::suite::{Findings, Gate, Row};

/// What the rows are called.
const SCENE: &str = "drill, open, press the brain";

/// The same where a session opens the built-in head by itself, and on another head.
const OWN: &str = "default opening";
const SECOND: &str = "second head";

/// One part for each setup, and those of the truth and of a second head.
pub fn parts(scope: Scope) -> Vec<Part> {
    let part = |candidate: Candidate| {
        Part::new(candidate.name, move |scope, findings| {
            reported(findings, candidate.name, row(scope, &candidate).map(|row| (row, Vec::new())));
        })
    };
    let others = [
        Part::new("error budget of drilling", bone::budget),
        Part::new("truth of two sizes", |scope, findings| reported(findings, "truth of two sizes", two_sizes(scope))),
        Part::new(OWN, |scope, findings| elsewhere(scope, OWN, "", findings)),
        Part::new(SECOND, |scope, findings| match setups::second_head() {
            Some(images) => elsewhere(scope, SECOND, &images, findings),
            None => findings.rows.push(Row::new(SECOND, "not run").with("why", "TREPAN_DATA names no second head")),
        }),
    ];
    setups::all(scope).into_iter().map(part).chain(others).collect()
}

/// Adds what a part found, or why it did not run.
fn reported(findings: &mut Findings, name: &str, found: Result<(Row, Vec<Gate>)>) {
    match found {
        Ok((row, gates)) => {
            findings.rows.push(row);
            findings.gates.extend(gates);
        }
        Err(fault) => {
            findings.rows.push(Row::new(name, "not run").with("fault", format!("{fault:#}")));
            findings.gates.push(Gate::at_least(format!("{name}: runs"), 0.0, 1.0));
        }
    }
}

/// The truth beside the same with half as many tetrahedra.
fn two_sizes(scope: Scope) -> Result<(Row, Vec<Gate>)> {
    let truth = Prepared::open(scope, setups::truth(scope).flags, None)?.run(&mut |_| {})?;
    let coarser = Prepared::open(scope, setups::coarser_truth(scope), Some(truth.site))?.run(&mut |_| {})?;
    let (errors, percent) = (Errors::between(&coarser, &truth), apart_percent(&coarser, &truth));
    let row = errors
        .named()
        .into_iter()
        .fold(Row::new("truth of two sizes", "half the size"), |row, (name, value)| row.metric(name, value));
    let what = "truth: force on the brain of its two sizes apart, percent";
    Ok((row.metric("force_apart_percent", percent), vec![Gate::at_most(what, percent, 5.0)]))
}

/// Root mean square of the difference of the forces on the brain over that of the forces, percent.
fn apart_percent(ride: &Ride, truth: &Ride) -> f64 {
    let ticks = (0..truth.forces.len()).filter(|&t| truth.probing[t] && !ride.on_bone[t] && !truth.on_bone[t]);
    let [apart, all] = ticks.fold([0.0; 2], |[apart, all], t| {
        let (a, b) = (ride.forces[t], truth.forces[t]);
        [apart + f64::from(a.distance_squared(b)), all + f64::from(b.length_squared())]
    });
    100.0 * (apart / all).sqrt()
}

/// What `auto` takes on a head, where it opens it by itself, beside a truth of its own; in full
/// also meshes by hand. Bone is judged at [`SCENE`] only.
fn elsewhere(scope: Scope, scene: &'static str, images: &str, findings: &mut Findings) {
    let truth = Prepared::at_own_opening(scope, &format!("{} {images}", setups::truth(scope).flags), None);
    let truth = truth.and_then(|prepared| prepared.run(&mut |_| {}));
    let truth = truth.and_then(|truth| {
        ensure!(truth.opened(), "the truth did not open the skull: nothing can be held against it");
        Ok(truth)
    });
    for (name, flags) in setups::elsewhere(scope) {
        let row = truth.as_ref().map_err(|fault| anyhow!("{fault:#}")).and_then(|truth| {
            let ride = Prepared::at_own_opening(scope, &format!("{flags} {images}"), Some(truth.site))?;
            Ok((of_brain(scene, name, &ride.run(&mut |_| {})?, truth), Vec::new()))
        });
        reported(findings, &format!("{scene}, {name}"), row);
    }
    let of_auto = |row: &&Row| row.scene == scene && row.method == "auto";
    // Without a row every number is missing, and no limit is met.
    let auto = findings.rows.iter().find(of_auto);
    let number = |name: &str| auto.and_then(|row| row.metrics.get(name).copied()).unwrap_or(f64::NAN);
    let limits = [
        ("auto: worst error of the brain over its default tolerance", "error_over_tolerance", 1.0),
        ("auto: processor time, cores", "cpu_s_per_s", 2.0),
        ("truth: nodes limited, elements inverted and ms skipped", "truth_solver_faults", 0.0),
    ]
    .map(|(what, metric, most)| Gate::at_most(format!("{scene}, {what}"), number(metric), most));
    findings.gates.extend(limits);
}

/// Errors of the brain in one run.
fn of_brain(scene: &str, name: &str, ride: &Ride, truth: &Ride) -> Row {
    let errors = Errors::between(ride, truth);
    let over = worst([errors.tissue_over, errors.shown_p95_mm / Scene::default().displacement_mm]);
    let row = Row::new(scene, name).with("setup", ride.setup.as_str());
    let row = errors.named().into_iter().fold(row, |row, (name, value)| row.metric(name, value));
    row.metric("error_over_tolerance", over)
        .metric("cpu_s_per_s", ride.cpu_s.iter().sum::<f64>() / ride.seconds)
        .metric("solver_faults", ride.solver_faults())
        .metric("truth_solver_faults", truth.solver_faults())
}

/// The finest run of this process: every part needs it, and it is the same for all.
static TRUTH: Mutex<Option<(Scope, Ride, ProxyOffsets)>> = Mutex::new(None);

fn row(scope: Scope, candidate: &Candidate) -> Result<Row> {
    let mut kept = TRUTH.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    if kept.as_ref().is_none_or(|(of, ..)| *of != scope) {
        let ride = Prepared::open(scope, setups::truth(scope).flags, None)?.run(&mut |_| {})?;
        let felt = bone::truth(scope, &ride.site)?;
        *kept = Some((scope, ride, felt));
    }
    let (_, truth, felt) = kept.as_ref().expect("it was just made");
    ensure!(truth.opened(), "the truth did not open the skull: nothing can be held against it");
    let ride = Prepared::open(scope, candidate.flags, Some(truth.site))?.run(&mut |_| {})?;
    let errors = Errors::between(&ride, truth);
    let per_s = |seconds: f64| seconds / ride.seconds;
    let on_bone = ProxyOffsets::of(&ride.lifted).against(felt).named();
    let bone_p95_n =
        on_bone.iter().find(|(name, _)| *name == "bone_force_error_p95_n").map_or(f64::NAN, |found| found.1);
    let allowed = Scene::default();
    let errors_over =
        [bone_p95_n / allowed.force_error_n, errors.tissue_over, errors.shown_p95_mm / allowed.displacement_mm];
    let mut row = Row::new(SCENE, candidate.name).with("setup", ride.setup.as_str()).with("seconds", ride.seconds);
    for (name, value) in errors.named().into_iter().chain(on_bone) {
        row = row.metric(name, value);
    }
    Ok(row
        .metric("error_over_tolerance", worst(errors_over))
        .metric("cpu_s_per_s", per_s(ride.cpu_s.iter().sum()))
        .metric("haptic_cpu_s_per_s", per_s(ride.cpu_s[0]))
        .metric("collision_cpu_s_per_s", per_s(ride.cpu_s[1]))
        .metric("solver_cpu_s_per_s", per_s(ride.cpu_s[2]))
        .metric("solver_steps", ride.steps as f64)
        .metric("memory_mb", ride.memory_mb)
        .metric("opened", f64::from(u8::from(ride.opened())))
        .metric("solver_faults", ride.solver_faults())
        .metric("truth_solver_faults", truth.solver_faults())
        .metric("truth_cpu_s_per_s", truth.cpu_s.iter().sum::<f64>() / truth.seconds))
}

/// Charts of error over CPU time, and what every setup must keep.
pub fn judge(_: Scope, findings: &mut Findings) {
    let charts = [
        ("All errors: the worst over its default tolerance", "error_over_tolerance"),
        ("Force on bone", "bone_force_error_rms_n"),
        ("Force on the brain", "tissue_force_error_rms_n"),
        ("Brain as it is shown, at the opening", "shown_error_p95_mm"),
    ];
    let number = |row: &Row, name: &str| row.metrics.get(name).copied().unwrap_or(f64::NAN);
    let of_scene: Vec<Row> = findings.rows.iter().filter(|row| row.scene == SCENE).cloned().collect();
    for (title, error) in charts {
        let mark = |row: &Row| Mark {
            method: row.method.clone(),
            cost: number(row, "cpu_s_per_s"),
            error: number(row, error),
        };
        findings.charts.push(Chart {
            title: format!("The whole operation. {title}"),
            cost: "cpu_s_per_s".into(),
            error: error.into(),
            marks: of_scene.iter().map(mark).collect(),
            budget: Some((1.0, "one core".into())),
            chosen: Some("auto".into()),
        });
    }
    gates(&of_scene, &mut findings.gates);
}

/// The acceptance limits: every choice opens the skull, and no fixed preset is both cheaper and
/// more accurate than what is chosen for this machine.
fn gates(rows: &[Row], gates: &mut Vec<Gate>) {
    let number = |row: &Row, name: &str| row.metrics.get(name).copied().unwrap_or(f64::NAN);
    let presets = || rows.iter().filter(|row| ["draft", "usual", "fine"].contains(&row.method.as_str()));
    let Some(auto) = rows.iter().find(|row| row.method == "auto") else { return };
    for row in presets().chain([auto]) {
        gates.push(Gate::at_least(format!("{}: the skull is opened", row.method), number(row, "opened"), 1.0));
    }
    let faults = number(auto, "truth_solver_faults");
    gates.push(Gate::at_most("truth: nodes limited, elements inverted and ms skipped", faults, 0.0));
    let force = number(auto, "drilling_force_error_p95_n");
    let normal = number(auto, "bone_normal_error_p95_deg");
    gates.push(Gate::at_most("auto: force while drilling, error against the truth, p95, N", force, 0.05));
    gates.push(Gate::at_most("auto: normal while drilling, error against the truth, p95, degrees", normal, 3.0));
    // What auto takes depends on the machine; `fine` is the same on all.
    if let Some(fine) = rows.iter().find(|row| row.method == "fine") {
        let worst = number(fine, "error_over_tolerance");
        gates.push(Gate::at_most("fine: worst error over its default tolerance", worst, 1.0));
    }
    let worst = number(auto, "error_over_tolerance");
    gates.push(Gate::at_most("auto: worst error over its default tolerance", worst, 1.0));
    for error in ["bone_force_error_rms_n", "tissue_force_error_rms_n", "shown_error_p95_mm"] {
        // What lies within the spread of two runs is no difference.
        let beats = |row: &&Row| {
            number(row, "cpu_s_per_s") < number(auto, "cpu_s_per_s") * (1.0 - Chart::SPREAD)
                && number(row, error) < number(auto, error) * (1.0 - Chart::SPREAD)
        };
        // Of what has no number nobody knows which is better.
        let known = |row: &Row| number(row, "cpu_s_per_s").is_finite() && number(row, error).is_finite();
        let beaten = if presets().chain([auto]).all(known) { presets().filter(beats).count() as f64 } else { f64::NAN };
        gates.push(Gate::at_most(format!("auto: presets that are cheaper and better, by {error}"), beaten, 0.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_that_is_no_number_misses_its_limit() {
        assert!(worst([f64::NAN, 1.0, 2.0]).is_nan() && worst([1.0, 2.0, f64::NAN]).is_nan());
        assert_eq!(worst([1.0, 3.0, 2.0]), 3.0);
        let row = |name: &str, tissue: f64| {
            let row = Row::new(SCENE, name).metric("opened", 1.0).metric("cpu_s_per_s", 0.5);
            let row = row.metric("truth_solver_faults", 0.0);
            let row = row.metric("drilling_force_error_p95_n", 0.04).metric("bone_normal_error_p95_deg", 1.0);
            let row = row
                .metric("error_over_tolerance", 0.9)
                .metric("bone_force_error_rms_n", 0.1)
                .metric("shown_error_p95_mm", 0.5);
            row.metric("tissue_force_error_rms_n", tissue)
        };
        let broken = |auto: f64, draft: f64| {
            let mut limits = Vec::new();
            gates(&[row("auto", auto), row("draft", draft)], &mut limits);
            limits.iter().filter(|gate| !gate.pass).count()
        };
        assert_eq!([broken(0.1, 0.1), broken(f64::NAN, 0.1), broken(0.1, f64::NAN)], [0, 1, 1]);
    }
}
