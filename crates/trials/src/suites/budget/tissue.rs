//! Tissue: a tool presses into the brain and slides, by every solver on every mesh, against a mesh that is fine where the tool is.
//!
//! # Theory
//! The tool's end is a disc that presses on the surface as a spring, deep into the rest shape by so much as the scene says; on every mesh it takes the triangles under it. The truth is
//! TLED with every element stepped on a mesh with a quarter of the edge around the opening. The error is the distance between where material points near the
//! opening are on both, at the end of the push and of the slide; that which 95 of 100 points stay within counts. Cost is counted: a step of TLED per tetrahedron is 1, a sleeping one
//! a tenth; of the other solvers it is measured as a ratio in one run.

use super::case::Case;
use super::scene::Situation;
use crate::timer::Samples;
use std::time::Instant;
use trepan_budget::Tissue;
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;
use trepan_mesh::{Surface, TetMesh, lattice};
use trepan_soft::{Body, Loads, Material, Method, SoftSolver};
use trepan_tled::{Config, Damping, Tled};

/// Tetrahedra of the whole brain.
const TETS: [usize; 7] = [3_000, 5_000, 8_000, 12_000, 20_000, 30_000, 50_000];
/// Limits of motion of the region of interest, mm; 0 steps all.
const STILL_MM: [f64; 3] = [0.0, 0.001, 0.01];
/// Meshes that rivals of TLED can step in real time.
const RIVALS_TETS: [usize; 1] = [3_000];
/// Tetrahedra of the truth and how often its edge is halved around the opening.
const FINE: (usize, u32) = (25_000, 2);
/// Radius of that, mm.
const FINE_MM: f32 = 14.0;
/// What a sleeping tetrahedron costs.
const ASLEEP: f64 = 0.1;
/// Times of push, rest and slide, ms.
const TIMES_MS: [f32; 3] = [120.0, 40.0, 120.0];
/// Time between two places of the tool, ms.
const TURN_MS: f32 = 8.0;
/// Longest step, ms; that of the implicit solver.
const LONGEST_MS: [f32; 2] = [1.0, 4.0];
/// Points looked at: this far apart and from the opening, mm.
const POINTS_MM: [f32; 2] = [3.5, 14.0];
/// The brain is held where its surface lies under this share of its height.
const HELD: f32 = 0.35;

/// Every choice.
pub fn choices() -> Vec<Tissue> {
    let tled = STILL_MM.into_iter().flat_map(|still_mm| TETS.map(|tets| Tissue { solver: "tled", tets, still_mm }));
    let names = Method::all().into_iter().filter(|m| m.name() != "reference").map(|m| m.name());
    tled.chain(names.flat_map(|solver| RIVALS_TETS.map(|tets| Tissue { solver, tets, still_mm: 0.0 }))).collect()
}

/// The choice whose step is that of a machine's measure, for rivals to be compared with.
pub fn unit(choices: &[Tissue]) -> usize {
    let is = |c: &Tissue| (c.solver, c.tets, c.still_mm) == ("tled", RIVALS_TETS[0], 0.0);
    choices.iter().position(is).expect("it is a choice")
}

/// What a choice came to.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// Error of the displacement, mm.
    pub error_mm: f64,
    /// Work of a step over that of one with every tetrahedron awake, TLED; else 0.
    pub awake: f64,
    /// Time of a tetrahedron and step, ns.
    pub ns: f64,
}

/// A brain in meshes of every size, with a solver for every choice, for many scenes.
pub struct Brains {
    brains: Vec<(Tissue, TetMesh, Solver)>,
    material: Material,
    /// Of all of them, 1/ms.
    damping: Damping,
}

impl Brains {
    /// Fills a brain and makes the solvers ready.
    pub fn of(case: &Case, choices: &[Tissue]) -> Self {
        let mut meshes: Vec<(usize, TetMesh)> = Vec::new();
        let material = case.material();
        let damping = {
            let mesh = filled(case, &lattice::Config { target_tets: TETS[0], ..lattice::Config::default() });
            let body = Body::uniform(mesh.clone(), held(&mesh), material);
            Damping::Rate(Tled::new(&body, &Config::default()).expect("the brain is sound").damping_per_ms())
        };
        let brain = |choice: &Tissue| {
            if !meshes.iter().any(|(tets, _)| *tets == choice.tets) {
                let config = lattice::Config { target_tets: choice.tets, ..lattice::Config::default() };
                meshes.push((choice.tets, filled(case, &config)));
            }
            let (_, mesh) = meshes.iter().find(|(tets, _)| *tets == choice.tets).expect("it was just made");
            let body = Body::uniform(mesh.clone(), held(mesh), material);
            (*choice, mesh.clone(), Solver::of(&body, choice, damping))
        };
        let brains = choices.iter().map(brain).collect();
        Self { brains, material, damping }
    }
}

fn filled(case: &Case, config: &lattice::Config) -> TetMesh {
    lattice::tetrahedra(&case.mask, config).expect("the mask can be filled")
}

/// A push and where it takes the tissue.
pub struct Push<'a> {
    situation: &'a Situation,
    place: Vec3,
    normal: Vec3,
    points: Vec<Vec3>,
    truth: Vec<Vec3>,
}

impl<'a> Push<'a> {
    /// Makes the truth.
    pub fn of(case: &Case, situation: &'a Situation, brains: &Brains) -> Self {
        let place = case.outer_brain(situation.towards);
        let around = |n: usize| {
            let turn = core::f32::consts::TAU * n as f32 / 12.0;
            let (a, b) = situation.towards.any_orthonormal_pair();
            case.brain.gradient(place + 4.0 * (turn.cos() * a + turn.sin() * b))
        };
        let normal = (0..12).map(around).sum::<Vec3>().try_normalize().unwrap_or(situation.towards);
        let points = points(case, place);
        let fine = lattice::Fine { centre: place, radius_mm: FINE_MM, halvings: FINE.1 };
        let mesh =
            filled(case, &lattice::Config { target_tets: FINE.0, fine: Some(fine), ..lattice::Config::default() });
        let mut push = Self { situation, place, normal, points, truth: Vec::new() };
        let choice = Tissue { solver: "tled", tets: FINE.0, still_mm: 0.0 };
        let body = Body::uniform(mesh.clone(), held(&mesh), brains.material);
        push.truth = push.run(&mesh, &choice, &mut Solver::of(&body, &choice, brains.damping)).0;
        push
    }

    /// Every choice, in the order of the brains.
    pub fn measure(&self, brains: &mut Brains) -> Vec<Found> {
        let one = |(choice, mesh, solver): &mut (Tissue, TetMesh, Solver)| {
            let (places, awake, ns) = self.run(mesh, choice, solver);
            solver.reset(choice.solver);
            let off = places.iter().zip(&self.truth).map(|(a, b)| f64::from(a.distance(*b)));
            Found { error_mm: Samples::from(off.collect::<Vec<_>>()).quantile(0.95), awake, ns }
        };
        brains.brains.iter_mut().map(one).collect()
    }

    /// Displacements of the points at the end of push and slide, mean work of a step, and ns for each tetrahedron and step.
    fn run(&self, mesh: &TetMesh, choice: &Tissue, solver: &mut Solver) -> (Vec<Vec3>, f64, f64) {
        let (seats, touch) = (seats(mesh, &self.points), Touch::of(mesh, self.place));
        let dt_ms = solver.dt_ms(choice);
        let (mut loads, mut places) = (Loads::default(), Vec::new());
        let (mut work, mut steps, start) = (0.0, 0u32, Instant::now());
        let ends = [TIMES_MS[0] + TIMES_MS[1], TIMES_MS.iter().sum()];
        let (mut now, mut next) = (0.0f32, 0.0f32);
        for end in ends {
            while now < end {
                if now >= next {
                    loads.contacts = self.contact(mesh, &touch, now).into();
                    next += TURN_MS;
                }
                solver.step(&loads, dt_ms);
                work += solver.work();
                (steps, now) = (steps + 1, now + dt_ms);
            }
            places.extend(
                seats.iter().zip(&self.points).map(|(seat, point)| seat.place(mesh, solver.positions()) - *point),
            );
        }
        let ns = start.elapsed().as_secs_f64() * 1e9 / (f64::from(steps) * mesh.tets.len() as f64);
        (places, work / f64::from(steps), ns)
    }

    /// The tool at a time: its disc's spring on the triangles under it.
    fn contact(&self, mesh: &TetMesh, touch: &Touch, now_ms: f32) -> NodalContact {
        let (scene, way) = (&self.situation.scene, (now_ms - TIMES_MS[0] - TIMES_MS[1]) / TIMES_MS[2]);
        let along = self.situation.along(self.normal);
        let middle = self.place + way.clamp(0.0, 1.0) * self.situation.slide_mm * along;
        let in_share = (now_ms / TIMES_MS[0]).min(1.0);
        let depth = scene.tissue_motion_mm as f32 * in_share * in_share * (3.0 - 2.0 * in_share);
        let mut contact = NodalContact::none();
        (contact.normal, contact.stiffness, contact.damping) = (self.normal, 0.5, 0.05);
        let (a, b) = self.normal.any_orthonormal_pair();
        for n in 0..19 {
            // Sunflower points: even over a disc.
            let (far, turn) =
                (((n as f32 + 0.5) / 19.0).sqrt() * 0.7 * scene.probe_radius_mm as f32, n as f32 * 2.399_963);
            touch.press(mesh, middle + far * (turn.cos() * a + turn.sin() * b), &mut contact);
        }
        contact.normalise();
        let rest = contact.mean(|n| mesh.positions[n as usize]).dot(self.normal);
        contact.offset_mm = depth - rest;
        contact
    }
}

/// A solver of either crate.
enum Solver {
    Tled(Box<Tled>),
    Rival(Box<dyn SoftSolver>, Box<Body>),
}

impl Solver {
    fn of(body: &Body, choice: &Tissue, damping: Damping) -> Self {
        if choice.solver == "tled" {
            let config = Config { still_mm: choice.still_mm as f32, damping, ..Config::default() };
            return Self::Tled(Box::new(Tled::new(body, &config).expect("the brain is sound")));
        }
        Self::Rival(rival(choice.solver, body), Box::new(body.clone()))
    }

    /// Back at rest.
    fn reset(&mut self, name: &str) {
        match self {
            Self::Tled(solver) => solver.reset(),
            Self::Rival(solver, body) => *solver = rival(name, body),
        }
    }

    fn seam(&mut self) -> &mut dyn SoftSolver {
        match self {
            Self::Tled(solver) => solver.as_mut(),
            Self::Rival(solver, _) => solver.as_mut(),
        }
    }

    fn dt_ms(&mut self, choice: &Tissue) -> f32 {
        let longest = LONGEST_MS[usize::from(choice.solver == "corotational")];
        self.seam().stable_dt_ms().min(longest)
    }

    fn step(&mut self, loads: &Loads, dt_ms: f32) {
        self.seam().step(loads, dt_ms);
    }

    fn positions(&mut self) -> &[Vec3] {
        self.seam().positions()
    }

    /// Share of the work of a step with every tetrahedron awake.
    fn work(&self) -> f64 {
        match self {
            Self::Tled(solver) => ASLEEP + (1.0 - ASLEEP) * f64::from(solver.awake_share()),
            Self::Rival(..) => 1.0,
        }
    }
}

fn rival(name: &str, body: &Body) -> Box<dyn SoftSolver> {
    Method::named(name).expect("a stored solver exists").build(body).expect("the brain is sound")
}

/// Surface nodes in the lower part, which the skull holds.
fn held(mesh: &TetMesh) -> Vec<u32> {
    let bounds = mesh.bounds();
    let top = bounds.min.z + HELD * bounds.size().z;
    Surface::of(mesh).nodes().into_iter().filter(|&n| mesh.positions[n as usize].z <= top).collect()
}

/// Points of the brain around the opening, on a lattice.
fn points(case: &Case, place: Vec3) -> Vec<Vec3> {
    let [apart, reach] = POINTS_MM;
    let n = (reach / apart) as i32;
    let all = (0..(2 * n + 1).pow(3)).map(|at| {
        let side = 2 * n + 1;
        place + apart * glam::IVec3::new(at % side - n, at / side % side - n, at / (side * side) - n).as_vec3()
    });
    all.filter(|p| p.distance(place) <= reach && case.brain.sample(*p) < -0.5).collect()
}

/// Triangles near the opening.
struct Touch(Vec<[u32; 3]>);

impl Touch {
    fn of(mesh: &TetMesh, place: Vec3) -> Self {
        let near = |t: &[u32; 3]| t.iter().any(|&n| mesh.positions[n as usize].distance(place) < 40.0);
        Self(Surface::of(mesh).triangles.into_iter().filter(near).collect())
    }

    /// Adds a point's weight to the corners of the nearest triangle.
    fn press(&self, mesh: &TetMesh, point: Vec3, contact: &mut NodalContact) {
        let corners = |t: &[u32; 3]| t.map(|n| mesh.positions[n as usize]);
        let weights = self.0.iter().map(|t| (t, nearest(point, corners(t))));
        let off = |(t, w): &(&[u32; 3], [f32; 3])| {
            let at: Vec3 = corners(t).iter().zip(w).map(|(c, w)| *c * *w).sum();
            at.distance_squared(point)
        };
        if let Some((t, w)) = weights.min_by(|a, b| off(a).total_cmp(&off(b))) {
            t.iter().zip(w).for_each(|(&n, w)| contact.add(n, w));
        }
    }
}

/// Weights of the corners of a triangle at its point nearest to `p`, near enough: the foot on the plane, cut to the triangle.
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
