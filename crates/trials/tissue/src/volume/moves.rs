//! How far registration can be trusted: moves, noise and missing parts, each with a known answer.

use super::registration::{moved_by, scanned_again};
use super::{image, quantile};
use glam::{DAffine3, DQuat, DVec3};
use trepan_evidence::part::Scope;
use trepan_evidence::picture::Outcome;
use trepan_evidence::suite::{Findings, Gate};
use trepan_fixtures::case_head;
use trepan_trials_scenes::conditions;
use trepan_volume::{RegistrationConfig, VoxelVolume, register};

/// Off by no more than this at the corners of the head, mm: works; by no more than that: degrades.
const RIGHT_MM: f64 = 1.5;
const USABLE_MM: f64 = 4.0;

/// Way, mm; turn, degrees; and what becomes of the image.
type Condition = (&'static str, f64, f64, fn(&mut VoxelVolume<f32>));

const CONDITIONS: [Condition; 9] = [
    ("5 mm and 5°", 5.0, 5.0, |_| {}),
    ("20 mm and 10°", 20.0, 10.0, |_| {}),
    ("30 mm and 20°", 30.0, 20.0, |_| {}),
    ("40 mm and 40°", 40.0, 40.0, |_| {}),
    ("10 mm and 90°", 10.0, 90.0, |_| {}),
    ("10 mm, noise of a third", 10.0, 5.0, |moving| {
        let mut random = fastrand::Rng::with_seed(5);
        moving.data.iter_mut().for_each(|v| *v += 300.0 * (random.f32() + random.f32() - 1.0));
    }),
    ("10 mm, upper half only", 10.0, 5.0, |moving| {
        let [nx, ny, nz] = moving.dims;
        moving.data[..nx * ny * (nz / 2)].fill(0.0);
    }),
    ("10 mm, grey values turned over", 10.0, 5.0, |moving| moving.data.iter_mut().for_each(|v| *v = 900.0 - *v)),
    ("an image of noise", 10.0, 5.0, |moving| {
        let mut random = fastrand::Rng::with_seed(6);
        moving.data.iter_mut().for_each(|v| *v = 900.0 * random.f32());
    }),
];

/// The map.
pub fn run(scope: Scope, findings: &mut Findings) {
    let still = image(&case_head().mri);
    let names = CONDITIONS.map(|(name, ..)| name);
    let verdict = |at: usize, _: &()| {
        let (_, way_mm, turn_deg, change) = CONDITIONS[at];
        judged(&still, way_mm, turn_deg, change, scope)
    };
    conditions::judge("Registration", &names, &[("mutual information", ())], verdict, findings);
    let map = findings.maps.last().expect("it was just drawn");
    let wrong = map.named_cells().filter(|(.., cell)| cell.grade() == 2).count();
    findings.gates.push(Gate::at_most("registration: wrong answers that it is sure of", wrong as f64, 0.0));
}

fn judged(
    still: &VoxelVolume<f32>,
    way_mm: f64,
    turn_deg: f64,
    change: fn(&mut VoxelVolume<f32>),
    scope: Scope,
) -> Outcome {
    let (low, high) = still.world_corners();
    let mut random = scope.random(17);
    let known = moved_by(0.5 * (low + high), way_mm, DQuat::from_rotation_z(turn_deg.to_radians()));
    let mut moving = scanned_again(still, known, &mut random);
    change(&mut moving);
    match register(still, &moving, &RegistrationConfig::default()) {
        Err(fault) => Outcome::Refused(fault.to_string()),
        Ok(found) => match off_mm(found.fixed_from_moving * known, low, high) {
            off if off <= RIGHT_MM => Outcome::Works,
            off if off <= USABLE_MM => Outcome::Degrades(format!("off by up to {USABLE_MM} mm")),
            _ => Outcome::Fails("sure, and wrong".into()),
        },
    }
}

/// The most that a corner of the head is off, mm.
fn off_mm(error: DAffine3, low: DVec3, high: DVec3) -> f64 {
    let corner = |c: usize| DVec3::select(glam::BVec3::new(c & 1 > 0, c & 2 > 0, c & 4 > 0), low, high);
    let mut all: Vec<f64> = (0..8).map(corner).map(|p| error.transform_point3(p).distance(p)).collect();
    quantile(&mut all, 1.0)
}
