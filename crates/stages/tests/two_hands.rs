//! Two tools on one brain: the second hand's does what the first's would, and an arm holds a tool.

use trepan_contact::{GuardConfig, SurfacePatch};
use trepan_deformable::Config;
use trepan_geometry::{Buttons, Pose, Tool, ToolKind, ToolState, Vec3};
use trepan_haptics::{Reading, Status};
use trepan_mesh::TetMesh;
use trepan_soft::{Body, Material, boxes};
use trepan_stages::haptic_config::HapticConfig;
use trepan_stages::haptic_tick::{HapticStage, SecondTool, TickInput, ToolSample};
use trepan_stages::notice::{NoArm, What};
use trepan_stages::program::Program;
use trepan_stages::second_hand::SecondHand;
use trepan_stages::{CollisionStage, SoftFrame, SolverStage};
use trepan_tled::{Config as Solver, Tled};

/// Top of the block of brain, mm.
const TOP_MM: f32 = 18.0;

fn block() -> TetMesh {
    boxes::split_box([12, 12, 9], Vec3::new(24.0, 24.0, TOP_MM))
}

/// A block of brain that aspirators take, with its solver.
struct Bench {
    collision: CollisionStage,
    solver: SolverStage,
    frame: SoftFrame,
}

impl Bench {
    fn new() -> Self {
        let mesh = block();
        let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
        let rates = vec![0.05; mesh.tets.len()];
        let collision =
            CollisionStage::new(Program::Brain, &mesh, &Config::default(), None).expect("the block is sound");
        let collision = collision.with_second_hand(&mesh, &Config::default()).expect("the block is sound");
        let collision = collision.aspirating(&mesh, &rates).expect("its own search");
        let config = Solver { averaged_pressure: true, ..Solver::default() };
        let solver = Tled::new(&Body::uniform(mesh, fixed, Material::BRAIN), &config).expect("the block is sound");
        Self { collision, solver: SolverStage::new(Box::new(solver)), frame: SoftFrame::default() }
    }

    /// Collides the tools and steps the brain to their time.
    fn step(&mut self, sample: &ToolSample) {
        self.solver.publish(&mut self.frame);
        let seq = self.collision.step(sample, &self.frame).seq;
        while self.solver.time_ms() < sample.state.time_ms {
            _ = self.solver.step(self.collision.loads(), seq);
        }
    }
}

/// A pose of a tool in a tick.
fn at(place: Vec3, buttons: Buttons, tick: u64) -> ToolState {
    ToolState { time_ms: tick as f64, buttons, ..ToolState::at(Pose::from_translation(place)) }
}

/// An aspirator over a place goes 3 mm into the block within 300 ticks.
fn lowered(x: f32, tick: u64) -> Vec3 {
    Vec3::new(x, 12.2, TOP_MM + Tool::aspirator().tip_radius_mm - 0.01 * tick.min(300) as f32)
}

/// Lowers the aspirators of both hands at places, `None` for far away; patches and nodes after it.
fn pressed(hands: [Option<f32>; 2], buttons: Buttons) -> ([SurfacePatch; 2], Vec<Vec3>, f64) {
    let mut bench = Bench::new();
    let tray = Program::Brain.tray();
    let slot = tray.iter().position(|tool| tool.kind == ToolKind::Aspirator).expect("the tray has it");
    for tick in 1..=400 {
        let [state, other] = hands.map(|x| at(x.map_or(Vec3::splat(200.0), |x| lowered(x, tick)), buttons, tick));
        let second = Some(SecondTool { tool: SecondHand::tool(), slot: tray.len(), state: other });
        bench.step(&ToolSample { tick, state, tool: tray[slot], slot, drilling: false, second, idle: false });
    }
    (*bench.collision.patches(), bench.solver.positions().to_vec(), bench.collision.aspirated_mm3())
}

#[test]
fn the_second_hand_presses_and_takes_as_the_first_does() {
    for buttons in [Buttons(0), Buttons::PEDAL] {
        let (first, nodes, taken_mm3) = pressed([Some(12.3), None], buttons);
        let (second, others, again_mm3) = pressed([None, Some(12.3)], buttons);
        assert!((first[0].force_n > 0.02) == (buttons == Buttons(0)), "{first:?}");
        assert_eq!((first[0], first[1].force_n), (second[1], second[0].force_n));
        assert!(nodes == others && taken_mm3 == again_mm3, "the same bits");
        assert!((taken_mm3 > 5.0) == (buttons == Buttons::PEDAL), "{taken_mm3} mm³");
    }
}

#[test]
fn hands_that_change_places_change_forces() {
    let (one, nodes, _) = pressed([Some(9.0), Some(16.0)], Buttons(0));
    let (other, others, _) = pressed([Some(16.0), Some(9.0)], Buttons(0));
    let alone = pressed([Some(9.0), None], Buttons(0)).0[0].force_n;
    for hand in [0, 1] {
        let (a, b) = (one[hand].force_n * one[hand].normal, other[1 - hand].force_n * other[1 - hand].normal);
        assert!(a.length() > 0.02 && a.distance(b) < 1e-4, "{a} {b} N");
    }
    let apart = nodes.iter().zip(&others).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    assert!(apart < 1e-3, "{apart} mm");
    assert!((one[0].force_n - alone).abs() > 0.02 * alone, "7 mm apart, each feels the other: {alone} N");
}

/// The hand of the arm's test: down with the spatula, then it leaves, then it is gone.
fn hand_of_arm(tick: u64, arm: [u64; 2]) -> ToolState {
    let radius_mm = Tool::spatula().tip_radius_mm;
    let down_mm = |tick: u64| 0.01 * tick.min(400) as f32;
    let z = match tick {
        ..=600 => TOP_MM + radius_mm - down_mm(tick),
        _ => TOP_MM + radius_mm - 4.0 + 0.02 * (tick - 600) as f32,
    };
    let spatula =
        Program::Brain.tray().iter().position(|tool| tool.kind == ToolKind::Spatula).expect("the tray has it");
    let buttons = match tick {
        ..=3 => Buttons::slot(spatula),
        _ if arm.contains(&tick) => Buttons::ARM,
        _ => Buttons(0),
    };
    at(Vec3::new(12.0, 12.0, z), buttons, tick)
}

#[test]
fn an_arm_holds_the_brain_aside_until_it_is_taken_away() {
    let guard = GuardConfig { ramp_in_ms: 0.0, passivity: None, ..GuardConfig::default() };
    let config = HapticConfig { guard, ..HapticConfig::usual(Program::Brain) };
    let mut hand = HapticStage::new(config, None, None, at(Vec3::splat(50.0), Buttons(0), 0));
    let (mut bench, mut patches, mut notices) = (Bench::new(), [SurfacePatch::default(); 2], Vec::new());
    let (mut idle, mut held_n) = (Vec::new(), Vec::new());
    let sag = |bench: &Bench| {
        bench.solver.positions().iter().zip(&block().positions).fold(0.0f32, |most, (x, at)| most.max(at.z - x.z))
    };
    let mut sags_mm = [0.0; 3];
    for tick in 1..=2600 {
        let tool = hand_of_arm(tick, [550, 1500]);
        let reading = Reading { tool, status: Status::Fresh };
        let input = TickInput {
            tick,
            reading,
            patch: &patches[0],
            patch_seq: tick,
            second: None,
            second_n: patches[1].force_n,
        };
        let done = hand.tick(&input, &mut |notice| notices.push(notice.what));
        bench.step(&done.sample);
        patches = *bench.collision.patches();
        match tick {
            540 => sags_mm[0] = sag(&bench),
            1490 => sags_mm[1] = sag(&bench),
            2600 => sags_mm[2] = sag(&bench),
            _ => {}
        }
        idle.extend(done.sample.idle.then_some(tick));
        if (560..1500).contains(&tick) {
            held_n.push(patches[1].force_n);
            assert!(!done.sample.idle || done.wrench.force().length() < 1e-3, "nothing is felt in the arm's place");
        }
    }
    assert!(sags_mm[0] > 2.0 && (sags_mm[1] / sags_mm[0] - 1.0).abs() < 0.05 && sags_mm[2] < 0.2, "{sags_mm:?} mm");
    assert!(held_n.iter().all(|n| *n > 0.02), "the arm bears the tissue");
    assert!(idle.first() == Some(&550) && idle.last().is_some_and(|last| (600..900).contains(last)), "{idle:?}");
    let tools: Vec<_> = notices.iter().filter(|what| matches!(what, What::ArmHolds(_) | What::ArmGone)).collect();
    assert_eq!(tools, [&What::ArmHolds(Tool::spatula()), &What::ArmGone]);
    assert!(notices.contains(&What::Taken(Tool::aspirator())), "the hand takes another tool");
}

#[test]
fn an_arm_holds_blunt_tools_and_one_at_a_time() {
    let mut hand = HapticStage::new(HapticConfig::usual(Program::Brain), None, None, at(Vec3::ZERO, Buttons(0), 0));
    let tray = Program::Brain.tray();
    let slot = |kind| Buttons::slot(tray.iter().position(|tool| tool.kind == kind).expect("the tray has it"));
    let [aspirator, spatula] = [ToolKind::Aspirator, ToolKind::Spatula].map(slot);
    let second = at(Vec3::ZERO, Buttons(0), 0);
    let none = Buttons(0);
    let mut notices = Vec::new();
    let all = [aspirator, Buttons::ARM, spatula, none, Buttons::ARM, none, spatula, none, Buttons::ARM, none, spatula];
    for (tick, buttons) in (1..).zip(all).chain([(20, none), (21, Buttons::ARM)]) {
        let reading = Reading { tool: at(tick as f32 * Vec3::Z, buttons, tick), status: Status::Fresh };
        let second = (tick == 21).then_some(second);
        let patch = &SurfacePatch { time_ms: tick as f64, ..SurfacePatch::default() };
        let input = TickInput { tick, reading, patch, patch_seq: tick, second, second_n: 0.0 };
        hand.tick(&input, &mut |notice| notices.push(notice.what));
    }
    notices.retain(|what| !matches!(what, What::Phase(_) | What::Warning(..)));
    let [aspirator, spatula] = [Tool::aspirator(), Tool::spatula()];
    assert_eq!(
        notices,
        [
            What::Taken(aspirator),
            What::NoArm(NoArm::Tool),
            What::Taken(spatula),
            What::Taken(aspirator),
            What::ArmHolds(spatula),
            What::HeldByArm,
            What::ArmGone,
            What::Taken(spatula),
            What::NoArm(NoArm::SecondHand),
        ]
    );
}
