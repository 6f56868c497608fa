//! Slides over the block, and a hand that gives way.
//!
//! # Theory
//! - Without friction an elastic body at rest does not know how the tool came: a slide that ends
//!   over the middle of the block must feel what an upright press feels there (`axial.csv`).
//! - With friction and in motion, slides to both sides are each other's mirror images: over the
//!   middle their forces must be, too, whatever tissue and friction do. The drag over the normal
//!   force must be at least the coefficient of friction: all places slip, and the tissue before the
//!   tool holds it back, too. Without friction it is 0.03 on pia-arachnoid.
//! - A hand of stiffness k that wants to be D deep comes to rest at the depth d where the truth's
//!   force F(d) is k (D - d). F is interpolated between whole millimetres as a power.
//!
//! # Practice
//! The hand is the simulated device of a session, with its delay, without Coulomb friction and
//! encoder steps, which let it rest beside its balance. Its haptic tick, with the force guard, is
//! that of a session; one scene has a collision step every 4 ms only.

use super::{
    BEFORE_MM, Bench, FELT_N, Found, REST_MS, SPEED, Scene, block, edge_mm, judge, largest_tilt_deg, sizes, truths,
};
use anyhow::Result;
use trepan_contact::SurfacePatch;
use trepan_evidence::part::Part;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::{Config, HandModel, Simulated};
use trepan_mesh::TetMesh;
use trepan_stages::{HapticConfig, HapticStage, Program, TickInput};

/// Way of a slide before and, where it goes on, behind the middle, mm.
const SLIDE_MM: f32 = 4.0;
/// Friction coefficient of the slides to both sides.
const FRICTION: f64 = 0.1;
/// Rest of the hand after each move, ms: several of its slowest time constants.
const HAND_REST_MS: usize = 600;
/// Time in which the hand waits in air while the force ramps in, ms.
const RAMP_MS: usize = 400;

/// The parts.
pub(super) fn parts() -> Vec<Part> {
    let of = |scene: Scene, judge: fn(&Scene, &TetMesh, &mut Findings) -> Result<()>| {
        Part::new(format!("axial press: {}", scene.name), move |scope, findings: &mut Findings| {
            for &size in sizes(scope) {
                let mesh = block(size).expect("the block can be filled");
                judge(&scene, &mesh, findings).expect("the fixture and the mesh are sound");
            }
        })
    };
    let heavy = Scene::pressed("", Tool::probe(2.0)).as_in_session();
    let spatula = Scene { tool: Tool::spatula(), ..heavy };
    let pia = heavy.on_pia_arachnoid();
    let smooth = |name, scene: Scene, truth_mm| Scene { name, friction: 0.0, truth_mm, ..scene };
    let rubbed = |name, scene: Scene| Scene { name, friction: FRICTION as f32, truth_mm: 3, ..scene };
    vec![
        of(smooth("slide of a probe to the middle", heavy, 3), end),
        of(smooth("slide of a spatula to the middle", spatula, 4), end),
        of(smooth("slide of a probe on pia-arachnoid to the middle", pia, 4), end),
        of(rubbed("slides of a probe to both sides", heavy), mirrored),
        of(rubbed("slides of a probe on pia-arachnoid to both sides", pia), mirrored),
        of(Scene { name: "hand with a probe", truth_mm: 4, ..heavy }, held),
        of(Scene { name: "hand with a probe on pia-arachnoid", ..pia }, held),
        of(Scene { name: "hand with a probe, collision every 4 ms", collision_ms: 4, ..heavy }, held),
    ]
}

/// Presses aside of the middle to the scene's depth, then slides along x to and past the middle.
/// `record` gets the offset from the middle, mm, and the force, N, at each millisecond.
fn slide(bench: &mut Bench, scene: &Scene, from_mm: f32, to_mm: f32, mut record: impl FnMut(f32, Vec3)) {
    let depth_mm = scene.truth_mm as f32;
    let mut tip = scene.above(-BEFORE_MM) + from_mm * Vec3::X;
    for goal in [scene.above(depth_mm) + from_mm * Vec3::X, scene.above(depth_mm) + to_mm * Vec3::X] {
        while tip != goal {
            let before = tip;
            tip = if tip.distance(goal) <= SPEED { goal } else { tip + SPEED * (goal - tip).normalize() };
            let force = bench.collide(tip, tip - before);
            record(tip.x - scene.above(0.0).x, force);
            bench.advance();
        }
    }
}

/// A slide that ends over the middle, at rest.
fn end(scene: &Scene, mesh: &TetMesh, findings: &mut Findings) -> Result<()> {
    let mut bench = Bench::new(scene, mesh)?;
    slide(&mut bench, scene, -SLIDE_MM, 0.0, |_, _| ());
    let mut found = Found { depth_mm: scene.truth_mm, ..Found::default() };
    let rest: Vec<Vec3> = (0..REST_MS)
        .map(|_| {
            let force = bench.collide(scene.above(scene.truth_mm as f32), Vec3::ZERO);
            bench.advance();
            force
        })
        .collect();
    found.rest(&rest);
    bench.tell(mesh, &mut found);
    found.exact_n =
        truths(scene.tool.tip_radius_mm, scene.membrane_n_per_mm)?.get(scene.truth_mm as usize - 1).copied();
    judge(scene, scene.name, mesh, &[found], findings);
    Ok(())
}

/// Slides to both sides, in motion over the middle.
fn mirrored(scene: &Scene, mesh: &TetMesh, findings: &mut Findings) -> Result<()> {
    let (mut over, mut found) = ([Vec3::ZERO; 2], [Found::default(), Found::default()]);
    for ((side, force), found) in [-1.0, 1.0].into_iter().zip(&mut over).zip(&mut found) {
        let mut bench = Bench::new(scene, mesh)?;
        slide(&mut bench, scene, side * SLIDE_MM, -side * SLIDE_MM, |x, at| {
            if x.abs() < 0.5 * SPEED {
                *force = at;
            }
        });
        bench.tell(mesh, found);
    }
    let inverted = found.iter().map(|side| f64::from(side.inverted)).fold(0.0, f64::max);
    let skipped_ms = found.iter().map(|side| side.skipped_ms).fold(0.0, f64::max);
    let (name, edge) = (scene.name, edge_mm(mesh));
    let [right, left] = over;
    let apart_n = f64::from(right.distance(left * Vec3::new(-1.0, 1.0, 1.0)));
    let size_n = f64::from(0.5 * (right.length() + left.length()));
    let aside_n = f64::from(0.5 * (right.y + left.y).abs());
    let drag_share = f64::from((left.x - right.x) / (left.z + right.z));
    let row = Row::new(format!("axial press: {name}"), "tled").with("tets", mesh.tets.len());
    findings.rows.push(
        row.with("depth_mm", scene.truth_mm)
            .metric("edge_mm", edge)
            .metric("moving_force_n", size_n)
            .metric("drag_share", drag_share)
            .metric("mirror_error_percent", 100.0 * apart_n / size_n)
            .metric("aside_share", aside_n / size_n)
            .metric("inverted", inverted),
    );
    let what = format!("{name}, edge of {edge:.1} mm");
    let over_n = apart_n / (0.1 * size_n).max(0.02);
    findings.gates.extend([
        Gate::at_least(format!("{what}: drag over the normal force"), drag_share, FRICTION),
        Gate::at_most(format!("{what}: forces and their mirror image apart, over what is allowed"), over_n, 1.0),
        Gate::at_most(format!("{what}: elements inverted"), inverted, 0.0),
        Gate::at_most(format!("{what}: time skipped, ms"), skipped_ms, 0.0),
    ]);
    Ok(())
}

/// Both grips, which mean to go to every depth, and rest where tissue and grip balance.
fn held(scene: &Scene, mesh: &TetMesh, findings: &mut Findings) -> Result<()> {
    let truth = truths(scene.tool.tip_radius_mm, scene.membrane_n_per_mm)?;
    for (grip, hand) in [("light", HandModel::LIGHT), ("firm", HandModel::FIRM)] {
        let mut all = press_by_hand(scene, mesh, hand)?;
        let balance = |found: &Found| balance_n(&truth, found.depth_mm.into(), hand.stiffness.into());
        all.iter_mut().for_each(|found| found.exact_n = Some(balance(found)));
        judge(scene, &format!("{}, {grip} grip", scene.name), mesh, &all, findings);
    }
    Ok(())
}

/// The hand's way: its places at each tick, mm, and the ticks at which it has rested.
fn way(scene: &Scene) -> (Vec<Vec3>, Vec<usize>) {
    let (mut depth_mm, mut ends) = (-BEFORE_MM, Vec::new());
    let mut places = vec![scene.above(depth_mm); RAMP_MS];
    for goal in 1..=scene.truth_mm {
        while depth_mm < goal as f32 {
            depth_mm = (depth_mm + SPEED).min(goal as f32);
            places.push(scene.above(depth_mm));
        }
        places.resize(places.len() + HAND_REST_MS, scene.above(depth_mm));
        ends.push(places.len() - 1);
    }
    (places, ends)
}

fn press_by_hand(scene: &Scene, mesh: &TetMesh, hand: HandModel) -> Result<Vec<Found>> {
    let mut bench = Bench::new(scene, mesh)?;
    let (places, ends) = way(scene);
    let states: Vec<ToolState> = places.iter().map(|place| ToolState::at(Pose::from_translation(*place))).collect();
    let config = Config { friction_n: 0.0, quantum_mm: 0.0, ..Config::default() };
    let mut stage = HapticStage::new(HapticConfig::usual(Program::Brain), None, None, states[0]);
    let mut device = Simulated::new(config, hand, Box::new(Replay::new(states)));
    let (mut patch, mut forces, mut all) = (SurfacePatch::default(), Vec::new(), Vec::new());
    for tick in 1..=places.len() as u64 {
        let reading = device.read(tick as f64);
        if tick.is_multiple_of(scene.collision_ms) {
            bench.collide(reading.tool.tip(), reading.tool.twist.linear);
            patch = SurfacePatch { time_ms: tick as f64, ..bench.out.patch };
        }
        let input = TickInput { tick, reading, patch: &patch, patch_seq: tick, second: None, second_n: 0.0 };
        let wrench = stage.tick(&input, &mut |_| ()).wrench;
        device.apply(wrench);
        forces.push(wrench.force());
        bench.advance();
        if let Some(at) = ends.iter().position(|end| *end as u64 + 1 == tick) {
            let mut found = Found { depth_mm: at as u32 + 1, ..Found::default() };
            found.rest(&forces);
            let felt = forces.iter().filter(|force| force.length() > FELT_N);
            found.tilt_moving_deg = Some(largest_tilt_deg(felt));
            bench.tell(mesh, &mut found);
            all.push(found);
        }
    }
    Ok(all)
}

/// Force where the truth's curve and the spring of a hand that means to be at a depth meet, N.
fn balance_n(truth: &[f64], goal_mm: f64, stiffness: f64) -> f64 {
    let force_n = |depth_mm: f64| {
        let below = (depth_mm as usize).clamp(1, truth.len() - 1);
        let power = (truth[below] / truth[below - 1]).ln() / ((below + 1) as f64 / below as f64).ln();
        truth[below - 1] * (depth_mm / below as f64).powf(power)
    };
    let (mut low, mut high) = (0.0, goal_mm);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if force_n(middle) < stiffness * (goal_mm - middle) { low = middle } else { high = middle }
    }
    stiffness * (goal_mm - low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_on_a_spring_rests_where_two_springs_in_series_do() {
        let linear = [0.2, 0.4, 0.6, 0.8];
        for goal_mm in [0.5, 1.0, 2.7, 4.0] {
            assert!((balance_n(&linear, goal_mm, 0.3) - 0.12 * goal_mm).abs() < 1e-9);
        }
    }
}
