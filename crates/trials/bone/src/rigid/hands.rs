//! Strokes of a compliant hand on the built-in head, on paths that the f64 truth made.
//!
//! # Theory
//! A hand of mass m means to be at x₀(t) and is held by the bone's force k d:
//! ```text
//! m a = c (x₀ - x) - b v + k d          m 250 g, c 1.5 N/mm, b 8 N s/m, k 2 N/mm
//! ```
//! It presses and slides, or drills into the bone and slides in what it drilled. The truth holds it
//! first. Then every method is judged twice:
//! ```text
//! led         the hand goes where it went with the truth: error of the force vector
//! compliant   the method holds the hand itself: by how much it comes to be elsewhere
//! ```
//! The first does not punish a method for where it went before, the second does.
//!
//! # Practice
//! Voxels are those that the default quality takes of this head. Burrs have a radius of 1 to 4 mm:
//! 2 to 6 mm across, as temporal-bone simulators have them, and 8. Rivals are as stiff as the
//! spring k at 0.5 mm (`rivals`), led and compliant. A hand that a method lets fall through the
//! skull has an error of millimetres.

use super::bones::{SKULLS, head, skull};
use super::{STIFFNESS, worst_chart};
use glam::DVec3;
use std::time::Instant;
use trepan_bone::BoneVolume;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Pose, Quat, Tool, ToolState, Vec3, quantile};
use trepan_rigid::removal::RemovalLaw;
use trepan_rigid::truth::{Ball, Bone, Scan};
use trepan_rigid::{Method, RigidContact, RigidStep};
use trepan_rivals::Family;
use trepan_volume::{AIR_HU, Grid, Interpolation, VoxelVolume, resample};

const MASS_G: f64 = 250.0;
const SPRING: f64 = 1.5;
/// Damping, N ms/mm.
const DAMPING: f64 = 8.0;
/// How deep the hand means to be, mm.
const MEANT_MM: f64 = 1.5;
/// Way of a slide, mm.
const SLIDE_MM: f64 = 4.0;
/// Time to come down, to stay, to slide, ms: of a quick run and of a full one.
const TIMES_MS: [[usize; 3]; 2] = [[200, 200, 300], [300, 500, 500]];
/// Radii of burrs, mm.
const BURRS_MM: [f32; 4] = [1.0, 2.0, 3.0, 4.0];
/// Edge of a voxel, mm.
const VOXEL_MM: f32 = 0.5;
/// Half an edge of the piece of the head that is touched, mm.
const AROUND_MM: f64 = 18.0;
/// Forces under this are not felt, N.
const FELT_N: f64 = 0.02;
/// Largest error of the force, p95, N: the default tolerance, which a hand notices.
const MOST_N: f64 = 0.1;
/// Chart of the errors.
const GROUP: &str = "compliant hand";

/// What a hand does.
#[derive(Clone, Copy, PartialEq)]
enum Task {
    Touch,
    Drill,
}

impl Task {
    fn name(self) -> &'static str {
        match self {
            Self::Touch => "touch",
            Self::Drill => "drill",
        }
    }
}

/// One part for each burr and task.
pub fn parts(scope: Scope) -> Vec<Part> {
    let burrs = scope.pick(&BURRS_MM[1..2], &BURRS_MM[..]);
    let all = burrs.iter().flat_map(|radius_mm| [Task::Touch, Task::Drill].map(|task| (*radius_mm, task)));
    let part = |(radius_mm, task): (f32, Task)| {
        let name = format!("hand, {} with a burr of {radius_mm} mm", task.name());
        Part::new(name, move |scope, findings: &mut Findings| stroke(scope, radius_mm, task, findings))
    };
    all.map(part).collect()
}

/// The chart, and the limits of the recommended method.
pub fn judge(findings: &mut Findings) {
    let title = "Compliant hand on a head: tick against the worst error of the force";
    let chart = worst_chart(findings, GROUP, title, ("tick_p50_us", "led_force_error_p95_n"), true);
    findings.charts.extend(chart);
    let own = |row: &&Row| row.method == Method::RECOMMENDED.name();
    let rows = findings.rows.iter().filter(|row| row.config.get("group").is_some_and(|of| of == GROUP)).filter(own);
    let limits = rows.flat_map(|row| {
        ["led", "compliant"].map(|hand| {
            let error = row.metrics[&format!("{hand}_force_error_p95_n")];
            Gate::at_most(format!("{}, {hand}: error of force, p95, N", row.scene), error, MOST_N)
        })
    });
    let limits: Vec<Gate> = limits.collect();
    findings.gates.extend(limits);
}

/// Where the skull is touched.
struct Site {
    entry: DVec3,
    /// Unit vector out of the bone.
    outward: DVec3,
    /// As in [`TIMES_MS`].
    times_ms: [usize; 3],
}

impl Site {
    /// Where a line from above meets the head, and the normal there by a large ball.
    fn of(ct: &VoxelVolume<i16>, isovalue: i16, scope: Scope) -> Self {
        const STEP_MM: f64 = 0.1;
        let (low, high) = ct.world_corners();
        let (middle, up) = (0.5 * (low + high), DVec3::new(0.35, 0.25, 0.9).normalize());
        let (dims, voxel_mm) = SKULLS[0];
        let bone = BoneVolume::new(&skull(ct, dims, voxel_mm), isovalue).expect("the head has bone");
        let out = high.distance(low);
        let line = (0..(out / STEP_MM) as usize).map(|n| middle + (out - STEP_MM * n as f64) * up);
        let entry = line.into_iter().find(|p| bone.is_bone(bone.grid_of(p.as_vec3()).round().as_ivec3()));
        let entry = entry.expect("the line meets the skull");
        let exact = Bone::new(Scan::around(ct, isovalue, entry, AROUND_MM));
        let mut ball = Ball::new(6.0, entry + 10.0 * up);
        let lifted = (0..60).map(|n| ball.follow(&exact, entry + (10.0 - 0.1 * f64::from(n)) * up)).last();
        let outward = lifted.unwrap_or(up).normalize();
        Self { entry, outward, times_ms: TIMES_MS[scope.pick(0, 1)] }
    }

    /// Where the hand means to be at a time, mm, and whether the burr works.
    fn meant(&self, task: Task, radius_mm: f64, ms: usize) -> (DVec3, bool) {
        let reach = |t: f64| t * t * t * (10.0 + t * (6.0 * t - 15.0));
        let [down, stay, slide] = self.times_ms;
        let share = |from: usize, time: usize| reach((ms.saturating_sub(from) as f64 / time as f64).min(1.0));
        let height = radius_mm + 2.0 - (2.0 + MEANT_MM) * share(0, down);
        let along = SLIDE_MM * share(down + stay, slide);
        let aside = self.outward.any_orthonormal_vector();
        let works = task == Task::Drill && (down..down + stay).contains(&ms);
        (self.entry + height * self.outward + along * aside, works)
    }
}

/// One tick of a hand.
#[derive(Clone, Copy)]
struct Tick {
    device: DVec3,
    /// How far the tool is held from there, mm.
    lifted: DVec3,
    works: bool,
}

/// A hand that `hold` holds: it gives the way from the device to where the tool is, mm.
fn hand(site: &Site, task: Task, radius_mm: f32, mut hold: impl FnMut(DVec3, bool) -> DVec3) -> Vec<Tick> {
    let meant = |ms| site.meant(task, radius_mm.into(), ms);
    let (mut device, mut speed) = (meant(0).0, DVec3::ZERO);
    let tick = |ms: usize| {
        let (goal, works) = meant(ms);
        // The device says where it is in f32.
        let place = device.as_vec3().as_dvec3();
        let lifted = hold(place, works);
        let force = SPRING * (goal - device) - DAMPING * speed + f64::from(STIFFNESS) * lifted;
        speed += force / MASS_G;
        device += speed;
        Tick { device: place, lifted, works }
    };
    (0..site.times_ms.iter().sum()).map(tick).collect()
}

/// The same ticks, held by something else.
fn led(ticks: &[Tick], mut hold: impl FnMut(DVec3, bool) -> DVec3) -> Vec<Tick> {
    ticks.iter().map(|tick| Tick { lifted: hold(tick.device, tick.works), ..*tick }).collect()
}

/// 95 of 100 errors are no larger. They count where one of the two feels something.
fn p95(own: &[Tick], truth: &[Tick], error: impl Fn(&Tick, &Tick) -> f64) -> f64 {
    let felt = |tick: &Tick| f64::from(STIFFNESS) * tick.lifted.length() > FELT_N;
    let both = own.iter().zip(truth).filter(|(a, b)| felt(a) || felt(b));
    quantile(&mut both.map(|(a, b)| error(a, b)).collect::<Vec<_>>(), 0.95)
}

fn stroke(scope: Scope, radius_mm: f32, task: Task, findings: &mut Findings) {
    let (ct, isovalue) = head();
    let site = Site::of(&ct, isovalue, scope);
    let mut exact = Bone::new(Scan::around(&ct, isovalue, site.entry, AROUND_MM));
    let mut ball = Ball::new(radius_mm, site.meant(task, radius_mm.into(), 0).0);
    let truth = hand(&site, task, radius_mm, |device, works| {
        let lifted = ball.follow(&exact, device);
        if works {
            ball.drill(&mut exact, (device, site.outward), &RemovalLaw::RATE, 1.0);
        }
        lifted
    });
    let piece = piece(&ct, &site);
    let in_scope = |method: &Method| !scope.quick || !method.descriptor().is_oracle;
    for method in Method::all().into_iter().filter(in_scope) {
        findings.rows.push(row(&method, &piece, isovalue, &site, (radius_mm, task), &truth));
    }
}

/// The voxels around the site.
fn piece(ct: &VoxelVolume<i16>, site: &Site) -> VoxelVolume<i16> {
    let edge = (2.0 * AROUND_MM / f64::from(VOXEL_MM)) as usize + 1;
    let origin = (site.entry - AROUND_MM).as_vec3();
    let grid = Grid::of(&VoxelVolume::isotropic([0; 3], origin, VOXEL_MM, 0u8));
    resample(ct, &Grid { dims: [edge; 3], ..grid }, Interpolation::Cubic, AIR_HU)
}

/// A tool that a method holds, in bone of its own.
struct HeldTool {
    bone: BoneVolume,
    contact: Box<dyn RigidContact>,
    out: RigidStep,
    /// The shaft stands out of the bone.
    turned: Quat,
    times_us: Vec<f64>,
}

impl HeldTool {
    fn by(
        method: &Method,
        piece: &VoxelVolume<i16>,
        isovalue: i16,
        (radius_mm, outward, start): (f32, DVec3, DVec3),
    ) -> Self {
        let bone = BoneVolume::new(piece, isovalue).expect("the piece has bone");
        let turned = Quat::from_rotation_arc(Vec3::Z, outward.as_vec3());
        let mut contact = method.build(&Tool::burr(radius_mm));
        contact.reset(Pose::from_parts(start.as_vec3(), turned));
        Self { bone, contact, out: RigidStep::default(), turned, times_us: Vec::new() }
    }

    /// How far the tool is held from the device, mm.
    fn hold(&mut self, device: DVec3, works: bool) -> DVec3 {
        let tool = ToolState::at(Pose::from_parts(device.as_vec3(), self.turned));
        let start = Instant::now();
        self.contact.step(&self.bone, &tool, works, 1.0, &mut self.out);
        self.times_us.push(1e6 * start.elapsed().as_secs_f64());
        (self.out.manifold.depth_mm * self.out.manifold.normal).as_dvec3()
    }
}

fn row(
    method: &Method,
    piece: &VoxelVolume<i16>,
    isovalue: i16,
    site: &Site,
    (radius_mm, task): (f32, Task),
    truth: &[Tick],
) -> Row {
    let held = || HeldTool::by(method, piece, isovalue, (radius_mm, site.outward, truth[0].device));
    let (mut first, mut second) = (held(), held());
    let led = led(truth, |device, works| first.hold(device, works));
    let own = hand(site, task, radius_mm, |device, works| second.hold(device, works));
    let mut times_us = [first.times_us, second.times_us].concat();
    let force = |a: &Tick, b: &Tick| f64::from(STIFFNESS) * a.lifted.distance(b.lifted);
    let elsewhere = |a: &Tick, b: &Tick| a.device.distance(b.device);
    let proxy = |a: &Tick, b: &Tick| (a.device + a.lifted).distance(b.device + b.lifted);
    Row::new(format!("hand, {} with a burr of {radius_mm} mm", task.name()), method.name())
        .with("group", GROUP)
        .with("radius_mm", radius_mm)
        .with("voxel_mm", VOXEL_MM)
        .metric("tick_p50_us", quantile(&mut times_us, 0.5))
        .metric("tick_p99_us", quantile(&mut times_us, 0.99))
        .metric("led_force_error_p95_n", p95(&led, truth, force))
        .metric("compliant_force_error_p95_n", p95(&own, truth, force))
        .metric("compliant_hand_error_p95_mm", p95(&own, truth, elsewhere))
        .metric("compliant_proxy_error_p95_mm", p95(&own, truth, proxy))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On an elastic half-space the hand comes to rest where the two springs balance.
    #[test]
    fn the_hand_rests_where_its_spring_balances_the_bone() {
        let site = Site { entry: DVec3::ZERO, outward: DVec3::Z, times_ms: TIMES_MS[1] };
        let ticks = hand(&site, Task::Touch, 2.0, |device, _| DVec3::Z * (2.0 - device.z).max(0.0));
        let rests = SPRING * MEANT_MM / (SPRING + f64::from(STIFFNESS));
        let end = ticks.last().unwrap();
        assert!((end.lifted.z - rests).abs() < 2e-3, "{} of {rests}", end.lifted.z);
        assert!(end.device.with_z(0.0).length() > SLIDE_MM - 0.05);
        let same = led(&ticks, |device, _| DVec3::Z * (2.0 - device.z).max(0.0));
        assert_eq!(p95(&same, &ticks, |a, b| a.lifted.distance(b.lifted)), 0.0);
        let off = led(&ticks, |device, _| DVec3::Z * (2.1 - device.z).max(0.0));
        assert!((p95(&off, &ticks, |a, b| a.lifted.distance(b.lifted)) - 0.1).abs() < 1e-9);
    }
}
