//! Judges TLED against an independent implicit code: a ball pressed into a block and into the
//! built-in brain, and slid.
//!
//! # Theory
//! The body is fixed below and free above. The ball presses the surface without friction, by the
//! contact law of a session ([`BallContact`]), so that the state at rest does not depend on the way
//! there: the end of a slide is a press at its end. The truth is `fixtures/fem/press.jsonl` by
//! `press.py`: quadratic displacements and linear pressure, Newton's method, f64, on its own mesh.
//! Displacements are compared at 60 places of the surface within 15 mm of the ball, as the root
//! mean square of the distance over that of the truth. The distance between two meshes of the
//! truth is its own uncertainty.
//!
//! # Practice
//! The ball goes in no deeper than its radius. Further, and under a sharper probe, the rim shears
//! the tissue without bound: no elastic model has an answer there, and none is asked for. The same
//! holds for stress at the edge of a clamp, where every mesh gives another value; only force and
//! displacement are judged. The meshes of TLED fill the body's mask, each in its own way, so that
//! the error holds what their shape lacks, too. `fixtures/fem/README.md` tells how far apart two
//! meshes of the truth are along the normal and sideways.

use super::Scope;
use anyhow::{Context, Result};
use serde::Deserialize;
use trepan_contact::NodalContacts;
use trepan_evidence::part::Part;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::Vec3;
use trepan_mesh::{TetMesh, lattice};
use trepan_models::measure::tissue::{BallContact, MASS_ADDED, PressedBall, Surroundings, disc, fixed_nodes};
use trepan_patient::Fineness;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Tled};
use trepan_volume::{DistanceField, Grid, Interpolation, VoxelVolume, largest_component, read, resample};

/// Radius around the ball's middle in which displacements are compared, mm; and number of places.
const LOOK_MM: f32 = 15.0;
const LOOKS: u32 = 60;
/// Way of the slide, mm.
const SLIDE_MM: f32 = 5.0;
/// Radius and depth of the ball, mm.
const BALL_MM: [f32; 2] = [5.0, 5.0];
/// Error that the size of the preset `usual` must keep, percent: this project's goal.
const GOAL_PERCENT: f64 = 5.0;
/// Edge of the mask's voxels, mm.
const MASK_MM: f32 = 2.0;
/// Duration of the press and longest rest after it, ms.
const TIMES_MS: [f32; 2] = [120.0, 3000.0];
/// Change of the force in 50 ms at which the tissue is at rest, as a share.
const STILL: f64 = 2e-4;

/// A mesh with what presses it.
pub struct Pressed {
    /// Name of the scene.
    pub scene: String,
    /// The body.
    pub body: Body,
    /// Its surface at rest.
    pub surface: Surroundings,
    /// The ball where it ends.
    pub ball: PressedBall,
}

/// A body of brain tissue.
pub struct Shape {
    name: &'static str,
    /// Its mask, ready to be filled.
    domain: lattice::Domain,
    field: DistanceField,
    /// Where the slide begins, and the normal there.
    place: Vec3,
    normal: Vec3,
    /// Direction of the slide, a unit vector.
    along: Vec3,
    /// Size of the block, mm; none for the brain.
    block_mm: Option<Vec3>,
}

/// Size of a mesh.
#[derive(Clone, Copy)]
pub struct Size {
    /// Tetrahedra of the whole body; cells across the truth's block.
    pub count: usize,
    /// Halvings of the edges under the ball.
    pub halvings: u32,
    /// Whether it is for the truth: small elements around the ball's end, not around its beginning.
    pub of_truth: bool,
}

impl Shape {
    /// The built-in brain.
    ///
    /// # Errors
    /// If its file cannot be read.
    pub fn brain() -> Result<Self> {
        let mask = largest_component(&read(&trepan_fixtures::case_head().labels)?.map(|label| u8::from(label > 0.5)));
        let mask: VoxelVolume<u8> = resample(&mask, &Grid::isotropic_over(&mask, MASK_MM), Interpolation::Majority, 0);
        let field = DistanceField::of_mask(&mask);
        let (bounds, up) = (mask.world_box(), Vec3::new(0.4, 0.3, 1.0).normalize());
        let along = (0..400).map(|n| bounds.centre() + (200.0 - 0.5 * n as f32) * up);
        let start = along.into_iter().find(|p| bounds.contains(*p) && field.sample(*p) <= 0.0);
        let start = start.context("there is no brain")?;
        let normal = disc(8.0, 30, up).map(|aside| field.gradient(start + aside)).sum::<Vec3>().normalize();
        let domain = domain(&mask)?;
        Ok(Self {
            name: "brain",
            domain,
            place: onto(&field, start, normal),
            field,
            normal,
            along: normal.any_orthonormal_vector(),
            block_mm: None,
        })
    }

    /// A block of 100x100x60 mm.
    ///
    /// # Errors
    /// If its mask cannot be filled.
    pub fn block() -> Result<Self> {
        let (cells, margin) = ([50, 50, 30], 2);
        let size = Vec3::from_array(cells.map(|n| MASK_MM * n as f32));
        let first = Vec3::splat(MASK_MM * (0.5 - margin as f32));
        let mut mask = VoxelVolume::isotropic(cells.map(|n| n + 2 * margin), first, MASK_MM, 0u8);
        let [nx, ny, _] = cells.map(|n| n + 2 * margin);
        for at in 0..mask.data.len() {
            let inside = [at % nx, at / nx % ny, at / (nx * ny)].into_iter().zip(cells);
            mask.data[at] = u8::from(inside.into_iter().all(|(k, n)| (margin..n + margin).contains(&k)));
        }
        let place = Vec3::new(0.5 * size.x, 0.5 * size.y, size.z);
        let (domain, field) = (domain(&mask)?, DistanceField::of_mask(&mask));
        Ok(Self { name: "block", domain, field, place, normal: Vec3::Z, along: Vec3::X, block_mm: Some(size) })
    }
}

fn domain(mask: &VoxelVolume<u8>) -> Result<lattice::Domain> {
    let labels = mask.map(|voxel| u16::from(voxel != 0));
    let coarsest = lattice::Config { target_tets: 3_000, ..lattice::Config::default() };
    Ok(lattice::Domain::of(&labels, &coarsest)?)
}

/// Moves a place along the normal to the surface of a mask.
fn onto(field: &DistanceField, place: Vec3, normal: Vec3) -> Vec3 {
    (0..8).fold(place, |p, _| p - field.sample(p) * normal)
}

/// Where a share of 0 to 1 lies between 0 and `end`, crowded around `fine`, mm.
fn crowded(share: f32, fine: f32, end: f32) -> f32 {
    let zero = (fine / end).sqrt() / ((fine / end).sqrt() + (1.0 - fine / end).sqrt());
    let away = share - zero;
    let (far, reach) = if away < 0.0 { (-fine, zero) } else { (end - fine, 1.0 - zero) };
    if reach > 0.0 { fine + far * (away / reach).powi(2) } else { fine }
}

impl Shape {
    /// The name of the scene.
    fn scene(&self, slid: bool) -> String {
        format!("{} {} 5 mm by a ball", self.name, if slid { "slid over" } else { "pressed" })
    }

    /// Makes a mesh with the ball at the beginning or the end of the slide.
    ///
    /// # Errors
    /// If the mask cannot be filled.
    pub fn pressed(&self, size: Size, slid: bool) -> Result<Pressed> {
        let Self { field, normal, along, .. } = self;
        let middle = onto(field, self.place + *along * if slid { SLIDE_MM } else { 0.0 }, *normal);
        let stepped = Fineness::stepped(size.count, size.halvings);
        let mesh = match (size.of_truth, self.block_mm) {
            // The truth's block has a mesh of another kind than the judged ones.
            (true, Some(block_mm)) => {
                let mut mesh = boxes::split_box([size.count, size.count, size.count * 6 / 10], Vec3::ONE);
                let at = |p: Vec3, k: usize| crowded(p[k], middle[k], block_mm[k]);
                mesh.positions.iter_mut().for_each(|p| *p = Vec3::new(at(*p, 0), at(*p, 1), at(*p, 2)));
                mesh
            }
            (true, None) => {
                self.filled(size.count, Fineness { radius_mm: 13.0, above_mm: 5.0, ..stepped }.fine(middle, *normal))?
            }
            (false, _) => self.filled(size.count, stepped.fine(self.place, *normal))?,
        };
        let fixed = match self.block_mm {
            Some(_) => boxes::nodes_where(&mesh, |p| p.z < 0.25 * MASK_MM),
            None => fixed_nodes(&mesh),
        };
        let surface = Surroundings::of(&mesh, middle)?;
        let body = Body::uniform(mesh, fixed, Material::BRAIN);
        let [radius_mm, depth_mm] = BALL_MM;
        let ball = PressedBall { middle, normal: *normal, radius_mm, depth_mm };
        Ok(Pressed { scene: self.scene(slid), body, surface, ball })
    }

    fn filled(&self, target_tets: usize, fine: Option<lattice::Fine>) -> Result<TetMesh> {
        Ok(self.domain.labelled(&lattice::Config::with_opening(target_tets, fine))?.mesh)
    }
}

impl Pressed {
    /// Places whose displacement is compared, over the surface.
    pub fn looks(&self) -> impl Iterator<Item = Vec3> {
        disc(LOOK_MM, LOOKS, self.ball.normal).map(|aside| self.ball.middle + aside)
    }
}

/// A line of the reference solution.
#[derive(Clone, Deserialize)]
pub struct Solution {
    /// Name of the scene.
    pub scene: String,
    /// Tetrahedra of its mesh.
    pub tets: usize,
    /// Force of the ball, N.
    pub force_n: f64,
    /// Places at rest, mm.
    pub places_mm: Vec<[f32; 3]>,
    /// Their displacements, mm.
    pub moved_mm: Vec<[f32; 3]>,
}

impl Solution {
    /// Every solution of a text, coarser meshes first.
    pub fn all(text: &str) -> Result<Vec<Self>> {
        text.lines().map(|line| serde_json::from_str(line).context("a line of press.jsonl")).collect()
    }

    /// The stored ones.
    pub fn stored() -> Result<Vec<Self>> {
        let path = trepan_fixtures::reference_solution("press");
        Self::all(&std::fs::read_to_string(&path).with_context(|| path.display().to_string())?)
    }

    /// How far displacements are from this solution's, percent.
    pub fn error_percent(&self, moved: impl Iterator<Item = Vec3>) -> f64 {
        let truth = self.moved_mm.iter().map(|&moved| Vec3::from_array(moved).as_dvec3());
        let apart: f64 = truth.clone().zip(moved).map(|(a, b)| a.distance_squared(b.as_dvec3())).sum();
        100.0 * (apart / truth.map(|a| a.length_squared()).sum::<f64>()).sqrt()
    }
}

/// Both bodies.
pub fn parts() -> Vec<Part> {
    let of = |name: &str, shape: fn() -> Result<Shape>| {
        Part::new(format!("outside: {name}"), move |scope, findings: &mut Findings| {
            let shape = shape().expect("the built-in case is there");
            judge(&shape, scope, findings).expect("the fixture and the meshes are sound");
        })
    };
    vec![of("block", Shape::block), of("brain", Shape::brain)]
}

/// Meshes of TLED; the first is that of the preset `usual`.
fn sizes(scope: Scope) -> &'static [Size] {
    const fn of(count: usize, halvings: u32) -> Size {
        Size { count, halvings, of_truth: false }
    }
    const ALL: [Size; 5] = [of(8_000, 4), of(3_000, 4), of(8_000, 0), of(20_000, 4), of(50_000, 4)];
    scope.pick(&ALL[..2], &ALL)
}

fn judge(shape: &Shape, scope: Scope, findings: &mut Findings) -> Result<()> {
    let stored = Solution::stored()?;
    for slid in [false, true] {
        let name = shape.scene(slid);
        let mut solutions = stored.iter().filter(|solution| solution.scene == name);
        let (Some(coarser), Some(truth)) = (solutions.next(), solutions.next()) else {
            anyhow::bail!("press.jsonl lacks two meshes of {name}");
        };
        let own = coarser.moved_mm.iter().map(|&moved| Vec3::from_array(moved));
        let apart = [truth.error_percent(own), 100.0 * (coarser.force_n / truth.force_n - 1.0).abs()];
        findings.rows.push(row(&name, "truth, coarser mesh", coarser.tets, apart, coarser.force_n));
        for (what, apart) in ["displacement", "force"].into_iter().zip(apart) {
            let name = format!("{name}: {what} of two meshes of the truth apart, percent");
            findings.gates.push(Gate::at_most(name, apart, 0.5 * GOAL_PERCENT));
        }
        for (at, &size) in sizes(scope).iter().enumerate() {
            let pressed = shape.pressed(size, slid)?;
            for (method, averaged_pressure) in [("tled", false), ("tled locking-free", true)] {
                let (force_n, errors) = step(&pressed, averaged_pressure, truth)?;
                findings.rows.push(
                    row(&name, method, pressed.body.mesh.tets.len(), errors, force_n)
                        .with("target", size.count)
                        .with("halvings", size.halvings),
                );
                for (what, error) in ["displacement", "force"].into_iter().zip(errors).filter(|_| at == 0) {
                    let name = format!("{name}, {method} of the size of `usual`: {what} error, percent");
                    findings.gates.push(Gate::at_most(name, error, GOAL_PERCENT));
                }
            }
        }
    }
    Ok(())
}

fn row(scene: &str, method: &str, tets: usize, [displacement, force]: [f64; 2], force_n: f64) -> Row {
    Row::new(scene, method)
        .with("tets", tets)
        .metric("displacement_error_percent", displacement)
        .metric("force_error_percent", force)
        .metric("force_n", force_n)
}

/// Presses over a time, then waits until rest or another time, ms; force, N, and whether it rests.
pub(super) fn press_to_rest(
    solver: &mut Tled,
    ball: &PressedBall,
    mesh: &TetMesh,
    times_ms: [f32; 2],
) -> Result<(f64, bool)> {
    let mut contact = BallContact::new(mesh, ball.radius_mm)?;
    let mut loads = Loads { contacts: NodalContacts::with_room(), ..Loads::default() };
    let (mut now, mut force_n, mut before, mut is_still) = (0.0f32, 0.0f64, f64::INFINITY, false);
    for ms in 1.. {
        let pressed = PressedBall { depth_mm: (now / times_ms[0]).min(1.0) * ball.depth_mm, ..*ball };
        force_n = contact.press(&pressed, 1.0, solver, &mut loads.contacts);
        if now > 2.0 * times_ms[0] && ms % 50 == 0 {
            is_still = (force_n / before - 1.0).abs() <= STILL;
            before = force_n;
        }
        if is_still || now >= times_ms[1] {
            break;
        }
        while now < ms as f32 {
            let dt_ms = solver.next_dt_ms().min(1.0);
            solver.step(&loads, dt_ms);
            now += dt_ms;
        }
    }
    Ok((force_n, is_still))
}

/// Presses by TLED as a session steps it, until rest; force, N, and errors of displacement and
/// force, percent.
fn step(pressed: &Pressed, averaged_pressure: bool, truth: &Solution) -> Result<(f64, [f64; 2])> {
    let Pressed { body, surface, ball, .. } = pressed;
    let config = Config { mass_scaling: MASS_ADDED, averaged_pressure, ..Config::default() };
    let mut solver = Tled::new(body, &config)?;
    let (force_n, _) = press_to_rest(&mut solver, ball, &body.mesh, TIMES_MS)?;
    let moved = truth.places_mm.iter().map(|&place| {
        let (_, nodes) = surface.under(Vec3::from_array(place));
        nodes.into_iter().map(|(n, w)| w * (solver.positions()[n as usize] - body.mesh.positions[n as usize])).sum()
    });
    Ok((force_n, [truth.error_percent(moved), 100.0 * (force_n / truth.force_n - 1.0).abs()]))
}

/// Meshes of the truth for block and brain, pressed and slid: coarser, finer.
const TRUTH_SIZES: [[[Size; 2]; 2]; 2] = {
    const fn of(count: usize, halvings: u32) -> Size {
        Size { count, halvings, of_truth: true }
    }
    let brain = [of(4_000, 3), of(9_000, 3)];
    [[[of(10, 0), of(12, 0)], [of(8, 0), of(10, 0)]], [brain, brain]]
};

/// A scene for `press.py`, by the name of its file.
pub struct Export {
    /// Name without ending; their order is that of the solutions.
    pub name: String,
    /// Content.
    pub json: serde_json::Value,
}

/// Every scene of the truth on both meshes.
///
/// # Errors
/// If the built-in case is not there.
pub fn exports() -> Result<Vec<Export>> {
    let shapes = [Shape::block()?, Shape::brain()?];
    let mut exports = Vec::new();
    for (shape, sizes) in shapes.iter().zip(TRUTH_SIZES) {
        for (slid, sizes) in [false, true].into_iter().zip(sizes) {
            for (size, which) in sizes.into_iter().zip(["coarser", "finer"]) {
                let pressed = shape.pressed(size, slid)?;
                exports.push(Export {
                    name: format!("{}-{which}", pressed.scene.replace(' ', "-")),
                    json: pressed.json(),
                });
            }
        }
    }
    Ok(exports)
}

impl Pressed {
    /// What `press.py` reads.
    fn json(&self) -> serde_json::Value {
        let Self { scene, body, surface, ball } = self;
        let on_triangle = |place: Vec3| surface.under(place).1;
        let place =
            |nodes: [(u32, f32); 3]| serde_json::json!({ "nodes": nodes.map(|n| n.0), "weights": nodes.map(|n| n.1) });
        let (material, mesh) = (body.material(0), &body.mesh);
        serde_json::json!({
            "scene": scene, "positions_mm": mesh.positions.iter().map(|p| p.to_array()).collect::<Vec<_>>(),
            "tets": mesh.tets, "fixed": body.fixed, "normal": ball.normal.to_array(), "depth_mm": ball.depth_mm,
            "radius_mm": ball.radius_mm, "centre_mm": ball.centre().to_array(),
            "looks": self.looks().map(|look| place(on_triangle(look))).collect::<Vec<_>>(),
            "young_mpa": material.young_mpa(), "poisson": material.poisson(),
        })
    }
}
