//! Scissors that close on a brain that they press.

use trepan_deformable::Config;
use trepan_geometry::{Buttons, Pose, ToolKind, ToolState, Vec3};
use trepan_mesh::Topology;
use trepan_soft::{Body, Material, boxes};
use trepan_stages::{CollisionStage, Program, SoftFrame, SolverStage, ToolSample};
use trepan_tled::{Config as Solver, Relaxation, Tled};

/// Presses a block of brain with scissors for half a second, closes them, and goes on.
///
/// Returns the hand's force at each tick, N, the splits, and the largest gap at the end, mm.
fn pressed(closes: bool) -> (Vec<Vec3>, usize, f32) {
    let mesh = boxes::centred_box([6, 6, 5], Vec3::new(24.0, 24.0, 20.0));
    let rates = vec![0.05; mesh.tets.len()];
    let stage = CollisionStage::new(Program::Brain, &mesh, &Config::default(), None).expect("a sound mesh");
    let stage = stage.aspirating(&mesh, &rates).expect("its own search").cutting(&mesh, &rates);
    let fixed = boxes::nodes_where(&mesh, |p| p.z == 0.0);
    let config = Solver { averaged_pressure: true, relaxation: Relaxation::SOLID_AND_FLUID, ..Solver::default() };
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    let tled = Tled::new(&body, &config).expect("the block is sound");
    let (mut stage, mut solver) = (stage, SolverStage::new(Box::new(tled)).resectable(rates.len()));
    let slot = Program::Brain.tray().iter().position(|tool| tool.kind == ToolKind::Scissors).expect("in the tray");
    let tool = Program::Brain.tray()[slot];
    let (mut frame, mut forces) = (SoftFrame::default(), Vec::new());
    for tick in 1..=900u64 {
        let z = 20.0 + tool.tip_radius_mm - 0.01 * tick.min(300) as f32;
        let mut state = ToolState::at(Pose::from_translation(Vec3::new(12.3, 11.8, z)));
        state.time_ms = tick as f64;
        state.buttons = if closes && tick > 500 { Buttons::PEDAL } else { Buttons(0) };
        solver.publish(&mut frame);
        let sample = ToolSample { tick, state, tool, slot, drilling: false, second: None, idle: false };
        let record = stage.step(&sample, &frame);
        forces.push(stage.patch().force_n * stage.patch().normal);
        // Some 30 ms after it was asked for, as in a session.
        if tick % 30 == 0 && stage.loads().splits.len() > solver.splits().len() {
            solver.wait_for_splits(stage.loads(), stage.loads().splits.len());
        }
        while solver.time_ms() < tick as f64 {
            solver.step(stage.loads(), record.seq);
        }
    }
    let faults = solver.solver_faults();
    assert_eq!((faults.limited, faults.non_finite, faults.inverted, faults.skipped_ms), (0, 0, 0, 0.0), "{faults:?}");
    let gap = |split: &trepan_mesh::Split| {
        solver.positions()[split.node as usize].distance(solver.positions()[split.from as usize])
    };
    let mut opened = body.mesh.clone();
    opened.split(solver.splits()).expect("the splits fit");
    assert_eq!(Topology::of(&opened).components().1, 1, "a slit, not two halves");
    (forces, solver.splits().len(), solver.splits().iter().map(gap).fold(0.0, f32::max))
}

#[test]
fn a_cut_under_a_tool_opens_and_its_force_does_not_jump() {
    let (whole, none, _) = pressed(false);
    let (cut, splits, gap_mm) = pressed(true);
    assert!(none == 0 && splits > 3 && gap_mm > 0.05, "{splits} splits, {gap_mm} mm");
    assert_eq!(whole[..500], cut[..500]);
    let jump = cut[500..].windows(2).map(|pair| pair[0].distance(pair[1])).fold(0.0, f32::max);
    assert!(jump <= 0.05, "{jump} N in a tick");
    assert!(cut[899].length() < 0.99 * whole[899].length(), "{} of {} N", cut[899], whole[899]);
}
