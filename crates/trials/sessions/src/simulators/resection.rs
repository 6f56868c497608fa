//! A made tumour that the scripted aspirator takes.
//!
//! # Practice
//! The loops turn on one thread as if each kept pace. Measured: how much goes, of the tumour and of
//! the brain around, whether volume is accounted for, and what the hand feels.

use anyhow::{Context, Result};
use clap::Parser;
use trepan_contact::SurfacePatch;
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::Vec3;
use trepan_haptics::HapticDevice;
use trepan_haptics::script::{Plan, Script};
use trepan_patient::TissueClass;
use trepan_simulator::{Options, Session};
use trepan_stages::{CollisionStage, Phase, Program, SoftFrame, SolverStage, TickInput};
use trepan_trials_scenes::case;

/// Length of the operation, bone included, ms.
const END_MS: u64 = 390_000;
/// Ingredients of the quality `auto`.
const INGREDIENTS: &str = "element=locking-free,law=stiffening,pia-arachnoid=on,relaxation=solid-and-fluid,friction=0.1,\
                           support=anchored";

/// With few tetrahedra, and with those of a session.
pub fn findings(scope: Scope) -> Result<Findings> {
    let mut findings = Findings::default();
    for quality in scope.pick(&["draft"][..], &["draft", "usual"][..]) {
        resect(quality, &mut findings)?;
    }
    Ok(findings)
}

fn resect(quality: &str, findings: &mut Findings) -> Result<()> {
    let words = "integrated --headless --frames-per-second 0 --device script:resect --quality";
    let options = Options::try_parse_from(words.split(' ').chain([quality, "--set", INGREDIENTS]))?;
    let session = Session::open(Program::Integrated, options, case::inputs())?;
    let how = Plan {
        outline: session.plan().outline.clone(),
        target: session.plan().target,
        incisions: session.plan().incisions.clone(),
        ..Plan::default()
    };
    let mut script = Script::planned("resect", &session.plan().site, END_MS as f64, &how)?;
    let mut stages = session.stages(script.at(0.0))?;
    let mut tissue = stages.tissue.take().context("the program has tissue")?;
    let (mut frame, mut newest) = (SoftFrame::default(), (0, SurfacePatch::default()));
    let (mut last, mut most_n, mut most_step_n, mut opened_ms) = (Vec3::ZERO, 0.0f32, 0.0f32, None);
    for tick in 1..=END_MS {
        let (reading, (patch_seq, patch)) = (script.read(tick as f64), &newest);
        let input = TickInput { tick, reading, patch, patch_seq: *patch_seq, second: None, second_n: 0.0 };
        let done = stages.haptic.tick(&input, &mut |_| {});
        // Nothing acts on the brain before.
        if done.sample.phase() != Phase::Brain {
            continue;
        }
        let since_ms = tick - *opened_ms.get_or_insert(tick);
        let force = done.record.wrench.force;
        most_n = most_n.max(force.length());
        most_step_n = most_step_n.max(force.distance(std::mem::replace(&mut last, force)));
        tissue.solver.publish(&mut frame);
        let record = tissue.collision.step(&done.sample, &frame);
        newest = (record.seq, *tissue.collision.patch());
        while tissue.solver.time_ms() < since_ms as f64 {
            tissue.solver.step(tissue.collision.loads(), record.seq);
        }
    }
    let felt = [most_n, most_step_n].map(f64::from);
    judge(&format!("resection, {quality}"), &session, (&tissue.collision, &tissue.solver), felt, findings)
}

/// Adds what is left and what bled; `felt`: the largest force and its largest change in a tick, N.
fn judge(
    name: &str,
    session: &Session,
    (collision, solver): (&CollisionStage, &SolverStage),
    felt: [f64; 2],
    findings: &mut Findings,
) -> Result<()> {
    let brain = session.scene().brain.as_ref().context("the program has a brain")?;
    let fills = solver.fills();
    let (whole, left) = (brain.left_mm3(&vec![u16::MAX; fills.len()]), brain.left_mm3(fills));
    let taken = |at: usize| whole[at] - left[at];
    let bleeding = &collision.wound().bleeding;
    let dura = &collision.wound().dura;
    let length_mm = |line: &Vec<Vec3>| line.windows(2).map(|pair| pair[0].distance(pair[1])).sum::<f32>();
    let planned_mm: f32 = session.plan().incisions.iter().map(length_mm).sum();
    let unaccounted = (bleeding.bled_ml - bleeding.sucked_ml - bleeding.lies_ml).abs() / bleeding.bled_ml;
    let (all_mm3, tumour) = (whole.iter().sum::<f64>(), TissueClass::Tumour as usize);
    let gone_mm3 = (0..whole.len()).map(taken).sum::<f64>();
    let share = taken(tumour) / whole[tumour];
    let lost = (gone_mm3 - collision.aspirated_mm3()).abs() / all_mm3;
    let faults = solver.solver_faults();
    findings.rows.push(
        Row::new(name, session.models().setup.tissue.to_string())
            .metric("tumour_share", share)
            .metric("healthy_mm3", gone_mm3 - taken(tumour))
            .metric("tetrahedra_gone", fills.iter().filter(|fill| **fill == 0).count() as f64)
            .metric("most_n", felt[0])
            .metric("bled_ml", bleeding.bled_ml)
            .metric("worst_ml_per_min", bleeding.worst_ml_per_min.into())
            .metric("sources_closed", bleeding.coagulated.into())
            .metric("incised_mm", dura.incised_mm.into())
            .metric("inverted", faults.inverted as f64),
    );
    let put_right = (faults.inverted + faults.limited + faults.non_finite) as f64 + faults.skipped_ms;
    findings.gates.extend([
        Gate::at_least(format!("{name}: share of the tumour taken"), share, 0.8),
        Gate::at_most(format!("{name}: volume not accounted for, of the brain"), lost, 1e-6),
        Gate::at_most(format!("{name}: elements, nodes and ms that the solver put right"), put_right, 0.0),
        Gate::at_most(format!("{name}: blood not accounted for"), unaccounted, 1e-3),
        Gate::at_least(format!("{name}: share of the dura's incisions"), (dura.incised_mm / planned_mm).into(), 0.9),
        Gate::at_most(format!("{name}: tears of the dura"), dura.torn.into(), 0.0),
        Gate::at_most(format!("{name}: bleeding at the end, ml/min"), bleeding.rate_ml_per_min.into(), 1.0),
        Gate::at_most(format!("{name}: largest change of force in a tick, N"), felt[1], 0.05),
    ]);
    Ok(())
}
