//! Can a tumour be felt: the probe pressed on the built-in brain over a stiff ball of tissue, and over the same place without it.
//!
//! # Sources
//! Least difference of force that a hand notices, 7 %: X. D. Pang, H. Z. Tan, N. I. Durlach, *Manual discrimination of force*, Perception & Psychophysics 49 (1991).

use super::bench::config;
use super::case;
use crate::suite::{Findings, Gate, Row};
use anyhow::Result;
use std::sync::Arc;
use trepan_geometry::{Pose, Quat, ToolState, Vec3};
use trepan_haptics::{Reading, Status};
use trepan_simulator::{
    Cache, CollisionStage, HapticStage, Program, RestBrain, Scene, SoftFrame, SolverStage, TickInput, TissueClass,
    open_case,
};
use trepan_soft::Body;

/// How fast and how deep the probe is pressed in.
const PRESS_MM_S: f32 = 4.0;
const DEPTH_MM: f32 = 8.0;
/// Radius of the tumour, and of its middle below the brain's surface, mm.
const TUMOUR_MM: f32 = 9.0;
const BELOW_MM: f32 = 10.0;
/// Young's modulus of the brain, MPa.
const BRAIN_MPA: f32 = 0.003;

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
    findings.gates.push(Gate::at_least(
        "tumour: force over it, of that without it (a hand notices 1.07)",
        stiff / plain,
        1.07,
    ));
    Ok(findings)
}

/// Largest force of a press, N.
fn press(brain: &RestBrain, tumour: Option<Vec3>, entry: Vec3, inward: Vec3) -> Result<f64> {
    let middle_of = |tet: &[u32; 4]| tet.iter().map(|n| brain.mesh.positions[*n as usize]).sum::<Vec3>() / 4.0;
    let ill = |tet: &[u32; 4]| tumour.is_some_and(|at| middle_of(tet).distance(at) < TUMOUR_MM);
    let class = |(tet, code): (&[u32; 4], &u8)| if ill(tet) { TissueClass::Tumour.code() - 1 } else { code - 1 };
    let body = Body {
        mesh: brain.mesh.clone(),
        fixed: brain.fixed.clone(),
        materials: TissueClass::ALL.map(|class| class.material(BRAIN_MPA)).to_vec(),
        material_of_tet: brain.mesh.tets.iter().zip(&brain.class_of_tet).map(class).collect(),
    };
    let rotation = Quat::from_rotation_arc(Vec3::Z, -inward);
    let tip_mm = Program::Brain.tray()[0].tip_radius_mm;
    let at = |ms: f64| {
        let depth_mm = (1e-3 * ms as f32 * PRESS_MM_S).min(DEPTH_MM + 1.0) - 1.0;
        let pose = Pose::from_parts(entry + inward * (depth_mm - tip_mm), rotation);
        ToolState { time_ms: ms, ..ToolState::at(pose) }
    };
    let mut haptic = HapticStage::new(config(Program::Brain), None, Some(Arc::clone(&brain.field)), at(0.0));
    let mut collision = CollisionStage::new(Program::Brain, &brain.mesh, &Default::default(), None)?;
    let mut solver = SolverStage::new(Box::new(trepan_tled::Tled::new(&body, &trepan_tled::Config::default())?));
    let (mut frame, mut seq, mut most) = (SoftFrame::default(), 0, 0.0f64);
    let end = (1e3 * (DEPTH_MM + 1.0) / PRESS_MM_S) as u64 + 500;
    for tick in 1..=end {
        let reading = Reading { tool: at(tick as f64), status: Status::Fresh };
        let done = haptic.tick(&TickInput { tick, reading, patch: collision.patch(), patch_seq: seq }, &mut |_| {});
        solver.publish(&mut frame);
        seq = collision.step(&done.sample, &frame).seq;
        while solver.time_ms() < tick as f64 {
            solver.step(collision.loads(), seq);
        }
        most = most.max(done.wrench.force().length().into());
    }
    Ok(most)
}
