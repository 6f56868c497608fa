//! Figures 4.8 to 4.21: cubes and brains of tetrahedra at rest, along the recorded paths.
//!
//! # Theory
//! The thesis's first stage is the search of the first colliding tetrahedron. Its time follows from
//! four steps of one collision at one pose, each timed:
//! ```text
//! fresh     history forgotten: boxes + search from the first tetrahedron + rest
//! again     the tetrahedron is known: boxes + rest
//! away      the tool far off: boxes
//! improved  history of the frame before: boxes + short search + rest
//!
//! first stage = fresh − (again − away)       rest = again − away
//! ```
//!
//! # Practice
//! The least time of each frame over some rounds counts. Cells are the thesis's. Meshes of the
//! brain are made by this project's lattice at the printed counts. As in the thesis, the meshes do
//! not deform.

use super::comparison::{Comparison, Rule};
use super::rigid::{SHARES, axis, changes, lines, most, turn_deg};
use crate::suites::deformable::published::MODELS;
use crate::suites::deformable::recording::{NAMES as PATH_FILES, TETS, path};
use crate::suites::deformable::scene::{PATHS, RADIUS_MM, Scene};
use crate::suites::{Part, Scope};
use std::time::Instant;
use trepan_contact::{ForceModel, Viscoelastic};
use trepan_deformable::{Config, Method, Response, TissueCollision, TissueStep};
use trepan_evidence::picture::Series;
use trepan_evidence::suite::Findings;
use trepan_geometry::{Pose, Tool, ToolState, Vec3, quantile};
use trepan_rivals::deformable::thesis;

/// Limit of a frame, µs.
const FRAME_US: f64 = 1000.0;
/// Change of force as printed for Figure 4.19, N.
const CHANGE_N: f64 = 0.8;
/// Limit of the thesis's device, N: "never exceeded" by Figure 4.20.
pub const DEVICE_N: f64 = 3.3;
/// Where no tissue is, mm.
const AWAY_MM: f32 = 1e4;
/// The way of a cube's tool, and of the brains' in the figures of time: Path1.
const TIMED_PATH: usize = 0;
/// What the responses are called on charts.
const NAMES: [&str; 3] = ["thesis, as printed", "thesis, nearest face", "ours"];
/// The mesh of a brain is not the thesis's.
const LATTICE: &str = "the brain is meshed by this project's lattice at the printed count";

/// Cubes, brains and force parameters.
pub fn parts() -> Vec<Part> {
    vec![Part::new("tetrahedra cubes", cubes), Part::new("brains", brains), Part::new("brain forces", forces)]
}

/// Times of every frame by the stages of the thesis's method, and ours, µs.
struct Timed {
    name: &'static str,
    fresh: Vec<f64>,
    improved: Vec<f64>,
    rest: Vec<f64>,
    first_stage: Vec<f64>,
    improved_first_stage: Vec<f64>,
    ours: Vec<f64>,
}

fn collision(scene: &Scene, method: Method, response: Option<Response>, cell_mm: Option<f32>) -> TissueCollision {
    let config = Config { method, response, cell_mm, ..Config::default() };
    TissueCollision::new(&scene.mesh, &Tool::probe(RADIUS_MM), &config).expect("the scene is sound")
}

/// Rides a path in some rounds; the least time of each frame counts.
fn timed(name: &'static str, scene: &Scene, cell_mm: f64, tools: &[ToolState], rounds: usize) -> Timed {
    let (positions, still) = (&scene.mesh.positions, vec![Vec3::ZERO; scene.mesh.positions.len()]);
    let mut out = TissueStep::default();
    let mut least = [(); 5].map(|()| vec![f64::INFINITY; tools.len()]);
    for _ in 0..rounds {
        let thesis = || collision(scene, Method::of(&thesis::METHOD), None, Some(cell_mm as f32));
        let (mut forgetful, mut improved) = (thesis(), thesis());
        let mut ours = collision(scene, Method::RECOMMENDED, None, None);
        let mut step = |collision: &mut TissueCollision, tool: &ToolState| {
            let start = Instant::now();
            collision.step(positions, &still, tool, &mut out);
            start.elapsed().as_secs_f64() * 1e6
        };
        for (frame, tool) in tools.iter().enumerate() {
            let away = ToolState::at(Pose::from_translation(Vec3::splat(AWAY_MM)));
            forgetful.reset();
            let times = [
                step(&mut forgetful, tool),
                step(&mut forgetful, tool),
                step(&mut forgetful, &away),
                step(&mut improved, tool),
                step(&mut ours, tool),
            ];
            for (least, time) in least.iter_mut().zip(times) {
                least[frame] = least[frame].min(time);
            }
        }
    }
    let [fresh, again, away, improved, ours] = least;
    let less = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).max(0.0)).collect::<Vec<f64>>();
    let rest = less(&again, &away);
    let (first_stage, improved_first_stage) = (less(&fresh, &rest), less(&improved, &rest));
    Timed { name, fresh, improved, rest, first_stage, improved_first_stage, ours }
}

fn over_models<'a>(all: &'a [Timed], of: impl Fn(&'a Timed) -> &'a Vec<f64>) -> Vec<(String, &'a [f64])> {
    let names: Vec<&str> = all.iter().map(|timed| timed.name).collect();
    lines(&names, all.iter().map(of))
}

fn times(title: impl Into<String>, lines: Vec<(String, &[f64])>) -> Series {
    Series::over_frames(title, "time, µs", lines).limited(FRAME_US, "printed: 1 ms")
}

fn table_row(table: &str, name: &str, [printed, tets]: [f64; 2], why: &str, findings: &mut Findings) {
    let comparison = Comparison::new(table, format!("{name}: tetrahedra"), "");
    findings.rows.push(comparison.printed(Rule::Equal(0.02), printed).ours(tets).why(why).row());
}

/// Compares the slowest, nearly slowest and median frame of a model.
fn frame_times(item: &str, of: &Timed, thesis: &[f64], why: &str, findings: &mut Findings) {
    for (what, share) in SHARES {
        let time = |values: &[f64]| quantile(&mut values.to_vec(), share);
        let comparison = Comparison::new(item, format!("{}: {what}", of.name), "µs");
        let measured = [f64::NAN, time(thesis), time(&of.ours)];
        findings.rows.push(comparison.printed(Rule::Time, FRAME_US).measured(measured).why(why).row());
    }
}

/// What the thesis says of frames over its bound.
fn over_bound(in_time: bool) -> &'static str {
    if in_time { "" } else { "printed: frames over 1 ms" }
}

fn cubes(scope: Scope, findings: &mut Findings) {
    let cells = scope.pick(&[7usize, 13, 22][..], &[7, 13, 22, 30, 40, 50, 60][..]);
    let mut all = Vec::new();
    for (&cells, (name, tets, cell_mm, in_time)) in cells.iter().zip(MODELS) {
        let scene = Scene::cube_at_rest(cells);
        let tools: Vec<ToolState> = scene.tips(&PATHS[TIMED_PATH], scope.pick(150, 600)).into_iter().map(at).collect();
        let of = timed(name, &scene, cell_mm, &tools, 3);
        table_row("Table 4.1", name, [tets as f64, scene.mesh.tets.len() as f64], "", findings);
        let own_mm = f64::from(1.45 * scene.edge_mm);
        let comparison = Comparison::new("Table 4.1", format!("{name}: cell, by 1.45 times the mean edge"), "mm");
        let why = "the cube's edge, 145 mm, was chosen from the printed cells: only ratios between cubes are tested";
        findings.rows.push(comparison.printed(Rule::Equal(0.1), cell_mm).ours(own_mm).why(why).row());
        frame_times("Figure 4.8", &of, &of.fresh, over_bound(in_time), findings);
        all.push(of);
    }
    let series = &mut findings.series;
    series.push(times("Figure 4.8: cubes, the thesis's method", over_models(&all, |of| &of.fresh)));
    series.push(times("Figure 4.8: cubes, ours", over_models(&all, |of| &of.ours)));
    let dearest = all.iter().filter(|of| ["Cube4", "Cube5"].contains(&of.name));
    let shown: Vec<&Timed> = if scope.quick { all.last().into_iter().collect() } else { dearest.collect() };
    for of in &shown {
        let stacked = lines(&["first stage", "first stage and rest"], [&of.first_stage, &of.fresh]);
        findings.series.push(times(format!("Figure 4.9: {}, stacked", of.name), stacked));
    }
    for of in &shown {
        let apart = lines(&["first stage", "rest"], [&of.first_stage, &of.rest]);
        findings.series.push(times(format!("Figure 4.10: {}, apart", of.name), apart));
        let share = of.first_stage.iter().sum::<f64>() / of.fresh.iter().sum::<f64>();
        let comparison = Comparison::new("Figure 4.9", format!("{}: share of the first stage", of.name), "");
        let why = "printed: the first stage is the bottleneck, over half";
        findings.rows.push(comparison.printed(Rule::More, 0.5).measured([f64::NAN, share, f64::NAN]).why(why).row());
        let comparison = Comparison::new("Figure 4.10", format!("{}: rest, 99 % of frames", of.name), "µs");
        let rest = [f64::NAN, quantile(&mut of.rest.clone(), 0.99), f64::NAN];
        findings.rows.push(comparison.printed(Rule::Time, FRAME_US).measured(rest).row());
    }
    findings.series.push(times("Figure 4.11: cubes, first stage", over_models(&all, |of| &of.first_stage)));
    for of in &all {
        let comparison = Comparison::new("Figure 4.11", format!("{}: first stage, median frame", of.name), "µs");
        let [stage, ours] = [&of.first_stage, &of.ours].map(|values| quantile(&mut values.clone(), 0.5));
        let why = "ours is the whole frame";
        findings.rows.push(comparison.measured([f64::NAN, stage, ours]).why(why).row());
    }
}

fn at(tip: Vec3) -> ToolState {
    ToolState::at(Pose::from_translation(tip))
}

fn brains(scope: Scope, findings: &mut Findings) {
    let tools = path(PATH_FILES[TIMED_PATH]);
    let tools: Vec<ToolState> = tools.iter().step_by(scope.pick(15, 2)).copied().collect();
    let mut all = Vec::new();
    for (name, tets, cell_mm, in_time) in MODELS.into_iter().filter(|model| model.0.starts_with("Brain")) {
        if scope.quick && tets > TETS {
            continue;
        }
        let scene = Scene::brain_at_rest(tets);
        table_row("Table 4.2", name, [tets as f64, scene.mesh.tets.len() as f64], LATTICE, findings);
        let of = timed(name, &scene, cell_mm, &tools, 3);
        frame_times("Figure 4.12", &of, &of.fresh, over_bound(in_time), findings);
        frame_times("Figure 4.13", &of, &of.improved, "printed: single frames over 1 ms", findings);
        if ["Brain3", "Brain5"].contains(&name) {
            let title = format!("Figure 4.14: {name}, first stage");
            let both = lines(
                &["initial", "improved", "ours, whole frame"],
                [&of.first_stage, &of.improved_first_stage, &of.ours],
            );
            findings.series.push(times(title, both));
            let comparison = Comparison::new("Figure 4.14", format!("{name}: first stage, sum over all frames"), "µs");
            let sums = [&of.first_stage, &of.improved_first_stage, &of.ours].map(|values| values.iter().sum());
            let why = "as printed is the initial search, put right the improved one, ours the whole frame";
            findings.rows.push(comparison.measured(sums).why(why).row());
        }
        all.push(of);
    }
    let more = [
        times("Figure 4.12: brains, the thesis's initial search", over_models(&all, |of| &of.fresh)),
        times("Figure 4.12: brains, ours", over_models(&all, |of| &of.ours)),
        times("Figure 4.13: brains, the thesis's improved search", over_models(&all, |of| &of.improved)),
    ];
    findings.series.extend(more);
}

/// What one response gave, frame by frame.
struct ResponseTrace {
    depth_mm: Vec<f64>,
    normals: Vec<Vec3>,
    forces: Vec<Vec3>,
}

fn felt(scene: &Scene, method: Method, response: Option<Response>, tools: &[ToolState]) -> ResponseTrace {
    let (positions, still) = (&scene.mesh.positions, vec![Vec3::ZERO; scene.mesh.positions.len()]);
    let mut collision = collision(scene, method, response, None);
    let (mut model, mut out) = (Viscoelastic::BRAIN, TissueStep::default());
    let mut felt = ResponseTrace { depth_mm: Vec::new(), normals: Vec::new(), forces: Vec::new() };
    for tool in tools {
        collision.step(positions, &still, tool, &mut out);
        felt.depth_mm.push(out.manifold.depth_mm.into());
        felt.normals.push(if out.manifold.touches() { out.manifold.normal } else { Vec3::ZERO });
        felt.forces.push(model.wrench(tool, &out.manifold, 1.0).force);
    }
    felt
}

/// The three methods along a path.
fn all_felt(scene: &Scene, tools: &[ToolState]) -> [ResponseTrace; 3] {
    let thesis = Method::of(&thesis::METHOD);
    let all = [(thesis, None), (thesis, Some(Response::NearestFace)), (Method::RECOMMENDED, None)];
    all.map(|(method, response)| felt(scene, method, response, tools))
}

fn forces(scope: Scope, findings: &mut Findings) {
    let paths = PATH_FILES.map(path);
    let models: Vec<(&str, Scene)> = [("Brain2", 12_511), ("Brain3", TETS), ("Brain4", 40_584)]
        .map(|(name, tets)| (name, Scene::brain_at_rest(tets)))
        .into();
    for (number, (tools, file)) in paths.iter().zip(PATH_FILES).enumerate() {
        let (item, name) = (format!("Figure 4.{}", 15 + number), format!("Path{}", number + 1));
        let comparison = Comparison::new("Table 4.3", format!("{name}, {file}: frames"), "");
        findings.rows.push(comparison.printed(Rule::Equal(0.0), 3000.0).ours(tools.len() as f64).row());
        let shown = &tools[..scope.pick(tools.len() / 3, tools.len())];
        let of_models: Vec<[ResponseTrace; 3]> = models.iter().map(|(_, scene)| all_felt(scene, shown)).collect();
        parameters(&item, &name, &of_models[1], findings);
        depths(&name, &models, &of_models, findings);
        variation(&name, &of_models[1], findings);
        if number == 2 {
            viscoelastic(&of_models[1], findings);
        }
    }
}

fn parameters(item: &str, path: &str, felt: &[ResponseTrace; 3], findings: &mut Findings) {
    for method in [0, 2] {
        let title = format!("{item}: normal, Brain3, {path}, {}", NAMES[method]);
        let axes = [0, 1, 2].map(|n| axis(&felt[method].normals, n));
        findings.series.push(Series::over_frames(title, "normal", lines(&["x", "y", "z"], &axes)));
    }
    let title = format!("{item}: depth, Brain3, {path}");
    let depths = lines(&NAMES, felt.iter().map(|felt| &felt.depth_mm));
    findings.series.push(Series::over_frames(title, "depth, mm", depths));
    let comparison = Comparison::new(item, "turn of the normal in a frame, 99 % of frames", "degrees");
    let turns = [0, 1, 2].map(|method| turn_deg(&felt[method].normals));
    findings.rows.push(comparison.measured(turns).why(LATTICE).row());
}

fn depths(path: &str, models: &[(&str, Scene)], felt: &[[ResponseTrace; 3]], findings: &mut Findings) {
    for method in [0, 2] {
        let names: Vec<&str> = models.iter().map(|(name, _)| *name).collect();
        let title = format!("Figure 4.18: depth, {path}, {}", NAMES[method]);
        let depths = lines(&names, felt.iter().map(|felt| &felt[method].depth_mm));
        findings.series.push(Series::over_frames(title, "depth, mm", depths));
    }
    for ((name, _), felt) in models.iter().zip(felt) {
        let comparison =
            Comparison::new("Figure 4.18", format!("{name}, {path}: largest change of depth in a frame"), "mm");
        let worst = [0, 1, 2].map(|method| most(&changes(&felt[method].depth_mm)));
        findings.rows.push(comparison.measured(worst).row());
    }
}

fn variation(path: &str, felt: &[ResponseTrace; 3], findings: &mut Findings) {
    let stiffness = f64::from(Viscoelastic::BRAIN.stiffness);
    let varied =
        felt.each_ref().map(|felt| changes(&felt.depth_mm.iter().map(|depth| stiffness * depth).collect::<Vec<f64>>()));
    let title = format!("Figure 4.19: change of k times depth, Brain3, {path}");
    findings.series.push(Series::over_frames(title, "force, N", lines(&NAMES, &varied)));
    let comparison = Comparison::new("Figure 4.19", format!("{path}: largest change of k times depth in a frame"), "N");
    findings.rows.push(comparison.printed(Rule::Less, CHANGE_N).measured(varied.map(|values| most(&values))).row());
}

fn viscoelastic(felt: &[ResponseTrace; 3], findings: &mut Findings) {
    let lengths = felt.each_ref().map(|felt| felt.forces.iter().map(|f| f64::from(f.length())).collect::<Vec<f64>>());
    for method in [0, 2] {
        let axes = [0, 1, 2].map(|n| axis(&felt[method].forces, n));
        let all = lines(&["x", "y", "z", "modulus"], axes.iter().chain([&lengths[method]]));
        let title = format!("Figure 4.20: viscoelastic force, Brain3, Path3, {}", NAMES[method]);
        findings.series.push(Series::over_frames(title, "force, N", all));
        let varied = axes.each_ref().map(|values| changes(values));
        let title = format!("Figure 4.21: change of the viscoelastic force, Brain3, Path3, {}", NAMES[method]);
        findings.series.push(Series::over_frames(title, "force, N", lines(&["x", "y", "z"], &varied)));
    }
    let worst = lengths.map(|values| most(&values));
    let comparison = Comparison::new("Figure 4.20", "largest viscoelastic force", "N").printed(Rule::Less, DEVICE_N);
    findings.rows.push(comparison.measured(worst).why("printed: the device's limit is never reached").row());
    let by_axis =
        |felt: &ResponseTrace| (0..3).map(|n| most(&changes(&axis(&felt.forces, n)))).fold(f64::NAN, f64::max);
    let quantity = "largest change of the viscoelastic force on an axis in a frame";
    let comparison = Comparison::new("Figure 4.21", quantity, "N").measured(felt.each_ref().map(by_axis));
    findings.rows.push(comparison.row());
}
