//! Ways of touching voxel bone: planes in many orientations and a sphere, against closed forms.

use super::Scope;
use crate::suite::{Findings, Gate, Row};
use crate::timer::Samples;
use trepan_geometry::{Pointshell, Pose, Spread, Tool, ToolState, Vec3};
use trepan_rigid::{Method, RigidStep};
use trepan_volume::{BoneVolume, VoxelVolume};

const EDGE: usize = 72;
const RADIUS_MM: f32 = 3.0;
const ISO: i16 = 400;
/// From this depth on a touch counts, mm: the least that the thesis measured (0.2 to 0.8 mm).
const TOUCH_MM: f32 = 0.2;
/// From this depth on the normal's angle counts, mm. A proxy that is off sideways by e turns the normal by e / depth, so that the angle of a
/// lighter touch says less of the method than of the depth; there the sideways error itself is measured, and in force as N/ms.
const PRESSED_MM: f32 = 0.5;

/// Bone with a known surface.
struct Scene {
    name: &'static str,
    bone: BoneVolume,
    /// Towards the free side at the place of contact.
    normal: Vec3,
    /// Point of the surface that is touched.
    surface: Vec3,
}

/// Every method in every scene.
pub fn run(scope: Scope) -> Findings {
    let mut findings = Findings::default();
    let orientations = scope.pick(12, 200);
    let mut number = 0;
    for group in ["half-space", "sphere"] {
        let scenes: Vec<Scene> = directions(orientations).into_iter().map(|d| scene(group, d)).collect();
        for method in Method::all() {
            number += 1;
            if scope.takes(number) {
                findings.rows.push(row(group, &method, &scenes, scope));
            }
        }
    }
    findings.gates = gates(&findings.rows);
    findings
}

fn directions(count: usize) -> Vec<Vec3> {
    Pointshell::sphere(1.0, count, Spread::Fibonacci).points
}

/// A surface through the middle of a grid of 1 mm voxels, blurred over one voxel either side as a scanner would.
fn scene(name: &'static str, normal: Vec3) -> Scene {
    let half = 0.5 * (EDGE as f32 - 1.0);
    let ball_mm = 18.0;
    let middle = Vec3::new(0.21, -0.37, 0.13);
    let out = |p: Vec3| match name {
        "sphere" => (p - middle).length() - ball_mm,
        _ => (p - middle).dot(normal),
    };
    let mut ct = VoxelVolume::isotropic([EDGE; 3], Vec3::splat(-half), 1.0, 0i16);
    for at in 0..ct.data.len() {
        let centre = ct.centre_of([at % EDGE, at / EDGE % EDGE, at / (EDGE * EDGE)]).as_vec3();
        ct.data[at] = (f32::from(ISO) - 1000.0 * out(centre).clamp(-1.0, 1.0)) as i16;
    }
    let surface = if name == "sphere" { middle + ball_mm * normal } else { middle };
    Scene { name, bone: BoneVolume::new(&ct, ISO).expect("the scene has bone"), normal, surface }
}

fn row(group: &str, method: &Method, scenes: &[Scene], scope: Scope) -> Row {
    let mut errors = Errors::default();
    scenes.iter().for_each(|scene| press(method, scene, &mut errors));
    let worst = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    let (normal_worst, jump_worst) = (worst(&errors.normal_deg), worst(&errors.jump_n));
    let times = timed(method, &scenes[0], scope.pick(400, 4000));
    let p95 = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[((values.len() - 1) as f64 * 0.95).round() as usize]
    };
    Row::new(group, method.name())
        .with("orientations", scenes.len())
        .with("radius_mm", RADIUS_MM)
        .metric("tick_p50_us", times.quantile(0.5))
        .metric("tick_p99_us", times.quantile(0.99))
        .metric("depth_error_p95_voxel", p95(errors.depth_voxel))
        .metric("normal_error_p95_deg", p95(errors.normal_deg))
        .metric("normal_error_worst_deg", normal_worst)
        .metric("sideways_error_p95_voxel", p95(errors.side_voxel))
        .metric("force_change_beyond_hand_max_n_per_ms", jump_worst)
}

/// Errors of every tick in every orientation: a share of them is a share of the time that a hand feels them.
#[derive(Default)]
struct Errors {
    depth_voxel: Vec<f64>,
    normal_deg: Vec<f64>,
    /// How far the proxy is off across the true normal.
    side_voxel: Vec<f64>,
    /// Change of force beyond that which the hand's own motion towards the bone makes, N.
    jump_n: Vec<f64>,
}

/// Approaches at 50 mm/s, presses 0.6 mm deep, slides 4 mm; compares every tick in contact with the truth, at k = 2 N/mm.
fn press(method: &Method, scene: &Scene, errors: &mut Errors) {
    let tool = Tool::burr(RADIUS_MM);
    let mut contact = method.build(&tool);
    let at = |depth: f32, side: f32| {
        let across = scene.normal.any_orthonormal_vector();
        let radial = (scene.normal + across * side / 18.0).normalize();
        let centre = scene.surface - 18.0 * scene.normal;
        match scene.name {
            "sphere" => (centre + radial * (18.0 + RADIUS_MM - depth), radial),
            _ => (scene.surface + scene.normal * (RADIUS_MM - depth) + across * side, scene.normal),
        }
    };
    contact.reset(Pose::from_translation(at(-2.0, 0.0).0));
    let mut out = RigidStep::default();
    let mut last: Option<Vec3> = None;
    for tick in 0..132 {
        let depth = (-2.0 + 0.05 * tick as f32).min(0.6);
        let side = (0.05 * (tick as f32 - 52.0)).clamp(0.0, 4.0);
        let (tip, normal) = at(depth, side);
        contact.step(&scene.bone, &ToolState::at(Pose::from_translation(tip)), false, 1.0, &mut out);
        let force = 2.0 * out.manifold.depth_mm * out.manifold.normal;
        let before = (-2.0 + 0.05 * (tick as f32 - 1.0)).min(0.6);
        let approach = 2.0 * (depth - before);
        if let Some(last) = last {
            errors.jump_n.push(f64::from((force - last).length() - approach).max(0.0));
        }
        last = Some(force);
        if depth >= TOUCH_MM {
            errors.depth_voxel.push(f64::from((out.manifold.depth_mm - depth).abs()));
            let lift = out.manifold.depth_mm * out.manifold.normal;
            errors.side_voxel.push(f64::from(lift.reject_from_normalized(normal).length()));
        }
        if depth >= PRESSED_MM {
            let angle = out.manifold.normal.angle_between(normal).to_degrees();
            errors.normal_deg.push(f64::from(if angle.is_finite() { angle } else { 180.0 }));
        }
    }
}

fn timed(method: &Method, scene: &Scene, ticks: usize) -> Samples {
    let mut contact = method.build(&Tool::burr(RADIUS_MM));
    let across = scene.normal.any_orthonormal_vector();
    let mut out = RigidStep::default();
    contact.reset(Pose::from_translation(scene.surface + scene.normal * (RADIUS_MM + 1.0)));
    Samples::of(ticks, |tick| {
        let side = 3.0 * (tick as f32 * 0.01).sin();
        let tip = scene.surface + scene.normal * (RADIUS_MM - 0.5) + across * side;
        contact.step(&scene.bone, &ToolState::at(Pose::from_translation(tip)), false, 1.0, &mut out);
    })
}

/// The recommended method keeps its promises and nothing is both faster and more accurate on planes.
fn gates(rows: &[Row]) -> Vec<Gate> {
    let name = Method::RECOMMENDED.name();
    let of = |scene: &str| rows.iter().find(|row| row.scene == scene && row.method == name);
    let mut gates = Vec::new();
    if let Some(plane) = of("half-space") {
        gates.push(Gate::at_most("depth on planes, p95 voxel", plane.metrics["depth_error_p95_voxel"], 0.05));
        gates.push(Gate::at_most("normal on planes, p95 degrees", plane.metrics["normal_error_p95_deg"], 2.0));
        gates.push(Gate::at_most("sideways on planes, p95 voxel", plane.metrics["sideways_error_p95_voxel"], 0.05));
        let change = plane.metrics["force_change_beyond_hand_max_n_per_ms"];
        gates.push(Gate::at_most(
            "change of force on planes beyond the hand's own, worst N/ms at 50 mm/s",
            change,
            0.1,
        ));
        let dominated = crate::front::dominated(rows, "half-space", name, "tick_p50_us", "depth_error_p95_voxel");
        gates.push(Gate::at_most("methods that beat the recommended one in both", dominated as f64, 0.0));
    }
    if let Some(ball) = of("sphere") {
        gates.push(Gate::at_most("normal on spheres, p95 degrees", ball.metrics["normal_error_p95_deg"], 5.0));
    }
    gates
}
