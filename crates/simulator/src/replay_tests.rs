//! Every key of `--set` in a short operation without a device: its effect on the hand, and replays.

use crate::config::SessionConfig;
use crate::device_limits::DeviceLimits;
use crate::models::ModelRequest;
use crate::operation::Operation;
use crate::options::Options;
use crate::session_setup::SessionSetup;
use clap::Parser;
use trepan_contact::SurfacePatch;
use trepan_geometry::{Buttons, Pose, Quat, ToolKind, ToolState, Vec3};
use trepan_haptics::{Capabilities, DeviceName, Reading, Status};
use trepan_link::Recording;
use trepan_link::wire::TickRecord;
use trepan_models::ingredients::{KEYS, SolverDevice};
use trepan_models::measure::CaseErrors;
use trepan_patient::import::Facts;
use trepan_patient::opening::Opening;
use trepan_patient::{Brain, Case};
use trepan_runtime::{Outcome, SolverOutcome, Stages, lockstep};
use trepan_soft::boxes;
use trepan_stages::collision_step::SoftFrame;
use trepan_stages::haptic_tick::{TickInput, ToolSample};
use trepan_stages::program::{Phase, Program};
use trepan_volume::VoxelVolume;

/// Length of the operation, ms, and when the probe is taken.
const END: u64 = 1300;
const PROBE: u64 = 600;

/// Every key at once.
const ALL: &str = "rigid=god-object-sphere,shaft=on,shading=on,bone-friction=0.3,vibration=off,element=locking-free,\
                   law=ogden,law.grey=mooney-rivlin,relaxation=solid-and-fluid,threads=2,device=gpu,surface-pressure=2,\
                   search=hashed-grid,friction=0.3,folds=on,dynamic-mass-scaling=4,\
                   selective-mass-scaling=off,pia-arachnoid=0.12,support=anchored";

/// A plate of bone 6 mm thick with a hole of 24 mm, 2 mm over a block of brain.
fn case() -> Case {
    let (n, low) = (48, Vec3::new(-23.5, -23.5, -38.5));
    let place = |at: usize| low + Vec3::from([at % n, at / n % n, at / (n * n)].map(|i| i as f32));
    let mut skull = VoxelVolume::isotropic([n; 3], low, 1.0, -1000i16);
    let mut classes = skull.map(|_| 0u8);
    for at in 0..skull.data.len() {
        let p = place(at);
        let depth = (-p.z).min(p.z + 6.0).min(p.truncate().length() - 12.0);
        skull.data[at] = (400.0 + 800.0 * depth).clamp(-1000.0, 1200.0) as i16;
        classes.data[at] = u8::from(p.z < -8.0 && p.z > -33.0 && p.truncate().abs().max_element() < 20.0);
    }
    let mut mesh = boxes::split_box([7, 7, 4], Vec3::new(40.0, 40.0, 25.0));
    mesh.positions.iter_mut().for_each(|p| *p -= Vec3::new(20.0, 20.0, 33.0));
    let class_of_tet = (0..mesh.tets.len()).map(|tet| if tet % 5 == 0 { 3 } else { 1 }).collect();
    let brain = Brain { mri: classes.map(f32::from), classes, mesh, class_of_tet, mixtures: Vec::new() };
    let opening = Opening { entry_mm: [0.0; 3], inward: [0.0, 0.0, -1.0], bone_mm: 6.0, brain_mm: 8.0 };
    Case {
        name: "plate".into(),
        skull: Some(skull),
        isovalue_hu: 400, // numerical
        brain: Some(brain),
        opening: Some(opening),
        ..Case::default()
    }
}

fn setup(line: &str, recording: Option<&Recording>) -> SessionSetup {
    let options = Options::try_parse_from(format!("x --headless --frames-per-second 0 {line}").split_whitespace());
    let (options, program) = (options.unwrap(), Program::Integrated);
    let recorded = recording.map(|recording| SessionConfig::of(&recording.header).unwrap());
    let mut operation = Operation::of(&options, &DeviceName::MOUSE, recorded.as_ref().map(|config| &config.operation));
    operation.opening_needed = false;
    let request = ModelRequest::of(program, &options, &operation, recorded.as_ref()).unwrap();
    let models = request.settle(&Facts::default(), || false, |_, _, _| Ok(CaseErrors::default())).unwrap();
    SessionSetup::new(program, (case(), models), operation, false).unwrap()
}

fn stages(setup: &SessionSetup, two_hands: bool) -> Stages {
    let limits = DeviceLimits::of(&Capabilities::passive("a script"), 1.0, None);
    setup.stages(hand(0), 1.0, (&limits, two_hands.then_some(&limits))).unwrap()
}

/// The tool in a hand at a time, ms.
type Hand = fn(u64) -> ToolState;

/// The tool in the hand at a time, ms. A burr slides over the bone, drills, and leans on the rim of
/// the hole; then a probe presses the brain and slides.
fn hand(ms: u64) -> ToolState {
    let way = |from: Vec3, to: Vec3, since: u64, span: f32| from.lerp(to, ((ms - since) as f32 / span).min(1.0));
    let at = |x: f32, z: f32| Vec3::new(x, 0.3, z);
    let lean = if (400..PROBE).contains(&ms) { 1.0 } else { 0.1 };
    let (tip, buttons) = match ms {
        0..100 => (way(at(16.0, 6.0), at(16.0, 2.2), 0, 80.0), Buttons(0)),
        100..250 => (way(at(16.0, 2.2), at(18.0, 2.2), 100, 150.0), Buttons(0)),
        250..330 => (at(18.0, 2.2), Buttons::PEDAL),
        330..400 => (way(at(18.0, 2.2), at(0.0, 12.0), 330, 60.0), Buttons(0)),
        400..460 => (way(at(0.0, 12.0), at(0.0, -1.5), 400, 50.0), Buttons(0)),
        460..560 => (way(at(0.0, -1.5), at(8.7, -1.5), 460, 80.0), Buttons(0)),
        560..PROBE => (way(at(8.7, -1.5), at(0.0, 14.0), 560, 30.0), Buttons(0)),
        PROBE..650 => (at(0.0, 14.0), Buttons::take(ToolKind::Probe)),
        650..1000 => (way(at(0.0, 14.0), at(0.0, -9.5), 650, 250.0), Buttons(0)),
        _ => (way(at(0.0, -9.5), at(5.0, -9.5), 1000, 200.0), Buttons(0)),
    };
    let pose = Pose::from_parts(tip, Quat::from_rotation_y(lean));
    ToolState { time_ms: ms as f64, buttons, ..ToolState::at(pose) }
}

/// The same with the aspirator instead of burr and probe, its pedal down on the brain.
fn aspirating(ms: u64) -> ToolState {
    let ToolState { world_from_tool, .. } = hand(ms.max(PROBE));
    let buttons = if ms < PROBE + 50 { Buttons::take(ToolKind::Aspirator) } else { Buttons::PEDAL };
    ToolState { time_ms: ms as f64, buttons, ..ToolState::at(world_from_tool) }
}

/// The same with scissors that close every 100 ms.
fn cutting(ms: u64) -> ToolState {
    let ToolState { world_from_tool, .. } = hand(ms.max(PROBE));
    let closes = if ms % 100 < 20 { Buttons::PEDAL } else { Buttons(0) };
    let buttons = if ms < PROBE + 50 { Buttons::take(ToolKind::Scissors) } else { closes };
    ToolState { time_ms: ms as f64, buttons, ..ToolState::at(world_from_tool) }
}

/// The second hand's aspirator presses the brain beside the probe of the first.
fn beside(ms: u64) -> ToolState {
    let deep_mm = if (650..1100).contains(&ms) { 23.0 * ((ms - 650) as f32 / 250.0).min(1.0) } else { 0.0 };
    let buttons = if ms > 950 { Buttons::PEDAL } else { Buttons(0) };
    let pose = Pose::from_translation(Vec3::new(-3.5, 0.3, 14.0 - deep_mm));
    ToolState { time_ms: ms as f64, buttons, ..ToolState::at(pose) }
}

/// Runs the operation, each loop as if it kept pace.
fn operated(line: &str) -> (Recording, SessionSetup) {
    let (recording, setup, _) = operated_by((hand, None), line, END);
    (recording, setup)
}

/// The same by a hand, with the cheaper solver from a tick on; also what it made of the brain.
fn operated_by(
    (hand, other): (Hand, Option<Hand>),
    line: &str,
    cheaper_from: u64,
) -> (Recording, SessionSetup, SolverOutcome) {
    let setup = setup(&format!("--quality usual {line}"), None);
    let Stages { mut haptic, mut second, tissue } = stages(&setup, other.is_some());
    let mut tissue = tissue.expect("the program has tissue");
    let (mut recording, mut frame, mut seq, mut place) = (Recording::default(), SoftFrame::default(), 0, None);
    let mut patches = [SurfacePatch::default(); 2];
    for tick in 1..END {
        let reading = Reading { tool: hand(tick), status: Status::Fresh };
        let second_n = patches[1].force_n;
        let input = TickInput { tick, reading, patch: &patches[0], patch_seq: seq, second: place, second_n };
        let done = haptic.tick(&input, &mut |_| {});
        if let Some((second, hand)) = second.as_mut().zip(other) {
            let reading = Reading { tool: hand(tick), status: Status::Fresh };
            recording.second.push(second.tick(tick, &reading, &patches[1], &mut |_| {}).1);
            place = second.place();
        }
        if tick == cheaper_from {
            tissue.solver.wait_for_cheaper();
        }
        tissue.solver.publish(&mut frame);
        let collision = tissue.collision.step(&done.sample, &frame);
        (seq, patches) = (collision.seq, *tissue.collision.patches());
        let cut = tissue.collision.loads().splits.len();
        if cut > tissue.solver.splits().len() {
            tissue.solver.wait_for_splits(tissue.collision.loads(), cut);
        }
        while tissue.solver.time_ms() < tick as f64 {
            recording.solver.extend(tissue.solver.step(tissue.collision.loads(), collision.seq));
        }
        recording.ticks.push(done.record);
        recording.collisions.push(collision);
    }
    let faults = tissue.solver.solver_faults();
    assert_eq!((faults.contacts_left_out, faults.restless_steps), (0, 0), "{line}");
    let config = setup.models.config(setup.ingredients());
    recording.header.config = SessionConfig { operation: setup.operation.clone(), ..config }.entries();
    let wound = tissue.collision.wound().clone();
    (recording, setup, SolverOutcome { wound, ..SolverOutcome::of(&tissue.solver) })
}

/// Ticks that give the same force when the recording is replayed by its header.
fn replayed(recording: &Recording) -> (u64, SessionSetup) {
    let (outcome, setup) = again(recording);
    (outcome.replayed.unwrap().identical, setup)
}

/// Outcome of a replay by the recording's header.
fn again(recording: &Recording) -> (Outcome, SessionSetup) {
    let setup = setup("", Some(recording));
    let tool = Program::Integrated.tray()[0];
    let start = ToolSample { tick: 0, state: hand(0), tool, slot: 0, drilling: false, second: None, idle: false };
    (lockstep::compare(stages(&setup, !recording.second.is_empty()), recording, start), setup)
}

/// Largest difference on bone and on the brain: of the forces, N, and of the torques, N mm.
fn difference(a: &Recording, b: &Recording) -> [[f32; 2]; 2] {
    let of_phase = |phase: Phase| {
        let both = a.ticks.iter().zip(&b.ticks).filter(|(a, _)| a.phase == phase as u8);
        both.fold([0.0f32; 2], |[force, torque], (a, b)| {
            let (a, b) = (a.wrench, b.wrench);
            [force.max(a.force.distance(b.force)), torque.max(a.torque.distance(b.torque))]
        })
    };
    [of_phase(Phase::Craniotomy), of_phase(Phase::Brain)]
}

#[test]
fn all_ingredients_together_are_recorded_and_replay_bit_for_bit() {
    let (recording, was) = operated(&format!("--set {ALL}"));
    let (identical, is) = replayed(&recording);
    assert_eq!((identical, is.ingredients()), (END - 1, was.ingredients()));
    for (name, text) in ALL.split(',').filter_map(|given| given.split_once('=')) {
        let key = KEYS.iter().find(|key| key.name == name.split('.').next().unwrap()).unwrap();
        let recorded = &recording.header.config[&format!("ingredients.{}", key.name)];
        let expected = match name {
            "rigid" => "god-object-sphere-shaft",
            "law" | "law.grey" => "ogden+grey:mooney-rivlin+ventricle:neo-hookean",
            // Surface pressure is the processor's alone.
            "device" => "cpu",
            _ => text,
        };
        assert_eq!(recorded, expected, "{name}");
    }
    let given = |name: &&str| ALL.split(',').any(|given| given.split_once('=').is_some_and(|(key, _)| key == *name));
    let unset: Vec<_> = KEYS.iter().map(|key| key.name).filter(|name| !given(name)).collect();
    assert_eq!(unset, ["rigid-points", "solver", "still-mm"], "every other key is on here");
    assert!(was.solver_remarks()[0].contains("runs on the processor"));
}

#[test]
fn each_key_that_is_physical_changes_the_force_where_it_acts_and_replays() {
    let (plain, _) = operated("");
    assert_eq!(replayed(&plain).0, END - 1);
    let peak = |phase: Phase| {
        let of = plain.ticks.iter().filter(|tick| tick.phase == phase as u8);
        of.map(|tick| tick.wrench.force.length()).fold(0.0, f32::max)
    };
    assert!(peak(Phase::Craniotomy) > 1.0 && peak(Phase::Brain) > 0.1, "the path touches bone and brain");
    // Smallest change on bone and on the brain: of the force, N, and of the torque, N mm.
    let cases = [
        ("rigid=thesis", [[0.02, 0.0], [0.0; 2]]),
        ("shaft=on", [[0.1, 1.0], [0.0; 2]]),
        ("shading=on", [[0.002, 0.0], [0.0; 2]]),
        ("bone-friction=0.3", [[0.1, 0.0], [0.0; 2]]),
        ("vibration=off", [[0.005, 0.0], [0.0; 2]]),
        ("element=locking-free", [[0.0; 2], [0.002, 0.0]]),
        ("law=ogden", [[0.0; 2], [0.002, 0.0]]),
        ("law=stiffening", [[0.0; 2], [0.002, 0.0]]),
        ("law.grey=ogden", [[0.0; 2], [0.0002, 0.0]]),
        ("pia-arachnoid=0.12", [[0.0; 2], [0.002, 0.0]]),
        ("relaxation=prony", [[0.0; 2], [0.01, 0.0]]),
        ("relaxation=solid-and-fluid", [[0.0; 2], [0.002, 0.0]]),
        ("surface-pressure=10", [[0.0; 2], [0.01, 0.0]]),
        ("friction=0.3", [[0.0; 2], [0.02, 0.0]]),
        ("support=anchored", [[0.0; 2], [0.001, 0.0]]),
        ("search=thesis", [[0.0; 2], [0.002, 0.0]]),
        ("solver=xpbd", [[0.0; 2], [0.01, 0.0]]),
    ];
    for (given, least) in cases {
        let (with, setup) = operated(&format!("--set {given}"));
        let found = difference(&plain, &with);
        let is_enough = found.iter().flatten().zip(least.iter().flatten()).all(|(found, least)| found >= least);
        assert!(is_enough, "{given}: {found:?} of {least:?}");
        let bone_alone = least[1] == [0.0; 2];
        assert!(bone_alone || found[0] == [0.0; 2], "{given} changes the force on bone: {found:?}");
        let name = given.split(['=', '.']).next().unwrap();
        let key = KEYS.iter().find(|key| key.name == name).unwrap();
        assert_ne!(
            key.value(&setup.ingredients()),
            plain.header.config[&format!("ingredients.{}", key.name)],
            "{given}"
        );
        assert_eq!(replayed(&with).0, END - 1, "{given}");
    }
}

#[test]
fn keys_of_speed_leave_the_force_as_it_is() {
    let (plain, _) = operated("");
    for given in ["threads=3", "folds=on", "search=hashed-grid", "device=gpu"] {
        let (with, setup) = operated(&format!("--set {given}"));
        let found = difference(&plain, &with);
        // A card rounds otherwise.
        let most = if setup.ingredients().device == SolverDevice::Gpu { 1e-3 } else { 0.0 };
        assert!(found.iter().flatten().all(|found| *found <= most), "{given}: {found:?}");
    }
}

#[test]
fn a_cheaper_solver_goes_on_without_a_jump_and_a_replay_changes_at_the_same_step() {
    let line = "--set element=locking-free,law=stiffening,relaxation=prony,threads=2";
    // While the probe is deep in the brain, which has relaxed under it.
    let from = 1050;
    let [(plain, ..), (cheaper, ..)] = [END, from].map(|from| operated_by((hand, None), line, from));
    assert_eq!(replayed(&cheaper).0, END - 1);
    let records = |recording: &Recording| recording.solver.iter().filter(|record| record.cheaper > 0).count();
    assert!(records(&plain) == 0 && records(&cheaper) > 100);
    let steps = |recording: &Recording| recording.solver.last().unwrap().step;
    assert!(steps(&cheaper) < steps(&plain), "its steps are longer");
    let apart = |(a, b): (&TickRecord, &TickRecord)| a.wrench.force.distance(b.wrench.force);
    let found: Vec<f32> = plain.ticks.iter().zip(&cheaper.ticks).map(apart).collect();
    let (before, after) = found.split_at(from as usize);
    let most = |of: &[f32]| of.iter().copied().fold(0.0, f32::max);
    // Without the stress memory it is 0.019 N, with it 0.0015.
    assert!(most(before) == 0.0 && most(after) > 0.0 && most(after) < 0.004, "{} N, {} N", most(before), most(after));
}

#[test]
fn an_aspirator_takes_tissue_and_a_replay_feels_the_same() {
    let line = "--set element=locking-free --aspiration 50 --bleeding 20";
    let (recording, setup, SolverOutcome { fills, wound, .. }) = operated_by((aspirating, None), line, 1100);
    let resection = setup.resection(&fills).unwrap();
    let names: Vec<&str> = resection.tissues.keys().map(String::as_str).collect();
    assert!(resection.healthy_mm3 > 30.0 && names == ["brain", "grey"], "{resection:?}");
    assert_eq!(resection.tumour_share, 0.0, "there is none");
    assert!(fills.iter().any(|fill| (1..u16::MAX).contains(fill)));
    let bled = &wound.bleeding;
    assert!(bled.bled_ml > 1e-3 && bled.sucked_ml > 0.0 && bled.stains.iter().any(|stain| *stain > 0), "{bled:?}");
    let again = again(&recording).0;
    let same = again.solver.unwrap().wound.bleeding;
    // No tick heard of the last collision step.
    assert_eq!((same.bled_ml, same.sucked_ml, &same.stains), (bled.bled_ml, bled.sucked_ml, &bled.stains));
    assert_eq!(again.replayed.unwrap().identical, END - 1);
    let (pressed, without, SolverOutcome { fills: whole, .. }) =
        operated_by((aspirating, None), "--set element=locking-free --aspiration 0", 1100);
    assert!(whole.is_empty() && without.resection(&whole).is_none());
    let sum_n = |recording: &Recording| recording.ticks.iter().map(|tick| tick.wrench.force.length()).sum::<f32>();
    assert!(sum_n(&recording) < 0.97 * sum_n(&pressed), "{} {} N", sum_n(&recording), sum_n(&pressed));
    let (_, rival, SolverOutcome { fills: whole, .. }) =
        operated_by((aspirating, None), "--set search=hashed-grid", END);
    assert!(whole.is_empty() && rival.no_aspiration().is_some_and(|why| why.contains("search=walk")));
}

#[test]
fn scissors_open_the_brain_and_a_replay_feels_the_same() {
    let line = "--set element=locking-free --aspiration 50 --bleeding 20";
    let (recording, _, SolverOutcome { splits, wound, .. }) = operated_by((cutting, None), line, END);
    let bled_ml = wound.bleeding.bled_ml;
    assert!(splits.len() > 5 && wound.cut_mm2 > 50.0 && bled_ml > 0.0, "{} {bled_ml}", splits.len());
    assert!(recording.solver.iter().any(|record| record.splits > 0) && recording.solver[0].splits == 0);
    let again = again(&recording).0;
    let SolverOutcome { wound: same, .. } = again.solver.unwrap();
    // No tick heard of the last collision step.
    assert_eq!((same.cut_mm2, same.bleeding.bled_ml), (wound.cut_mm2, bled_ml));
    assert_eq!(same.bleeding.stains, wound.bleeding.stains);
    assert_eq!(again.replayed.unwrap().identical, END - 1);
    let (_, _, SolverOutcome { splits, .. }) = operated_by((cutting, None), "--set search=hashed-grid", END);
    assert!(splits.is_empty());
}

#[test]
fn two_hands_on_the_brain_feel_each_other_and_replay_bit_for_bit() {
    let line = "--set element=locking-free --aspiration 50 --bleeding 20";
    let (alone, ..) = operated_by((hand, None), line, END);
    let (both, setup, SolverOutcome { fills, .. }) = operated_by((hand, Some(beside)), line, END);
    let peak_n = both.second.iter().map(|tick| tick.wrench.force.length()).fold(0.0, f32::max);
    assert!(peak_n > 0.05, "the second hand feels the brain: {peak_n} N");
    assert!(difference(&alone, &both)[1][0] > 0.01, "and the first feels the second");
    assert!(setup.resection(&fills).is_some_and(|made| made.healthy_mm3 > 3.0), "its aspirator takes tissue");
    assert_eq!(replayed(&both).0, END - 1);
}

#[test]
fn an_arm_holds_a_tool_and_a_replay_holds_it_too() {
    let held = |ms: u64| {
        let ToolState { world_from_tool, buttons, .. } = hand(ms);
        let buttons = if ms == 950 { Buttons::ARM } else { buttons };
        let back = Vec3::Z * 0.1 * ms.saturating_sub(950) as f32;
        let pose = Pose::from_parts(world_from_tool.translation + back, world_from_tool.rotation);
        ToolState { time_ms: ms as f64, buttons, ..ToolState::at(pose) }
    };
    let (recording, _, made) = operated_by((held, None), "", END);
    assert!(made.end_displacement_mm > 0.5 * made.max_displacement_mm, "{made:?}");
    let tools = [900, 1200].map(|tick| recording.ticks[tick].tool);
    let kinds = tools.map(|slot| Program::Integrated.tray()[usize::from(slot)].kind);
    assert_eq!(kinds, [ToolKind::Probe, ToolKind::Aspirator]);
    // A replay of the film knows the arm by the ticks.
    let [(from_ms, Some(in_arm))] = trepan_runtime::arms(&recording.ticks, Program::Integrated.tray())[..] else {
        panic!("an arm that stays")
    };
    let off_mm = in_arm.world_from_tool.translation.distance(hand(950).tip());
    assert!(from_ms == 950.0 && in_arm.tool.kind == ToolKind::Probe && off_mm < 0.1, "{from_ms} ms, {off_mm} mm");
    assert_eq!(replayed(&recording).0, END - 1);
}

#[test]
fn friction_holds_the_hand_back() {
    let pull = |line: &str| operated(line).0.ticks.last().unwrap().wrench.force.x;
    let (free, held) = (pull(""), pull("--set friction=0.5"));
    assert!(held < free - 0.05, "sliding towards +x: {free} N without, {held} N with friction");
}
