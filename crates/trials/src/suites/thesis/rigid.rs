//! Figures 3.11 to 3.26: cubes and skulls along the recorded paths, by the thesis's method as
//! printed, put right, and by the recommended one.
//!
//! # Practice
//! The least time of each frame over some rides counts: a busy machine spoils single frames. A ride
//! that drills gets the bone whole again. The paths are those of the suite `rigid`.

use super::comparison::{Comparison, Rule};
use crate::suites::rigid::bones::{SKULLS, cube, head, skull};
use crate::suites::rigid::models::CUBES;
use crate::suites::rigid::recording::{Place, Task, path};
use crate::suites::rigid::solid::{ISO, RADIUS_MM};
use crate::suites::{Part, Scope};
use std::time::Instant;
use trepan_bone::BoneVolume;
use trepan_contact::{ForceModel, Viscoelastic};
use trepan_evidence::picture::Series;
use trepan_evidence::suite::Findings;
use trepan_geometry::{Buttons, Pointshell, Spread, Tool, ToolState, Vec3, quantile};
use trepan_rigid::{Method, RigidStep};
use trepan_rivals::rigid::{Ball, Sweep, thesis};
use trepan_volume::VoxelVolume;

/// The thesis's method as printed, put right, and ours.
const METHODS: [Method; 3] = [Method::of(&thesis::AS_PRINTED), Method::of(&thesis::METHOD), Method::RECOMMENDED];
/// What the methods are called on charts.
const NAMES: [&str; 3] = ["thesis, as printed", "thesis, put right", "ours"];
/// Limit of a frame, µs.
const FRAME_US: f64 = 1000.0;
/// Bound of the sweep as printed for Figure 3.16, µs.
const SWEEP_US: f64 = 15.0;
/// The thesis's stiffness, N/mm.
const STIFFNESS: f32 = 2.0;
/// What the first depth is.
const FIRST: &str =
    "the first depth is the proxy's, which the sweep leaves in light touch; the rectified one is the hand's";
/// Quantiles of the times of frames.
pub const SHARES: [(&str, f64); 3] = [("slowest frame", 1.0), ("99 % of frames", 0.99), ("median frame", 0.5)];
/// Table 3.1 as printed: voxels, and edge of a voxel, mm.
const PRINTED_CUBES: [(f64, f64); 6] =
    [(1e6, 2.0), (8e6, 1.0), (27e6, 0.667), (64e6, 0.5), (91.125e6, 0.444), (125e6, 0.4)];
/// What differs in every ride.
const HAND: &str = "the path is our recorded hand's, the tool's radius is not printed";

/// Cubes, skulls, and force on one skull.
pub fn parts() -> Vec<Part> {
    vec![Part::new("cubes", cubes), Part::new("skulls", skulls), Part::new("skull forces", forces)]
}

/// Numbers of the figures of a group of models.
struct Group {
    name: &'static str,
    place: Place,
    /// Touched, then drilled.
    figures: [&'static str; 2],
}

/// A model of a table.
struct Model {
    name: String,
    ct: VoxelVolume<i16>,
    isovalue: i16,
}

impl Model {
    fn bone(&self) -> BoneVolume {
        BoneVolume::new(&self.ct, self.isovalue).expect("the model has bone")
    }
}

/// What one method did, frame by frame.
#[derive(Default)]
struct Ride {
    frame_us: Vec<f64>,
    sweep_us: Vec<f64>,
    /// Voxels in contact.
    voxels: Vec<f64>,
    /// Depth of Algorithm 1 before it is rectified, mm.
    first_mm: Vec<f64>,
    /// Depth that the force model gets, mm.
    depth_mm: Vec<f64>,
    normals: Vec<Vec3>,
    /// Viscoelastic force, N.
    forces: Vec<Vec3>,
}

/// Rides a path some times and keeps the least time of each frame. Bone that was drilled is made
/// anew.
fn ride(method: &Method, model: &Model, path: &[ToolState], rounds: usize) -> Ride {
    let (mut kept, mut bone) = (Ride::default(), model.bone());
    let drills = path.iter().any(|tool| tool.buttons.has(Buttons::PEDAL));
    for round in 0..rounds {
        if drills && round > 0 {
            bone = model.bone();
        }
        let ride = ride_once(method, &bone, path);
        let least = |kept: &[f64], new: &[f64]| match kept.is_empty() {
            true => new.to_vec(),
            false => kept.iter().zip(new).map(|(a, b)| a.min(*b)).collect(),
        };
        let (frame_us, sweep_us) = (least(&kept.frame_us, &ride.frame_us), least(&kept.sweep_us, &ride.sweep_us));
        kept = Ride { frame_us, sweep_us, ..ride };
    }
    kept
}

fn ride_once(method: &Method, bone: &BoneVolume, path: &[ToolState]) -> Ride {
    let mut contact = method.build(&Tool::burr(RADIUS_MM));
    let shell = Pointshell::sphere(RADIUS_MM, Pointshell::RIGID_COUNT, Spread::Fibonacci);
    let ball = Ball { radius_mm: RADIUS_MM, shell: &shell.points };
    let (mut model, mut out, mut ride) = (Viscoelastic::BONE, RigidStep::default(), Ride::default());
    if let Some(first) = path.first() {
        contact.reset(first.world_from_tool);
    }
    for tool in path {
        let (from, mut visited) = (contact.proxy().translation, 0);
        let start = Instant::now();
        std::hint::black_box(ball.sweep(bone, Sweep::Line, from, tool.tip(), &mut visited));
        ride.sweep_us.push(start.elapsed().as_secs_f64() * 1e6);
        let start = Instant::now();
        contact.step(bone, tool, tool.buttons.has(Buttons::PEDAL), 1.0, &mut out);
        ride.frame_us.push(start.elapsed().as_secs_f64() * 1e6);
        let first_mm = out.manifold.contacts().iter().map(|contact| contact.depth_mm).fold(0.0, f32::max);
        ride.voxels.push(out.voxels_in_contact.into());
        ride.first_mm.push(first_mm.into());
        ride.depth_mm.push(out.manifold.depth_mm.into());
        ride.normals.push(if out.manifold.touches() { out.manifold.normal } else { Vec3::ZERO });
        ride.forces.push(model.wrench(tool, &out.manifold, 1.0).force);
    }
    ride
}

/// Largest value.
pub fn most(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NAN, f64::max)
}

/// Absolute changes from frame to frame.
pub fn changes(values: &[f64]) -> Vec<f64> {
    values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect()
}

/// Values of one axis.
pub fn axis(vectors: &[Vec3], axis: usize) -> Vec<f64> {
    vectors.iter().map(|v| f64::from(v[axis])).collect()
}

/// Largest angle between the directions of two touching frames, degrees: 99 % quantile.
pub fn turn_deg(normals: &[Vec3]) -> f64 {
    let both = normals.windows(2).filter(|pair| pair[0] != Vec3::ZERO && pair[1] != Vec3::ZERO);
    quantile(&mut both.map(|pair| f64::from(pair[0].angle_between(pair[1]).to_degrees())).collect::<Vec<_>>(), 0.99)
}

/// Names lines.
pub fn lines<'a>(names: &[&str], values: impl IntoIterator<Item = &'a Vec<f64>>) -> Vec<(String, &'a [f64])> {
    names.iter().map(ToString::to_string).zip(values.into_iter().map(Vec::as_slice)).collect()
}

fn cubes(scope: Scope, findings: &mut Findings) {
    let sizes = scope.pick(&CUBES[..2], &CUBES[..]);
    let group = Group { name: "cubes", place: Place::Cube, figures: ["Figure 3.11", "Figure 3.12"] };
    let models = sizes.iter().map(|&voxels| Model { name: format!("Cube{voxels}"), ct: cube(voxels), isovalue: ISO });
    let [touched, drilled] = models_by_frame(&group, models, scope, findings);
    for (model, (voxels, edge_mm)) in touched.iter().zip(PRINTED_CUBES) {
        model.beside_the_table("Table 3.1", voxels, edge_mm, findings);
    }
    let name = &touched[touched.len() - 1].name;
    let [touch, drill] = [&touched, &drilled].map(|all| &all[all.len() - 1].rides);
    let title = format!("Figure 3.13: voxels in contact with {name}, the thesis's method put right");
    let both = lines(&["touching", "drilling"], [&touch[1].voxels, &drill[1].voxels]);
    findings.series.push(Series::over_frames(title, "voxels", both));
    let ratio = |method: usize| most(&drill[method].voxels) / most(&touch[method].voxels);
    let quantity = format!("{name}: largest number of voxels in contact, drilling over touching");
    let comparison = Comparison::new("Figure 3.13", quantity, "").printed(Rule::Equal(0.25), 3.0);
    findings.rows.push(comparison.measured([ratio(0), ratio(1), f64::NAN]).why(HAND).row());
}

fn skulls(scope: Scope, findings: &mut Findings) {
    let (ct, isovalue) = head();
    let model = |(number, (dims, voxel_mm)): (usize, ([usize; 3], f32))| Model {
        name: format!("Skull{}", number + 1),
        ct: skull(&ct, dims, voxel_mm),
        isovalue,
    };
    let tables = scope.pick(&SKULLS[..2], &SKULLS[..]);
    let group = Group { name: "skulls", place: Place::Skull, figures: ["Figure 3.14", "Figure 3.15"] };
    let [touched, drilled] = models_by_frame(&group, tables.iter().copied().enumerate().map(model), scope, findings);
    for (model, (dims, edge_mm)) in touched.iter().zip(SKULLS) {
        model.beside_the_table("Table 3.2", dims.iter().product::<usize>() as f64, edge_mm.into(), findings);
    }
    for (task, rides) in [("touch", &touched), ("drill", &drilled)] {
        let names: Vec<&str> = rides.iter().map(|model| model.name.as_str()).collect();
        let title = format!("Figure 3.16: sweep before moving, {task}");
        let times = lines(&names, rides.iter().map(|model| &model.rides[1].sweep_us));
        findings.series.push(Series::over_frames(title, "time, µs", times).limited(SWEEP_US, "printed: most frames"));
        for Ridden { name, rides, .. } in rides {
            let p99 = quantile(&mut rides[1].sweep_us.clone(), 0.99);
            let comparison = Comparison::new("Figure 3.16", format!("{name}, {task}: sweep, 99 % of frames"), "µs");
            let comparison = comparison.printed(Rule::Time, SWEEP_US).measured([f64::NAN, p99, f64::NAN]);
            findings.rows.push(comparison.why("ours has no sweep of its own: it is part of the frame").row());
        }
    }
}

/// A model that every method has ridden over.
struct Ridden {
    name: String,
    /// Number of voxels of the bone that was ridden over.
    voxels: f64,
    /// Edge of its voxels, mm.
    edge_mm: f64,
    rides: [Ride; 3],
}

impl Ridden {
    fn beside_the_table(&self, table: &str, voxels: f64, edge_mm: f64, findings: &mut Findings) {
        let comparison = Comparison::new(table, format!("{}: voxels", self.name), "");
        findings.rows.push(comparison.printed(Rule::Equal(0.0), voxels).ours(self.voxels).row());
        let comparison = Comparison::new(table, format!("{}: edge of a voxel", self.name), "mm");
        findings.rows.push(comparison.printed(Rule::Equal(0.002), edge_mm).ours(self.edge_mm).row());
    }
}

/// Time and voxels in contact of every model; returns the rides, touched and drilled.
fn models_by_frame(
    group: &Group,
    models: impl Iterator<Item = Model>,
    scope: Scope,
    findings: &mut Findings,
) -> [Vec<Ridden>; 2] {
    let paths = [Task::Touch, Task::Drill].map(|task| path(group.place, task));
    let mut all = [Vec::new(), Vec::new()];
    for model in models {
        for (path, rides) in paths.iter().zip(&mut all) {
            let (name, bone) = (model.name.clone(), model.bone());
            let voxels = bone.dims().iter().product::<usize>() as f64;
            let of = METHODS.each_ref().map(|method| ride(method, &model, path, scope.pick(4, 3)));
            rides.push(Ridden { name, voxels, edge_mm: bone.spacing_mm().into(), rides: of });
        }
    }
    for ((figure, task), rides) in group.figures.into_iter().zip(["touched", "drilled"]).zip(&all) {
        let names: Vec<&str> = rides.iter().map(|model| model.name.as_str()).collect();
        for method in [1, 2] {
            let title = format!("{figure} (a): {} {task}, {}", group.name, NAMES[method]);
            let times = lines(&names, rides.iter().map(|model| &model.rides[method].frame_us));
            findings.series.push(Series::over_frames(title, "time, µs", times).limited(FRAME_US, "printed: 1 ms"));
        }
        let title = format!("{figure} (b): {} {task}, {}", group.name, NAMES[1]);
        let voxels = lines(&names, rides.iter().map(|model| &model.rides[1].voxels));
        findings.series.push(Series::over_frames(title, "voxels in contact", voxels));
        for Ridden { name, rides: of, .. } in rides {
            for (what, share) in SHARES {
                let times = [0, 1, 2].map(|method| quantile(&mut of[method].frame_us.clone(), share));
                let comparison = Comparison::new(figure, format!("{name}: {what}"), "µs");
                let why = if share == 1.0 { printed_time(name, task) } else { "" };
                findings.rows.push(comparison.printed(Rule::Time, FRAME_US).measured(times).why(why).row());
            }
        }
        if let Some(Ridden { name, rides: of, .. }) = rides.iter().find(|model| model.name == "Cube500") {
            let printed = if task == "touched" { 100.0 } else { 300.0 };
            let voxels = [0, 1].map(|method| most(&of[method].voxels));
            let comparison = Comparison::new(figure, format!("{name}: largest number of voxels in contact"), "voxels");
            let comparison = comparison.printed(Rule::Equal(0.25), printed);
            findings.rows.push(comparison.measured([voxels[0], voxels[1], f64::NAN]).why(HAND).row());
        }
    }
    all
}

/// What the thesis says of frames over its bound.
fn printed_time(model: &str, task: &str) -> &'static str {
    match (model, task) {
        ("Cube400" | "Cube450" | "Cube500", "drilled") => "printed: some frames over 1 ms",
        ("Skull5", "drilled") => "printed: few frames over 1 ms",
        _ => "ours reads the bone around it when the tool comes near",
    }
}

/// Figures of force on one skull, touched and drilled.
struct ForceFigures {
    task: Task,
    parameters: &'static str,
    variation: &'static str,
    first: &'static str,
    force: &'static str,
    force_variation: &'static str,
    /// Printed bounds: depth, mm; change of k times depth, force, change of force, N.
    bounds: [f64; 4],
}

const FORCE_FIGURES: [ForceFigures; 2] = [
    ForceFigures {
        task: Task::Touch,
        parameters: "Figure 3.17",
        variation: "Figure 3.19",
        first: "Figure 3.21",
        force: "Figure 3.23",
        force_variation: "Figure 3.24",
        bounds: [0.8, 0.3, 1.5, 0.6],
    },
    ForceFigures {
        task: Task::Drill,
        parameters: "Figure 3.18",
        variation: "Figure 3.20",
        first: "Figure 3.22",
        force: "Figure 3.25",
        force_variation: "Figure 3.26",
        bounds: [0.3, 0.5, 0.5, 0.4],
    },
];

/// The original skull's stand-in: the built-in CT with voxels of 1 mm.
fn forces(_: Scope, findings: &mut Findings) {
    let ((ct, isovalue), (dims, voxel_mm)) = (head(), SKULLS[2]);
    let model = Model { name: "Skull3".into(), ct: skull(&ct, dims, voxel_mm), isovalue };
    for figures in &FORCE_FIGURES {
        let path = path(Place::Skull, figures.task);
        let rides = METHODS.each_ref().map(|method| ride(method, &model, &path, 1));
        figures.add(&rides, findings);
    }
}

impl ForceFigures {
    fn add(&self, rides: &[Ride; 3], findings: &mut Findings) {
        let task = self.task.name();
        let [depth, change, force, force_change] = self.bounds;
        for method in [1, 2] {
            let title = format!("{} (a): normal, {task}, {}", self.parameters, NAMES[method]);
            let axes = [0, 1, 2].map(|n| axis(&rides[method].normals, n));
            findings.series.push(Series::over_frames(title, "normal", lines(&["x", "y", "z"], &axes)));
        }
        let title = format!("{} (b): depth, {task}", self.parameters);
        let depths = lines(&NAMES, rides.iter().map(|ride| &ride.depth_mm));
        findings.series.push(Series::over_frames(title, "depth, mm", depths));
        let each = |value: &dyn Fn(&Ride) -> f64| [0, 1, 2].map(|method| value(&rides[method]));
        let mut compare = |item: &str, quantity: &str, unit: &str, rule: Rule, printed: f64, values: [f64; 3]| {
            let why = match rule {
                Rule::Equal(_) => HAND,
                _ if item == self.first => FIRST,
                _ => "",
            };
            let comparison = Comparison::new(item, quantity, unit).printed(rule, printed);
            findings.rows.push(comparison.measured(values).why(why).row());
        };
        compare(self.parameters, "largest depth", "mm", Rule::Equal(0.25), depth, each(&|r| most(&r.depth_mm)));
        let quantity = "turn of the normal in a frame, 99 % of frames";
        compare(self.parameters, quantity, "degrees", Rule::Less, f64::NAN, each(&|r| turn_deg(&r.normals)));
        let elastic = |ride: &Ride| -> Vec<f64> { ride.depth_mm.iter().map(|d| f64::from(STIFFNESS) * d).collect() };
        let varied: Vec<Vec<f64>> = rides.iter().map(|ride| changes(&elastic(ride))).collect();
        let worst = [0, 1, 2].map(|method| most(&varied[method]));
        compare(self.variation, "largest change of k times depth in a frame", "N", Rule::Less, change, worst);
        let share = |r: &Ride| {
            let touching = || r.first_mm.iter().zip(&r.depth_mm).filter(|(first, _)| **first > 0.0);
            let worst_change = |values: Vec<f64>| most(&changes(&values));
            let first = worst_change(touching().map(|pair| *pair.0).collect());
            worst_change(touching().map(|pair| *pair.1).collect()) / first
        };
        let quantity = "largest change of the rectified depth over that of the first, where it touches";
        compare(self.first, quantity, "", Rule::Less, 1.0, [f64::NAN, share(&rides[1]), f64::NAN]);
        let sum = |values: &[f64], first: &[f64]| -> f64 {
            values.iter().zip(first).filter(|(_, first)| **first > 0.0).map(|(value, _)| value).sum()
        };
        let ride = &rides[1];
        let means = sum(&ride.depth_mm, &ride.first_mm) / sum(&ride.first_mm, &ride.first_mm);
        let quantity = "mean rectified depth over the mean first depth, where it touches";
        compare(self.first, quantity, "", Rule::Less, 1.0, [f64::NAN, means, f64::NAN]);
        let lengths: Vec<Vec<f64>> =
            rides.iter().map(|ride| ride.forces.iter().map(|f| f64::from(f.length())).collect()).collect();
        let worst = [0, 1, 2].map(|method| most(&lengths[method]));
        compare(self.force, "largest viscoelastic force", "N", Rule::Equal(0.25), force, worst);
        let by_axis = |ride: &Ride| (0..3).map(|n| most(&changes(&axis(&ride.forces, n)))).fold(f64::NAN, f64::max);
        let quantity = "largest change of the viscoelastic force on an axis in a frame";
        compare(self.force_variation, quantity, "N", Rule::Less, force_change, each(&by_axis));
        let mut chart = |item: &str, what: String, y: &str, lines: Vec<(String, &[f64])>| {
            findings.series.push(Series::over_frames(format!("{item}: {what}, {task}"), y, lines));
        };
        chart(self.variation, "change of k times depth".into(), "force, N", lines(&NAMES, &varied));
        let both = lines(&["first", "rectified"], [&rides[1].first_mm, &rides[1].depth_mm]);
        chart(self.first, "first and rectified depth, thesis, put right".into(), "depth, mm", both);
        for method in [1, 2] {
            let axes = [0, 1, 2].map(|n| axis(&rides[method].forces, n));
            let all = lines(&["x", "y", "z", "modulus"], axes.iter().chain([&lengths[method]]));
            chart(self.force, format!("viscoelastic force, {}", NAMES[method]), "force, N", all);
            let varied = axes.each_ref().map(|values| changes(values));
            let what = format!("change of the viscoelastic force, {}", NAMES[method]);
            chart(self.force_variation, what, "force, N", lines(&["x", "y", "z"], &varied));
        }
    }
}
