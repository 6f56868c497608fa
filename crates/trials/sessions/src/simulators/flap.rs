//! A flap cut by script on the built-in case: found free when its last bridge goes, lifted whole,
//! and near to the plan.

use super::bench::Bench;
use trepan_bone::Piece;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_haptics::script::{Plan, Script};
use trepan_haptics::simulated::HandModel;
use trepan_patient::PlanComparison;
use trepan_stages::{Program, What};
use trepan_trials_scenes::case::CaseFixture;

/// Duration of the operation, ms.
const END_MS: f64 = 75_000.0;

/// A lap of the craniotome in each way round, and its gates.
pub fn findings(table: &CaseFixture) -> Findings {
    let mut findings = Findings::default();
    for (name, turn_back) in [("flap", false), ("flap, the other way round", true)] {
        lap(table, name, turn_back, &mut findings);
    }
    findings
}

/// Cuts along the outline, or from its first point along its other way.
fn lap(table: &CaseFixture, name: &str, turn_back: bool, findings: &mut Findings) {
    let (bone, brain) = table.fresh();
    let pieces = Piece::all(&bone);
    let mut how = Plan { outline: table.flap.outline.clone(), ..Plan::default() };
    if turn_back {
        how.outline[1..].reverse();
    }
    let script = Script::planned("flap", &table.flap.site, END_MS, &how).expect("the site is sound");
    let search = Some(table.flap.search(&bone));
    let mut bench = Bench::new(Program::Craniotomy, bone.clone(), brain, search, HandModel::FIRM, Box::new(script));
    // At the tick that finds it free the flood's answer is held against all pieces of the skull.
    let (mut free, mut cut_off, mut found_mm3) = (0, Vec::new(), 0.0f32);
    let mut until_ms = 0.0;
    while until_ms < END_MS {
        until_ms += 5.0;
        bench.run(until_ms, |_| false);
        if free == 0
            && let Some(notice) = bench.notices.iter().find(|n| matches!(n.what, What::FlapFree(_)))
        {
            free = notice.tick;
            cut_off = Piece::cut_off(&pieces, &Piece::all(&bone));
            found_mm3 = if let What::FlapFree(mm3) = notice.what { mm3 } else { 0.0 };
        }
    }
    let of_pieces = cut_off.first().map_or(0.0, |piece| piece.voxels as f64 * f64::from(bone.voxel_mm3()));
    let lifted = bench.notices.iter().any(|notice| matches!(notice.what, What::FlapLifted(_)));
    let against = PlanComparison::of(&table.flap, &bone).expect("a flap is planned");
    findings.rows.push(
        Row::new(format!("{name} of 24 mm on the built-in case"), "craniotome")
            .metric("free_after_s", 1e-3 * free as f64)
            .metric("flap_mm3", f64::from(found_mm3))
            .metric("dice", against.dice)
            .metric("surface_95_mm", against.surface_95_mm.unwrap_or(f64::NAN))
            .metric("outside_plan_mm3", against.outside_plan_mm3),
    );
    findings.gates.extend([
        Gate::at_least(format!("{name}: found free and lifted"), f64::from(u8::from(lifted && free > 0)), 1.0),
        Gate::at_most(
            format!("{name}: bone by flooding less that by all pieces, mm3"),
            (f64::from(found_mm3) - of_pieces).abs(),
            0.0,
        ),
        Gate::at_least(format!("{name}: Dice with the plan"), against.dice, 0.9),
        Gate::at_most(
            format!("{name}: 95 % surface distance from the plan, voxels"),
            against.surface_95_mm.unwrap_or(f64::NAN) / f64::from(bone.spacing_mm()),
            1.5,
        ),
    ]);
}
