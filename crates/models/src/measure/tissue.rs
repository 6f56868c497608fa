//! Measures the displacement error of each solver on each mesh, against a finer mesh: a tool
//! presses into the brain and slides.
//!
//! # Theory
//! The tool's tip is a ball that enters the mask's surface by the depth of the scene. It presses
//! the tissue by the contact law of a session, so that its force holds what contact and mesh do to
//! each other. (Springs along one normal press fixed places of the surface together until it
//! creases, and no finer mesh settles; a flat tip shears the tissue at its rim without bound.)
//!
//! The ground truth is TLED with averaged nodal pressure and no sleeping elements, on a mesh with a
//! sixteenth of the edge length under the ball. The error is the distance from its surface within
//! 5 mm of the tool to the surface of the mesh, at the end of push and slide: its 95th percentile.
//! It holds what the mesh's shape lacks at rest, too. That of the tool's force is taken at the same
//! times; the worse one counts.
//!
//! The cost of TLED is counted: 1 per tetrahedron and step, 0.1 for a sleeping one, times the
//! expected stable time step for this number of tetrahedra over the mesh's. The cost of the other
//! solvers is a ratio of times in one run.

use super::bone::Slide;
use crate::ingredients::{DYNAMIC_MASS_SCALING, Element};
use crate::{ModelError, methods};
use parry3d::query::{PointQuery, PointQueryWithLocation};
use parry3d::shape::TriMesh;
use trepan_budget::{Scene, Tissue, TissueForce, dt_ms};
use trepan_contact::NodalContacts;
use trepan_deformable::{Config as Touch, TissueCollision, TissueStep};
use trepan_geometry::{Pose, Tool, ToolState, Twist, Vec3, quantile};
use trepan_mesh::{Surface, TetMesh, lattice};
use trepan_patient::Fineness;
use trepan_patient::progress::Stopwatch;
use trepan_soft::{Body, Loads, Material, SoftSolver};
use trepan_tled::{Config, Damping, Tled};
use trepan_volume::{DistanceField, VoxelVolume};

/// Tetrahedra of the whole brain.
const TETS: [usize; 3] = [3_000, 8_000, 20_000];
/// Tetrahedra of the whole brain in meshes refined at the opening.
const REFINED_TETS: [usize; 5] = [3_000, 5_000, 8_000, 12_000, 20_000];
/// Halvings of the edge length there. Three err by more at the same cost.
const HALVINGS: u32 = 4;
/// A mesh that the other solvers can step in real time.
const RIVALS_TETS: usize = 3_000;

/// Largest mass that mass scaling adds, as a share of the brain's mass; the weight is unchanged. It
/// is added to the elements with the shortest stable time steps: slivers and refined ones.
pub const MASS_ADDED: f32 = 0.01;
/// Durations of push, rest and slide, ms.
const TIMES_MS: [f32; 3] = [120.0, 40.0, 120.0];
/// Time between updates of the tool, ms.
const TURN_MS: f32 = 1.0;
/// Longest time step, ms: of explicit solvers, of the implicit solver.
const LONGEST_MS: [f32; 2] = [1.0, 4.0];
/// Radius around the tool within which the surface is compared, mm, as wide as a burr hole; and
/// number of places.
const LOOK: (f32, u32) = (5.0, 150);
/// Motion below which a push does not distinguish meshes, mm.
pub const LEAST_MM: f64 = 0.1;
/// A numerical parameter: share of the brain's height below which its surface nodes are fixed.
const FIXED_SHARE: f32 = 0.35;

/// All choices for tissue.
pub fn choices() -> Vec<Tissue> {
    let choice = |solver, tets| Tissue { solver, tets, halvings: 0 };
    let refined = REFINED_TETS.map(|tets| Tissue { halvings: HALVINGS, ..choice("tled", tets) });
    let names = methods::solvers().into_iter().filter(|m| !m.descriptor().is_static).map(|m| m.name());
    let rivals = names.map(|solver| choice(solver, RIVALS_TETS));
    let tled = TETS.map(|tets| choice("tled", tets)).into_iter();
    tled.chain(refined).chain(rivals).collect()
}

/// Measured error and cost of a choice.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// Error of the displacement, mm.
    pub error_mm: f64,
    /// Force of the tool and its error, the worse of push and slide.
    pub force: TissueForce,
    /// Cost of a step over that of one plain substep of the same length.
    pub step_cost: f64,
    /// Mean time step, ms.
    pub dt_ms: f64,
    /// Computing time per tetrahedron and step, ns.
    pub ns: f64,
}

/// Cost of choice `at`, relative to the expected cost by machine speed and number of tetrahedra;
/// `found` are the measurements of all choices.
pub fn cost(at: usize, choices: &[Tissue], found: &[Measurement], scene: &Scene) -> f64 {
    let (choice, of) = (&choices[at], &found[at]);
    let of_step = match choice.solver {
        "tled" => of.step_cost,
        _ => of.ns / found[unit(choices)].ns,
    };
    of_step * dt_ms(scene, choice) / of.dt_ms
}

/// Index of the choice that other solvers are compared with: TLED as the machine's measure steps
/// it.
fn unit(choices: &[Tissue]) -> usize {
    let is = |c: &Tissue| (c.solver, c.tets, c.halvings) == ("tled", RIVALS_TETS, 0);
    choices.iter().position(is).expect("it is a choice")
}

/// Shape and material of a brain before meshing.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Mask: 1 in the brain, else 0.
    pub mask: VoxelVolume<u8>,
    /// Signed distance to its surface, mm.
    pub field: DistanceField,
    /// Material.
    pub material: Material,
}

/// Uniform meshes of a brain, for many scenes; refined meshes are built per scene.
pub struct Brains<'a> {
    shape: &'a Shape,
    domain: lattice::Domain,
    choices: Vec<Tissue>,
    meshes: Vec<(usize, TetMesh)>,
    /// Element of TLED.
    element: Element,
    /// Damping of all solvers, 1/ms.
    damping: Damping,
}

impl<'a> Brains<'a> {
    /// Builds the uniform meshes of a brain; TLED runs with that element.
    ///
    /// # Errors
    /// If the mask cannot be meshed.
    pub fn of(shape: &'a Shape, choices: &[Tissue], element: Element) -> Result<Self, ModelError> {
        let coarsest = lattice::Config { target_tets: TETS[0], ..lattice::Config::default() };
        let labels = shape.mask.map(|voxel| u16::from(voxel != 0));
        let domain = lattice::Domain::of(&labels, &coarsest).map_err(brain_error)?;
        let mut meshes: Vec<(usize, TetMesh)> = Vec::new();
        for choice in choices.iter().filter(|choice| choice.halvings == 0) {
            if !meshes.iter().any(|(tets, _)| *tets == choice.tets) {
                meshes.push((choice.tets, meshed(&domain, choice.tets, None)?));
            }
        }
        let mesh = meshed(&domain, TETS[0], None)?;
        let body = Body::uniform(mesh.clone(), fixed_nodes(&mesh), shape.material);
        let damping = Tled::new(&body, &Config::default()).map_err(brain_error)?.damping_per_ms();
        Ok(Self { shape, domain, choices: choices.to_vec(), meshes, element, damping: Damping::Rate(damping) })
    }

    /// Creates the solver of a choice; also returns its cost in a session over that without
    /// averaged accelerations.
    fn solver(&self, choice: &Tissue, mesh: &TetMesh) -> Result<(Box<dyn SoftSolver>, f64), ModelError> {
        if let Some(method) = methods::solver(choice.solver) {
            return Ok((method.build(&self.body(mesh)).map_err(brain_error)?, 1.0));
        }
        let tled = self.tled(mesh, self.element == Element::LockingFree, true)?;
        let cost = tled.averaged_cost();
        Ok((Box::new(tled), cost))
    }

    /// Creates TLED with or without averaged nodal pressure, and with the mass that a session adds
    /// to stiffened elements or without. Accelerations are not averaged: equilibria stay.
    fn tled(&self, mesh: &TetMesh, averaged_pressure: bool, as_session: bool) -> Result<Tled, ModelError> {
        let config = Config {
            mass_scaling: MASS_ADDED,
            dynamic_mass_scaling: if as_session { DYNAMIC_MASS_SCALING } else { 1.0 },
            damping: self.damping,
            averaged_pressure,
            ..Config::default()
        };
        Tled::new(&self.body(mesh), &config).map_err(brain_error)
    }

    fn body(&self, mesh: &TetMesh) -> Body {
        Body::uniform(mesh.clone(), fixed_nodes(mesh), self.shape.material)
    }
}

fn meshed(domain: &lattice::Domain, target_tets: usize, fine: Option<lattice::Fine>) -> Result<TetMesh, ModelError> {
    let config = lattice::Config::with_opening(target_tets, fine);
    domain.labelled(&config).map(|labelled| labelled.mesh).map_err(brain_error)
}

fn brain_error(fault: impl std::fmt::Display) -> ModelError {
    ModelError::Internal(format!("measuring the brain: {fault}"))
}

/// A push of the tool, with the ground truth of what the hand feels and the eye sees.
pub struct Push {
    course: Course,
    truth: Pushed,
}

/// The way of the tool over the brain.
#[derive(Clone, Copy)]
struct Course {
    slide: Slide,
    normal: Vec3,
    /// Ends of the slide on the mask's surface.
    ends: [Vec3; 2],
}

impl Course {
    fn of(slide: &Slide, shape: &Shape) -> Self {
        let around = |n: usize| {
            let turn = core::f32::consts::TAU * n as f32 / 12.0;
            let (a, b) = slide.outward.any_orthonormal_pair();
            shape.field.gradient(slide.place + 4.0 * (turn.cos() * a + turn.sin() * b))
        };
        let normal = (0..12).map(around).sum::<Vec3>().try_normalize().unwrap_or(slide.outward);
        let on_surface = |p: Vec3| (0..4).fold(p, |p, _| p - shape.field.sample(p) * normal);
        let ends = [0.0, slide.length_mm].map(|mm| on_surface(slide.place + mm * slide.along(normal)));
        Self { slide: *slide, normal, ends }
    }

    fn truth(self, brains: &Brains, fineness: Fineness) -> Result<Push, ModelError> {
        let middle = 0.5 * (self.ends[0] + self.ends[1]);
        let mesh = refined(&brains.domain, fineness, middle, self.normal)?;
        let truth = run(self, &mesh, &mut brains.tled(&mesh, true, false)?, LONGEST_MS[0])?;
        Ok(Push { course: self, truth })
    }

    /// Runs every choice, in the order of `brains`; each with the cost of a step.
    fn runs(self, brains: &Brains) -> Result<Vec<(f64, Pushed)>, ModelError> {
        let one = |choice: &Tissue| {
            let (tets, halvings) = (choice.tets, choice.halvings);
            let refined = (halvings > 0)
                .then(|| refined(&brains.domain, Fineness::stepped(tets, halvings), self.ends[0], self.normal));
            let refined = refined.transpose()?;
            let alike = || brains.meshes.iter().find(|(alike, _)| *alike == tets).map(|(_, mesh)| mesh);
            let mesh = refined.as_ref().or_else(alike).ok_or_else(|| brain_error("a mesh is missing"))?;
            let longest_ms = LONGEST_MS[usize::from(choice.solver == "corotational")];
            let (mut solver, cost) = brains.solver(choice, mesh)?;
            Ok((cost, run(self, mesh, &mut *solver, longest_ms)?))
        };
        brains.choices.iter().map(one).collect()
    }
}

/// What a push did to the tissue.
struct Pushed {
    /// The surface at rest around the slide, and at the end of push and slide.
    surfaces: [Surroundings; 3],
    /// Force of the tool at the end of each, N.
    forces_n: [f64; 2],
    /// Mean number of substeps of a step.
    substeps: f64,
    /// Mean time step, ms.
    dt_ms: f64,
    /// Computing time per tetrahedron and step, ns.
    ns: f64,
}

impl Push {
    /// Computes the ground truth. The slide begins on the brain's surface.
    ///
    /// # Errors
    /// If the mask cannot be meshed.
    pub fn of(slide: &Slide, brains: &Brains, truth: Fineness) -> Result<Self, ModelError> {
        Course::of(slide, brains.shape).truth(brains, truth)
    }

    /// Computes the ground truth and measures every choice beside it, on two threads.
    ///
    /// # Errors
    /// If the mask cannot be meshed, or a solver refuses the mesh.
    pub fn measured(slide: &Slide, brains: &Brains, truth: Fineness) -> Result<(Self, Vec<Measurement>), ModelError> {
        let course = Course::of(slide, brains.shape);
        let (push, runs) = rayon::join(|| course.truth(brains, truth), || course.runs(brains));
        let push = push?;
        let found = runs?.into_iter().map(|(cost, run)| push.found(cost, &run)).collect();
        Ok((push, found))
    }

    /// Measures TLED on a mesh refined at the opening, with or without averaged nodal pressure.
    ///
    /// # Errors
    /// If the mask cannot be meshed.
    pub fn measure_finer(
        &self,
        brains: &Brains,
        fineness: Fineness,
        averaged_pressure: bool,
    ) -> Result<Measurement, ModelError> {
        let mesh = refined(&brains.domain, fineness, self.course.ends[0], self.course.normal)?;
        let mut tled = brains.tled(&mesh, averaged_pressure, true)?;
        let run = run(self.course, &mesh, &mut tled, LONGEST_MS[0])?;
        Ok(self.found(tled.averaged_cost(), &run))
    }

    /// Measures every choice, in the order of `brains`.
    ///
    /// # Errors
    /// If a solver refuses the mesh.
    pub fn measure(&self, brains: &Brains) -> Result<Vec<Measurement>, ModelError> {
        Ok(self.course.runs(brains)?.iter().map(|(cost, run)| self.found(*cost, run)).collect())
    }

    fn found(&self, cost: f64, found: &Pushed) -> Measurement {
        let (step_cost, dt_ms, ns) = (cost * found.substeps, found.dt_ms, found.ns);
        Measurement { error_mm: self.error_mm(found), force: self.force(found), step_cost, dt_ms, ns }
    }

    /// Distance of this ground truth from a finer one, 95th percentile over the places, mm.
    pub fn apart_mm(&self, finer: &Self) -> f64 {
        self.error_mm(&finer.truth)
    }

    /// Largest displacement of a place, mm; 0 if the tool meets fixed tissue or none.
    pub fn moved_mm(&self) -> f64 {
        let [rest, pushed, slid] = &self.truth.surfaces;
        let moved = |end: usize, to: &Surroundings| {
            let nodes = self.seen(end).map(|place| rest.under(place).1);
            nodes.map(|nodes| f64::from(to.at(nodes).distance(rest.at(nodes)))).fold(0.0, f64::max)
        };
        moved(0, pushed).max(moved(1, slid))
    }

    /// Places over the surface around the tool at an end of the slide: the hole that one sees
    /// through.
    fn seen(&self, end: usize) -> impl Iterator<Item = Vec3> {
        disc(LOOK.0, LOOK.1, self.course.normal).map(move |aside| self.course.ends[end] + aside)
    }

    fn error_mm(&self, found: &Pushed) -> f64 {
        let [rest, truth @ ..] = &self.truth.surfaces;
        let apart = |end: usize| {
            let places = self.seen(end).map(move |place| truth[end].at(rest.under(place).1));
            places.map(move |place| f64::from(found.surfaces[end + 1].0.distance_to_local_point(place, false)))
        };
        quantile(&mut apart(0).chain(apart(1)).collect::<Vec<_>>(), 0.95)
    }

    fn force(&self, found: &Pushed) -> TissueForce {
        let both = found.forces_n.into_iter().zip(self.truth.forces_n);
        let apart = both.map(|(found, truth)| TissueForce { error_n: (found - truth).abs(), force_n: truth });
        let of = |force: &TissueForce| force.error_n / force.force_n.max(1e-6);
        apart.max_by(|a, b| of(a).total_cmp(&of(b))).expect("there are two")
    }
}

/// Builds a mesh refined around a place.
fn refined(domain: &lattice::Domain, fineness: Fineness, place: Vec3, normal: Vec3) -> Result<TetMesh, ModelError> {
    meshed(domain, fineness.tets, fineness.fine(place, normal))
}

/// Runs push and slide.
fn run(
    Course { slide, normal, ends }: Course,
    mesh: &TetMesh,
    solver: &mut dyn SoftSolver,
    longest_ms: f32,
) -> Result<Pushed, ModelError> {
    let ball = Ball { slide: &slide, normal, ends };
    let mut contact = BallContact::new(mesh, ball.at(0.0).radius_mm)?;
    let mut loads = Loads { contacts: NodalContacts::with_room(), ..Loads::default() };
    let (mut surfaces, mut forces_n) = (vec![Surroundings::of(mesh, ends[0])?], [0.0; 2]);
    let (mut substeps, mut steps, mut step_ms) = (0, 0u32, 0.0);
    let stops = [TIMES_MS[0] + TIMES_MS[1], TIMES_MS.iter().sum()];
    let (mut now, mut next) = (0.0f32, 0.0f32);
    for (stop, force_n) in stops.into_iter().zip(&mut forces_n) {
        while now < stop {
            if now >= next {
                *force_n = contact.press(&ball.at(now), TURN_MS, solver, &mut loads.contacts);
                next += TURN_MS;
            }
            let clock = Stopwatch::start();
            let dt_ms = solver.next_dt_ms().min(longest_ms);
            substeps += solver.step(&loads, dt_ms).substeps;
            step_ms += clock.now_ms();
            (steps, now) = (steps + 1, now + dt_ms);
        }
        surfaces.push(surfaces[0].moved(solver.positions())?);
    }
    let ns = step_ms * 1e6 / (f64::from(steps) * mesh.tets.len() as f64);
    let surfaces = surfaces.try_into().unwrap_or_else(|_| unreachable!("at rest and at two ends"));
    Ok(Pushed {
        surfaces,
        forces_n,
        substeps: f64::from(substeps) / f64::from(steps),
        dt_ms: f64::from(now) / f64::from(steps),
        ns,
    })
}

/// The tip of the tool on its way: down at one end of the slide, then straight to the other.
struct Ball<'a> {
    slide: &'a Slide,
    normal: Vec3,
    ends: [Vec3; 2],
}

impl Ball<'_> {
    /// The ball at a time.
    fn at(&self, now_ms: f32) -> PressedBall {
        let (scene, way) = (&self.slide.scene, (now_ms - TIMES_MS[0] - TIMES_MS[1]) / TIMES_MS[2]);
        let in_share = (now_ms / TIMES_MS[0]).min(1.0);
        PressedBall {
            middle: self.ends[0].lerp(self.ends[1], way.clamp(0.0, 1.0)),
            normal: self.normal,
            radius_mm: scene.probe_radius_mm as f32,
            depth_mm: scene.tissue_motion_mm as f32 * in_share * in_share * (3.0 - 2.0 * in_share),
        }
    }
}

/// A ball in the tissue, without friction.
#[derive(Clone, Copy, Debug)]
pub struct PressedBall {
    /// Place of the surface at rest under the ball's middle.
    pub middle: Vec3,
    /// Direction away from the tissue, a unit vector.
    pub normal: Vec3,
    /// Radius, mm.
    pub radius_mm: f32,
    /// How far the ball's lowest point is under `middle`, mm.
    pub depth_mm: f32,
}

impl PressedBall {
    /// The ball's middle, mm.
    pub fn centre(&self) -> Vec3 {
        self.middle + (self.radius_mm - self.depth_mm) * self.normal
    }
}

/// A session's contact between a ball and one mesh.
pub struct BallContact {
    collision: TissueCollision,
    out: TissueStep,
    before: Option<Vec3>,
}

impl BallContact {
    /// Prepares a ball of a radius, mm.
    ///
    /// # Errors
    /// If the mesh has no surface.
    pub fn new(mesh: &TetMesh, radius_mm: f32) -> Result<Self, ModelError> {
        let collision = TissueCollision::new(mesh, &Tool::probe(radius_mm), &Touch::default()).map_err(brain_error)?;
        Ok(Self { collision, out: TissueStep::default(), before: None })
    }

    /// Replaces contacts by those of a ball on its way since the last call, ms ago; returns the
    /// force on it, N.
    pub fn press(&mut self, ball: &PressedBall, ms: f32, solver: &dyn SoftSolver, out: &mut NodalContacts) -> f64 {
        let centre = ball.centre();
        let linear = (centre - self.before.replace(centre).unwrap_or(centre)) / ms;
        let twist = Twist { linear, angular: Vec3::ZERO };
        let state = ToolState { twist, ..ToolState::at(Pose::from_translation(centre)) };
        self.collision.step(solver.positions(), solver.velocities(), &state, &mut self.out);
        out.clear();
        self.out.springs(out);
        self.out.patch.force_n.into()
    }
}

/// Points of a disc, evenly distributed as in a sunflower.
pub fn disc(radius: f32, count: u32, normal: Vec3) -> impl Iterator<Item = Vec3> {
    let (a, b) = normal.any_orthonormal_pair();
    (0..count).map(move |n| {
        let far = ((n as f32 + 0.5) / count as f32).sqrt() * radius;
        let turn = n as f32 * 2.399_963;
        far * (turn.cos() * a + turn.sin() * b)
    })
}

/// Surface nodes of the lower part, which the skull supports.
pub fn fixed_nodes(mesh: &TetMesh) -> Vec<u32> {
    let bounds = mesh.bounds();
    let top = bounds.min.z + FIXED_SHARE * bounds.size().z;
    Surface::of(mesh).nodes().into_iter().filter(|&n| mesh.positions[n as usize].z <= top).collect()
}

/// The brain's surface around the slide.
pub struct Surroundings(TriMesh);

impl Surroundings {
    /// The surface within 40 mm of a place.
    ///
    /// # Errors
    /// If there is none.
    pub fn of(mesh: &TetMesh, place: Vec3) -> Result<Self, ModelError> {
        let near = |t: &[u32; 3]| t.iter().any(|&n| mesh.positions[n as usize].distance(place) < 40.0);
        let triangles: Vec<[u32; 3]> = Surface::of(mesh).triangles.into_iter().filter(near).collect();
        TriMesh::new(mesh.positions.clone(), triangles).map(Self).map_err(brain_error)
    }

    /// The same with its nodes elsewhere.
    fn moved(&self, positions: &[Vec3]) -> Result<Self, ModelError> {
        TriMesh::new(positions.to_vec(), self.0.indices().to_vec()).map(Self).map_err(brain_error)
    }

    /// Nearest triangle to a point, and the weights of its corners there.
    pub fn under(&self, point: Vec3) -> (usize, [(u32, f32); 3]) {
        let (_, (triangle, location)) = self.0.project_local_point_and_get_location(point, true);
        let weights = location.barycentric_coordinates().unwrap_or([1.0, 0.0, 0.0]);
        let nodes = self.0.indices()[triangle as usize];
        (triangle as usize, [0, 1, 2].map(|corner| (nodes[corner], weights[corner])))
    }

    /// The place with these weights of nodes.
    pub fn at(&self, nodes: [(u32, f32); 3]) -> Vec3 {
        nodes.into_iter().map(|(node, weight)| weight * self.0.vertices()[node as usize]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_under_the_tool_is_the_nearest_point_of_the_surface() {
        let mesh = trepan_soft::boxes::split_box([3, 3, 3], Vec3::splat(30.0));
        let touch = Surroundings::of(&mesh, Vec3::splat(15.0)).unwrap();
        for (point, nearest) in [([12.0, 17.0, 33.0], [12.0, 17.0, 30.0]), ([-4.0, 31.0, 8.0], [0.0, 30.0, 8.0])] {
            let (_, nodes) = touch.under(Vec3::from(point));
            let found: Vec3 = nodes.iter().map(|(node, weight)| *weight * mesh.positions[*node as usize]).sum();
            assert!(found.distance(Vec3::from(nearest)) < 1e-4, "{found}");
        }
    }
}
