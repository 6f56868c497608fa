//! How tissue classes enter the tetrahedra: with borders of their own, by their shares, or not.
//!
//! # Theory
//! A ball is pressed into the built-in brain at its planned opening, at rest, on meshes from coarse
//! to fine. The truth is the finest mesh whose classes all have borders; the finest one with shares
//! tells how sure it is. Shares are mixed by Reuss's, Hill's and Voigt's mean. What a coarse mesh
//! gets wrong anyway, it gets wrong without classes, too: the same mesh of one material against the
//! finest of one material is the floor.
//!
//! # Practice
//! The law fitted to human brain, whose grey matter is stiffer than white, with locking-free
//! elements, as `auto` has them. The ball's springs press along one normal (`outside.rs`); at 3 mm
//! with a radius of 5 mm no surface creases.

use super::Scope;
use crate::engine::picture::Series;
use crate::engine::suite::{Findings, Gate, Row};
use crate::suites::simulators::case;
use anyhow::{Context, Result};
use trepan_contact::NodalContacts;
use trepan_geometry::Vec3;
use trepan_mesh::lattice::{Config, Domain, LabelledMesh};
use trepan_simulator::measure::tissue::{Fineness, MASS_ADDED, PressedBall, Surroundings, disc, fixed_nodes};
use trepan_simulator::{Cache, Program, Scene, TissueClass, body_of, open_case};
use trepan_soft::{Body, Bound, Loads, SoftSolver};
use trepan_tled::{Settling, Tled};
use trepan_volume::VoxelVolume;

const SCENE: &str = "built-in brain with its classes pressed 3 mm by a ball";
/// Sizes of the meshes, and of the truth, in a quick run and in a full one.
const SIZES: (&[usize], &[usize]) = (&[3_000, 8_000], &[3_000, 8_000, 12_000, 20_000, 40_000]);
const TRUTH: (usize, usize) = (20_000, 80_000);
/// The size of the preset `usual`.
const USUAL: usize = 8_000;
/// Radius and depth of the ball, mm.
const BALL_MM: [f32; 2] = [5.0, 3.0];
/// Young's modulus of brain, MPa: the programs' default.
const BRAIN_MPA: f32 = 0.003;
/// Places whose displacement is compared, and how far around the ball, mm.
const LOOKS: (u32, f32) = (60, 15.0);
/// End of the press, and steps to get there.
const REST: Settling = Settling { tolerance_mm: 0.003, steps: 600 };
/// In how many stages the ball goes in.
const STAGES: u8 = 6;

/// How classes enter a mesh.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    /// All of them have borders.
    Conforming,
    /// What is thin enters by shares.
    Mixed(Bound),
    /// None.
    Absent,
}

impl Way {
    const ALL: [Self; 5] = [
        Self::Conforming,
        Self::Mixed(Bound::Reuss),
        Self::Mixed(Bound::Hill),
        Self::Mixed(Bound::Voigt),
        Self::Absent,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Conforming => "conforming",
            Self::Mixed(Bound::Reuss) => "mixed (Reuss)",
            Self::Mixed(Bound::Hill) => "mixed (Hill)",
            Self::Mixed(Bound::Voigt) => "mixed (Voigt)",
            Self::Absent => "absent",
        }
    }
}

/// The brain and where it is pressed.
struct Pressed {
    domain: Domain,
    place: Vec3,
    normal: Vec3,
}

/// What a press gives: the force, N, and where the places go, mm.
struct Answer {
    tets: usize,
    force_n: f64,
    moved: Vec<Vec3>,
    converged: bool,
}

impl Pressed {
    fn new() -> Result<Self> {
        let case = open_case(Program::Integrated, &case::inputs(), &case::recipe(), &Cache::of_user()?)?;
        let scene = Scene::new(Program::Integrated, case)?;
        let brain = scene.brain.context("the built-in case has a brain")?;
        let (site, normal) = (scene.site, -scene.site.inward);
        let place = site.entry + site.brain_mm * site.inward;
        let labels: VoxelVolume<u16> = brain.classes.map(u16::from);
        let domain = Domain::of(&labels, &Config { target_tets: SIZES.0[0], ..Config::default() })?;
        Ok(Self { domain, place, normal })
    }

    fn body(&self, way: Way, tets: usize) -> Result<Body> {
        let least_thickness = match way {
            Way::Conforming => 0.0,
            Way::Mixed(_) => Config::default().least_thickness,
            Way::Absent => f64::INFINITY,
        };
        let fine = Fineness::stepped(tets, 4).fine(self.place, self.normal);
        let labelled = self.domain.labelled(&Config { least_thickness, ..Config::with_opening(tets, fine) })?;
        let fixed = fixed_nodes(&labelled.mesh);
        let of_classes = TissueClass::ALL.map(|class| class.stiffening(BRAIN_MPA)).to_vec();
        if way == Way::Absent {
            let LabelledMesh { mesh, .. } = labelled;
            return Ok(Body::uniform(mesh, fixed, of_classes[TissueClass::Brain as usize]));
        }
        let bound = if let Way::Mixed(bound) = way { bound } else { Bound::Hill };
        Ok(body_of(&labelled, of_classes, bound, fixed))
    }

    fn press(&self, way: Way, tets: usize) -> Result<Answer> {
        let body = self.body(way, tets)?;
        let surface = Surroundings::of(&body.mesh, self.place)?;
        let middle = surface.at(surface.under(self.place).1);
        let [radius_mm, depth_mm] = BALL_MM;
        let config = trepan_tled::Config {
            mass_scaling: MASS_ADDED,
            averaged_pressure: true,
            threads: 2,
            ..trepan_tled::Config::default()
        };
        let mut solver = Tled::new(&body, &config)?;
        let mut loads = Loads { contacts: NodalContacts::with_room(), ..Loads::default() };
        let mut converged = false;
        for stage in 1..=STAGES {
            let depth_mm = depth_mm * f32::from(stage) / f32::from(STAGES);
            PressedBall { middle, normal: self.normal, radius_mm, depth_mm }.press(&surface, &mut loads.contacts);
            converged = solver.settle(&loads, &REST).converged;
        }
        let at = |n: u32| solver.positions()[n as usize] - body.mesh.positions[n as usize];
        let moved = disc(LOOKS.1, LOOKS.0, self.normal).map(|aside| {
            let (_, nodes) = surface.under(middle + aside);
            nodes.into_iter().map(|(n, weight)| weight * at(n)).sum()
        });
        Ok(Answer {
            tets: body.mesh.tets.len(),
            force_n: PressedBall::force_n(&loads.contacts, solver.positions()),
            moved: moved.collect(),
            converged,
        })
    }
}

/// Presses every mesh.
pub fn run(scope: Scope, findings: &mut Findings) {
    if let Err(fault) = judged(scope, findings) {
        findings.rows.push(Row::new(SCENE, "not run").with("fault", format!("{fault:#}")));
        findings.gates.push(Gate::at_most(format!("{SCENE}: not run"), 1.0, 0.0));
    }
}

fn judged(scope: Scope, findings: &mut Findings) -> Result<()> {
    let pressed = Pressed::new()?;
    let finest = scope.pick(TRUTH.0, TRUTH.1);
    let truth = pressed.press(Way::Conforming, finest)?;
    let of_one = pressed.press(Way::Absent, finest)?;
    let mut unsettled = usize::from(!truth.converged) + usize::from(!of_one.converged);
    for (at, &tets) in scope.pick(SIZES.0, SIZES.1).iter().chain([&finest]).enumerate() {
        let is_finest = at == scope.pick(SIZES.0, SIZES.1).len();
        for way in Way::ALL.into_iter().filter(|way| !is_finest || matches!(way, Way::Mixed(_))) {
            let answer = pressed.press(way, tets)?;
            unsettled += usize::from(!answer.converged);
            let [force, displacement] = errors_percent(&answer, &truth);
            findings.rows.push(row(way, &answer, [force, displacement]));
            if way == Way::Mixed(Bound::Hill) && (tets == USUAL || is_finest) {
                let size = if is_finest { "of the truth's size" } else { "of the size of `usual`" };
                for (what, error) in [("force", force), ("displacement", displacement)] {
                    let name = format!("{SCENE}, mixed (Hill) {size}: {what} error, percent");
                    findings.gates.push(Gate::at_most(name, error.abs(), 5.0));
                }
            }
            if way == Way::Absent {
                findings.rows.push(
                    Row::new(SCENE, "floor (one material)")
                        .with("tets", answer.tets)
                        .metric("force_error_percent", errors_percent(&answer, &of_one)[0]),
                );
            }
        }
    }
    findings.rows.push(row(Way::Conforming, &truth, [0.0; 2]));
    findings.gates.push(Gate::at_most(format!("{SCENE}: presses not at rest"), unsettled as f64, 0.0));
    Ok(())
}

/// Error of the force with its sign, and of the displacements, percent.
fn errors_percent(answer: &Answer, truth: &Answer) -> [f64; 2] {
    let apart: f32 = answer.moved.iter().zip(&truth.moved).map(|(a, b)| a.distance_squared(*b)).sum();
    let all: f32 = truth.moved.iter().map(|moved| moved.length_squared()).sum();
    [100.0 * (answer.force_n / truth.force_n - 1.0), 100.0 * f64::from((apart / all).sqrt())]
}

fn row(way: Way, answer: &Answer, [force, displacement]: [f64; 2]) -> Row {
    Row::new(SCENE, way.name())
        .with("tets", answer.tets)
        .metric("force_n", answer.force_n)
        .metric("force_error_percent", force)
        .metric("displacement_error_percent", displacement)
}

/// Draws force and error of the displacements over the number of tetrahedra.
pub fn draw(findings: &mut Findings) {
    let line = |way: Way, metric: &str| {
        let of_way = findings.rows.iter().filter(|row| row.scene == SCENE && row.method == way.name());
        let point = |row: &Row| Some((row.config.get("tets")?.as_f64()?, row.metrics.get(metric).copied()?));
        (way.name().to_string(), of_way.filter_map(point).collect::<Vec<_>>())
    };
    for (metric, axis) in [("force_n", "force, N"), ("displacement_error_percent", "displacement error, %")] {
        let series = Series::over(SCENE, ["tetrahedra", axis], Way::ALL.map(|way| line(way, metric)));
        if series.is_drawn() {
            findings.series.push(series);
        }
    }
}
