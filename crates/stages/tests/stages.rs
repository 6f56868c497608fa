//! The haptic stage under faults: no fault of a device, thread or script causes a force jump, a NaN
//! or a panic.

use glam::IVec3;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_contact::SurfacePatch;
use trepan_geometry::{Buttons, Pose, Quat, ToolKind, ToolState, Vec3};
use trepan_haptics::{Reading, Status};
use trepan_link::wire::TickRecord;
use trepan_stages::{HapticConfig, HapticStage, Hindrance, Notice, Phase, Program, TickInput, Warning, What};
use trepan_volume::{DistanceField, VoxelVolume};

/// Makes a flat head: bone from z = -6 to 0 mm, brain under z = -8 mm.
fn head() -> (Arc<BoneVolume>, Arc<DistanceField>) {
    let n = 48;
    let mut ct = VoxelVolume::isotropic([n, n, n], Vec3::new(-23.5, -23.5, -27.5), 1.0, -1000i16);
    let mut mask = ct.map(|_| 0u8);
    for at in 0..ct.data.len() {
        let z = -27.5 + (at / (n * n)) as f32;
        ct.data[at] = (400.0 + 1000.0 * (3.0 - (z + 3.0).abs())).clamp(-1000.0, 1200.0) as i16;
        mask.data[at] = u8::from(z < -8.0);
    }
    (Arc::new(BoneVolume::new(&ct, 400).expect("there is bone")), Arc::new(DistanceField::of_mask(&mask)))
}

struct Bench {
    stage: HapticStage,
    tick: u64,
    notices: Vec<Notice>,
    second: Option<Pose>,
}

impl Bench {
    fn new(program: Program) -> Self {
        let (bone, brain) = head();
        let bone = Some(bone).filter(|_| program.has_bone());
        Self {
            stage: HapticStage::new(HapticConfig::usual(program), bone, Some(brain), at(20.0, 0.0)),
            tick: 0,
            notices: Vec::new(),
            second: None,
        }
    }

    fn step(&mut self, tool: ToolState, status: Status, patch: &SurfacePatch) -> TickRecord {
        self.tick += 1;
        let tool = ToolState { time_ms: self.tick as f64, ..tool };
        let input = TickInput {
            tick: self.tick,
            reading: Reading { tool, status },
            patch,
            patch_seq: 1,
            second: self.second.map(ToolState::at),
            second_n: 0.0,
        };
        let done = self.stage.tick(&input, &mut |notice| self.notices.push(notice));
        let force = done.wrench.force();
        assert!(force.is_finite() && force.length() <= 3.3 + 1e-5, "{force} at tick {}", self.tick);
        done.record
    }

    fn raised(&self, warning: Warning) -> Option<u64> {
        self.notices.iter().find(|n| matches!(n.what, What::Warning(w, true, _) if w == warning)).map(|n| n.tick)
    }
}

/// Returns a tool with its tip at height z, mm, moving at `speed` mm/ms along z.
fn at(z: f32, speed: f32) -> ToolState {
    let mut tool = ToolState::at(Pose::from_parts(Vec3::new(0.3, -0.2, z), Quat::IDENTITY));
    tool.twist.linear.z = speed;
    tool
}

const NO_PATCH: SurfacePatch = SurfacePatch {
    time_ms: 0.0,
    tissue_ms: 0.0,
    normal: Vec3::ZERO,
    tip_mm: Vec3::ZERO,
    force_n: 0.0,
    normal_velocity: 0.0,
    couple_mm: Vec3::ZERO,
};

#[test]
fn undoing_a_stroke_restores_its_bone_once_the_tool_is_free() {
    let (bone, brain) = head();
    let before = bone.snapshot();
    let stage =
        HapticStage::new(HapticConfig::usual(Program::Craniotomy), Some(bone.clone()), Some(brain), at(6.0, 0.0));
    let mut bench = Bench { stage, tick: 0, notices: Vec::new(), second: None };
    let mut removed = 0.0;
    let mut run = |bench: &mut Bench, z: f32, buttons: u32| {
        let record = bench.step(ToolState { buttons: Buttons(buttons), ..at(z, 0.0) }, Status::Fresh, &NO_PATCH);
        removed += record.removed_mm3;
        removed
    };
    let (pedal, undo) = (Buttons::PEDAL.0, Buttons::UNDO.0);
    (0..400).for_each(|i| _ = run(&mut bench, 6.0 - 0.01 * i as f32, pedal));
    let drilled = run(&mut bench, 2.0, pedal | undo);
    assert!(
        drilled > 0.1 && bone.snapshot() != before,
        "nothing was drilled, or undone with the pedal down: {drilled}"
    );
    (0..200).for_each(|_| _ = run(&mut bench, 12.0, 0));
    // Some bricks a tick.
    (0..40).for_each(|_| _ = run(&mut bench, 12.0, undo));
    let left = run(&mut bench, 12.0, undo);
    assert_eq!(bone.snapshot(), before);
    assert!(left.abs() < 1e-3 * drilled, "{left} mm3 are left in the score");
    assert!(
        bench.notices.iter().any(|n| matches!(n.what, What::Undone(mm3) if (mm3 - drilled).abs() < 1e-3 * drilled))
    );
    (0..400).for_each(|i| _ = run(&mut bench, 6.0 - 0.01 * i as f32, 0));
    let felt = bench.step(at(2.0, 0.0), Status::Fresh, &NO_PATCH);
    assert!(felt.depth_mm > 0.5, "the bone that came back is not felt: {} mm", felt.depth_mm);
}

/// Drills a stroke 4 mm down at `x`, mm, from 6 mm over the bone, then moves away to 12 mm. Returns
/// the removed bone, mm³.
fn stroke(bench: &mut Bench, turn: Buttons, x: f32) -> f32 {
    let mut run = |z: f32, buttons: Buttons| {
        let mut tool = ToolState { buttons, ..at(z, 0.0) };
        tool.world_from_tool.translation.x += x;
        bench.step(tool, Status::Fresh, &NO_PATCH).removed_mm3
    };
    (0..5).for_each(|_| _ = run(12.0, turn));
    (0..300).for_each(|i| _ = run(12.0 - 0.02 * i as f32, Buttons(0)));
    let drilled = (0..400).map(|i| run(6.0 - 0.01 * i as f32, Buttons::PEDAL)).sum();
    (0..250).for_each(|_| _ = run(12.0, Buttons(0)));
    drilled
}

#[test]
fn strokes_of_several_tools_are_undone_one_by_one() {
    let (bone, brain) = head();
    let stage =
        HapticStage::new(HapticConfig::usual(Program::Craniotomy), Some(bone.clone()), Some(brain), at(12.0, 0.0));
    let mut bench = Bench { stage, tick: 0, notices: Vec::new(), second: None };
    let turns = [Buttons(0), Buttons::take(ToolKind::Perforator), Buttons::take(ToolKind::Burr)];
    let mut states = Vec::new();
    let mut drilled = Vec::new();
    for (turn, x) in turns.into_iter().zip([-8.0, 8.0, 0.0]) {
        states.push(bone.snapshot());
        drilled.push(stroke(&mut bench, turn, x));
        assert!(*drilled.last().unwrap() > 0.1 && bone.snapshot() != *states.last().unwrap());
    }
    let press = |buttons| ToolState { buttons, ..at(12.0, 0.0) };
    for (state, mm3) in states.iter().zip(&drilled).rev() {
        let back: f32 = (0..20).map(|_| bench.step(press(Buttons::UNDO), Status::Fresh, &NO_PATCH).removed_mm3).sum();
        bench.step(press(Buttons(0)), Status::Fresh, &NO_PATCH);
        assert!((back + mm3).abs() < 1e-3 * mm3, "{back} mm3 of {mm3} in the score");
        assert!(bone.snapshot() == *state);
    }
    bench.step(press(Buttons::UNDO), Status::Fresh, &NO_PATCH);
    assert_eq!(bench.notices.last().unwrap().what, What::NotUndone(Hindrance::NoStroke));
    assert!(bench.stage.scores().bone_removed_mm3.abs() < 1e-2, "{}", bench.stage.scores().bone_removed_mm3);
}

#[test]
fn no_bone_is_restored_around_a_tool_of_either_hand() {
    let (bone, brain) = head();
    let stage =
        HapticStage::new(HapticConfig::usual(Program::Integrated), Some(bone.clone()), Some(brain), at(12.0, 0.0));
    let mut bench = Bench { stage, tick: 0, notices: Vec::new(), second: None };
    let before = bone.snapshot();
    let mut z = 6.0;
    while !bench.notices.iter().any(|n| n.what == What::Through) {
        z -= 0.002;
        assert!(z > -9.0, "it does not come through");
        bench.step(ToolState { buttons: Buttons::PEDAL, ..at(z, 0.0) }, Status::Fresh, &NO_PATCH);
    }
    let drilled = bone.snapshot();
    (0..100).for_each(|_| _ = bench.step(at(z + 1.0, 0.0), Status::Fresh, &NO_PATCH));
    let peak = bench.stage.scores().hand_peak_force_n;
    let undo_at = |bench: &mut Bench, z: f32| {
        (0..300).for_each(|_| _ = bench.step(at(z, 0.0), Status::Fresh, &NO_PATCH));
        let undo = ToolState { buttons: Buttons::UNDO, ..at(z, 0.0) };
        (0..300).for_each(|_| _ = bench.step(undo, Status::Fresh, &NO_PATCH));
        (0..20).for_each(|_| _ = bench.step(at(z, 0.0), Status::Fresh, &NO_PATCH));
        let undo = |n: &&Notice| matches!(n.what, What::Undone(_) | What::NotUndone(_));
        *bench.notices.iter().rev().find(undo).unwrap()
    };
    let refused = undo_at(&mut bench, z + 1.0);
    assert_eq!(refused.what, What::NotUndone(Hindrance::Tool), "the burr lies in the hole");
    assert!(bone.snapshot() == drilled && bench.stage.scores().hand_peak_force_n == peak);
    let words = refused.words();
    assert!(words.0 == "refused" && words.1.contains("once the tool is out"), "{words:?}");
    bench.second = Some(at(-3.0, 0.0).world_from_tool);
    assert_eq!(undo_at(&mut bench, 20.0).what, What::NotUndone(Hindrance::SecondTool));
    assert!(bone.snapshot() == drilled);
    bench.second = Some(at(20.0, 0.0).world_from_tool);
    assert!(matches!(undo_at(&mut bench, 20.0).what, What::Undone(_)) && bone.snapshot() == before);
    let probe = ToolState { buttons: Buttons::take(ToolKind::Probe), ..at(20.0, 0.0) };
    bench.step(probe, Status::Fresh, &NO_PATCH);
    assert_eq!(bench.notices.last().unwrap().what, What::NotOpen, "the hole is bone again");
}

#[test]
fn drilling_warns_before_the_brain_and_removes_bone_only_under_the_burr() {
    let (bone, brain) = head();
    let before = bone.snapshot();
    let stage =
        HapticStage::new(HapticConfig::usual(Program::Craniotomy), Some(bone.clone()), Some(brain), at(20.0, 0.0));
    let mut bench = Bench { stage, tick: 0, notices: Vec::new(), second: None };
    let mut deepest = f32::INFINITY;
    for i in 0..14_000 {
        let mut tool = at((6.0 - 0.001 * i as f32).max(-7.0), -0.001);
        tool.buttons = Buttons::PEDAL;
        let record = bench.step(tool, Status::Fresh, &NO_PATCH);
        let load = if record.depth_mm > 0.0 { 20_000.0..60_000.0 } else { 60_000.0..60_000.1 };
        assert!(load.contains(&record.spindle_rpm), "{} 1/min, {} mm deep", record.spindle_rpm, record.depth_mm);
        if bench.raised(Warning::BrainNear).is_none() {
            deepest = deepest.min(record.brain_distance_mm);
        }
    }
    assert!(deepest > 1.9, "no warning although the brain was {deepest} mm away");
    let order = [Warning::BoneThin, Warning::BreakThrough, Warning::BrainTouched].map(|w| bench.raised(w).unwrap());
    let through: Vec<u64> = bench.notices.iter().filter(|n| n.what == What::Through).map(|n| n.tick).collect();
    assert!(matches!(through[..], [tick] if tick > order[1]), "came through at {through:?}, warned at {order:?}");
    assert!(order.is_sorted() && bench.raised(Warning::BrainNear).unwrap() < order[2], "{order:?}");
    let after = bone.snapshot();
    let removed: Vec<_> = (0..before.data.len()).filter(|&v| after.data[v] != before.data[v]).collect();
    assert!(removed.len() > 100);
    for voxel in removed {
        let centre = before.centre_of([voxel % 48, voxel / 48 % 48, voxel / 2304]).as_vec3();
        assert!(Vec3::new(centre.x - 0.3, centre.y + 0.2, 0.0).length() < 5.0, "bone was lost at {centre}");
    }
}

#[test]
fn warning_and_score_agree_on_a_touch_of_the_brain_and_exclude_a_craniotomes_foot() {
    for (kind, foot) in [(ToolKind::Burr, false), (ToolKind::Craniotome, true)] {
        let (bone, brain) = head();
        // A hole that no tool touches on its way down.
        (0..24).for_each(|at| {
            (0..48 * 48).for_each(|n| bone.set_hu(IVec3::new(n % 48, n / 48, at + 15), trepan_volume::AIR_HU));
        });
        let stage = HapticStage::new(HapticConfig::usual(Program::Craniotomy), Some(bone), Some(brain), at(20.0, 0.0));
        let mut bench = Bench { stage, tick: 0, notices: Vec::new(), second: None };
        let take = |z: f32| ToolState { buttons: Buttons::take(kind), ..at(z, 0.0) };
        let lift = |bench: &mut Bench, from: f32, to: f32| {
            (0..=400).for_each(|i| {
                let z = from + (to - from) * i as f32 / 400.0;
                // Contact with the deformed mesh alone, above the rest surface, is no touch.
                let patch = SurfacePatch {
                    time_ms: (bench.tick + 1) as f64,
                    normal: Vec3::Z,
                    tip_mm: at(z, 0.0).tip(),
                    force_n: 0.12,
                    ..NO_PATCH
                };
                bench.step(take(z), Status::Fresh, &patch);
            });
        };
        (0..5).for_each(|_| _ = bench.step(take(20.0), Status::Fresh, &NO_PATCH));
        let radius = Program::Craniotomy.tray().iter().find(|tool| tool.kind == kind).unwrap().tip_radius_mm;
        lift(&mut bench, 20.0, -8.0 + radius + 0.5);
        assert_eq!((bench.raised(Warning::BrainTouched), bench.stage.scores().burr_touches_of_brain), (None, 0));
        lift(&mut bench, -8.0 + radius + 0.5, -8.0 + 0.5 * radius);
        let touched = bench.raised(Warning::BrainTouched).is_some();
        assert_eq!((touched, bench.stage.scores().burr_touches_of_brain), (!foot, u32::from(!foot)), "{kind:?}");
        assert_eq!(bench.raised(Warning::BrainNear).is_some(), !foot);
        lift(&mut bench, -8.0 + 0.5 * radius, -8.0 - 2.0 * radius);
        assert!(bench.raised(Warning::BrainTouched).is_some(), "what cuts is in the brain");
        assert_eq!(bench.stage.scores().burr_touches_of_brain, 1);
        let words = bench.notices.iter().map(|n| n.words().1).find(|text| text.starts_with("brain-touched")).unwrap();
        assert!(words.ends_with("draw it back"), "no depth at the first touch: {words}");
    }
}

#[test]
fn a_drill_pressed_too_hard_stalls_with_a_warning() {
    let mut bench = Bench::new(Program::Craniotomy);
    for i in 0..1500 {
        let tool = ToolState { buttons: Buttons::PEDAL, ..at(6.0 - 0.1 * i.min(130) as f32, 0.0) };
        bench.step(tool, Status::Fresh, &NO_PATCH);
    }
    let stalled = bench.raised(Warning::DrillStalled).expect("a warning");
    assert!((100..200).contains(&stalled), "tick {stalled}");
    let record = bench.step(ToolState { buttons: Buttons::PEDAL, ..at(-7.0, 0.0) }, Status::Fresh, &NO_PATCH);
    assert_eq!((record.spindle_rpm, record.removed_mm3), (0.0, 0.0));
    assert!(bench.step(at(6.0, 0.0), Status::Fresh, &NO_PATCH).spindle_rpm == 0.0, "it turns without the pedal");
}

#[test]
fn a_craniotome_is_said_to_be_caught_when_led_on_too_fast_and_not_before() {
    let caught = |mm_per_ms: f32| {
        let mut bench = Bench::new(Program::Craniotomy);
        let take = Buttons::take(ToolKind::Craniotome);
        (0..50).for_each(|_| _ = bench.step(ToolState { buttons: take, ..at(20.0, 0.0) }, Status::Fresh, &NO_PATCH));
        let mut place = Vec3::new(0.0, 0.0, 20.0);
        let ways = [(Vec3::new(-30.0, 0.0, 20.0), 0.05), (Vec3::new(-30.0, 0.0, -7.5), 0.05)];
        for (to, mm_per_ms) in ways.into_iter().chain([(Vec3::new(-16.0, 0.0, -7.5), mm_per_ms)]) {
            while place != to {
                place = place.move_towards(to, mm_per_ms);
                let tool = ToolState { world_from_tool: Pose::from_translation(place), ..at(0.0, 0.0) };
                bench.step(ToolState { buttons: Buttons::PEDAL, ..tool }, Status::Fresh, &NO_PATCH);
            }
        }
        assert!(bench.stage.scores().bone_removed_mm3 > 20.0, "it cuts");
        bench.raised(Warning::CutterJams).is_some()
    };
    assert_eq!([0.001, 0.05].map(caught), [false, true]);
}

#[test]
fn invalid_device_poses_are_replaced_by_the_last_valid_one_and_warned_of() {
    let mut bench = Bench::new(Program::Integrated);
    for _ in 0..400 {
        bench.step(at(2.6, 0.0), Status::Fresh, &NO_PATCH);
    }
    let nan = ToolState::at(Pose::from_parts(Vec3::NAN, Quat::IDENTITY));
    let mut last = f32::INFINITY;
    for tick in 0..300 {
        let record = match tick % 3 {
            0 => bench.step(nan, Status::Fresh, &NO_PATCH),
            1 => bench.step(at(-1e30, 0.0), Status::Stale, &NO_PATCH),
            _ => bench.step(at(2.6, f32::INFINITY), Status::Fresh, &NO_PATCH),
        };
        assert!(record.has(TickRecord::STALE));
        last = record.wrench.force.length();
    }
    assert!(last.is_finite());
    assert!(bench.raised(Warning::DeviceStale).is_some());
}

#[test]
fn after_a_loss_force_and_drill_are_off_until_a_deliberate_action() {
    let mut bench = Bench::new(Program::Craniotomy);
    let mut run = |ticks: usize, z: f32, buttons: Buttons, status: Status| {
        let step = |_| bench.step(ToolState { buttons, ..at(z, 0.0) }, status, &NO_PATCH);
        (0..ticks).map(step).fold((0f32, false), |(peak_n, drilled), record| {
            let drills = record.has(TickRecord::DRILLING);
            (peak_n.max(record.wrench.force.length()), drilled | drills)
        })
    };
    let (none, pedal) = (Buttons(0), Buttons::PEDAL);
    run(50, 6.0, none, Status::Fresh);
    assert!(run(400, 2.6, none, Status::Fresh).0 > 0.4, "nothing was felt");
    run(30, 2.6, pedal, Status::Fresh);
    for (gone, ticks) in [(Status::Lost, 20), (Status::Stale, 200)] {
        run(ticks, 2.6, pedal, gone);
        assert_eq!(run(500, 2.2, pedal, Status::Fresh), (0.0, false), "it came back by itself");
        assert_eq!(run(5, 2.2, none, Status::Fresh), (0.0, false));
        assert!(run(400, 2.2, Buttons::FLAP, Status::Fresh).0 > 0.2, "a button is an act");
    }
    run(30, 2.2, none, Status::Lost);
    assert_eq!(run(50, 2.2, none, Status::Fresh).0, 0.0);
    run(300, 6.0, none, Status::Fresh);
    assert!(run(400, 2.2, none, Status::Fresh).0 > 0.2, "moving clear is an act");
    let changes: Vec<What> =
        bench.notices.iter().map(|n| n.what).filter(|what| matches!(what, What::Force { .. })).collect();
    let force = |waits| What::Force { waits, second: false };
    assert_eq!(changes, [true, false, true, false, true, false].map(force));
    let words = bench.notices.iter().map(Notice::words).find(|(kind, _)| *kind == "device").unwrap();
    assert!(words.1.contains("pressed anew"), "{words:?}");
}

#[test]
fn the_proxy_does_not_follow_a_jump_through_the_skull() {
    let mut bench = Bench::new(Program::Craniotomy);
    bench.step(at(20.0, 0.0), Status::Fresh, &NO_PATCH);
    let record = bench.step(at(-20.0, 0.0), Status::Fresh, &NO_PATCH);
    assert!(record.proxy.translation.z > 2.5, "the proxy is at {}", record.proxy.translation);
}

#[test]
fn the_force_of_a_stale_patch_fades_and_its_ticks_are_flagged() {
    let mut bench = Bench::new(Program::Brain);
    let patch = SurfacePatch { time_ms: 500.0, normal: Vec3::Z, tip_mm: at(0.0, 0.0).tip(), force_n: 1.2, ..NO_PATCH };
    let mut forces = Vec::new();
    for _ in 0..600 {
        let record = bench.step(at(0.0, 0.0), Status::Fresh, &patch);
        forces.push((record.wrench.force.length(), record.has(TickRecord::HELD)));
    }
    assert!((forces[505].0 - 1.2).abs() < 0.05 && !forces[505].1, "{:?}", forces[505]);
    assert!(forces[540].0 < 0.7 && forces[540].1, "{:?}", forces[540]);
    assert!(forces[599].0 < 1e-3, "{:?}", forces[599]);
    assert!(bench.raised(Warning::TissueLate).is_some());
}

#[test]
fn a_probe_that_scrapes_the_rim_does_not_press_the_brain() {
    let patch = |ms: u64, force_n: f32| SurfacePatch {
        time_ms: ms as f64,
        normal: Vec3::Z,
        tip_mm: at(1.0, 0.0).tip(),
        force_n,
        ..NO_PATCH
    };
    let (bone, brain) = head();
    let config = HapticConfig { opening_needed: false, ..HapticConfig::usual(Program::Integrated) };
    let stage = HapticStage::new(config, Some(bone), Some(brain), at(20.0, 0.0));
    let mut bench = Bench { stage, tick: 0, notices: Vec::new(), second: None };
    let probe = |z: f32| ToolState { buttons: Buttons::take(ToolKind::Probe), ..at(z, 0.0) };
    (0..50).for_each(|_| _ = bench.step(probe(20.0), Status::Fresh, &NO_PATCH));
    let mut last = TickRecord::default();
    for i in 0..1500u32 {
        let z = 6.0 - 0.01 * i.min(500) as f32;
        let soft = SurfacePatch { tip_mm: last.proxy.translation, ..patch(bench.tick + 1, 0.15) };
        last = bench.step(probe(z), Status::Fresh, &soft);
    }
    assert!(last.wrench.force.length() > 1.0 && last.depth_mm > 0.5, "no bone is felt: {last:?}");
    assert!((0.02..0.16).contains(&last.tissue_n()), "{} N of 0.15 N", last.tissue_n());
    assert_eq!(bench.raised(Warning::BrainPressed), None);
    assert!(bench.raised(Warning::RestsOnBone).is_some(), "nothing tells her what holds the probe");
    let scores = bench.stage.scores();
    assert!(scores.peak_tissue_force_n < 0.2 && scores.hand_peak_force_n > 1.0, "{scores:?}");
    assert!(scores.tissue_impulse_n_s < 0.2 * scores.tissue_s && scores.tissue_s > 1.0, "{scores:?}");
}

#[test]
fn the_tool_changes_once_for_a_press_and_only_when_free() {
    let request = Buttons::take(ToolKind::Probe);
    let press = |z: f32| ToolState { buttons: request, ..at(z, 0.0) };
    for needed in [true, false] {
        let (bone, brain) = head();
        let config = HapticConfig { opening_needed: needed, ..HapticConfig::usual(Program::Integrated) };
        let stage = HapticStage::new(config, Some(bone), Some(brain), at(20.0, 0.0));
        let mut bench = Bench { stage, tick: 0, notices: Vec::new(), second: None };
        for _ in 0..5 {
            bench.step(at(2.5, 0.0), Status::Fresh, &NO_PATCH);
        }
        bench.step(press(2.5), Status::Fresh, &NO_PATCH);
        assert_eq!(bench.stage.phase(), Phase::Craniotomy, "changed in contact");
        bench.step(at(20.0, 0.0), Status::Fresh, &NO_PATCH);
        for _ in 0..50 {
            bench.step(press(20.0), Status::Fresh, &NO_PATCH);
        }
        assert_eq!(bench.stage.phase(), if needed { Phase::Craniotomy } else { Phase::Brain });
        let count = |what: fn(&What) -> bool| bench.notices.iter().filter(|n| what(&n.what)).count();
        assert_eq!(count(|what| matches!(what, What::Phase(_))), if needed { 1 } else { 2 });
        assert_eq!(count(|what| *what == What::NotOpen), usize::from(needed));
    }
}

#[test]
fn a_release_ends_at_zero_and_stays_there() {
    let mut bench = Bench::new(Program::Craniotomy);
    for _ in 0..500 {
        bench.step(at(2.5, 0.0), Status::Fresh, &NO_PATCH);
    }
    bench.stage.release();
    for _ in 0..20 {
        bench.step(at(2.5, 0.0), Status::Fresh, &NO_PATCH);
    }
    assert!(bench.stage.is_at_rest());
    assert_eq!(bench.step(at(2.0, 0.0), Status::Fresh, &NO_PATCH).wrench.force, Vec3::ZERO);
}

#[test]
fn a_perforators_clutch_disengages_at_breakthrough_until_the_pedal_is_up() {
    let mut bench = Bench::new(Program::Craniotomy);
    let pedal = Buttons::take(ToolKind::Perforator) | Buttons::PEDAL;
    let press = |z: f32, buttons| ToolState { buttons, ..at(z, 0.0) };
    bench.step(press(20.0, Buttons::take(ToolKind::Perforator)), Status::Fresh, &NO_PATCH);
    let mut z = 6.0;
    let through = (0..40_000).find(|_| {
        z = f32::max(z - 0.002, -4.0);
        bench.step(press(z, pedal), Status::Fresh, &NO_PATCH).has(TickRecord::THROUGH)
    });
    assert!(through.is_some(), "it did not come through");
    let turns =
        |bench: &mut Bench, buttons| bench.step(press(z, buttons), Status::Fresh, &NO_PATCH).has(TickRecord::DRILLING);
    assert!((0..200).all(|_| !turns(&mut bench, pedal)), "the clutch lets go");
    assert!(!turns(&mut bench, Buttons(0)) && turns(&mut bench, Buttons::PEDAL), "and holds again");
}

#[test]
fn a_forbidden_structure_within_a_millimetre_gives_a_warning_for_every_tool() {
    let (bone, brain) = head();
    let mut mask = VoxelVolume::isotropic([36; 3], Vec3::new(-17.5, -17.5, -11.5), 1.0, 0u8);
    for at in 0..mask.data.len() {
        let place = mask.centre_of([at % 36, at / 36 % 36, at / 1296]);
        mask.data[at] = u8::from((place - glam::DVec3::new(0.3, -0.2, 6.0)).length() < 3.0);
    }
    for slot in [0, 1, 4] {
        let radius = Program::Integrated.tray()[slot].tip_radius_mm;
        let config = HapticConfig { opening_needed: false, ..HapticConfig::usual(Program::Integrated) };
        let stage = HapticStage::new(config, Some(bone.clone()), Some(brain.clone()), at(30.0, 0.0));
        let stage = stage.forbidding(Arc::new(DistanceField::of_mask(&mask)));
        let mut bench = Bench { stage, tick: 0, notices: Vec::new(), second: None };
        let mut warned_at = None;
        for step in 0..2000 {
            let z = 30.0 - 0.01 * step as f32;
            bench.step(ToolState { buttons: Buttons::slot(slot), ..at(z, 0.0) }, Status::Fresh, &NO_PATCH);
            warned_at = warned_at.or(bench.raised(Warning::ForbiddenNear).map(|_| z));
        }
        let warned_at = warned_at.unwrap();
        assert!((warned_at - (9.0 + radius + 1.0)).abs() < 0.6, "tool {slot} at {warned_at}");
    }
}

#[test]
fn a_pause_fades_the_force_out_and_in_at_the_guards_rate() {
    let pace = 0.5 + 1e-4;
    let mut bench = Bench::new(Program::Craniotomy);
    let mut press = |buttons| bench.step(ToolState { buttons, ..at(2.2, 0.0) }, Status::Fresh, &NO_PATCH);
    (0..300).for_each(|_| _ = press(Buttons::default()));
    let felt = press(Buttons::default()).wrench.force.length();
    let mut last = felt;
    let mut least = felt;
    for tick in 0..600 {
        let paused = (100..400).contains(&tick);
        let force = press(if paused { Buttons::PAUSE } else { Buttons::default() });
        let now = force.wrench.force.length();
        assert!((now - last).abs() < pace, "{last} N, then {now} N in tick {tick}");
        assert_eq!(force.buttons & Buttons::PAUSE.0 != 0, paused, "a replay must know");
        (last, least) = (now, least.min(now));
    }
    assert!(felt > 0.3 && least == 0.0 && (last - felt).abs() < 0.1 * felt, "{felt} N, {least} N, {last} N");
}

#[test]
fn a_pose_that_no_hand_can_have_counts_as_none() {
    let free = SurfacePatch::default();
    for far in [1e5, 1e9, 3e9, 1e20, f32::MAX] {
        for axis in [Vec3::X, Vec3::NEG_Y, Vec3::Z, Vec3::ONE, Vec3::NEG_ONE] {
            let mut bench = Bench::new(Program::Craniotomy);
            for z in [20.0, 5.0, 2.5] {
                bench.step(at(z, 0.0), Status::Fresh, &free);
            }
            let tool = ToolState::at(Pose::from_translation(far * axis));
            let record = bench.step(ToolState { buttons: Buttons::PEDAL, ..tool }, Status::Fresh, &free);
            assert!(record.has(TickRecord::STALE) && record.proxy.translation.length() < 30.0, "{far} {axis}");
            let back = bench.step(at(5.0, 0.0), Status::Fresh, &free);
            assert!(!back.has(TickRecord::STALE) && back.proxy.translation.z > 3.0, "{far} {axis}");
        }
    }
}
