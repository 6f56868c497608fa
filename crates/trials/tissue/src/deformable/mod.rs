//! Measures collision of a ball-tipped tool with moving tetrahedra against an f64 oracle. Scenes
//! are cubes and a brain on the thesis's three paths, jumps and broken meshes.

mod poses;
pub mod published;
pub mod recording;
mod ride;
pub mod scene;
pub mod stability;
mod truth;

pub use recording::record_all;

use ride::{Ride, START, ride};
use scene::{PATHS, Scene};
use trepan_deformable::Method;
use trepan_deformable::search::uniform_grid;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::Vec3;
use trepan_rivals::Family;
use truth::Truth;

/// Required speed-up of the recommended method over scanning all tetrahedra, from 48,000 of them
/// on.
const LEAST_RATIO: f64 = 40.0;
/// Number of steps times tetrahedra for methods that scan all tetrahedra.
const STEPS_TIMES_TETS: usize = 20_000_000;
/// Number of steps of the oracle, which is slow.
const ORACLE_STEPS: usize = 20;
/// Largest allowed jump of the depth between neighbouring tetrahedra, edges.
const MOST_JUMP: f64 = 1e-4;

/// Lists the parts: every method on every mesh and path, then stability.
pub fn parts(scope: Scope) -> Vec<Part> {
    let cubes = scope.pick(&[7usize, 22][..], &[7, 13, 22, 30, 40, 50, 60][..]);
    let brains = scope.pick(&[][..], &[12_511usize, 22_076, 50_041][..]);
    let cube = |&cells: &usize| {
        Part::new(format!("cube {cells}"), move |scope, found| measure(&Scene::cube(cells), scope, found))
    };
    let brain = |&tets: &usize| {
        Part::new(format!("brain {tets}"), move |scope, found| measure(&Scene::brain(tets), scope, found))
    };
    let mut parts: Vec<Part> = cubes.iter().map(cube).chain(brains.iter().map(brain)).collect();
    parts.push(Part::new("recorded paths", recorded));
    parts.push(Part::new("flat stroke", slide));
    parts.push(Part::new("pressed in", |_, found| press(found)));
    parts.push(Part::new("stability", stability::run));
    parts.extend(poses::parts(scope));
    parts.push(Part::new("published", |_, found| found.rows.extend(published::rows())));
    parts
}

/// Adds the gate over all random poses, and the tables of rivals.
pub fn judge(_: Scope, findings: &mut Findings) {
    poses::judge(findings);
    findings.tables.extend(published::tables(&findings.rows));
}

/// All methods but the oracle, which is the reference and too slow to be rated.
fn methods() -> impl Iterator<Item = Method> {
    Method::all().into_iter().filter(|method| !method.descriptor().is_oracle)
}

/// Whether the method must find every point.
fn is_complete(method: Method) -> bool {
    method.descriptor().is_complete
}

/// Runs every method on every path over one mesh.
fn measure(scene: &Scene, scope: Scope, findings: &mut Findings) {
    for path in PATHS {
        let steps = if path.jumps { scope.pick(30, 200) } else { scope.pick(80, 1000) };
        let place = format!("{}, {}", scene.name, path.name);
        follow(scene, &place, &scene.tips(&path, steps), !path.jumps, findings);
    }
}

/// Runs the three recorded paths over the brain on which they were recorded.
fn recorded(scope: Scope, findings: &mut Findings) {
    let scene = Scene::brain_at_rest(recording::TETS);
    for name in recording::NAMES {
        let tips = recording::tips(name);
        let tips = &tips[..scope.pick(tips.len() / 50, tips.len())];
        follow(&scene, &format!("{}, at rest, recorded path {name}", scene.name), tips, false, findings);
    }
}

/// Runs every method on one path; `in_time` adds gates on the recommended method's speed.
fn follow(scene: &Scene, place: &str, tips: &[Vec3], in_time: bool, findings: &mut Findings) {
    let steps = tips.len();
    let truth = Truth::along(scene, tips);
    // The cost of methods that scan all tetrahedra varies little: on large meshes a few warm steps
    // suffice.
    let enough = (STEPS_TIMES_TETS / scene.mesh.tets.len()).max(3 * START).min(steps);
    let steps_of = |method| if method == Method::RECOMMENDED { steps } else { enough };
    let take = |method| ride(scene, method, &tips[..steps_of(method)], &truth);
    let rides: Vec<Ride> = methods().map(take).collect();
    let scan = rides.iter().find(|ride| ride.method == Method::of(&uniform_grid::SCAN));
    findings.rows.extend(rides.iter().map(|ride| ride.row(place, scene, scan)));
    let complete = rides.iter().filter(|ride| is_complete(ride.method));
    let wrong = complete.map(|ride| (ride.missed + ride.invented) as f64).sum();
    findings.gates.push(Gate::at_most(format!("{place}: points missed or invented by complete methods"), wrong, 0.0));
    if in_time {
        speed_gates(place, scene, &rides, findings);
    }
}

/// Adds gates: no method beats the recommended one in both time and depth, and its speed-up over
/// the scan is as required.
fn speed_gates(place: &str, scene: &Scene, rides: &[Ride], findings: &mut Findings) {
    let best = Method::RECOMMENDED.name();
    let beaten = trepan_evidence::front::dominated(&findings.rows, place, best, "step_p50_us", "depth_error_p95_mm");
    findings.gates.push(Gate::at_most(format!("{place}: methods that beat {best} in both"), beaten as f64, 0.0));
    if scene.mesh.tets.len() > 48_000 {
        let of = |method| rides.iter().find(|ride| ride.method == method);
        let faster = of(Method::RECOMMENDED)
            .zip(of(Method::of(&uniform_grid::SCAN)))
            .map(|(own, scan)| own.times_faster_than(scan));
        let name = format!("{place}: {best}, times faster than the scan");
        findings.gates.push(Gate::at_least(name, faster.unwrap_or(f64::NAN), LEAST_RATIO));
    }
}

/// A stroke 0.5 mm deep over a flat side at rest: the true depth is constant while points pass from
/// tetrahedron to tetrahedron.
fn slide(scope: Scope, findings: &mut Findings) {
    let scene = Scene::cube_at_rest(13);
    let (tips, depth_mm) = scene.stroke(scope.pick(800, 4000));
    let truth = vec![Truth { depth_mm, ..Truth::UNKNOWN }; tips.len()];
    let (place, mut most_edges) = (format!("{}, flat stroke", scene.name), 0.0f64);
    for method in Method::all() {
        let steps = if method.descriptor().is_oracle { ORACLE_STEPS } else { tips.len() };
        let ride = ride(&scene, method, &tips[..steps], &truth);
        let jump_edges = ride.depth_jump_mm / f64::from(scene.edge_mm);
        findings.rows.push(ride.row(&place, &scene, None).metric("depth_jump_edges", jump_edges));
        most_edges = most_edges.max(if is_complete(method) { jump_edges } else { 0.0 });
    }
    findings.gates.push(Gate::at_most(
        format!("{place}: jump of depth by complete methods, edges"),
        most_edges,
        MOST_JUMP,
    ));
}

/// Pushes straight into a slab to 0.9 of its thickness: depth, and with it force, must never
/// decrease.
fn press(findings: &mut Findings) {
    let scene = Scene::cube_at_rest(7);
    let (tips, deepest_mm) = scene.push(0.9);
    let place = format!("{}, pressed in by {deepest_mm:.0} mm", scene.name);
    let truth = vec![Truth::UNKNOWN; tips.len()];
    for method in methods() {
        let ride = ride(&scene, method, &tips, &truth);
        findings.rows.push(ride.row(&place, &scene, None).metric("depth_fall_mm", ride.depth_fall_mm));
        if is_complete(method) {
            let name = format!("{place}: {}, largest fall of depth, mm", method.name());
            findings.gates.push(Gate::at_most(name, ride.depth_fall_mm, 1e-4));
        }
    }
}

/// Adds the finite metrics to a row.
fn finite(row: Row, metrics: &[(&str, f64)]) -> Row {
    metrics.iter().filter(|(_, value)| value.is_finite()).fold(row, |row, (name, value)| row.metric(name, *value))
}
