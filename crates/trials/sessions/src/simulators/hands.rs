//! A novice and an expert operate on the built-in case: do the scores tell them apart, does every
//! warning come once and in time?
//!
//! # Practice
//! Both hands are scripts in a simulated grip; the novice's plunges deeper, presses harder,
//! hesitates and trembles. So this is **synthetic** validity: that the scores measure what they are
//! named for, not that they measure surgeons.

use super::bench::Bench;
use trepan_contact::GuardedWrench;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::Vec3;
use trepan_haptics::script::{Plan, Script};
use trepan_haptics::simulated::HandModel;
use trepan_haptics::{Capabilities, HapticDevice, Reading};
use trepan_link::wire::TickRecord;
use trepan_patient::PlanComparison;
use trepan_stages::{Limits, Program, ScoreKeeper, Warning, What};
use trepan_trials_scenes::case::CaseFixture;

/// Duration of an operation, ms.
const END_MS: f64 = 20_000.0;
/// A warning is cleared when its cause was gone for this long, ms.
const CLEAR_MS: f64 = 100.0;

/// A hand that trembles and hesitates.
struct Novice {
    script: Script,
    tremor_mm: f32,
}

impl HapticDevice for Novice {
    fn read(&mut self, time_ms: f64) -> Reading {
        // Time that stands still for a part of every second, and then catches up.
        let halting = time_ms + 180.0 * (std::f64::consts::TAU * time_ms * 1e-3).sin() / std::f64::consts::TAU * 6.0;
        let mut reading = self.script.read(halting.clamp(0.0, END_MS));
        let shake = |hz: f64, turn: f64| (std::f64::consts::TAU * hz * time_ms * 1e-3 + turn).sin() as f32;
        let tremor = Vec3::new(shake(9.0, 0.0), shake(10.3, 1.0), shake(8.2, 2.0))
            + 3.0 * Vec3::new(shake(1.7, 0.0), shake(1.3, 2.0), 0.0);
        reading.tool.world_from_tool.translation += self.tremor_mm * tremor;
        reading
    }

    fn apply(&mut self, _: GuardedWrench) {}

    fn capabilities(&self) -> Capabilities {
        self.script.capabilities()
    }

    fn close(&mut self) {}
}

/// Rows of both, and their gates.
pub fn findings(table: &CaseFixture) -> Findings {
    let mut findings = Findings::default();
    let deep = deep();
    let novice = |seed: f32| Operated::by(table, &deep, 0.25 + 0.1 * seed);
    let (expert, novices) = (Operated::by(table, &Plan::default(), 0.0), [novice(0.0), novice(1.0), novice(2.0)]);
    findings.rows.push(expert.row("expert"));
    findings.rows.extend(novices.iter().map(|novice| novice.row("novice")));
    let all = |worse: &dyn Fn(&Operated) -> bool| novices.iter().filter(|novice| worse(novice)).count() as f64;
    for (name, reported) in [
        ("path", all(&|n| n.scores.path_mm > 1.05 * expert.scores.path_mm)),
        ("smoothness", all(&|n| n.jerk() < expert.jerk() - 0.5)),
        ("plunge", all(&|n| n.scores.plunge_mm > expert.scores.plunge_mm + 1.0)),
        ("time on the dura", all(&|n| n.scores.burr_on_brain_s > 1.2 * expert.scores.burr_on_brain_s)),
        ("bone beside the plan", all(&|n| n.against.outside_plan_mm3 > expert.against.outside_plan_mm3)),
    ] {
        findings.gates.push(Gate::at_least(
            format!("novices whose {name} is worse than the expert's, of 3"),
            reported,
            3.0,
        ));
    }
    let late = novices.iter().chain([&expert]).map(|one| one.late_ticks).max().unwrap_or(0);
    let odd = novices.iter().chain([&expert]).map(|one| one.odd_warnings).sum::<u64>();
    findings.gates.push(Gate::at_most("warnings: most ticks from cause to warning", late as f64, 2.0));
    findings.gates.push(Gate::at_most("warnings without their cause, repeated, or missing", odd as f64, 0.0));
    findings
}

/// A plan that goes 3 mm too deep.
pub fn deep() -> Plan {
    Plan { breakthrough_mm: 4.0, burr_clearance_mm: -3.0, burr_overlap_mm: 3.0, ..Plan::default() }
}

/// How an operation went.
struct Operated {
    scores: ScoreKeeper,
    against: PlanComparison,
    warnings: usize,
    late_ticks: u64,
    odd_warnings: u64,
}

impl Operated {
    fn by(table: &CaseFixture, plan: &Plan, tremor_mm: f32) -> Self {
        let (bone, brain) = table.fresh();
        let script = Script::planned("craniotomy", &table.plan.site, END_MS, plan).expect("the site is sound");
        let hand = Box::new(Novice { script, tremor_mm });
        let mut bench = Bench::new(Program::Craniotomy, bone.clone(), brain, None, HandModel::FIRM, hand);
        bench.run(END_MS, |_| false);
        let (late_ticks, odd_warnings) = checked(&bench);
        let raised = |what: &What| matches!(what, What::Warning(_, true, _));
        Self {
            scores: *bench.stage.scores(),
            against: PlanComparison::of(&table.plan, &bone).expect("a hole is planned"),
            warnings: bench.notices.iter().filter(|notice| raised(&notice.what)).count(),
            late_ticks,
            odd_warnings,
        }
    }

    fn jerk(&self) -> f64 {
        self.scores.log_dimensionless_jerk.unwrap_or(f64::NAN)
    }

    fn row(&self, method: &str) -> Row {
        Row::new("craniotomy on the built-in case", method)
            .metric("path_mm", self.scores.path_mm)
            .metric("log_dimensionless_jerk", self.jerk())
            .metric("idle_s", self.scores.idle_s)
            .metric("plunge_mm", self.scores.plunge_mm.into())
            .metric("burr_on_brain_s", self.scores.burr_on_brain_s)
            .metric("dice", self.against.dice)
            .metric("surface_95_mm", self.against.surface_95_mm.unwrap_or(f64::NAN))
            .metric("outside_plan_mm3", self.against.outside_plan_mm3)
            .metric("warnings", self.warnings as f64)
    }
}

/// What in a tick calls for a warning.
type Cause<'a> = &'a dyn Fn(&TickRecord) -> bool;

/// Checks the warnings that a record alone can justify: most ticks late, and how many came without
/// a cause, twice or not at all.
fn checked(bench: &Bench) -> (u64, u64) {
    let near_mm = Limits::default().near_mm;
    let causes: [(Warning, Cause); 4] = [
        (Warning::BrainNear, &|tick| tick.phase == 0 && tick.brain_distance_mm <= near_mm),
        (Warning::BrainTouched, &|tick| tick.phase == 0 && tick.brain_distance_mm <= 0.0),
        (Warning::ForceLimit, &|tick| tick.has(TickRecord::CLAMPED)),
        (Warning::DeviceStale, &|tick| tick.has(TickRecord::STALE)),
    ];
    let (mut late, mut odd) = (0, 0);
    for (warning, cause) in causes {
        let is = |what: &What| matches!(what, What::Warning(w, true, _) if *w == warning);
        let reported: Vec<u64> = bench.notices.iter().filter(|n| is(&n.what)).map(|n| n.tick).collect();
        let due = due(&bench.records, cause);
        odd += reported.len().abs_diff(due.len()) as u64;
        late = reported.iter().zip(&due).map(|(reported, due)| reported.abs_diff(*due)).max().unwrap_or(0).max(late);
    }
    (late, odd)
}

/// Ticks in which a warning should be raised: at each cause that was gone for long enough.
fn due(records: &[TickRecord], cause: Cause) -> Vec<u64> {
    let (mut due, mut quiet_since): (Vec<u64>, Option<f64>) = (Vec::new(), None);
    for tick in records {
        if cause(tick) {
            if due.is_empty() || quiet_since.is_some_and(|since| tick.time_ms - since > CLEAR_MS) {
                due.push(tick.tick);
            }
            quiet_since = Some(tick.time_ms);
        }
    }
    due
}
