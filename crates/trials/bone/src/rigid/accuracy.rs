//! Depth, normal, force and cost of every method on bone with a closed form, in many orientations.

use super::solid::{ISO, KINDS, Kind, Moment, RADIUS_MM, Scene, directions};
use super::{STIFFNESS, worst_chart};
use std::time::Instant;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::timer::Samples;
use trepan_geometry::{Tool, Vec3};
use trepan_rigid::{Method, RigidStep};
use trepan_rivals::Family;

/// From this depth on a touch counts, mm: the least that the thesis measured (0.2 to 0.8 mm).
const TOUCH_MM: f64 = 0.2;
/// From this depth on the normal's angle counts, mm. A proxy that is off sideways by e turns the
/// normal by e / depth, so that the angle of a lighter touch says less of the method than of the
/// depth; there the sideways error itself is measured, and in force as N/ms.
const PRESSED_MM: f64 = 0.5;
/// Orientations by the oracle, which is slow.
const ORACLE_ORIENTATIONS: usize = 8;

/// Every sort of bone.
pub fn parts() -> Vec<Part> {
    let part = |kind: &'static Kind| Part::new(kind.name, move |scope, findings| measure(kind, scope, findings));
    KINDS.iter().map(part).collect()
}

/// Every method on a sort of bone.
fn measure(kind: &Kind, scope: Scope, findings: &mut Findings) {
    let (quick, full) = if kind.group == "planes" { (12, 200) } else { (6, 60) };
    let all = directions(scope.pick(quick, full));
    let methods = Method::all();
    let mut errors: Vec<Errors> = methods.iter().map(|_| Errors::default()).collect();
    for (at, direction) in all.iter().enumerate() {
        let scene = kind.scene(*direction);
        for (method, errors) in methods.iter().zip(&mut errors) {
            if !method.descriptor().is_oracle || at < scope.pick(1, ORACLE_ORIENTATIONS) {
                stroke(method, &scene, errors);
            }
        }
    }
    findings.rows.extend(methods.iter().zip(errors).map(|(method, errors)| errors.row(kind, method)));
}

/// The charts and the limits of the recommended method.
pub fn judge(findings: &mut Findings) {
    for (group, title) in [
        ("planes", "Planes in every orientation, 0.5 and 1 mm voxels"),
        ("solids", "Sphere, cylinder shell from both sides, box over an edge"),
        ("walls", "Walls of 1 to 5 voxels, pressed as a hand does"),
        ("confined", "Slot as wide as the tool, and a pit"),
    ] {
        let chart = worst_chart(findings, group, title, ("tick_p50_us", "depth_error_p95_voxel"), true);
        findings.charts.extend(chart);
    }
    let gates = gates(&findings.rows);
    findings.gates.extend(gates);
}

/// Errors of every tick in every orientation: a share of them is a share of the time that a hand
/// feels them.
#[derive(Default)]
struct Errors {
    orientations: usize,
    depth_voxel: Vec<f64>,
    normal_deg: Vec<f64>,
    /// How far the proxy is off across the true normal, voxels.
    side_voxel: Vec<f64>,
    /// Change of force in a tick of the slide, N.
    slide_n: Vec<f64>,
    /// Change of force in a tick that is not the true one, N.
    beyond_n: Vec<f64>,
    /// Ticks of true contact without any.
    lost: usize,
    tick_us: Vec<f64>,
    points: u64,
    voxels: u64,
}

fn stroke(method: &Method, scene: &Scene, errors: &mut Errors) {
    let mut contact = method.build(&Tool::burr(RADIUS_MM));
    let mut out = RigidStep::default();
    let mut last: Option<(Vec3, Vec3)> = None;
    contact.reset(scene.path[0].tool.world_from_tool);
    errors.orientations += 1;
    for moment in &scene.path {
        let start = Instant::now();
        contact.step(&scene.bone, &moment.tool, false, 1.0, &mut out);
        let spent = start.elapsed().as_secs_f64() * 1e6;
        let force = STIFFNESS * out.manifold.depth_mm * out.manifold.normal;
        let truth = STIFFNESS * (moment.truth.depth_mm * moment.truth.normal).as_vec3();
        if let Some((was, true_was)) = last.replace((force, truth)) {
            if moment.slides {
                errors.slide_n.push((force - was).length().into());
            }
            errors.beyond_n.push((force - was - (truth - true_was)).length().into());
        }
        if moment.truth.depth_mm > 0.0 {
            errors.tick_us.push(spent);
            errors.points += u64::from(out.points_in_contact);
            errors.voxels += u64::from(out.voxels_swept);
        }
        errors.compare(moment, &out, f64::from(scene.bone.spacing_mm()));
    }
}

impl Errors {
    fn compare(&mut self, moment: &Moment, out: &RigidStep, voxel_mm: f64) {
        let truth = moment.truth;
        if truth.depth_mm < TOUCH_MM {
            return;
        }
        let lift = (out.manifold.depth_mm * out.manifold.normal).as_dvec3();
        self.depth_voxel.push((f64::from(out.manifold.depth_mm) - truth.depth_mm).abs() / voxel_mm);
        self.side_voxel.push(lift.reject_from_normalized(truth.normal).length() / voxel_mm);
        self.lost += usize::from(!out.manifold.touches());
        if truth.depth_mm >= PRESSED_MM {
            let angle = out.manifold.normal.as_dvec3().angle_between(truth.normal).to_degrees();
            self.normal_deg.push(if angle.is_finite() { angle } else { 180.0 });
        }
    }

    fn row(self, kind: &Kind, method: &Method) -> Row {
        let ticks = self.tick_us.len().max(1) as f64;
        let lost = 100.0 * self.lost as f64 / self.depth_voxel.len().max(1) as f64;
        let [times, depth, normal, side, slide, beyond] =
            [self.tick_us, self.depth_voxel, self.normal_deg, self.side_voxel, self.slide_n, self.beyond_n]
                .map(Samples::from);
        Row::new(kind.name, method.name())
            .with("group", kind.group)
            .with("voxel_mm", kind.voxel_mm)
            .with("isovalue_hu", ISO)
            .with("orientations", self.orientations)
            .with("radius_mm", RADIUS_MM)
            .metric("tick_p50_us", times.quantile(0.5))
            .metric("tick_p99_us", times.quantile(0.99))
            .metric("points_in_contact_mean", self.points as f64 / ticks)
            .metric("voxels_visited_mean", self.voxels as f64 / ticks)
            .metric("depth_error_p95_voxel", depth.quantile(0.95))
            .metric("depth_error_worst_voxel", depth.quantile(1.0))
            .metric("normal_error_p95_deg", normal.quantile(0.95))
            .metric("normal_error_worst_deg", normal.quantile(1.0))
            .metric("sideways_error_p95_voxel", side.quantile(0.95))
            .metric("contact_lost_percent", lost)
            .metric("force_change_slide_max_n_per_ms", slide.quantile(1.0))
            .metric("force_change_beyond_truth_p99_n_per_ms", beyond.quantile(0.99))
            .metric("force_change_beyond_truth_max_n_per_ms", beyond.quantile(1.0))
    }
}

/// The recommended method keeps its limits on planes in every orientation and on curved bone.
fn gates(rows: &[Row]) -> Vec<Gate> {
    let name = Method::RECOMMENDED.name();
    let own = || rows.iter().filter(move |row| row.method == name);
    let mut gates = Vec::new();
    let mut gate = |row: &Row, what: &str, metric: &str, limit: f64| {
        gates.push(Gate::at_most(format!("{}: {what}", row.scene), row.metrics[metric], limit));
    };
    for row in own().filter(|row| row.config.get("group").is_some_and(|group| group == "planes")) {
        gate(row, "depth, worst voxel", "depth_error_worst_voxel", 0.05);
        gate(row, "normal, worst degrees", "normal_error_worst_deg", 2.0);
        gate(row, "change of force in a slide at 50 mm/s, worst N/ms", "force_change_slide_max_n_per_ms", 0.1);
        gate(row, "change of force beyond the true one, worst N/ms", "force_change_beyond_truth_max_n_per_ms", 0.1);
    }
    for row in own().filter(|row| row.config.get("group").is_some_and(|group| group == "solids")) {
        // A box's edge is sharper than a voxel: on its grid no method knows where it is, so its
        // normal is shown without a limit.
        if !row.scene.starts_with("box") {
            gate(row, "normal, p95 degrees", "normal_error_p95_deg", 5.0);
        }
        gate(row, "change of force in a slide at 50 mm/s, worst N/ms", "force_change_slide_max_n_per_ms", 0.1);
    }
    for row in own().filter(|row| row.config.get("group").is_some_and(|group| group == "walls")) {
        gate(row, "ticks without contact, percent", "contact_lost_percent", 0.0);
    }
    gates
}
