//! The thesis's cubes (Table 3.1) and skulls (Table 3.2), touched and drilled along recorded paths:
//! what a whole haptic tick costs there.
//!
//! # Practice
//! A cube's outer voxels are 1800 HU in air, so that the surface lies on its faces at every voxel
//! size and the depth is known in closed form. The skulls are the built-in CT, 1 x 1 x 2 mm,
//! resampled to the dimensions of the table: its upper 14 cm. A tick is contact with sweep,
//! viscoelastic force, guard, and drilling where the pedal is down. The path is the hand's as
//! recorded, the same for every model and method: where a burr is slower than the recorded one, it
//! lags.

use super::bones::{HALF_MM, SKULLS, cube, head, skull};
use super::recording::{self, Task};
use super::solid::{ISO, RADIUS_MM};
use super::{STIFFNESS, clearance, published, worst_chart};
use glam::DVec3;
use std::time::Instant;
use trepan_bone::{BRICK, BoneVolume};
use trepan_contact::{ForceGuard, ForceModel, GuardConfig, Viscoelastic};
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::timer::Samples;
use trepan_geometry::{Buttons, Tool, ToolState, Vec3};
use trepan_rigid::{Method, RigidStep};
use trepan_rivals::Family;
use trepan_volume::VoxelVolume;

/// Table 3.1: voxels along an edge of 200 mm.
pub const CUBES: [usize; 6] = [100, 200, 300, 400, 450, 500];
/// Edge of the largest grid, voxels.
const HUGE: usize = 1024;
/// How much slower the largest grid may be.
const MOST_RATIO: f64 = 1.5;
/// Ticks by the oracle, which is slow.
const ORACLE_TICKS: usize = 800;
/// Ticks between two looks at the held ball.
const LOOK: usize = 20;

/// Every model, then the grid of 1024³.
pub fn parts(scope: Scope) -> Vec<Part> {
    let of_cube = |&voxels: &usize| {
        let name = format!("Cube{voxels}");
        Part::new(name.clone(), move |scope, findings| {
            Model { group: "cubes", name, ct: cube(voxels), isovalue: ISO }.measure(&Method::all(), scope, findings);
        })
    };
    let of_skull = |(number, &(dims, voxel_mm)): (usize, &([usize; 3], f32))| {
        let name = format!("Skull{}", number + 1);
        Part::new(name.clone(), move |scope, findings| {
            let (head, isovalue) = head();
            let ct = skull(&head, dims, voxel_mm);
            Model { group: "skulls", name, ct, isovalue }.measure(&Method::all(), scope, findings);
        })
    };
    let mut parts: Vec<Part> = scope.pick(&CUBES[1..2], &CUBES[..]).iter().map(of_cube).collect();
    let skulls = SKULLS.iter().enumerate().filter(|(number, _)| !scope.quick || *number == 2);
    parts.extend(skulls.map(of_skull));
    parts.push(Part::new("published", |_, findings| findings.rows.extend(published::rows())));
    parts.push(Part::new("large", large));
    parts
}

/// Two charts a group: against the truth, which the recommended method must lead, and against what
/// the thesis prints of itself.
pub fn judge(findings: &mut Findings) {
    for group in ["cubes, touch", "cubes, drill", "skulls, touch", "skulls, drill"] {
        let (error, what) = match group {
            "cubes, touch" => ("depth_error_p95_voxel", "depth in closed form"),
            _ => ("clearance_error_p95_voxel", "gap or overlap between the held ball and the bone"),
        };
        let title = format!("The thesis's {group}: whole tick against {what}");
        let chart = worst_chart(findings, group, &title, ("tick_p50_us", error), true);
        findings.charts.extend(chart);
        let title =
            format!("The thesis's {group}: whole tick against largest change of force, as the thesis prints it");
        let chart = worst_chart(findings, group, &title, ("tick_p50_us", "force_change_max_n_per_ms"), false);
        findings.charts.extend(chart);
    }
}

struct Model {
    group: &'static str,
    name: String,
    ct: VoxelVolume<i16>,
    isovalue: i16,
}

impl Model {
    fn measure(&self, methods: &[Method], scope: Scope, findings: &mut Findings) {
        let of = if self.group == "cubes" { recording::Place::Cube } else { recording::Place::Skull };
        for task in [Task::Touch, Task::Drill] {
            let path = recording::path(of, task);
            for method in methods {
                let slow = method.descriptor().is_oracle;
                if slow && (scope.quick || task == Task::Drill) {
                    continue;
                }
                let ticks = if slow { ORACLE_TICKS } else { path.len() };
                let bone = BoneVolume::new(&self.ct, self.isovalue).expect("the model has bone");
                let ride = ride(method, &bone, &path[..ticks], true);
                findings.rows.push(self.row(task, method, &bone, &ride));
            }
        }
    }

    fn row(&self, task: Task, method: &Method, bone: &BoneVolume, ride: &Ride) -> Row {
        let scene = format!("{}, {}", self.name, task.name());
        let clearance = Samples::from(ride.clearance_voxel.clone()).quantile(0.95);
        let row = ride
            .row(&scene, method, bone)
            .with("group", format!("{}, {}", self.group, task.name()))
            .with("voxel_mm", bone.spacing_mm())
            .metric("clearance_error_p95_voxel", clearance);
        if self.group != "cubes" || task != Task::Touch {
            return row;
        }
        let errors: Vec<f64> = ride.felt.iter().filter_map(|felt| felt.error_voxel(bone.spacing_mm())).collect();
        row.metric("depth_error_p95_voxel", Samples::from(errors).quantile(0.95))
    }
}

/// What one tick felt.
struct TickResult {
    tip: Vec3,
    depth_mm: f32,
}

impl TickResult {
    /// Error of the depth on a cube, voxels. It counts where the truth is a touch of 0.2 mm or more
    /// and the centre is out of the cube.
    fn error_voxel(&self, voxel_mm: f32) -> Option<f64> {
        let out = self.tip.as_dvec3().abs() - HALF_MM;
        let depth = f64::from(RADIUS_MM) - out.max(DVec3::ZERO).length();
        let counts = depth >= 0.2 && out.max_element() > 0.0;
        counts.then(|| (f64::from(self.depth_mm) - depth).abs() / f64::from(voxel_mm))
    }
}

/// A path, ridden.
pub(super) struct Ride {
    tick_us: Samples,
    felt: Vec<TickResult>,
    points: u64,
    voxels_in_contact: u32,
    voxels: u64,
    touching: u64,
    jump_n: f32,
    removed_mm3: f64,
    /// Gap or overlap of the held ball, voxels, now and then.
    clearance_voxel: Vec<f64>,
}

/// A path of whole ticks: contact, force, guard. `look` for how far the held ball is from the bone.
fn ride(method: &Method, bone: &BoneVolume, path: &[ToolState], look: bool) -> Ride {
    let mut contact = method.build(&Tool::burr(RADIUS_MM));
    let (mut model, mut guard) = (Viscoelastic::BONE, ForceGuard::new(GuardConfig::default()));
    let (mut out, mut last, mut times) = (RigidStep::default(), Vec3::ZERO, Vec::with_capacity(path.len()));
    let mut ride = Ride {
        tick_us: Samples::default(),
        felt: Vec::with_capacity(path.len()),
        points: 0,
        voxels_in_contact: 0,
        voxels: 0,
        touching: 0,
        jump_n: 0.0,
        removed_mm3: 0.0,
        clearance_voxel: Vec::new(),
    };
    if let Some(first) = path.first() {
        contact.reset(first.world_from_tool);
    }
    for (tick, tool) in path.iter().enumerate() {
        let start = Instant::now();
        contact.step(bone, tool, tool.buttons.has(Buttons::PEDAL), 1.0, &mut out);
        let wrench = model.wrench(tool, &out.manifold, 1.0);
        std::hint::black_box(guard.guard(wrench, tool, 1.0));
        let spent = start.elapsed().as_secs_f64() * 1e6;
        let force = STIFFNESS * out.manifold.depth_mm * out.manifold.normal;
        ride.jump_n = ride.jump_n.max(force.distance(last));
        last = force;
        if out.manifold.touches() {
            times.push(spent);
            ride.touching += 1;
            ride.points += u64::from(out.points_in_contact);
            ride.voxels += u64::from(out.voxels_swept);
            ride.voxels_in_contact = ride.voxels_in_contact.max(out.voxels_in_contact);
        }
        ride.removed_mm3 += f64::from(out.removed_mm3);
        if look && tick % LOOK == 0 {
            ride.clearance_voxel.extend(clearance::error_voxel(bone, tool.tip(), &out.manifold));
        }
        ride.felt.push(TickResult { tip: tool.tip(), depth_mm: out.manifold.depth_mm });
    }
    ride.tick_us = Samples::from(times);
    ride
}

impl Ride {
    fn row(&self, scene: &str, method: &Method, bone: &BoneVolume) -> Row {
        let each = |sum: u64| sum as f64 / self.touching.max(1) as f64;
        let deepest = self.felt.iter().map(|felt| felt.depth_mm).fold(0.0, f32::max);
        let voxels: usize = bone.dims().iter().product();
        let bricks: usize = bone.dims().iter().map(|n| n.div_ceil(BRICK)).product();
        Row::new(scene, method.name())
            .with("radius_mm", RADIUS_MM)
            .with("ticks", self.felt.len())
            .metric("tick_p50_us", self.tick_us.quantile(0.5))
            .metric("tick_p99_us", self.tick_us.quantile(0.99))
            .metric("grid_mvoxel", voxels as f64 / 1e6)
            .metric("grid_mib", (2 * voxels + 4 * bricks) as f64 / f64::from(1 << 20))
            .metric("touching_percent", 100.0 * self.touching as f64 / self.felt.len().max(1) as f64)
            .metric("points_in_contact_mean", each(self.points))
            .metric("voxels_in_contact_max", self.voxels_in_contact.into())
            .metric("voxels_visited_mean", each(self.voxels))
            .metric("depth_max_mm", deepest.into())
            .metric("force_change_max_n_per_ms", self.jump_n.into())
            .metric("removed_mm3", self.removed_mm3)
    }
}

/// The drilling tick of the recommended method in 48.5 million voxels and, where memory allows, in
/// 1024³ of the same edge.
fn large(scope: Scope, findings: &mut Findings) {
    let (head, isovalue) = head();
    let path = recording::path(recording::Place::Skull, Task::Drill);
    let (dims, voxel_mm) = SKULLS[4];
    let grids = [("48.5 million voxels", dims), ("1024³ voxels", [HUGE; 3])];
    let mut p50 = Vec::new();
    for (name, dims) in grids {
        let voxels: usize = dims.iter().product();
        if dims[0] == HUGE && (scope.quick || available_mib() < (5 * voxels) >> 20) {
            continue;
        }
        let bone = BoneVolume::new(&skull(&head, dims, voxel_mm), isovalue).expect("the skull has bone");
        let found = ride(&Method::RECOMMENDED, &bone, &path, false);
        p50.push(found.tick_us.quantile(0.5));
        findings.rows.push(found.row(&format!("full drilling tick, {name}"), &Method::RECOMMENDED, &bone));
        if dims[0] != HUGE && !scope.quick {
            findings.rows.push(super::soak::row(&bone, &path));
        }
    }
    if let [small, large] = p50[..] {
        let name = "full drilling tick: 1024³ over 48.5 million voxels, p50";
        findings.gates.push(Gate::at_most(name, large / small, MOST_RATIO));
    }
}

/// Memory that can be had, MiB; 0 where the system does not say.
fn available_mib() -> usize {
    let info = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let line = info.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<usize>().ok()).unwrap_or(0) / 1024
}
