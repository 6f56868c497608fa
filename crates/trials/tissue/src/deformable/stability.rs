//! What breaks a search: slivers, torn and inverted meshes, absurd cells, a large tool, meshes that
//! stand still, leap or run away.

use super::{Scope, is_complete, truth::inside};
use trepan_deformable::{Config, Method, TissueCollision, TissueStep};
use trepan_evidence::picture::Outcome;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Pointshell, Pose, Spread, Tool, ToolState, Vec3};
use trepan_mesh::TetMesh;
use trepan_rivals::Family;
use trepan_trials_scenes::conditions;

const CELLS: usize = 6;
/// Edge of the cube's cells, mm.
pub const EDGE_MM: f32 = 5.0;
const SIZE_MM: f32 = CELLS as f32 * EDGE_MM;

/// Moves the nodes at a step.
type Motion<'a> = dyn Fn(usize, &mut fastrand::Rng, &mut [Vec3]) + 'a;

/// One way to make it hard.
#[derive(Clone, Copy)]
pub struct Condition<'a> {
    /// Name.
    pub name: &'static str,
    /// Radius of the tool, mm.
    pub radius_mm: f32,
    /// Cell of the grids, in edges; `None` leaves it to the method.
    pub cell_edges: Option<f32>,
    /// The mesh at rest, node by node.
    pub shape: &'a dyn Fn(Vec3) -> Vec3,
    /// The mesh at this step.
    pub motion: &'a Motion<'a>,
}

/// Nothing is hard.
pub const PLAIN: Condition =
    Condition { name: "plain", radius_mm: 2.0, cell_edges: None, shape: &|p| p, motion: &|_, _, _| {} };

const CONDITIONS: [Condition; 16] = [
    PLAIN,
    Condition { name: "cell of 0.05 edges", cell_edges: Some(0.05), ..PLAIN },
    Condition { name: "cell of 0.5 edges", cell_edges: Some(0.5), ..PLAIN },
    Condition { name: "cell of 5 edges", cell_edges: Some(5.0), ..PLAIN },
    Condition { name: "cell of 20 edges", cell_edges: Some(20.0), ..PLAIN },
    Condition { name: "tool larger than two rings", radius_mm: 12.0, ..PLAIN },
    Condition { name: "tool of a twentieth of an edge", radius_mm: 0.25, ..PLAIN },
    Condition { name: "slivers of 1/1000 edge", shape: &slivers, ..PLAIN },
    Condition { name: "graded 1:100", shape: &graded, ..PLAIN },
    Condition { name: "clustered", shape: &clustered, ..PLAIN },
    Condition { name: "flat, no volume anywhere", shape: &flat, ..PLAIN },
    Condition { name: "stands still, then leaps", motion: &stale, ..PLAIN },
    Condition { name: "leaves its place", motion: &leaves, ..PLAIN },
    Condition { name: "NaN nodes", motion: &nan, ..PLAIN },
    Condition { name: "inverted", motion: &inverted, ..PLAIN },
    Condition { name: "torn in every way", motion: &everything, ..PLAIN },
];

/// Every second layer of nodes lies almost on the one below.
fn slivers(p: Vec3) -> Vec3 {
    let layer = (p.z / EDGE_MM).round();
    Vec3::new(p.x, p.y, if layer % 2.0 == 1.0 && layer > 0.0 { (layer - 0.999) * EDGE_MM } else { p.z })
}

fn graded(p: Vec3) -> Vec3 {
    (p / SIZE_MM).powf(3.0) * SIZE_MM
}

/// Most nodes near the middle.
fn clustered(p: Vec3) -> Vec3 {
    let q = p / SIZE_MM * 2.0 - 1.0;
    (q * q * q * 0.9 + q * 0.1 + 1.0) * 0.5 * SIZE_MM
}

fn flat(p: Vec3) -> Vec3 {
    Vec3::new(p.x, p.y, 0.5 * SIZE_MM)
}

fn stale(step: usize, _: &mut fastrand::Rng, positions: &mut [Vec3]) {
    let leap = Vec3::new(0.0, 0.0, if step / 20 % 2 == 1 { 1.5 * EDGE_MM } else { 0.0 });
    positions.iter_mut().for_each(|p| *p += leap);
}

fn leaves(step: usize, _: &mut fastrand::Rng, positions: &mut [Vec3]) {
    positions.iter_mut().for_each(|p| *p += Vec3::X * (0.2 * step as f32));
}

fn nan(_: usize, random: &mut fastrand::Rng, positions: &mut [Vec3]) {
    (0..4).for_each(|_| positions[random.usize(..positions.len())] = Vec3::NAN);
}

fn inverted(_: usize, random: &mut fastrand::Rng, positions: &mut [Vec3]) {
    (0..4).for_each(|_| positions[random.usize(..positions.len())] += 2.0 * EDGE_MM * cube(random));
}

fn everything(step: usize, random: &mut fastrand::Rng, positions: &mut [Vec3]) {
    inverted(step, random, positions);
    nan(step, random, positions);
    for _ in 0..4 {
        let (to, from) = (random.usize(..positions.len()), random.usize(..positions.len()));
        positions[to] = positions[from];
    }
}

/// A random vector within ±1 along each axis.
pub fn cube(random: &mut fastrand::Rng) -> Vec3 {
    Vec3::from_array(core::array::from_fn(|_| 2.0 * random.f32() - 1.0))
}

/// What one method did under one condition.
#[derive(Default)]
pub struct Record {
    /// Points inside that it did not find.
    pub missed_points: u64,
    missed_contacts: u64,
    /// Points outside that it took for inside.
    pub invented_points: u64,
    touching: u64,
    /// Points inside, by the truth.
    pub inside: u64,
    /// Contacts that are no number.
    pub not_finite: u64,
    overflow: u64,
    stale: u64,
    skipped: u64,
}

/// Every condition, every method, the oracle for fewer steps.
pub fn run(scope: Scope, findings: &mut Findings) {
    let steps = |method: Method| if method.descriptor().is_oracle { 50 } else { scope.pick(150, 2000) };
    let methods: Vec<(&str, Method)> = Method::all().into_iter().map(|method| (method.name(), method)).collect();
    let mut all: Vec<(usize, Method, Record)> = Vec::new();
    let verdict = |at: usize, method: &Method| {
        let record = endure(&CONDITIONS[at], *method, steps(*method), scope, |_| ());
        let outcome = record.outcome();
        all.push((at, *method, record));
        outcome
    };
    conditions::judge("Broken meshes", &CONDITIONS.map(|condition| condition.name), &methods, verdict, findings);
    for (at, condition) in CONDITIONS.iter().enumerate() {
        let records: Vec<_> =
            all.iter().filter(|(of, ..)| *of == at).map(|(_, method, record)| (*method, record)).collect();
        findings.rows.extend(records.iter().map(|(method, record)| record.row(condition, *method)));
        judge(condition, &records, findings);
    }
}

/// Random poses near the mesh, three in ten a jump; the mesh is made anew at every step. `each`
/// gets how many points too many the method found at every step.
pub fn endure(condition: &Condition, method: Method, steps: usize, scope: Scope, mut each: impl FnMut(f64)) -> Record {
    let mut mesh = super::scene::five_split(CELLS, EDGE_MM);
    mesh.positions.iter_mut().for_each(|p| *p = (condition.shape)(*p));
    let config = Config { method, cell_mm: condition.cell_edges.map(|c| c * EDGE_MM), ..Config::default() };
    let tool = Tool::probe(condition.radius_mm);
    let mut collision = TissueCollision::new(&mesh, &tool, &config).expect("the mesh at rest is sound");
    let shell = Pointshell::sphere(condition.radius_mm, config.points, Spread::Fibonacci).points;
    let (mut random, mut out, mut record) = (scope.random(5), TissueStep::default(), Record::default());
    let still = vec![Vec3::ZERO; mesh.positions.len()];
    let mut local = Vec3::splat(0.5 * SIZE_MM);
    for step in 0..steps {
        let mut positions = mesh.positions.clone();
        (condition.motion)(step, &mut random, &mut positions);
        let anywhere = Vec3::splat(0.5 * SIZE_MM) + cube(&mut random) * (0.5 * SIZE_MM + condition.radius_mm);
        local = if random.u8(..10) < 3 { anywhere } else { local + 0.5 * cube(&mut random) };
        let tip = local + if condition.name == "leaves its place" { Vec3::X * (0.2 * step as f32) } else { Vec3::ZERO };
        let state = ToolState::at(Pose::from_translation(tip));
        collision.step(&positions, &still, &state, &mut out);
        let (surely, perhaps) = truth(&mesh, &positions, &shell, tip);
        record.compare(&out, (surely, perhaps));
        let found = u64::from(out.points_in_contact);
        each(found as f64 - found.clamp(surely, perhaps) as f64);
    }
    record
}

fn truth(mesh: &TetMesh, positions: &[Vec3], shell: &[Vec3], tip: Vec3) -> (u64, u64) {
    inside(mesh, positions, &shell.iter().map(|p| tip + *p).collect::<Vec<_>>())
}

/// All complete methods together.
fn judge(condition: &Condition, records: &[(Method, &Record)], findings: &mut Findings) {
    let mut gate = |what: &str, value: f64, limit: f64| {
        findings.gates.push(Gate::at_most(format!("{}: {what}", condition.name), value, limit));
    };
    gate("results that are not finite", records.iter().map(|(_, r)| r.not_finite as f64).sum(), 0.0);
    let complete = records.iter().filter(|(m, _)| is_complete(*m));
    let wrong = complete.map(|(_, r)| (r.missed_points + r.invented_points) as f64).sum();
    gate("points missed or invented by complete methods", wrong, 0.0);
}

impl Record {
    fn compare(&mut self, out: &TissueStep, (surely, perhaps): (u64, u64)) {
        let found = u64::from(out.points_in_contact);
        self.missed_points += surely.saturating_sub(found);
        self.invented_points += found.saturating_sub(perhaps);
        self.missed_contacts += u64::from(surely > 0 && found == 0);
        self.touching += u64::from(surely > 0);
        self.inside += surely;
        let nodal = out.nodal.offset_mm.is_finite() && out.nodal.nodes().all(|(_, w)| w.is_finite());
        self.not_finite += u64::from(!(nodal && out.manifold.is_finite() && out.patch.force_n.is_finite()));
        self.overflow += u64::from(out.overflow);
        self.stale += u64::from(out.stale);
        self.skipped += u64::from(out.skipped);
    }

    fn outcome(&self) -> Outcome {
        if self.not_finite > 0 {
            Outcome::Fails("not a number".into())
        } else if self.missed_contacts > 0 {
            Outcome::Fails("misses whole contacts".into())
        } else if self.missed_points > 0 {
            Outcome::Degrades("misses points".into())
        } else if self.invented_points > 0 {
            Outcome::Degrades("invents points".into())
        } else {
            Outcome::Works
        }
    }

    fn row(&self, condition: &Condition, method: Method) -> Row {
        Row::new(format!("stability: {}", condition.name), method.name())
            .with("radius_mm", condition.radius_mm)
            .metric("missed_percent", 100.0 * self.missed_points as f64 / self.inside.max(1) as f64)
            .metric("missed_contacts_count", self.missed_contacts as f64)
            .metric("invented_points_count", self.invented_points as f64)
            .metric("touching_count", self.touching as f64)
            .metric("not_finite_count", self.not_finite as f64)
            .metric("overflow_count", self.overflow as f64)
            .metric("stale_count", self.stale as f64)
            .metric("skipped_count", self.skipped as f64)
    }
}
