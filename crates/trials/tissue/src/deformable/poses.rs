//! A million random poses against the f64 oracle, on meshes that bend, shake and tear: no contact
//! may be missed.

use super::{Part, Scope, scene::five_split, truth::inside};
use trepan_deformable::{Config, Method, TissueCollision, TissueStep};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Pointshell, Pose, Spread, Tool, ToolState, Vec3};

const CELLS: usize = 6;
const EDGE_MM: f32 = 5.0;
const SIZE_MM: f32 = CELLS as f32 * EDGE_MM;
const RADIUS_MM: f32 = 2.0;
/// Poses of a full run, and of a quick one.
const MILLION: usize = 1_000_000;
const QUICK: usize = 16_000;
/// Parts of a full run on each kind of mesh; each has its own seed, so that any of them can be made
/// alone.
const PARTS: usize = 10;

/// A way to move the nodes, anew at every pose.
type Motion = fn(usize, &mut fastrand::Rng, &mut [Vec3]);

const KINDS: [(&str, Motion); 4] = [
    ("sheared by 30 % and shaken", shaken),
    ("nodes thrown through the rest", thrown),
    ("nodes nowhere", nowhere),
    ("thrown, doubled and nowhere", torn),
];

fn shaken(pose: usize, random: &mut fastrand::Rng, positions: &mut [Vec3]) {
    for p in positions {
        let wave = (0.2 * p.x + 0.01 * pose as f32).sin();
        *p += Vec3::new(0.3 * p.z, 0.0, 1.5 * wave) + 0.15 * EDGE_MM * cube(random);
    }
}

fn thrown(pose: usize, random: &mut fastrand::Rng, positions: &mut [Vec3]) {
    shaken(pose, random, positions);
    (0..1 + pose % 12).for_each(|_| positions[random.usize(..positions.len())] += 2.0 * EDGE_MM * cube(random));
}

fn nowhere(pose: usize, random: &mut fastrand::Rng, positions: &mut [Vec3]) {
    shaken(pose, random, positions);
    (0..1 + pose % 12).for_each(|_| positions[random.usize(..positions.len())] = Vec3::NAN);
}

fn torn(pose: usize, random: &mut fastrand::Rng, positions: &mut [Vec3]) {
    thrown(pose, random, positions);
    for _ in 0..4 {
        let (to, from) = (random.usize(..positions.len()), random.usize(..positions.len()));
        positions[to] = positions[from];
        positions[random.usize(..positions.len())] = Vec3::NAN;
    }
}

fn cube(random: &mut fastrand::Rng) -> Vec3 {
    Vec3::from_array(core::array::from_fn(|_| 2.0 * random.f32() - 1.0))
}

/// What one kind of mesh showed.
#[derive(Default)]
struct Tally {
    poses: usize,
    touching: u64,
    missed_contacts: u64,
    missed_points: u64,
    invented_points: u64,
}

/// Every kind of mesh by the recommended method, in parts.
pub fn parts(scope: Scope) -> Vec<Part> {
    let of = scope.pick(1, PARTS);
    let poses = scope.pick(QUICK, MILLION) / KINDS.len() / of;
    let part = move |(name, motion): (&'static str, Motion), number: usize| {
        Part::new(format!("poses {name} {}", number + 1), move |scope, findings: &mut Findings| {
            let tally = taken(motion, poses, number, scope);
            findings.rows.push(
                Row::new(format!("random poses: {name}, part {} of {of}", number + 1), Method::RECOMMENDED.name())
                    .with("poses", tally.poses)
                    .metric("touching_count", tally.touching as f64)
                    .metric(MISSED, tally.missed_contacts as f64)
                    .metric("missed_points_count", tally.missed_points as f64)
                    .metric("invented_points_count", tally.invented_points as f64),
            );
        })
    };
    KINDS.into_iter().flat_map(|kind| (0..of).map(move |number| part(kind, number))).collect()
}

/// The metric that only these rows have together with `poses`.
const MISSED: &str = "missed_contacts_count";

/// Nothing may be missed or invented in any part.
pub fn judge(findings: &mut Findings) {
    let rows = || findings.rows.iter().filter(|row| row.config.contains_key("poses"));
    let all: f64 = rows().filter_map(|row| row.config["poses"].as_f64()).sum();
    let count = |row: &Row| {
        [MISSED, "missed_points_count", "invented_points_count"].iter().map(|name| row.metrics[*name]).sum::<f64>()
    };
    let wrong = rows().map(count).sum();
    findings.gates.push(Gate::at_most(
        format!("{all} random poses: contacts or points missed or invented"),
        wrong,
        0.0,
    ));
}

/// Three poses in ten are a jump, the rest a small step.
fn taken(motion: Motion, poses: usize, part: usize, scope: Scope) -> Tally {
    let mesh = five_split(CELLS, EDGE_MM);
    let config = Config { method: Method::RECOMMENDED, ..Config::default() };
    let mut collision =
        TissueCollision::new(&mesh, &Tool::probe(RADIUS_MM), &config).expect("the mesh at rest is sound");
    let shell = Pointshell::sphere(RADIUS_MM, config.points, Spread::Fibonacci).points;
    let still = vec![Vec3::ZERO; mesh.positions.len()];
    let (mut random, mut out, mut tally) = (scope.random(11 + part as u64), TissueStep::default(), Tally::default());
    let (mut positions, mut points) = (mesh.positions.clone(), shell.clone());
    let mut tip = Vec3::splat(0.5 * SIZE_MM);
    for pose in 0..poses {
        positions.copy_from_slice(&mesh.positions);
        motion(part * poses + pose, &mut random, &mut positions);
        let anywhere = Vec3::splat(0.5 * SIZE_MM) + cube(&mut random) * (0.5 * SIZE_MM + 2.0 * RADIUS_MM);
        tip = if random.u8(..10) < 3 { anywhere } else { tip + 0.5 * cube(&mut random) };
        collision.step(&positions, &still, &ToolState::at(Pose::from_translation(tip)), &mut out);
        points.iter_mut().zip(&shell).for_each(|(p, local)| *p = tip + *local);
        tally.compare(u64::from(out.points_in_contact), inside(&mesh, &positions, &points));
    }
    tally
}

impl Tally {
    fn compare(&mut self, found: u64, (surely, perhaps): (u64, u64)) {
        self.poses += 1;
        self.touching += u64::from(surely > 0);
        self.missed_contacts += u64::from(surely > 0 && found == 0);
        self.missed_points += surely.saturating_sub(found);
        self.invented_points += found.saturating_sub(perhaps);
    }
}
