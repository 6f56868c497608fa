//! Random hands on voxel bone through the guard: what comes out must not be more than what went in.
//! And the same path gives the same bytes.
//!
//! # Theory
//! Energy to the hand is what the motors give less what the device's own friction takes,
//! `b Δx²/T + f_c |Δx|` a tick; the most that ever came out above what went in is counted, per
//! hand.
//!
//! # Practice
//! A new hand every ten thousand ticks: stiffness 0.05 to 0.5 N/mm, damping 0.05 to 6 N ms/mm, 5 to
//! 200 g, on one of three devices, 0 to 2 ticks late and with the wall that it bears, that means to
//! be now here, now there, up to 6 mm in the bone.

use super::coupling;
use super::recording::{self, Place, Task};
use super::solid::{ISO, RADIUS_MM, held};
use trepan_bone::BoneVolume;
use trepan_contact::{ForceGuard, ForceModel, GuardConfig, Viscoelastic};
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Buttons, Tool, ToolState, Vec3};
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::{Config, HandModel, Simulated};
use trepan_rigid::{Method, RigidStep};
use trepan_rivals::Family;

const HAND_TICKS: usize = 10_000;
const MOST_MJ: f64 = 0.1;
/// Coulomb friction, N, and encoder step, mm: exact, fine, and a Touch's. A step must be seen by
/// the friction, K Δ/2 ≤ f_c.
const DEVICES: [(f32, f32); 3] = [(0.0, 0.0), (0.02, 0.01), (0.26, 0.055)];
const NMM_PER_J: f64 = 1000.0;

/// Every method but the oracle; the recommended one for a million ticks.
pub fn parts() -> Vec<Part> {
    let part = |method: Method| {
        Part::new(format!("random hands {}", method.name()), move |scope, found| hands(&method, scope, found))
    };
    let quick_enough = Method::all().into_iter().filter(|method| !method.descriptor().is_oracle);
    quick_enough.map(part).chain([Part::new("same path again", repeats)]).collect()
}

fn hands(method: &Method, scope: Scope, findings: &mut Findings) {
    let normal = coupling::normal();
    let bone = coupling::bone(normal);
    let chosen = *method == Method::RECOMMENDED;
    let hands = scope.pick(if chosen { 5 } else { 2 }, if chosen { 100 } else { 20 });
    let worst = |guarded: bool| {
        let given = (0..hands).map(|own| given_j(method, &bone, normal, scope.random(own as u64), guarded));
        given.fold(0.0, f64::max)
    };
    let (guarded, bare) = (worst(true), worst(false));
    let row = Row::new("random hands", method.name())
        .with("ticks", hands * HAND_TICKS)
        .metric("energy_out_j", guarded)
        .metric("energy_out_unguarded_j", bare);
    findings.rows.push(row);
    if chosen {
        let [guarded, bare] = [guarded, bare].map(|joule| 1000.0 * joule);
        findings.gates.push(Gate::at_most("random hands: energy out through the guard, worst mJ", guarded, MOST_MJ));
        findings.gates.push(Gate::at_least("random hands: energy out without the guard, worst mJ", bare, MOST_MJ));
    }
}

/// The most energy that one hand got above what it gave, J.
fn given_j(method: &Method, bone: &BoneVolume, normal: Vec3, mut random: fastrand::Rng, guarded: bool) -> f64 {
    let (friction_n, quantum_mm) = DEVICES[random.usize(0..DEVICES.len())];
    let config = Config { delay_ticks: random.usize(0..3), friction_n, quantum_mm, ..Config::default() };
    // Even over the decades: from a finger that hardly damps to a fist.
    let mut decade = |low: f32, high: f32| low * (high / low).powf(random.f32());
    let hand = HandModel { mass_g: decade(5.0, 200.0), damping: decade(0.05, 6.0), stiffness: decade(0.05, 0.5) };
    let intent = wandering(&mut random, normal);
    let mut device = Simulated::new(config, hand, Box::new(Replay::new(intent)));
    let capable = device.capabilities();
    let limits = capable.guard_config();
    let passivity = limits.passivity.filter(|_| guarded);
    let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, passivity, ..limits });
    let (mut contact, mut model) = (method.build(&Tool::burr(RADIUS_MM)), capable.coupled(Viscoelastic::BONE, 1.0));
    let mut out = RigidStep::default();
    let (mut taken_nmm, mut lowest_nmm) = (0.0f64, 0.0f64);
    for tick in 0..HAND_TICKS {
        let (from, motor) = (device.position(), device.motor_force());
        let tool = device.read(tick as f64).tool;
        if tick == 0 {
            contact.reset(tool.world_from_tool);
        } else {
            let way = device.position() - from;
            let friction = config.damping * way.length_squared() + config.friction_n * way.length();
            taken_nmm += f64::from(friction - motor.dot(way));
            lowest_nmm = lowest_nmm.min(taken_nmm);
        }
        contact.step(bone, &tool, false, 1.0, &mut out);
        device.apply(guard.guard(model.wrench(&tool, &out.manifold, 1.0), &tool, 1.0));
    }
    -lowest_nmm / NMM_PER_J
}

fn wandering(random: &mut fastrand::Rng, normal: Vec3) -> Vec<ToolState> {
    let across = normal.any_orthonormal_vector();
    let place = |h: f32, s: f32| normal * (RADIUS_MM + h) + across * s;
    let (mut aim, mut at) = ((2.0f32, 0.0f32), (2.0f32, 0.0f32));
    (0..HAND_TICKS)
        .map(|_| {
            if random.u32(0..125) == 0 {
                aim = (2.0 - 8.0 * random.f32(), 8.0 * random.f32() - 4.0);
            }
            at = (at.0 + 0.03 * (aim.0 - at.0), at.1 + 0.03 * (aim.1 - at.1));
            held(place(at.0, at.1), normal)
        })
        .collect()
}

/// The recorded drill path twice over, by every method: results and bone must be the same bytes.
fn repeats(scope: Scope, findings: &mut Findings) {
    let path = recording::path(Place::Cube, Task::Drill);
    let ticks = scope.pick(800, path.len());
    let mut differing = 0;
    for method in Method::all() {
        let slow = method.descriptor().is_oracle;
        let part = if slow { &path[400..500] } else { &path[..ticks] };
        let same = hash(&method, part) == hash(&method, part);
        differing += u32::from(!same);
        let row = Row::new("same path again", method.name()).with("ticks", part.len());
        findings.rows.push(row.metric("differing_runs_count", f64::from(u8::from(!same))));
    }
    let limit = "same path again: methods whose results or bone differ";
    findings.gates.push(Gate::at_most(limit, f64::from(differing), 0.0));
}

/// FNV-1a over everything that a run answers and leaves.
fn hash(method: &Method, path: &[ToolState]) -> u64 {
    let bone = super::solid::voxels(48, 1.0, |p| (p.z - 2.0).max(p.x - 20.0));
    let lift = Vec3::new(90.0, 0.0, 98.0);
    let mut contact = method.build(&Tool::burr(RADIUS_MM));
    let (mut out, mut hash) = (RigidStep::default(), 0xcbf2_9ce4_8422_2325u64);
    let mut take =
        |bytes: &[u8]| bytes.iter().for_each(|&b| hash = (hash ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
    for (at, tool) in path.iter().enumerate() {
        let mut tool = *tool;
        tool.world_from_tool.translation -= lift;
        if at == 0 {
            contact.reset(tool.world_from_tool);
        }
        contact.step(&bone, &tool, tool.buttons.has(Buttons::PEDAL), 1.0, &mut out);
        take(format!("{out:?} {:?}", contact.proxy()).as_bytes());
    }
    bone.snapshot().data.iter().for_each(|hu| take(&hu.to_le_bytes()));
    debug_assert_eq!(bone.isovalue(), ISO);
    hash
}
