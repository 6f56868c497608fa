//! Compares TLED and the solvers of `trepan-soft` with soft bodies of other programs on one block:
//! error against computing time.
//!
//! # Theory
//! A block of 60x20x20 mm of brain (neo-Hookean, 3 kPa, ν 0.45) is clamped at one end and hangs
//! under a tenth of gravity. The truth is the continuum's rest: quadratic displacements and linear
//! pressure by scikit-fem on a finer mesh (`fixtures/fem/hang.jsonl`). The error is the root mean
//! square over three places of the distance from there, as a share of the way. A run is at rest
//! from the first sample after which all stay within `STILL_PERCENT` of the last one, which must
//! be in the first four fifths of the time.
//!
//! # Practice
//! Every program steps the same tetrahedra with every setting of its script; each is charted with
//! all of them, so that its best counts. Programs run one after the other in Python environments of
//! their own, which go afterwards; one that cannot be fetched gives a row `not run`. Time is that
//! of the processor, since other work on the machine changes it less, for one thread; the wall's
//! time stands in the rows. Only TLED and scikit-fem's factorisation have threads: these run with
//! two as well. MuJoCo, Newton on the processor and PyBullet have one.
//!
//! On one mesh all linear tetrahedra have the same rest, so that their errors hardly differ; only
//! averaged nodal pressure and quadratic elements are nearer. Vertex block descent that has not
//! converged sags further and can seem nearer than its mesh allows.
//!
//! Laws: MuJoCo has St. Venant-Kirchhoff and the stable neo-Hookean law, Newton and PyBullet the
//! latter; scikit-fem that of TLED. At these strains they differ by some 2 % of the way.
//!
//! Liberties, each in favour of the other program:
//! - MuJoCo and PyBullet damp in proportion to stiffness only. MuJoCo gets what is critical for the
//!   lowest mode, PyBullet the best of three.
//! - MuJoCo gives all nodes the same mass; its script sets them by volume, as in TLED. PyBullet
//!   gives all nodes the same mass and has no way to set them.
//! - Newton damps no mass; its script does, as TLED. Every launch of a kernel costs Python's time.
//! - Compiling and loading do not count. scikit-fem goes straight to rest on meshes of its own, and
//!   its time holds the making of the mesh.
//!
//! # Sources
//! Smith, de Goes, Kim, ACM Trans. Graph. 37 (2018), stable neo-Hookean flesh simulation, section
//! 3.4: `μ = 4/3 μ_Lamé`, `λ = λ_Lamé + 5/6 μ_Lamé` give its law the moduli at small strain.

mod ours;

use crate::tled::outside;
use anyhow::{Context, Result};
use serde::Deserialize;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::picture::{Chart, Mark, Table};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Vec3, units};
use trepan_mesh::TetMesh;
use trepan_soft::{Body, Material, boxes};
use trepan_trials_scenes::python::Workshop;

const BLOCK_MM: Vec3 = Vec3::new(60.0, 20.0, 20.0);
/// Share of earth's gravity.
const GRAVITY_SHARE: f32 = 0.1;
/// Simulated time, ms.
const SIMULATED_MS: f64 = 2500.0;
/// Processor's time after which a run is given up, s.
const LONGEST_S: [f64; 2] = [10.0, 120.0];
/// Distance from the last sample at which a block is at rest, percent of the way.
const STILL_PERCENT: f64 = 1.0;
/// Longest step that still shows motion, ms: that of a picture.
const PICTURE_MS: f64 = 17.0;
/// Errors at which the programs are compared, percent.
const LIMITS: [f64; 3] = [20.0, 10.0, 5.0];

/// Displacement of the watched places, mm.
type Places = [[f64; 3]; 3];

/// A program that others wrote.
struct Program {
    name: &'static str,
    /// Name to import and name in the index.
    packages: &'static [(&'static str, &'static str)],
    script: &'static str,
    threads: &'static [usize],
    /// Whether it makes its own meshes, so that one run covers all sizes.
    own_meshes: bool,
}

const PROGRAMS: [Program; 4] = [
    Program {
        name: "MuJoCo",
        packages: &[("mujoco", "mujoco"), ("numpy", "numpy")],
        script: concat!(include_str!("common.py"), include_str!("mujoco.py")),
        threads: &[1],
        own_meshes: false,
    },
    Program {
        name: "Newton",
        packages: &[("newton", "newton"), ("warp", "warp-lang"), ("numpy", "numpy")],
        script: concat!(include_str!("common.py"), include_str!("newton.py")),
        threads: &[1],
        own_meshes: false,
    },
    Program {
        name: "PyBullet",
        packages: &[("pybullet", "pybullet"), ("numpy", "numpy")],
        script: concat!(include_str!("common.py"), include_str!("pybullet.py")),
        threads: &[1],
        own_meshes: false,
    },
    Program {
        name: SCIKIT_FEM,
        packages: &[("skfem", "scikit-fem"), ("scipy", "scipy"), ("pypardiso", "pypardiso"), ("numpy", "numpy")],
        script: concat!(include_str!("common.py"), include_str!("scikit_fem.py")),
        threads: &[1, 2],
        own_meshes: true,
    },
];

const SCIKIT_FEM: &str = "scikit-fem";

/// Helper of the scikit-fem script: the program that made the truth.
const TAYLOR_HOOD: &str = include_str!("../../../../../fixtures/fem/taylor_hood.py");

/// A program with one setting on one mesh.
#[derive(Deserialize)]
struct Run {
    setting: String,
    /// Step, ms; none without motion.
    dt_ms: Option<f64>,
    /// Why it could not do it.
    fault: Option<String>,
    samples: Vec<Sample>,
}

/// A moment of a run.
#[derive(Deserialize)]
struct Sample {
    simulated_ms: f64,
    wall_ms: f64,
    cpu_ms: f64,
    moved_mm: Places,
}

/// A line of a reference solution.
#[derive(Deserialize)]
struct Solution {
    /// Cells across.
    n: usize,
    moved_mm: Places,
}

/// The rest of the block by the independent code, coarser mesh first.
fn truth() -> Result<Vec<Solution>> {
    let path = trepan_fixtures::reference_solution("hang");
    let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    text.lines().map(|line| serde_json::from_str(line).context("a line of hang.jsonl")).collect()
}

/// Distance of the places from the truth as a share of their way, percent.
fn error_percent(found: &Places, truth: &Places) -> f64 {
    let pairs = found.iter().flatten().zip(truth.iter().flatten());
    let apart: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
    100.0 * (apart / truth.iter().flatten().map(|b| b * b).sum::<f64>()).sqrt()
}

impl Run {
    /// The first moment from which on every place stays near its last one.
    fn rest(&self) -> Option<&Sample> {
        let last = self.samples.last()?;
        let near = |sample: &Sample| error_percent(&sample.moved_mm, &last.moved_mm) <= STILL_PERCENT;
        let still = self.samples.iter().rev().take_while(|sample| near(sample)).last();
        still.filter(|rest| self.dt_ms.is_none() || rest.simulated_ms <= 0.8 * SIMULATED_MS)
    }

    fn row(&self, scene: &str, program: &str, truth: &Places) -> Row {
        let mut row = Row::new(scene, format!("{program}: {}", self.setting).trim_end_matches(": "));
        if let Some(dt_ms) = self.dt_ms {
            row = row.with("dt_ms", dt_ms);
        }
        let Some(last) = self.samples.last() else {
            return row.with("fault", self.fault.as_deref().unwrap_or("says nothing"));
        };
        row = row.metric("displacement_error_percent", error_percent(&last.moved_mm, truth));
        if self.dt_ms.is_some() {
            row = row.metric("cpu_per_simulated_ratio", last.cpu_ms / last.simulated_ms);
        }
        match self.rest() {
            Some(rest) => row.metric("cpu_to_rest_ms", rest.cpu_ms).metric("wall_to_rest_ms", rest.wall_ms),
            None if last.simulated_ms < SIMULATED_MS - 1.0 => row.with("fault", "gives up: too slow"),
            None => row.with("fault", "does not come to rest"),
        }
    }
}

/// The block with that many cells across, and the nodes at the watched places.
fn block(across: usize) -> (Body, [u32; 3]) {
    let mesh = boxes::split_box([3 * across, across, across], BLOCK_MM);
    let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
    let watched = [60.0, 40.0, 20.0].map(|x| {
        let near = |n: &u32| mesh.positions[*n as usize].distance(Vec3::new(x, 10.0, 10.0));
        (0..mesh.positions.len() as u32).min_by(|a, b| near(a).total_cmp(&near(b))).unwrap_or_default()
    });
    (Body::uniform(mesh, fixed, Material::BRAIN), watched)
}

fn scene_name(mesh: &TetMesh) -> String {
    format!("hanging block, {} tetrahedra", mesh.tets.len())
}

/// Every program, and our solvers.
pub fn parts(_: Scope) -> Vec<Part> {
    let theirs = PROGRAMS.iter().map(|program| {
        Part::new(program.name, move |scope, findings| {
            if let Err(fault) = theirs(program, scope, findings) {
                println!("  {} is not run: {fault:#}", program.name);
                findings.rows.push(Row::new("hanging block", program.name).with("not run", format!("{fault:#}")));
            }
        })
    });
    let ours = Part::new("ours", |scope, findings| {
        ours::run(scope, &truth().expect("the fixture is there"), findings);
    });
    let truth = Part::new("truth of the press", |scope, findings| {
        if let Err(fault) = recompute_press(scope, findings) {
            println!("  the truth of the press is not recomputed: {fault:#}");
            findings.rows.push(Row::new("pressed by a ball", SCIKIT_FEM).with("not run", format!("{fault:#}")));
        }
    });
    std::iter::once(ours).chain(theirs).chain([truth]).collect()
}

/// Computes `fixtures/fem/press.jsonl` again, coarser meshes only in a quick run.
fn recompute_press(scope: Scope, findings: &mut Findings) -> Result<()> {
    let stored = outside::Solution::stored()?;
    let program = PROGRAMS.iter().find(|program| program.name == SCIKIT_FEM).context("it is listed")?;
    let workshop = Workshop::with(program.packages, include_str!("../../../../../fixtures/fem/press.py"))?;
    std::fs::write(workshop.at("taylor_hood.py"), TAYLOR_HOOD)?;
    for export in outside::exports()?.iter().filter(|export| !scope.quick || export.name.ends_with("coarser")) {
        std::fs::write(workshop.at("scene.json"), export.json.to_string())?;
        for found in outside::Solution::all(&workshop.run(["scene.json"])?)? {
            let alike = |one: &&outside::Solution| one.scene == found.scene && one.tets == found.tets;
            let one = stored.iter().find(alike).with_context(|| format!("press.jsonl lacks {}", export.name))?;
            let displacement = one.error_percent(found.moved_mm.iter().map(|&moved| Vec3::from_array(moved)));
            let force = 100.0 * (found.force_n / one.force_n - 1.0).abs();
            let row = Row::new(&found.scene, SCIKIT_FEM).with("tets", found.tets);
            findings.rows.push(
                row.with("versions", workshop.versions.as_str())
                    .metric("force_n", found.force_n)
                    .metric("off_fixture_displacement_percent", displacement)
                    .metric("off_fixture_force_percent", force),
            );
            let name = format!("{}: recomputed, off the fixture, percent", export.name);
            findings.gates.push(Gate::at_most(name, displacement.max(force), 0.1));
        }
    }
    Ok(())
}

/// Cells across the block.
fn sizes(scope: Scope) -> &'static [usize] {
    scope.pick(&[2, 4], &[2, 4, 6, 8])
}

fn theirs(program: &'static Program, scope: Scope, findings: &mut Findings) -> Result<()> {
    let truth = truth()?;
    let finest = &truth.last().context("the fixture is empty")?.moved_mm;
    let workshop = Workshop::with(program.packages, program.script)?;
    std::fs::write(workshop.at("taylor_hood.py"), TAYLOR_HOOD)?;
    let sizes = if program.own_meshes { &sizes(scope)[..1] } else { sizes(scope) };
    for &across in sizes {
        let (body, watched) = block(across);
        let rate = trepan_tled::Tled::new(&body, &Default::default())?.damping_per_ms();
        let scene = serde_json::json!({
            "positions_mm": body.mesh.positions.iter().map(|p| p.to_array()).collect::<Vec<_>>(), "tets": body.mesh.tets, "fixed": body.fixed, "watched": watched,
            "young_mpa": Material::BRAIN.young_mpa(), "poisson": Material::BRAIN.poisson(),
            "density_g_mm3": Material::BRAIN.density_g_mm3(), "damping_per_ms": rate,
            "gravity_mm_per_ms2": -GRAVITY_SHARE * units::GRAVITY_MM_PER_MS2,
            "simulated_ms": SIMULATED_MS, "longest_s": scope.pick(LONGEST_S[0], LONGEST_S[1]),
            "implicit_cells": scope.pick(&[1, 2, 4][..], &[1, 2, 4, 6, 8][..]),
        });
        std::fs::write(workshop.at("scene.json"), scene.to_string())?;
        for threads in program.threads {
            let output = workshop.run(["scene.json", &threads.to_string()])?;
            for line in output.lines().filter(|line| line.starts_with('{')) {
                let run: Run = serde_json::from_str(line)?;
                let name = if program.own_meshes { "hanging block, own meshes".into() } else { scene_name(&body.mesh) };
                let row = run.row(&name, program.name, finest).with("threads", *threads);
                findings.rows.push(row.with("versions", workshop.versions.as_str()));
                if let (true, Some(found)) = (program.own_meshes, run.samples.last()) {
                    check_fixture(&run.setting, &found.moved_mm, &truth, findings);
                }
            }
        }
    }
    Ok(())
}

/// The stored truth is what its program says now, and its own error is small.
fn check_fixture(setting: &str, found: &Places, truth: &[Solution], findings: &mut Findings) {
    let Some(one) = truth.iter().find(|one| setting == format!("{} cells across", one.n)) else { return };
    let name = format!("hanging block, {setting}: recomputed, off the fixture, percent");
    findings.gates.push(Gate::at_most(name, error_percent(found, &one.moved_mm), 1e-3));
    if let [.., coarser, finest] = truth {
        let apart = error_percent(&coarser.moved_mm, &finest.moved_mm);
        findings.gates.push(Gate::at_most("hanging block: two meshes of the truth apart, percent", apart, 1.0));
    }
}

/// Charts, and for each program its least time within an error.
pub fn judge(_: Scope, findings: &mut Findings) {
    let single = |row: &&Row| row.config.get("threads").is_none_or(|threads| threads == 1);
    let chart = |title: &str, cost: &str, rows: &[&Row]| Chart {
        title: title.into(),
        cost: cost.into(),
        error: ERROR.into(),
        marks: rows
            .iter()
            .filter_map(|row| {
                let mark = (row.metrics.get(cost)?, row.metrics.get(ERROR)?);
                Some(Mark { method: row.method.clone(), cost: *mark.0, error: *mark.1 })
            })
            .collect(),
        ..Chart::default()
    };
    let rows: Vec<&Row> = findings.rows.iter().filter(single).collect();
    let moving: Vec<&Row> = rows
        .iter()
        .copied()
        .filter(|row| row.config.get("dt_ms").and_then(|dt| dt.as_f64()).is_some_and(|dt| dt <= PICTURE_MS))
        .collect();
    let charts = [
        chart("A block hangs down: error over the time to rest, one thread", "cpu_to_rest_ms", &rows),
        chart(
            "A block hangs down: error over the time for each simulated one, steps of at most a picture, one thread",
            "cpu_per_simulated_ratio",
            &moving,
        ),
    ];
    findings.tables.extend(charts.iter().map(least_costs));
    findings.charts.extend(charts);
}

/// Least cost of each program within each error.
fn least_costs(chart: &Chart) -> Table {
    let within = |method: &str, limit: f64| {
        let marks = chart.marks.iter().filter(|mark| program(&mark.method) == method && mark.error <= limit);
        let least = marks.min_by(|a, b| a.cost.total_cmp(&b.cost));
        least.map_or("never".to_string(), |mark| format!("{:.4} ({})", mark.cost, mark.method))
    };
    let row = |method: &str| {
        std::iter::once(method.to_string()).chain(LIMITS.iter().map(|limit| within(method, *limit))).collect()
    };
    Table {
        title: format!("Least {} within an error", chart.cost.replace('_', " ")),
        columns: std::iter::once("program".to_string())
            .chain(LIMITS.iter().map(|limit| format!("{limit} %")))
            .collect(),
        rows: methods(chart).into_iter().map(row).collect(),
    }
}

const ERROR: &str = "displacement_error_percent";

/// The program of a method's name.
fn program(method: &str) -> &str {
    method.split(": ").next().unwrap_or(method)
}

fn methods(chart: &Chart) -> Vec<&str> {
    let mut names: Vec<&str> = chart.marks.iter().map(|mark| program(&mark.method)).collect();
    names.sort_unstable();
    names.dedup();
    names
}
