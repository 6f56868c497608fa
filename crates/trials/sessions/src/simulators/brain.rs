//! The built-in brain in the simulator's own loops: is a tumour felt, how far does the brain sink
//! and breathe, what does a spatula hold?
//!
//! # Practice
//! A tumour is a ball of its class's stiffness under the place that the probe presses. Shift,
//! breath and retraction are shown, not judged: they are uncalibrated.
//!
//! # Sources
//! Least difference of force that a hand notices, 7 %: X. D. Pang, H. Z. Tan, N. I. Durlach,
//! *Manual discrimination of force*, Perception & Psychophysics 49 (1991).

use super::bench::config;
use anyhow::Result;
use std::sync::Arc;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Pose, Quat, ToolState, Vec3};
use trepan_haptics::{Reading, Status};
use trepan_patient::{Cache, RestBrain, Scene, TissueClass, open_case};
use trepan_soft::{Body, Loads};
use trepan_stages::{
    CollisionStage, HapticStage, Phase, Program, Settling, SoftFrame, SolverStage, TickInput, ToolSample,
};
use trepan_trials_scenes::case;

/// How fast and how deep the probe is pressed in.
const PRESS_MM_S: f32 = 4.0;
const DEPTH_MM: f32 = 8.0;
/// Radius of the tumour, and of its middle below the brain's surface, mm.
const TUMOUR_MM: f32 = 9.0;
const BELOW_MM: f32 = 10.0;
/// Young's modulus of the brain, MPa.
const BRAIN_MPA: f32 = 0.003;
/// The spatula's place in the tray.
const SPATULA: usize = 1;
/// How long the brain is watched, ms.
const SINKING_MS: f64 = 16_000.0;

/// Rows of both presses, and the gate.
pub fn findings() -> Result<Findings> {
    let case = open_case(Program::Brain, &case::inputs(), &case::recipe(), &Cache::of_user()?)?;
    let scene = Scene::new(Program::Brain, case)?;
    let brain = scene.brain.ok_or_else(|| anyhow::anyhow!("the built-in case lacks a brain"))?;
    let (entry, inward) = (scene.site.entry, scene.site.inward);
    let middle = entry + BELOW_MM * inward;
    let [plain, stiff] = [None, Some(middle)].map(|tumour| press(&brain, tumour, entry, inward));
    let (plain, stiff) = (plain?, stiff?);
    let mut findings = Findings::default();
    for (method, force_n) in [("brain", plain), ("brain with a tumour", stiff)] {
        findings.rows.push(Row::new("a press of 8 mm", method).metric("force_n", force_n));
    }
    findings.rows.push(retraction(&brain, entry, inward)?);
    for lost in [0.0, 0.05] {
        findings.rows.push(sinking(&brain, entry, inward, lost)?);
    }
    findings.gates.push(Gate::at_least(
        "tumour: force over it, of that without it (a hand notices 1.07)",
        stiff / plain,
        1.07,
    ));
    Ok(findings)
}

/// The brain at rest in a solver.
fn solver(brain: &RestBrain, material_of_tet: Vec<u8>) -> Result<SolverStage> {
    let of_classes = TissueClass::ALL.map(|class| class.material(BRAIN_MPA)).to_vec();
    let body = Body { material_of_tet, ..brain.body(of_classes, 0.0, &brain.fixed, &[]) };
    Ok(SolverStage::new(Box::new(trepan_tled::Tled::new(&body, &trepan_tled::Config::default())?)))
}

/// The spatula laid on the brain beside its end and moved in by 6 mm, then held.
fn retraction(brain: &RestBrain, entry: Vec3, inward: Vec3) -> Result<Row> {
    let spatula = Program::Brain.tray()[SPATULA];
    let along = inward.any_orthonormal_vector();
    let rotation = Quat::from_rotation_arc(Vec3::Z, (along - 0.2 * inward).normalize());
    let at = |ms: f64| {
        let depth_mm = (1e-3 * ms as f32 * PRESS_MM_S).min(7.0) - 1.0;
        let pose = Pose::from_parts(entry + inward * (depth_mm - spatula.tip_radius_mm) - 8.0 * along, rotation);
        ToolState { time_ms: ms, ..ToolState::at(pose) }
    };
    let sample = |tick: u64| ToolSample {
        tick,
        state: at(tick as f64),
        tool: spatula,
        slot: SPATULA,
        drilling: false,
        second: None,
        idle: false,
    };
    let codes = brain.class_of_tet.iter().map(|code| code - 1).collect();
    let (mut solver, mut frame, mut seq) = (solver(brain, codes)?, SoftFrame::default(), 0);
    let mut collision = CollisionStage::new(Program::Brain, &brain.mesh, &Default::default(), None)?;
    for tick in 1..=4000 {
        solver.publish(&mut frame);
        seq = collision.step(&sample(tick), &frame).seq.max(seq);
        while solver.time_ms() < tick as f64 {
            solver.step(collision.loads(), seq);
        }
    }
    solver.publish(&mut frame);
    let moved = frame.positions.iter().zip(&brain.mesh.positions).filter(|(now, rest)| now.distance(**rest) > 2.0);
    Ok(Row::new("retraction by 6 mm", "spatula")
        .metric("largest_displacement_mm", solver.displacement_mm().into())
        .metric("nodes_moved_over_2_mm", moved.count() as f64))
}

/// The place under the opening while the brain sinks and breathes.
fn sinking(brain: &RestBrain, entry: Vec3, inward: Vec3, lost: f32) -> Result<Row> {
    let codes = brain.class_of_tet.iter().map(|code| code - 1).collect();
    let (mut solver, mut frame) = (solver(brain, codes)?, SoftFrame::default());
    let mut settling = Settling::new(lost, Vec3::NEG_Y, -inward);
    let near = |n: &usize| brain.mesh.positions[*n].distance_squared(entry);
    let node = (0..brain.mesh.positions.len()).min_by(|a, b| near(a).total_cmp(&near(b))).unwrap_or(0);
    let (mut seq, mut places, mut loads) = (0, Vec::new(), Loads::default());
    while solver.time_ms() < SINKING_MS {
        settling.load(Phase::Brain, solver.time_ms(), &mut loads);
        seq += 1;
        solver.step(&loads, seq);
        if solver.time_ms() > 0.5 * SINKING_MS {
            solver.publish(&mut frame);
            places.push(frame.positions[node] - brain.mesh.positions[node]);
        }
    }
    let out: Vec<f32> = places.iter().map(|place| -place.dot(inward)).collect();
    let [low, high] = [f32::min, f32::max].map(|pick| out.iter().copied().reduce(pick).unwrap_or(f32::NAN));
    let mean = places.iter().sum::<Vec3>() / places.len().max(1) as f32;
    Ok(Row::new("the brain with the dura open", "tled")
        .with("csf_loss", lost)
        .metric("shift_mm", mean.length().into())
        .metric("breath_and_pulse_mm", (high - low).into()))
}

/// Largest force of a press, N.
fn press(brain: &RestBrain, tumour: Option<Vec3>, entry: Vec3, inward: Vec3) -> Result<f64> {
    let middle_of = |tet: &[u32; 4]| tet.iter().map(|n| brain.mesh.positions[*n as usize]).sum::<Vec3>() / 4.0;
    let ill = |tet: &[u32; 4]| tumour.is_some_and(|at| middle_of(tet).distance(at) < TUMOUR_MM);
    let class = |(tet, code): (&[u32; 4], &u8)| if ill(tet) { TissueClass::Tumour.code() - 1 } else { code - 1 };
    let codes = brain.mesh.tets.iter().zip(&brain.class_of_tet).map(class).collect();
    let rotation = Quat::from_rotation_arc(Vec3::Z, -inward);
    let tip_mm = Program::Brain.tray()[0].tip_radius_mm;
    let at = |ms: f64| {
        let depth_mm = (1e-3 * ms as f32 * PRESS_MM_S).min(DEPTH_MM + 1.0) - 1.0;
        let pose = Pose::from_parts(entry + inward * (depth_mm - tip_mm), rotation);
        ToolState { time_ms: ms, ..ToolState::at(pose) }
    };
    let mut haptic = HapticStage::new(config(Program::Brain), None, Some(Arc::clone(&brain.field)), at(0.0));
    let mut collision = CollisionStage::new(Program::Brain, &brain.mesh, &Default::default(), None)?;
    let mut solver = solver(brain, codes)?;
    let (mut frame, mut seq, mut most) = (SoftFrame::default(), 0, 0.0f64);
    let end = (1e3 * (DEPTH_MM + 1.0) / PRESS_MM_S) as u64 + 500;
    for tick in 1..=end {
        let reading = Reading { tool: at(tick as f64), status: Status::Fresh };
        let done = haptic.tick(
            &TickInput { tick, reading, patch: collision.patch(), patch_seq: seq, second: None, second_n: 0.0 },
            &mut |_| {},
        );
        solver.publish(&mut frame);
        seq = collision.step(&done.sample, &frame).seq;
        while solver.time_ms() < tick as f64 {
            solver.step(collision.loads(), seq);
        }
        most = most.max(done.wrench.force().length().into());
    }
    Ok(most)
}
