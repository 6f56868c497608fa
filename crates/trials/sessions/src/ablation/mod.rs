//! What each ingredient of `--set` changes in the built-in operation, and what it costs.
//!
//! # Theory
//! The default is what `--quality auto` runs, on the sizes of `usual`, which are the same on every
//! machine. The table of keys (`trepan_models::variants`) gives the values; one that the default
//! has is left out instead. Each is run alone against the default, along its path of the hand and
//! on its mesh, tick by tick:
//!
//! ```text
//! default ──> force at the hand, shown surface, pictures ─┐
//!                                                         ├─> difference, over its tolerance
//! one value ─> the same ──────────────────────────────────┘
//! ```
//!
//! Force is judged on bone and on tissue apart, by what 95 of 100 ticks stay under. One more run
//! takes every value that physical realism asks for, because effects add. The default runs again
//! too: what its second run changes, and how its cost differs, is the resolution of the suite.
//!
//! # Practice
//! A quick run puts the operation into 6 s, a full one into 20 s. The quick hand is faster than a
//! surgeon's: the burr is pressed harder and the changes on bone are larger. Choose by a full run.
//!
//! A key with new values in the table has new rows here, without a change of this suite. A value
//! whose device is absent has a row that says so.
//!
//! # When not to use it
//! To judge accuracy: the differences are between a value and the default, and neither is a truth.
//! A small difference means that this operation does not need the ingredient; another operation,
//! mesh or hand may. The suites of the methods and `operation` compare with a truth.

mod change;
mod judge;
mod pictures;

pub use judge::judge;

use crate::scripted::{Prepared, Ride};
use anyhow::Result;
use change::Change;
use pictures::Pictures;
use std::sync::Mutex;
use trepan_budget::Quality;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_models::{Effect, Variant, of_quality, realistic, variants};
use trepan_render::Image;

/// What the rows are called.
const SCENE: &str = "drill, open, press the brain";
/// Sizes of every run, the same on every machine.
const SIZES: &str = "--quality usual";
/// Name of the second run of the default.
const AGAIN: &str = "default, again";
/// Name of the run with every value that physical realism asks for.
const TOGETHER: &str = "all that realism asks for";
/// Settings of a row: what it may change, whether it leaves out what the default has, and why it
/// did not run.
const EFFECT: &str = "effect";
const LEFT_OUT: &str = "left out";
const NOT_RUN: &str = "not run";

/// One run beside the default.
struct Candidate {
    name: String,
    settings: Vec<String>,
    effect: Effect,
    left_out: bool,
}

impl Candidate {
    /// The default with a value, or without one that it has.
    fn alone(variant: &Variant) -> Self {
        let left_out = of_quality(Quality::Auto).contains(variant);
        let usual = variant.usual().filter(|_| left_out);
        let setting = usual.as_ref().unwrap_or(variant).setting();
        Self { name: setting.clone(), settings: vec![setting], effect: variant.effect, left_out }
    }

    /// Its flags: without what another solver than the default's does not have.
    fn flags(&self) -> String {
        let is_rival = self.name.starts_with("solver=");
        let set = self.settings.iter().map(|setting| format!(" --set {setting}"));
        flags(|variant| !is_rival || !variant.is_of_tled()) + &set.collect::<String>()
    }
}

/// Flags of the default, with those of its ingredients that are kept.
fn flags(is_kept: impl Fn(&Variant) -> bool) -> String {
    let kept = of_quality(Quality::Auto).into_iter().filter(is_kept);
    SIZES.to_string() + &kept.map(|variant| format!(" --set {}", variant.setting())).collect::<String>()
}

/// Every run: in a quick one the first value of each key.
fn candidates(scope: Scope) -> Vec<Candidate> {
    let mut alone = variants();
    if scope.quick {
        alone.dedup_by_key(|variant| variant.key);
    }
    let together = realistic().iter().map(Variant::setting).collect();
    [Candidate { name: AGAIN.into(), settings: Vec::new(), effect: Effect::Cost, left_out: false }]
        .into_iter()
        .chain(alone.iter().map(Candidate::alone))
        .chain([Candidate { name: TOGETHER.into(), settings: together, effect: Effect::Model, left_out: false }])
        .collect()
}

/// One part for each run.
pub fn parts(scope: Scope) -> Vec<Part> {
    let part = |candidate: Candidate| {
        Part::new(candidate.name.clone(), move |scope, findings: &mut Findings| {
            let fault = match row(scope, &candidate) {
                Ok(row) => return findings.rows.push(row),
                Err(fault) => format!("{fault:#}"),
            };
            findings.rows.push(candidate.row().with(NOT_RUN, fault));
            findings.gates.push(Gate::at_least(format!("{}: runs", candidate.name), 0.0, 1.0));
        })
    };
    candidates(scope).into_iter().map(part).collect()
}

impl Candidate {
    fn row(&self) -> Row {
        let effect = match self.effect {
            Effect::Model => "model",
            Effect::Rounding => "rounding",
            Effect::Cost => "cost",
        };
        Row::new(SCENE, &*self.name).with("flags", self.flags()).with(EFFECT, effect).with(LEFT_OUT, self.left_out)
    }
}

/// A run with its pictures.
struct Filmed {
    ride: Ride,
    pictures: Vec<Image>,
}

impl Filmed {
    fn run(scope: Scope, prepared: Prepared) -> Result<Self> {
        let mut pictures = Pictures::every(scope.pick(1_000, 2_000));
        let ride = prepared.run(&mut |shown| pictures.watch(shown))?;
        Ok(Self { ride, pictures: pictures.taken()? })
    }
}

/// The default of this process: every part needs it, and it is the same for all.
static OF_DEFAULT: Mutex<Option<(Scope, Filmed)>> = Mutex::new(None);

fn row(scope: Scope, candidate: &Candidate) -> Result<Row> {
    let mut kept = OF_DEFAULT.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    if kept.as_ref().is_none_or(|(of, _)| *of != scope) {
        *kept = Some((scope, Filmed::run(scope, Prepared::open(scope, &flags(|_| true), None)?)?));
    }
    let (_, usual) = kept.as_ref().expect("it was just made");
    let prepared = Prepared::open(scope, &candidate.flags(), Some(usual.ride.site))?;
    if let Some(remark) = prepared.remarks().first() {
        return Ok(candidate.row().with(NOT_RUN, "no graphics card").with("remark", remark.as_str()));
    }
    let run = Filmed::run(scope, prepared)?;
    let row = Change::between(&run, usual).named().into_iter();
    let row = row.fold(candidate.row(), |row, (name, value)| row.metric(name, value));
    Ok(costs(&run.ride, &usual.ride).into_iter().fold(row, |row, (name, value)| row.metric(name, value)))
}

/// What a run cost, and what it did not do, by names with units.
fn costs(ride: &Ride, usual: &Ride) -> [(&'static str, f64); 14] {
    let cores = |ride: &Ride| ride.cpu_s.iter().sum::<f64>() / ride.seconds;
    let (ticks, steps) = (ride.forces.len() as f64, ride.steps as f64);
    let finite = ride.forces.iter().all(|force| force.is_finite())
        && ride.looks.iter().flat_map(|look| look.triangles.iter().flatten()).all(|node| node.is_finite());
    [
        ("cpu_s_per_s", cores(ride)),
        ("haptic_cpu_s_per_s", ride.cpu_s[0] / ride.seconds),
        ("collision_cpu_s_per_s", ride.cpu_s[1] / ride.seconds),
        ("solver_cpu_s_per_s", ride.cpu_s[2] / ride.seconds),
        ("cpu_change_s_per_s", cores(ride) - cores(usual)),
        ("haptic_tick_us", 1e6 * ride.cpu_s[0] / ticks),
        ("solver_step_us", 1e6 * ride.cpu_s[2] / steps),
        ("solver_step_wall_us", 1e6 * ride.wall_s[2] / steps),
        ("memory_mb", ride.memory_mb),
        ("memory_change_mb", ride.memory_mb - usual.memory_mb),
        ("opened", f64::from(u8::from(ride.opened()))),
        ("finite", f64::from(u8::from(finite && ride.faults.non_finite == 0))),
        ("inverted_elements", ride.faults.inverted as f64),
        ("clamped_nodes", ride.faults.limited as f64),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_value_of_the_table_has_a_run_and_a_quick_one_has_every_key() {
        let names = |quick| -> Vec<String> {
            candidates(Scope { quick, seed: 1 }).into_iter().map(|candidate| candidate.name).collect()
        };
        let (quick, full) = (names(true), names(false));
        assert_eq!(full.len(), variants().len() + 2);
        let run = |variant: &Variant| full.contains(&Candidate::alone(variant).name);
        assert!(variants().iter().all(run) && full.contains(&"element=plain".into()), "{full:?}");
        let keys: BTreeSet<&str> = variants().iter().map(|variant| variant.key).collect();
        assert_eq!(quick.len(), keys.len() + 2);
        assert!(keys.iter().all(|key| quick.iter().any(|name| name.starts_with(&format!("{key}=")))));
        let together = candidates(Scope { quick: true, seed: 1 }).pop().unwrap();
        let default = of_quality(Quality::Auto).len();
        assert_eq!(together.flags().matches("--set ").count(), default + realistic().len());
        assert!(together.flags().contains("--set element=locking-free"), "{}", together.flags());
    }

    #[test]
    fn a_run_with_a_force_that_is_no_number_is_not_finite() {
        let finite = |ride: &Ride| {
            let found = costs(ride, ride).into_iter().find(|(name, _)| *name == "finite");
            found.map(|(_, value)| value)
        };
        let mut ride = crate::scripted::tests::hand_made(1.0, 8.0, 1.0, 80);
        assert_eq!(finite(&ride), Some(1.0));
        ride.forces[3].x = f32::NAN;
        assert_eq!(finite(&ride), Some(0.0));
    }
}
