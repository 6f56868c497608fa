//! Tissue: a tool presses into the brain and slides, by every solver on every mesh, against a mesh
//! that is fine where the tool is.
//!
//! # Theory
//! The tool's end is a ball that goes into the rest shape by so much as the scene says, at most up
//! to its equator; on every mesh each triangle under it is pressed by a spring, as deep as the ball
//! is there. (One spring on the mean of all sinks the deeper the finer the mesh is; a flat end
//! shears the tissue at its rim without bound.) The truth is TLED with every element stepped and
//! its cure of locking, on a mesh with a sixteenth of the edge where the ball goes. The error is
//! the distance between where material points near the opening are on both, at the end of the push
//! and of the slide; that which 95 of 100 points stay within counts. Cost is counted: a step of
//! TLED per tetrahedron is 1, a sleeping one a tenth, times how much shorter a mesh's stable step
//! is than its number of tetrahedra lets expect; of the other solvers it is measured as a ratio in
//! one run.

use super::bone::Slide;
use super::quantile;
use crate::error::SessionError;
use crate::run::clock::Clock;
use std::collections::BTreeMap;
use trepan_budget::{Scene, Tissue, dt_ms};
use trepan_contact::{NodalContact, NodalContacts};
use trepan_geometry::Vec3;
use trepan_mesh::{Surface, TetMesh, lattice};
use trepan_soft::{Body, Loads, Material, Method, SoftSolver};
use trepan_tled::{Config, Damping, Tled};
use trepan_volume::{DistanceField, VoxelVolume};

/// Tetrahedra of the whole brain.
const TETS: [usize; 7] = [3_000, 5_000, 8_000, 12_000, 20_000, 30_000, 50_000];
/// Meshes that are finer at the opening: tetrahedra of the whole brain, and how often edges are
/// halved there.
const FINER: ([usize; 5], [u32; 2]) = ([3_000, 5_000, 8_000, 12_000, 20_000], [1, 2]);
/// Meshes with a region of interest, and its limit of motion, mm.
const STILL: ([usize; 2], f64) = ([5_000, 12_000], 0.01);
/// Meshes that rivals of TLED can step in real time.
const RIVALS_TETS: [usize; 1] = [3_000];
/// How fine a mesh is: tetrahedra of the whole brain, how often their edge is halved around a
/// place, and how far around it, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// Tetrahedra of the whole brain.
    pub tets: usize,
    /// Halvings.
    pub halvings: u32,
    /// Radius of what is finer, mm.
    pub radius_mm: f32,
}

impl Fineness {
    /// What choices are judged by.
    pub const JUDGE: Self = Self { tets: 50_000, halvings: 4, radius_mm: 8.0 };
    /// What a session can wait for.
    pub const QUICK: Self = Self { tets: 25_000, halvings: 4, radius_mm: 8.0 };

    /// A mesh that a session could step.
    pub const fn stepped(tets: usize, halvings: u32) -> Self {
        Self { tets, halvings, radius_mm: OPENING_MM }
    }
}

/// Radius of what is finer in a mesh that a session could step, mm.
pub const OPENING_MM: f32 = 10.0;
/// Most mass that TLED adds to the elements with the shortest steps, slivers and what is finer at
/// the opening, as a share of the brain's; weight stays.
pub const MASS_ADDED: f32 = 0.01;
/// What a sleeping tetrahedron costs.
const ASLEEP: f64 = 0.1;
/// Places of the ball's surface, each on the triangle under it: nearer to each other than the nodes
/// of a truth.
const PLACES: u32 = 199;
/// Share of the ball's radius that they lie in, as seen from above.
const WIDTH: f32 = 0.98;
/// Stiffness of all springs, N/mm, over ten times the tissue's; and damping, N ms/mm.
const SPRINGS: (f32, f32) = (0.5, 0.05);
/// Times of push, rest and slide, ms.
const TIMES_MS: [f32; 3] = [120.0, 40.0, 120.0];
/// Time between two places of the tool, ms.
const TURN_MS: f32 = 8.0;
/// Longest step, ms; that of the implicit solver.
const LONGEST_MS: [f32; 2] = [1.0, 4.0];
/// Points looked at: this far apart and from the opening, mm.
const POINTS_MM: [f32; 2] = [3.5, 14.0];
/// Motion under which a push says nothing of meshes, mm.
pub const LEAST_MM: f64 = 0.1;
/// The brain is held where its surface lies under this share of its height.
const HELD: f32 = 0.35;

/// Every choice.
pub fn choices() -> Vec<Tissue> {
    let choice = |solver, tets, still_mm| Tissue { solver, tets, halvings: 0, still_mm };
    let finer = |halvings| FINER.0.map(|tets| Tissue { halvings, ..choice("tled", tets, 0.0) });
    let names = Method::all().into_iter().filter(|m| m.name() != "reference").map(|m| m.name());
    let rivals = names.flat_map(|solver| RIVALS_TETS.map(|tets| choice(solver, tets, 0.0)));
    let tled = TETS.map(|tets| choice("tled", tets, 0.0)).into_iter();
    tled.chain(FINER.1.into_iter().flat_map(finer))
        .chain(STILL.0.map(|tets| choice("tled", tets, STILL.1)))
        .chain(rivals)
        .collect()
}

/// What a choice came to.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// Error of the displacement, mm.
    pub error_mm: f64,
    /// Work of a step over that of one with every tetrahedron awake, TLED; else 1.
    pub awake: f64,
    /// Length of its step, ms.
    pub dt_ms: f64,
    /// Time of a tetrahedron and step, ns.
    pub ns: f64,
}

/// What a choice costs over what a machine's number and the step by the tetrahedra's number alone
/// let expect; `found` is what all choices came to.
pub fn cost(at: usize, choices: &[Tissue], found: &[Measurement], scene: &Scene) -> f64 {
    let (choice, of) = (&choices[at], &found[at]);
    let of_step = match choice.solver {
        "tled" => of.awake,
        _ => of.ns / found[unit(choices)].ns,
    };
    of_step * dt_ms(scene, choice) / of.dt_ms
}

/// The choice whose step is that of a machine's measure, for rivals to be compared with.
fn unit(choices: &[Tissue]) -> usize {
    let is = |c: &Tissue| (c.solver, c.tets, c.halvings, c.still_mm) == ("tled", RIVALS_TETS[0], 0, 0.0);
    choices.iter().position(is).expect("it is a choice")
}

/// A brain, not yet of tetrahedra.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Where it is, 0 or 1.
    pub mask: VoxelVolume<u8>,
    /// Distance to its surface.
    pub field: DistanceField,
    /// What it is made of.
    pub material: Material,
}

/// A brain in meshes that are alike everywhere, for many scenes; those that are finer at an opening
/// are made for each.
pub struct Brains<'a> {
    shape: &'a Shape,
    choices: Vec<Tissue>,
    meshes: Vec<(usize, TetMesh)>,
    /// Of all solvers, 1/ms.
    damping: Damping,
}

impl<'a> Brains<'a> {
    /// Fills a brain with meshes of every size.
    ///
    /// # Errors
    /// When the mask cannot be filled.
    pub fn of(shape: &'a Shape, choices: &[Tissue]) -> Result<Self, SessionError> {
        let mut meshes: Vec<(usize, TetMesh)> = Vec::new();
        for choice in choices.iter().filter(|choice| choice.halvings == 0) {
            if !meshes.iter().any(|(tets, _)| *tets == choice.tets) {
                meshes.push((choice.tets, filled(shape, choice.tets, None)?));
            }
        }
        let mesh = filled(shape, TETS[0], None)?;
        let body = Body::uniform(mesh.clone(), held(&mesh), shape.material);
        let damping = Tled::new(&body, &Config::default()).map_err(of_brain)?.damping_per_ms();
        Ok(Self { shape, choices: choices.to_vec(), meshes, damping: Damping::Rate(damping) })
    }

    /// A solver for a choice on its mesh.
    fn solver(&self, choice: &Tissue, mesh: &TetMesh) -> Result<Box<dyn Solver>, SessionError> {
        let body = Body::uniform(mesh.clone(), held(mesh), self.shape.material);
        match Method::named(choice.solver) {
            Some(method) => Ok(Box::new(method.build(&body).map_err(of_brain)?)),
            None => Ok(Box::new(self.tled(&body, Config { still_mm: choice.still_mm as f32, ..Config::default() })?)),
        }
    }

    /// TLED with or without its cure of locking.
    fn cured(&self, mesh: &TetMesh, averaged_pressure: bool) -> Result<Tled, SessionError> {
        let body = Body::uniform(mesh.clone(), held(mesh), self.shape.material);
        self.tled(&body, Config { averaged_pressure, ..Config::default() })
    }

    /// TLED as a session steps it.
    fn tled(&self, body: &Body, config: Config) -> Result<Tled, SessionError> {
        let config = Config { mass_scaling: MASS_ADDED, damping: self.damping, ..config };
        Tled::new(body, &config).map_err(of_brain)
    }
}

fn filled(shape: &Shape, target_tets: usize, fine: Option<lattice::Fine>) -> Result<TetMesh, SessionError> {
    let config = lattice::Config { target_tets, fine, ..lattice::Config::default() };
    lattice::tetrahedra(&shape.mask, &config).map_err(of_brain)
}

fn of_brain(fault: impl std::fmt::Display) -> SessionError {
    SessionError::Internal(format!("measuring the brain: {fault}"))
}

/// A solver of either crate, with the share of the work of a step with every tetrahedron awake.
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

/// A push and where it takes the tissue.
pub struct Push {
    slide: Slide,
    normal: Vec3,
    points: Vec<Vec3>,
    truth: Vec<Vec3>,
}

impl Push {
    /// Makes the truth. The slide begins on the brain's surface.
    ///
    /// # Errors
    /// When the mask cannot be filled.
    pub fn of(slide: &Slide, brains: &Brains, truth: Fineness) -> Result<Self, SessionError> {
        let shape = brains.shape;
        let around = |n: usize| {
            let turn = core::f32::consts::TAU * n as f32 / 12.0;
            let (a, b) = slide.outward.any_orthonormal_pair();
            shape.field.gradient(slide.place + 4.0 * (turn.cos() * a + turn.sin() * b))
        };
        let normal = (0..12).map(around).sum::<Vec3>().try_normalize().unwrap_or(slide.outward);
        let mut push = Self { slide: *slide, normal, points: points(shape, slide.place), truth: Vec::new() };
        let mesh = push.finer(shape, truth, 0.5)?;
        push.truth = push.run(&mesh, &mut brains.cured(&mesh, true)?, LONGEST_MS[0]).0;
        Ok(push)
    }

    /// A mesh that is finer around a place of the slide.
    fn finer(&self, shape: &Shape, fineness: Fineness, way: f32) -> Result<TetMesh, SessionError> {
        let Fineness { tets, halvings, radius_mm } = fineness;
        let fine = lattice::Fine { centre: self.on_way(way), radius_mm, halvings };
        filled(shape, tets, Some(fine).filter(|_| halvings > 0))
    }

    /// TLED on a mesh that is finer at the opening, with its cure of locking or without.
    ///
    /// # Errors
    /// When the mask cannot be filled.
    pub fn measure_finer(&self, brains: &Brains, fineness: Fineness, cure: bool) -> Result<Measurement, SessionError> {
        let mesh = self.finer(brains.shape, fineness, 0.0)?;
        Ok(self.found(&mesh, &mut brains.cured(&mesh, cure)?, LONGEST_MS[0]))
    }

    /// Every choice, in the order of the brains.
    ///
    /// # Errors
    /// When a solver refuses the brain.
    pub fn measure(&self, brains: &Brains) -> Result<Vec<Measurement>, SessionError> {
        let one = |choice: &Tissue| {
            let (tets, halvings) = (choice.tets, choice.halvings);
            let finer = (halvings > 0).then(|| self.finer(brains.shape, Fineness::stepped(tets, halvings), 0.0));
            let finer = finer.transpose()?;
            let alike = || brains.meshes.iter().find(|(alike, _)| *alike == tets).map(|(_, mesh)| mesh);
            let mesh = finer.as_ref().or_else(alike).ok_or_else(|| of_brain("a mesh is missing"))?;
            let longest_ms = LONGEST_MS[usize::from(choice.solver == "corotational")];
            Ok(self.found(mesh, &mut *brains.solver(choice, mesh)?, longest_ms))
        };
        brains.choices.iter().map(one).collect()
    }

    fn found(&self, mesh: &TetMesh, solver: &mut dyn Solver, longest_ms: f32) -> Measurement {
        let (places, awake, dt_ms, ns) = self.run(mesh, solver, longest_ms);
        Measurement { error_mm: self.error_mm(&places), awake, dt_ms, ns }
    }

    /// A truth beside a finer one: what 95 of 100 points stay within, mm.
    pub fn apart_mm(&self, finer: &Self) -> f64 {
        self.error_mm(&finer.truth)
    }

    /// How far the point goes that goes farthest, mm; 0 where the tool finds tissue that is held,
    /// or none.
    pub fn moved_mm(&self) -> f64 {
        self.truth.iter().map(|moved| f64::from(moved.length())).fold(0.0, f64::max)
    }

    fn error_mm(&self, places: &[Vec3]) -> f64 {
        quantile(places.iter().zip(&self.truth).map(|(a, b)| f64::from(a.distance(*b))).collect(), 0.95)
    }

    /// Displacements of the points at the end of push and slide, mean work of a step, its length,
    /// ms, and ns for each tetrahedron and step.
    fn run(&self, mesh: &TetMesh, solver: &mut dyn Solver, longest_ms: f32) -> (Vec<Vec3>, f64, f64, f64) {
        let (seats, touch) = (seats(mesh, &self.points), Touch::of(mesh, self.slide.place));
        let dt_ms = solver.seam().stable_dt_ms().min(longest_ms);
        let (mut loads, mut places) = (Loads { contacts: NodalContacts::with_room(), ..Loads::default() }, Vec::new());
        let (mut work, mut steps, mut step_ms) = (0.0, 0u32, 0.0);
        let ends = [TIMES_MS[0] + TIMES_MS[1], TIMES_MS.iter().sum()];
        let (mut now, mut next) = (0.0f32, 0.0f32);
        for end in ends {
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
            places.extend(
                seats
                    .iter()
                    .zip(&self.points)
                    .map(|(seat, point)| seat.place(mesh, solver.seam().positions()) - *point),
            );
        }
        let ns = step_ms * 1e6 / (f64::from(steps) * mesh.tets.len() as f64);
        (places, work / f64::from(steps), dt_ms.into(), ns)
    }

    /// A place of the slide, by the share that is done.
    fn on_way(&self, share: f32) -> Vec3 {
        self.slide.place + share * self.slide.length_mm * self.slide.along(self.normal)
    }

    /// The tool at a time: a spring on each triangle under its ball, as deep into the rest shape as
    /// the ball is there.
    fn press(&self, mesh: &TetMesh, touch: &Touch, now_ms: f32, out: &mut NodalContacts) {
        let (scene, way) = (&self.slide.scene, (now_ms - TIMES_MS[0] - TIMES_MS[1]) / TIMES_MS[2]);
        let (middle, radius) = (self.on_way(way.clamp(0.0, 1.0)), scene.probe_radius_mm as f32);
        let in_share = (now_ms / TIMES_MS[0]).min(1.0);
        let depth = scene.tissue_motion_mm as f32 * in_share * in_share * (3.0 - 2.0 * in_share);
        let (a, b) = self.normal.any_orthonormal_pair();
        // Of each triangle the spring, the sum of the ball's depths there and how many these are.
        let mut pressed: BTreeMap<usize, (NodalContact, f32, f32)> = BTreeMap::new();
        for n in 0..PLACES {
            // Sunflower points: even over a disc.
            let far = ((n as f32 + 0.5) / PLACES as f32).sqrt() * WIDTH * radius;
            let turn = n as f32 * 2.399_963;
            let Some((triangle, nodes)) = touch.under(mesh, middle + far * (turn.cos() * a + turn.sin() * b)) else {
                continue;
            };
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

/// Surface nodes in the lower part, which the skull holds.
fn held(mesh: &TetMesh) -> Vec<u32> {
    let bounds = mesh.bounds();
    let top = bounds.min.z + HELD * bounds.size().z;
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

/// Triangles near the opening.
struct Touch(Vec<[u32; 3]>);

impl Touch {
    fn of(mesh: &TetMesh, place: Vec3) -> Self {
        let near = |t: &[u32; 3]| t.iter().any(|&n| mesh.positions[n as usize].distance(place) < 40.0);
        Self(Surface::of(mesh).triangles.into_iter().filter(near).collect())
    }

    /// The triangle nearest to a point, and the weights of its corners there.
    fn under(&self, mesh: &TetMesh, point: Vec3) -> Option<(usize, [(u32, f32); 3])> {
        let corners = |t: &[u32; 3]| t.map(|n| mesh.positions[n as usize]);
        let off = |w: &[f32; 3], t: &[u32; 3]| {
            let at: Vec3 = corners(t).iter().zip(w).map(|(c, w)| *c * *w).sum();
            at.distance_squared(point)
        };
        let all = self.0.iter().enumerate().map(|(at, t)| (at, t, nearest(point, corners(t))));
        let (at, t, w) = all.min_by(|(_, t, w), (_, u, v)| off(w, t).total_cmp(&off(v, u)))?;
        Some((at, [0, 1, 2].map(|corner| (t[corner], w[corner]))))
    }
}

/// Weights of the corners of a triangle at its point nearest to `p`, near enough: the foot on the
/// plane, cut to the triangle.
fn nearest(p: Vec3, [a, b, c]: [Vec3; 3]) -> [f32; 3] {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d, e, f) = (ab.dot(ab), ab.dot(ac), ac.dot(ac));
    let (g, h) = (ab.dot(ap), ac.dot(ap));
    let whole = (d * f - e * e).max(f32::MIN_POSITIVE);
    let (v, w) = ((f * g - e * h) / whole, (d * h - e * g) / whole);
    let cut = [1.0 - v - w, v, w].map(|x| x.max(0.0));
    let sum: f32 = cut.iter().sum();
    cut.map(|x| x / sum)
}

/// Where a point sits: a tetrahedron and weights of its corners.
struct Seat {
    tet: usize,
    weights: [f32; 4],
}

impl Seat {
    fn place(&self, mesh: &TetMesh, positions: &[Vec3]) -> Vec3 {
        mesh.tets[self.tet].iter().zip(self.weights).map(|(&n, w)| positions[n as usize] * w).sum()
    }
}

/// The tetrahedron of each point; of one outside the mesh that which it is least out of.
fn seats(mesh: &TetMesh, points: &[Vec3]) -> Vec<Seat> {
    let middle = points.iter().sum::<Vec3>() / points.len().max(1) as f32;
    let reach = points.iter().map(|p| p.distance(middle)).fold(0.0, f32::max) + 25.0;
    let near: Vec<(usize, [Vec3; 4])> =
        (0..mesh.tets.len()).map(|t| (t, mesh.corners(t))).filter(|(_, c)| c[0].distance(middle) < reach).collect();
    let seat = |p: &Vec3| {
        let of = |(t, c): &(usize, [Vec3; 4])| Seat { tet: *t, weights: weights(*p, c) };
        let least = |seat: &Seat| seat.weights.iter().copied().fold(f32::INFINITY, f32::min);
        near.iter().map(of).max_by(|a, b| least(a).total_cmp(&least(b))).expect("there is a mesh around the opening")
    };
    points.iter().map(seat).collect()
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
        for (seat, point) in seats(&mesh, &points).iter().zip(points) {
            assert!(seat.place(&mesh, &mesh.positions).distance(point) < 1e-4);
            assert!(seat.place(&mesh, &moved).distance(point * 2.0 + Vec3::X) < 1e-3);
        }
    }

    #[test]
    fn a_foot_outside_the_triangle_is_cut_to_it() {
        let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
        assert_eq!(nearest(Vec3::new(0.25, 0.25, 3.0), triangle), [0.5, 0.25, 0.25]);
        assert_eq!(nearest(Vec3::new(-1.0, -1.0, 0.0), triangle), [1.0, 0.0, 0.0]);
    }
}
