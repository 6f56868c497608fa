//! How tissue classes enter the tetrahedra: with borders of their own, by their shares, or not.
//!
//! # Theory
//! A ball is pressed into the built-in brain at its planned opening, at rest. What counts is the
//! force over that of brain without classes on the same mesh, so that what the mesh gets wrong
//! anyway cancels. The truth is a mesh with borders between all classes and elements of about 2 mm
//! for 30 mm around; shares on that mesh tell how sure it is. Shares are mixed by four
//! bounds. Borders on a coarse mesh are no truth: elements of 10 mm get the class of a
//! point.
//!
//! # Practice
//! The law fitted to human brain, whose grey matter is stiffer than white, with locking-free
//! elements, as `auto` has them, and all bulk moduli rounded as those of mixtures. The ball's
//! springs press along one normal (`outside.rs`); at 3 mm with a radius of 5 mm no surface creases.

use super::Scope;
use super::outside::press_to_rest;
use anyhow::{Context, Result};
use trepan_evidence::picture::Series;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::Vec3;
use trepan_mesh::lattice::{Config, Domain, LabelledMesh};
use trepan_models::measure::tissue::{MASS_ADDED, PressedBall, Surroundings, disc, fixed_nodes};
use trepan_patient::Fineness;
use trepan_patient::{Cache, Scene, TissueClass, body_of, open_case};
use trepan_soft::{Body, Bound, Material, SoftSolver};
use trepan_stages::Program;
use trepan_tled::Tled;
use trepan_trials_scenes::case;
use trepan_volume::VoxelVolume;

const SCENE: &str = "built-in brain with its classes pressed 3 mm by a ball";
/// Sizes of the meshes of sessions in a quick run and in a full one.
const SIZES: (&[usize], &[usize]) = (&[3_000, 8_000], &[3_000, 8_000, 12_000, 20_000]);
/// Size of the truth, and the ball in which it is fine: halvings, radius, height over the surface.
const TRUTH: (usize, usize) = (25_000, 60_000);
const WIDE: (u32, f32, f32) = (3, 30.0, 8.0);
/// The size of the preset `usual`.
const USUAL: usize = 8_000;
/// Radius and depth of the ball, mm.
const BALL_MM: [f32; 2] = [5.0, 3.0];
/// Young's modulus of brain, MPa: the programs' default.
const BRAIN_MPA: f32 = 0.003;
/// Places whose displacement is compared, and how far around the ball, mm.
const LOOKS: (u32, f32) = (60, 15.0);
/// Duration of the press and longest rest after it, ms.
const TIMES_MS: [f32; 2] = [120.0, 2000.0];

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
    const ALL: [Self; 6] = [
        Self::Conforming,
        Self::Mixed(Bound::Reuss),
        Self::Mixed(Bound::Hill),
        Self::Mixed(Bound::HashinShtrikman),
        Self::Mixed(Bound::Voigt),
        Self::Absent,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Conforming => "conforming",
            Self::Mixed(Bound::Reuss) => "mixed (Reuss)",
            Self::Mixed(Bound::Hill) => "mixed (Hill)",
            Self::Mixed(Bound::HashinShtrikman) => "mixed (Hashin-Shtrikman)",
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
#[derive(Clone)]
struct Answer {
    tets: usize,
    force_n: f64,
    moved: Vec<Vec3>,
    at_rest: bool,
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

    fn body(&self, way: Way, tets: usize, is_truth: bool) -> Result<Body> {
        let least_thickness = match way {
            Way::Conforming => 0.0,
            Way::Mixed(_) => Config::default().least_thickness,
            Way::Absent => f64::INFINITY,
        };
        let (halvings, radius_mm, above_mm) = WIDE;
        let fineness = match is_truth {
            true => Fineness { tets, halvings, radius_mm, above_mm },
            false => Fineness::stepped(tets, 4),
        };
        let fine = fineness.fine(self.place, self.normal);
        let labelled = self.domain.labelled(&Config { least_thickness, ..Config::with_opening(tets, fine) })?;
        let fixed = fixed_nodes(&labelled.mesh);
        let brain = TissueClass::Brain.stiffening(BRAIN_MPA);
        let alone = |class: TissueClass| {
            Material::mixture(&[(1.0, class.stiffening(BRAIN_MPA))], Bound::Voigt, &brain).unwrap_or(brain)
        };
        let of_classes = TissueClass::ALL.map(alone).to_vec();
        if way == Way::Absent {
            let LabelledMesh { mesh, .. } = labelled;
            return Ok(Body::uniform(mesh, fixed, of_classes[TissueClass::Brain as usize]));
        }
        let bound = if let Way::Mixed(bound) = way { bound } else { Bound::Hill };
        Ok(body_of(&labelled, of_classes, bound, fixed))
    }

    fn press(&self, way: Way, tets: usize, is_truth: bool) -> Result<Answer> {
        let body = self.body(way, tets, is_truth)?;
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
        let ball = PressedBall { middle, normal: self.normal, radius_mm, depth_mm };
        let (force_n, at_rest) = press_to_rest(&mut solver, &ball, &body.mesh, TIMES_MS)?;
        let at = |n: u32| solver.positions()[n as usize] - body.mesh.positions[n as usize];
        let moved = disc(LOOKS.1, LOOKS.0, self.normal).map(|aside| {
            let (_, nodes) = surface.under(middle + aside);
            nodes.into_iter().map(|(n, weight)| weight * at(n)).sum()
        });
        Ok(Answer { tets: body.mesh.tets.len(), force_n, moved: moved.collect(), at_rest })
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
    let truth = pressed.press(Way::Conforming, finest, true)?;
    let mut unsettled = usize::from(!truth.at_rest);
    let (mut truth_share, used) = (f64::NAN, Way::Mixed(Bound::HashinShtrikman));
    for (tets, is_truth) in [(finest, true)].into_iter().chain(scope.pick(SIZES.0, SIZES.1).iter().map(|n| (*n, false)))
    {
        let absent = pressed.press(Way::Absent, tets, is_truth)?;
        for way in Way::ALL {
            let answer = match (way, is_truth) {
                (Way::Absent, _) => absent.clone(),
                (Way::Conforming, true) => truth.clone(),
                _ => pressed.press(way, tets, is_truth)?,
            };
            unsettled += usize::from(!answer.at_rest);
            let share = answer.force_n / absent.force_n;
            if way == Way::Conforming && is_truth {
                truth_share = share;
            }
            let errors = [100.0 * (share / truth_share - 1.0), displacement_percent(&answer, &truth)];
            let method = format!("{}{}", way.name(), if is_truth { ", fine" } else { "" });
            findings.rows.push(
                Row::new(SCENE, method)
                    .with("tets", answer.tets)
                    .metric("force_n", answer.force_n)
                    .metric("force_over_absent", share)
                    .metric("force_error_percent", errors[0])
                    .metric("displacement_error_percent", errors[1]),
            );
            if way == used && (is_truth || tets == USUAL) {
                let mesh = if is_truth { "on the truth's mesh" } else { "on the mesh of `usual`" };
                let name = format!("{SCENE}, shares {mesh}: force over that without classes, off by percent");
                findings.gates.push(Gate::at_most(name, errors[0].abs(), 5.0));
            }
        }
    }
    findings.gates.push(Gate::at_most(format!("{SCENE}: presses not at rest"), unsettled as f64, 0.0));
    Ok(())
}

/// Distance of the displacements from the truth's, percent.
fn displacement_percent(answer: &Answer, truth: &Answer) -> f64 {
    let apart: f32 = answer.moved.iter().zip(&truth.moved).map(|(a, b)| a.distance_squared(*b)).sum();
    let all: f32 = truth.moved.iter().map(|moved| moved.length_squared()).sum();
    100.0 * f64::from((apart / all).sqrt())
}

/// Draws force and error of the displacements over the number of tetrahedra.
pub fn draw(findings: &mut Findings) {
    let line = |way: Way, metric: &str| {
        let of_way = findings.rows.iter().filter(|row| row.scene == SCENE && row.method == way.name());
        let point = |row: &Row| Some((row.config.get("tets")?.as_f64()?, row.metrics.get(metric).copied()?));
        (way.name().to_string(), of_way.filter_map(point).collect::<Vec<_>>())
    };
    let axes = [
        ("force_over_absent", "force over that without classes"),
        ("displacement_error_percent", "displacement error, %"),
    ];
    for (metric, axis) in axes {
        let series = Series::over(SCENE, ["tetrahedra", axis], Way::ALL.map(|way| line(way, metric)));
        if series.is_drawn() {
            findings.series.push(series);
        }
    }
}
