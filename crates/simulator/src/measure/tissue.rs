//! Measures the displacement error of each solver on each mesh, against a finer mesh: a tool
//! presses into the brain and slides.
//!
//! # Theory
//! The tool's tip is a ball that penetrates the rest shape by the depth of the scene, at most up to
//! its equator. On every mesh a spring presses each triangle under the ball to the ball's depth
//! there. (A single spring on the mean of all triangles sinks deeper on finer meshes; a flat tip
//! shears the tissue at its rim without bound.)
//!
//! The ground truth is TLED with averaged nodal pressure and no sleeping elements, on a mesh with a
//! sixteenth of the edge length under the ball. The error is the distance between the positions of
//! material points near the opening on both meshes, at the end of push and slide: its 95th
//! percentile over the points. That of the tool's force is taken at the same times; the worse one
//! counts.
//!
//! The cost of TLED is counted: 1 per tetrahedron and step, 0.1 for a sleeping one, times the
//! expected stable time step for this number of tetrahedra over the mesh's. The cost of the other
//! solvers is a ratio of times in one run.

use super::bone::Slide;
use crate::error::SessionError;
use crate::ingredients::Element;
use crate::run::clock::Clock;
use parry3d::query::PointQueryWithLocation;
use parry3d::shape::TriMesh;
use std::collections::BTreeMap;
use trepan_budget::{Scene, Tissue, TissueForce, dt_ms};
use trepan_contact::{NodalContact, NodalContacts};
use trepan_geometry::{Vec3, quantile};
use trepan_mesh::{Surface, TetMesh, lattice};
use trepan_soft::{Body, Loads, Material, Method, SoftSolver};
use trepan_tled::{Config, Damping, Tled};
use trepan_volume::{DistanceField, VoxelVolume};

/// Tetrahedra of the whole brain.
const TETS: [usize; 7] = [3_000, 5_000, 8_000, 12_000, 20_000, 30_000, 50_000];
/// Meshes refined at the opening: tetrahedra of the whole brain, and halvings of the edge length
/// there.
const FINER: ([usize; 5], [u32; 2]) = ([3_000, 5_000, 8_000, 12_000, 20_000], [1, 2]);
/// Meshes with a region of interest, and the motion below which tissue sleeps, mm.
const STILL: ([usize; 2], f64) = ([5_000, 12_000], 0.01);
/// Meshes that the other solvers can step in real time.
const RIVALS_TETS: [usize; 1] = [3_000];
/// Resolution of a mesh: tetrahedra of the whole brain, and the refinement around a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// Tetrahedra of the whole brain.
    pub tets: usize,
    /// Halvings of the edge length.
    pub halvings: u32,
    /// Radius of the refined region, mm.
    pub radius_mm: f32,
}

impl Fineness {
    /// Ground truth for validation.
    pub const JUDGE: Self = Self { tets: 50_000, halvings: 4, radius_mm: 8.0 };
    /// Ground truth that a session computes at its start.
    pub const QUICK: Self = Self { tets: 25_000, halvings: 4, radius_mm: 8.0 };

    /// Resolution of a mesh that a session can step.
    pub const fn stepped(tets: usize, halvings: u32) -> Self {
        Self { tets, halvings, radius_mm: OPENING_MM }
    }
}

/// Radius of the refined region in a session's mesh, mm.
pub const OPENING_MM: f32 = 10.0;
/// Largest mass that mass scaling adds, as a share of the brain's mass; the weight is unchanged. It
/// is added to the elements with the shortest stable time steps: slivers and refined ones.
pub const MASS_ADDED: f32 = 0.01;
/// Cost of a sleeping tetrahedron, as a share of an awake one's.
const ASLEEP: f64 = 0.1;
/// Sample points of the ball's surface, each on the triangle under it; denser than the nodes of a
/// ground truth.
const PLACES: u32 = 199;
/// Share of the ball's radius that the sample points cover, seen from above.
const WIDTH: f32 = 0.98;
/// Total stiffness of the springs, N/mm, over ten times the tissue's; and damping, N ms/mm.
const SPRINGS: (f32, f32) = (0.5, 0.05);
/// Durations of push, rest and slide, ms.
const TIMES_MS: [f32; 3] = [120.0, 40.0, 120.0];
/// Time between updates of the tool, ms.
const TURN_MS: f32 = 8.0;
/// Longest time step, ms: of explicit solvers, of the implicit solver.
const LONGEST_MS: [f32; 2] = [1.0, 4.0];
/// Spacing of the evaluated points, and their largest distance from the opening, mm.
const POINTS_MM: [f32; 2] = [3.5, 14.0];
/// Motion below which a push does not distinguish meshes, mm.
pub const LEAST_MM: f64 = 0.1;
/// Share of the brain's height below which its surface nodes are fixed.
const FIXED_SHARE: f32 = 0.35;

/// All choices for tissue.
pub fn choices() -> Vec<Tissue> {
    let choice = |solver, tets, still_mm| Tissue { solver, tets, halvings: 0, still_mm };
    let refined = |halvings| FINER.0.map(|tets| Tissue { halvings, ..choice("tled", tets, 0.0) });
    let names = Method::all().into_iter().filter(|m| !m.descriptor().is_static).map(|m| m.name());
    let rivals = names.flat_map(|solver| RIVALS_TETS.map(|tets| choice(solver, tets, 0.0)));
    let tled = TETS.map(|tets| choice("tled", tets, 0.0)).into_iter();
    tled.chain(FINER.1.into_iter().flat_map(refined))
        .chain(STILL.0.map(|tets| choice("tled", tets, STILL.1)))
        .chain(rivals)
        .collect()
}

/// Measured error and cost of a choice.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// Error of the displacement, mm.
    pub error_mm: f64,
    /// Force of the tool and its error, the worse of push and slide.
    pub force: TissueForce,
    /// Work of a TLED step, as a share of one with all tetrahedra awake; 1 for other solvers.
    pub awake: f64,
    /// Time step, ms.
    pub dt_ms: f64,
    /// Computing time per tetrahedron and step, ns.
    pub ns: f64,
}

/// Cost of choice `at`, relative to the expected cost by machine speed and number of tetrahedra;
/// `found` are the measurements of all choices.
pub fn cost(at: usize, choices: &[Tissue], found: &[Measurement], scene: &Scene) -> f64 {
    let (choice, of) = (&choices[at], &found[at]);
    let of_step = match choice.solver {
        "tled" => of.awake,
        _ => of.ns / found[unit(choices)].ns,
    };
    of_step * dt_ms(scene, choice) / of.dt_ms
}

/// Index of the choice that other solvers are compared with: TLED as the machine's measure steps
/// it.
fn unit(choices: &[Tissue]) -> usize {
    let is = |c: &Tissue| (c.solver, c.tets, c.halvings, c.still_mm) == ("tled", RIVALS_TETS[0], 0, 0.0);
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
    pub fn of(shape: &'a Shape, choices: &[Tissue], element: Element) -> Result<Self, SessionError> {
        let mut meshes: Vec<(usize, TetMesh)> = Vec::new();
        for choice in choices.iter().filter(|choice| choice.halvings == 0) {
            if !meshes.iter().any(|(tets, _)| *tets == choice.tets) {
                meshes.push((choice.tets, meshed(shape, choice.tets, None)?));
            }
        }
        let mesh = meshed(shape, TETS[0], None)?;
        let body = Body::uniform(mesh.clone(), fixed_nodes(&mesh), shape.material);
        let damping = Tled::new(&body, &Config::default()).map_err(brain_error)?.damping_per_ms();
        Ok(Self { shape, choices: choices.to_vec(), meshes, element, damping: Damping::Rate(damping) })
    }

    /// Creates the solver of a choice.
    fn solver(&self, choice: &Tissue, mesh: &TetMesh) -> Result<Box<dyn Solver>, SessionError> {
        let body = Body::uniform(mesh.clone(), fixed_nodes(mesh), self.shape.material);
        match Method::named(choice.solver) {
            Some(method) => Ok(Box::new(method.build(&body).map_err(brain_error)?)),
            None => {
                let averaged_pressure = self.element == Element::LockingFree;
                let still_mm = choice.still_mm as f32;
                Ok(Box::new(self.tled(&body, Config { still_mm, averaged_pressure, ..Config::default() })?))
            }
        }
    }

    /// Creates TLED with or without averaged nodal pressure.
    fn tled_with_pressure(&self, mesh: &TetMesh, averaged_pressure: bool) -> Result<Tled, SessionError> {
        let body = Body::uniform(mesh.clone(), fixed_nodes(mesh), self.shape.material);
        self.tled(&body, Config { averaged_pressure, ..Config::default() })
    }

    /// Creates TLED with the settings of a session.
    fn tled(&self, body: &Body, config: Config) -> Result<Tled, SessionError> {
        let config = Config { mass_scaling: MASS_ADDED, damping: self.damping, ..config };
        Tled::new(body, &config).map_err(brain_error)
    }
}

fn meshed(shape: &Shape, target_tets: usize, fine: Option<lattice::Fine>) -> Result<TetMesh, SessionError> {
    let config = lattice::Config { target_tets, fine, ..lattice::Config::default() };
    lattice::tetrahedra(&shape.mask, &config).map_err(brain_error)
}

fn brain_error(fault: impl std::fmt::Display) -> SessionError {
    SessionError::Internal(format!("measuring the brain: {fault}"))
}

/// A solver of either crate, with the relative work of its last step.
trait Solver {
    fn seam(&mut self) -> &mut dyn SoftSolver;

    fn work(&self) -> f64;
}

impl Solver for Tled {
    fn seam(&mut self) -> &mut dyn SoftSolver {
        self
    }

    fn work(&self) -> f64 {
        ASLEEP + (1.0 - ASLEEP) * f64::from(self.awake_share())
    }
}

impl Solver for Box<dyn SoftSolver> {
    fn seam(&mut self) -> &mut dyn SoftSolver {
        self.as_mut()
    }

    fn work(&self) -> f64 {
        1.0
    }
}

/// A push of the tool, with the ground-truth displacements of the tissue.
pub struct Push {
    slide: Slide,
    normal: Vec3,
    points: Vec<Vec3>,
    truth: Pushed,
}

/// What a push did to the tissue.
#[derive(Clone, Debug, Default)]
struct Pushed {
    /// Displacements of the points at the end of push and slide, mm.
    moved: Vec<Vec3>,
    /// Force of the tool at the end of each, N.
    forces_n: [f64; 2],
    /// Mean work of a step, as a share of one with all tetrahedra awake.
    awake: f64,
    /// Time step, ms.
    dt_ms: f64,
    /// Computing time per tetrahedron and step, ns.
    ns: f64,
}

impl Push {
    /// Computes the ground truth. The slide begins on the brain's surface.
    ///
    /// # Errors
    /// If the mask cannot be meshed.
    pub fn of(slide: &Slide, brains: &Brains, truth: Fineness) -> Result<Self, SessionError> {
        let shape = brains.shape;
        let around = |n: usize| {
            let turn = core::f32::consts::TAU * n as f32 / 12.0;
            let (a, b) = slide.outward.any_orthonormal_pair();
            shape.field.gradient(slide.place + 4.0 * (turn.cos() * a + turn.sin() * b))
        };
        let normal = (0..12).map(around).sum::<Vec3>().try_normalize().unwrap_or(slide.outward);
        let mut push = Self { slide: *slide, normal, points: points(shape, slide.place), truth: Pushed::default() };
        let mesh = push.refined(shape, truth, 0.5)?;
        push.truth = push.run(&mesh, &mut brains.tled_with_pressure(&mesh, true)?, LONGEST_MS[0])?;
        Ok(push)
    }

    /// Builds a mesh refined around a point of the slide.
    fn refined(&self, shape: &Shape, fineness: Fineness, way: f32) -> Result<TetMesh, SessionError> {
        let Fineness { tets, halvings, radius_mm } = fineness;
        let fine = lattice::Fine { centre: self.on_way(way), radius_mm, halvings };
        meshed(shape, tets, Some(fine).filter(|_| halvings > 0))
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
    ) -> Result<Measurement, SessionError> {
        let mesh = self.refined(brains.shape, fineness, 0.0)?;
        self.found(&mesh, &mut brains.tled_with_pressure(&mesh, averaged_pressure)?, LONGEST_MS[0])
    }

    /// Measures every choice, in the order of `brains`.
    ///
    /// # Errors
    /// If a solver refuses the mesh.
    pub fn measure(&self, brains: &Brains) -> Result<Vec<Measurement>, SessionError> {
        let one = |choice: &Tissue| {
            let (tets, halvings) = (choice.tets, choice.halvings);
            let refined = (halvings > 0).then(|| self.refined(brains.shape, Fineness::stepped(tets, halvings), 0.0));
            let refined = refined.transpose()?;
            let alike = || brains.meshes.iter().find(|(alike, _)| *alike == tets).map(|(_, mesh)| mesh);
            let mesh = refined.as_ref().or_else(alike).ok_or_else(|| brain_error("a mesh is missing"))?;
            let longest_ms = LONGEST_MS[usize::from(choice.solver == "corotational")];
            self.found(mesh, &mut *brains.solver(choice, mesh)?, longest_ms)
        };
        brains.choices.iter().map(one).collect()
    }

    fn found(&self, mesh: &TetMesh, solver: &mut dyn Solver, longest_ms: f32) -> Result<Measurement, SessionError> {
        let found = self.run(mesh, solver, longest_ms)?;
        let Pushed { awake, dt_ms, ns, .. } = found;
        Ok(Measurement { error_mm: self.error_mm(&found), force: self.force(&found), awake, dt_ms, ns })
    }

    /// Distance of this ground truth from a finer one, 95th percentile over the points, mm.
    pub fn apart_mm(&self, finer: &Self) -> f64 {
        self.error_mm(&finer.truth)
    }

    /// Largest displacement of a point, mm; 0 if the tool meets fixed tissue or none.
    pub fn moved_mm(&self) -> f64 {
        self.truth.moved.iter().map(|moved| f64::from(moved.length())).fold(0.0, f64::max)
    }

    fn error_mm(&self, found: &Pushed) -> f64 {
        let apart = found.moved.iter().zip(&self.truth.moved).map(|(a, b)| f64::from(a.distance(*b)));
        quantile(&mut apart.collect::<Vec<_>>(), 0.95)
    }

    fn force(&self, found: &Pushed) -> TissueForce {
        let both = found.forces_n.into_iter().zip(self.truth.forces_n);
        let apart = both.map(|(found, truth)| TissueForce { error_n: (found - truth).abs(), force_n: truth });
        let of = |force: &TissueForce| force.error_n / force.force_n.max(1e-6);
        apart.max_by(|a, b| of(a).total_cmp(&of(b))).expect("there are two")
    }

    /// Runs push and slide.
    fn run(&self, mesh: &TetMesh, solver: &mut dyn Solver, longest_ms: f32) -> Result<Pushed, SessionError> {
        let (locations, touch) = (locate(mesh, &self.points), Touch::of(mesh, self.slide.place)?);
        let dt_ms = solver.seam().stable_dt_ms().min(longest_ms);
        let mut loads = Loads { contacts: NodalContacts::with_room(), ..Loads::default() };
        let (mut moved, mut forces_n) = (Vec::new(), [0.0; 2]);
        let (mut work, mut steps, mut step_ms) = (0.0, 0u32, 0.0);
        let ends = [TIMES_MS[0] + TIMES_MS[1], TIMES_MS.iter().sum()];
        let (mut now, mut next) = (0.0f32, 0.0f32);
        for (end, force_n) in ends.into_iter().zip(&mut forces_n) {
            while now < end {
                if now >= next {
                    self.press(mesh, &touch, now, &mut loads.contacts);
                    next += TURN_MS;
                }
                let clock = Clock::start();
                solver.seam().step(&loads, dt_ms);
                step_ms += clock.now_ms();
                work += solver.work();
                (steps, now) = (steps + 1, now + dt_ms);
            }
            let positions = solver.seam().positions();
            let held = |spring: &NodalContact| spring.mean(|n| positions[n as usize]);
            *force_n = loads.contacts.all().map(|spring| f64::from(spring.pressure_n(held(&spring), Vec3::ZERO))).sum();
            moved.extend(
                locations.iter().zip(&self.points).map(|(location, point)| location.place(mesh, positions) - *point),
            );
        }
        let ns = step_ms * 1e6 / (f64::from(steps) * mesh.tets.len() as f64);
        Ok(Pushed { moved, forces_n, awake: work / f64::from(steps), dt_ms: dt_ms.into(), ns })
    }

    /// Point of the slide at a share of its length.
    fn on_way(&self, share: f32) -> Vec3 {
        self.slide.place + share * self.slide.length_mm * self.slide.along(self.normal)
    }

    /// Contacts of the tool at a time: a spring on each triangle under the ball, to the ball's
    /// depth there.
    fn press(&self, mesh: &TetMesh, touch: &Touch, now_ms: f32, out: &mut NodalContacts) {
        let (scene, way) = (&self.slide.scene, (now_ms - TIMES_MS[0] - TIMES_MS[1]) / TIMES_MS[2]);
        let (middle, radius) = (self.on_way(way.clamp(0.0, 1.0)), scene.probe_radius_mm as f32);
        let in_share = (now_ms / TIMES_MS[0]).min(1.0);
        let depth = scene.tissue_motion_mm as f32 * in_share * in_share * (3.0 - 2.0 * in_share);
        let (a, b) = self.normal.any_orthonormal_pair();
        // Per triangle: the spring, the sum of the ball's depths, and their number.
        let mut pressed: BTreeMap<usize, (NodalContact, f32, f32)> = BTreeMap::new();
        for n in 0..PLACES {
            // Sunflower points: evenly distributed over a disc.
            let far = ((n as f32 + 0.5) / PLACES as f32).sqrt() * WIDTH * radius;
            let turn = n as f32 * 2.399_963;
            let (triangle, nodes) = touch.under(middle + far * (turn.cos() * a + turn.sin() * b));
            let (spring, deep, places) = pressed.entry(triangle).or_default();
            nodes.into_iter().for_each(|(node, weight)| spring.add(node, weight));
            *deep += depth - (radius - (radius * radius - far * far).sqrt());
            *places += 1.0;
        }
        out.clear();
        for (mut spring, deep, places) in pressed.into_values() {
            spring.normalise();
            let (rest, share) = (spring.mean(|n| mesh.positions[n as usize]).dot(self.normal), places / PLACES as f32);
            (spring.normal, spring.offset_mm) = (self.normal, deep / places - rest);
            (spring.stiffness, spring.damping) = (share * SPRINGS.0, share * SPRINGS.1);
            out.push(spring);
        }
    }
}

/// Surface nodes of the lower part, which the skull supports.
fn fixed_nodes(mesh: &TetMesh) -> Vec<u32> {
    let bounds = mesh.bounds();
    let top = bounds.min.z + FIXED_SHARE * bounds.size().z;
    Surface::of(mesh).nodes().into_iter().filter(|&n| mesh.positions[n as usize].z <= top).collect()
}

/// Points of the brain around the opening, on a lattice.
fn points(shape: &Shape, place: Vec3) -> Vec<Vec3> {
    let [apart, reach] = POINTS_MM;
    let n = (reach / apart) as i32;
    let all = (0..(2 * n + 1).pow(3)).map(|at| {
        let side = 2 * n + 1;
        place + apart * glam::IVec3::new(at % side - n, at / side % side - n, at / (side * side) - n).as_vec3()
    });
    all.filter(|p| p.distance(place) <= reach && shape.field.sample(*p) < -0.5).collect()
}

/// The brain's surface at rest near the opening.
struct Touch(TriMesh);

impl Touch {
    fn of(mesh: &TetMesh, place: Vec3) -> Result<Self, SessionError> {
        let near = |t: &[u32; 3]| t.iter().any(|&n| mesh.positions[n as usize].distance(place) < 40.0);
        let triangles: Vec<[u32; 3]> = Surface::of(mesh).triangles.into_iter().filter(near).collect();
        TriMesh::new(mesh.positions.clone(), triangles).map(Self).map_err(brain_error)
    }

    /// Nearest triangle to a point, and the weights of its corners there.
    fn under(&self, point: Vec3) -> (usize, [(u32, f32); 3]) {
        let (_, (triangle, location)) = self.0.project_local_point_and_get_location(point, true);
        let weights = location.barycentric_coordinates().unwrap_or([1.0, 0.0, 0.0]);
        let nodes = self.0.indices()[triangle as usize];
        (triangle as usize, [0, 1, 2].map(|corner| (nodes[corner], weights[corner])))
    }
}

/// Location of a point in a mesh: a tetrahedron and barycentric weights.
struct Location {
    tet: usize,
    weights: [f32; 4],
}

impl Location {
    fn place(&self, mesh: &TetMesh, positions: &[Vec3]) -> Vec3 {
        mesh.tets[self.tet].iter().zip(self.weights).map(|(&n, w)| positions[n as usize] * w).sum()
    }
}

/// Locates each point in the mesh; for a point outside, in the tetrahedron that it leaves least.
fn locate(mesh: &TetMesh, points: &[Vec3]) -> Vec<Location> {
    let middle = points.iter().sum::<Vec3>() / points.len().max(1) as f32;
    let reach = points.iter().map(|p| p.distance(middle)).fold(0.0, f32::max) + 25.0;
    let near: Vec<(usize, [Vec3; 4])> =
        (0..mesh.tets.len()).map(|t| (t, mesh.corners(t))).filter(|(_, c)| c[0].distance(middle) < reach).collect();
    let location = |p: &Vec3| {
        let of = |(t, c): &(usize, [Vec3; 4])| Location { tet: *t, weights: weights(*p, c) };
        let least = |location: &Location| location.weights.iter().copied().fold(f32::INFINITY, f32::min);
        near.iter().map(of).max_by(|a, b| least(a).total_cmp(&least(b))).expect("there is a mesh around the opening")
    };
    points.iter().map(location).collect()
}

fn weights(p: Vec3, [a, b, c, d]: &[Vec3; 4]) -> [f32; 4] {
    let volume = |u: Vec3, v: Vec3, w: Vec3| u.cross(v).dot(w);
    let whole = volume(*b - *a, *c - *a, *d - *a);
    let q = p - *a;
    let of_b = volume(q, *c - *a, *d - *a) / whole;
    let of_c = volume(*b - *a, q, *d - *a) / whole;
    let of_d = volume(*b - *a, *c - *a, q) / whole;
    [1.0 - of_b - of_c - of_d, of_b, of_c, of_d]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_keeps_its_place_in_a_linear_field() {
        let mesh = trepan_soft::boxes::split_box([3, 3, 3], Vec3::splat(30.0));
        let points = [Vec3::new(4.0, 17.0, 26.0), Vec3::new(15.0, 15.0, 15.0), Vec3::new(29.0, 1.0, 31.0)];
        let moved: Vec<Vec3> = mesh.positions.iter().map(|p| *p * 2.0 + Vec3::X).collect();
        for (location, point) in locate(&mesh, &points).iter().zip(points) {
            assert!(location.place(&mesh, &mesh.positions).distance(point) < 1e-4);
            assert!(location.place(&mesh, &moved).distance(point * 2.0 + Vec3::X) < 1e-3);
        }
    }

    #[test]
    fn what_is_under_the_tool_is_the_nearest_point_of_the_surface() {
        let mesh = trepan_soft::boxes::split_box([3, 3, 3], Vec3::splat(30.0));
        let touch = Touch::of(&mesh, Vec3::splat(15.0)).unwrap();
        for (point, nearest) in [([12.0, 17.0, 33.0], [12.0, 17.0, 30.0]), ([-4.0, 31.0, 8.0], [0.0, 30.0, 8.0])] {
            let (_, nodes) = touch.under(Vec3::from(point));
            let found: Vec3 = nodes.iter().map(|(node, weight)| *weight * mesh.positions[*node as usize]).sum();
            assert!(found.distance(Vec3::from(nearest)) < 1e-4, "{found}");
        }
    }
}
