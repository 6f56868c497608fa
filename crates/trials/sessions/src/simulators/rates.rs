//! One operation, its ticks thinned to lower rates: are the scores the same?

use super::bench::Bench;
use super::hands::deep;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_haptics::script::Script;
use trepan_haptics::simulated::HandModel;
use trepan_link::wire::TickRecord;
use trepan_stages::{Program, ScoreKeeper};
use trepan_trials_scenes::case::CaseFixture;

/// Ticks a second that an operation of 1000 is thinned to.
const RATES_HZ: [usize; 5] = [1000, 500, 250, 125, 60];

/// A row for each rate, and the gate.
pub fn findings(table: &CaseFixture) -> Findings {
    let (bone, brain) = table.fresh();
    let script = Script::planned("craniotomy", &table.plan.site, 20_000.0, &deep()).expect("the site is sound");
    let mut bench = Bench::new(Program::Craniotomy, bone, brain, None, HandModel::FIRM, Box::new(script));
    bench.run(20_000.0, |_| false);
    let truth = scores(&bench.records);
    let mut findings = Findings::default();
    let mut worst = 0.0f64;
    for rate_hz in RATES_HZ {
        let mut row = Row::new("scores at several rates", format!("{rate_hz} Hz"));
        for ((name, value), (_, at_1000)) in scores(&thinned(&bench.records, rate_hz)).into_iter().zip(truth) {
            worst = worst.max(100.0 * (value / at_1000 - 1.0).abs());
            row = row.metric(name, value);
        }
        findings.rows.push(row);
    }
    findings.gates.push(Gate::at_most("scores: largest change from 1000 to 60 Hz, percent", worst, 1.0));
    findings
}

/// What must not depend on the rate.
fn scores(ticks: &[TickRecord]) -> [(&'static str, f64); 6] {
    let mut keeper = ScoreKeeper::default();
    ticks.iter().for_each(|tick| keeper.add(tick));
    [
        ("path_mm", keeper.path_mm),
        ("idle_s", keeper.idle_s),
        ("log_dimensionless_jerk", keeper.log_dimensionless_jerk.unwrap_or(f64::NAN)),
        ("drilling_s", keeper.drilling_s),
        ("burr_on_brain_s", keeper.burr_on_brain_s),
        ("bone_removed_mm3", keeper.bone_removed_mm3),
    ]
}

/// The last tick of each period, with the bone of all of them.
fn thinned(ticks: &[TickRecord], rate_hz: usize) -> Vec<TickRecord> {
    let period = |tick: &TickRecord| (tick.time_ms * rate_hz as f64 * 1e-3).ceil() as u64;
    let whole =
        |run: &[TickRecord]| TickRecord { removed_mm3: run.iter().map(|t| t.removed_mm3).sum(), ..run[run.len() - 1] };
    ticks.chunk_by(|a, b| period(a) == period(b)).map(whole).collect()
}
