//! The oracle: equilibrium or motion of a hyperelastic body, f64, Newton's method with an exact
//! tangent and a sparse Cholesky factor.
//!
//! # Theory
//! Minimises the potential energy `Π(u) = Σ V W(F) - Σ m g·u + Π_contact(u)`. Each iteration solves
//! `(K + k v vᵀ + τ I) Δu = -∂Π/∂u`, `v = w ⊗ n` being a contact spring (rank-one terms, taken in
//! one by one by the Sherman-Morrison formula), τ a shift that grows until the matrix is positive
//! definite; a line search makes sure that Π falls. The loads are not stepped: with an energy that
//! is finite for every state, descent alone finds the equilibrium. Pressure follows the surface:
//! its forces are held while Π is minimised, then computed anew, until they agree.
//!
//! In motion ([`Config::motion`]) a step of length h minimises `Π + Σ m/(2 β h²) |u - ũ|²`,
//! Newmark's method with β = 1/4, γ = 1/2: second order, and of itself undamped.
//! `ũ = u + h v + h² a/4`, `a⁺ = (u⁺ - ũ)/(β h²)`, `v⁺ = v + h (a + a⁺)/2`.
//!
//! # Practice
//! At rest a "step" goes all the way to equilibrium under the loads, whatever `dt_ms` is;
//! velocities are zero. About 0.1 s an iteration at 5,000 linear tetrahedra. Prescribed
//! displacements: [`Reference::prescribe`].
//!
//! # When not to use it
//! In any loop that must keep a rate. Where several equilibria exist it finds one of them, not the
//! one that dynamics would reach.

mod cells;

use crate::bound::dot;
use crate::factor::Factor;
use crate::method::Descriptor;
use crate::tangent::{RankOne, known};
use crate::{Body, BodyError, Law, Loads, Material, NodeState, SoftSolver, StepReport, SurfacePressure};
use cells::{Cell, Cells};
use glam::{DMat3, DVec3};

pub use cells::Order;

/// Newmark's β; with γ = 1/2 the method of constant average acceleration.
const BETA: f64 = 0.25;
/// Most times that the forces of pressure are computed anew in one step.
const FOLLOWS: usize = 30;

/// Settings of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Most Newton iterations in one step.
    pub iterations: u32,
    /// Done when no residual force is over this share of the largest nodal force, without unit.
    pub tolerance: f64,
    /// Degree of the elements' shape functions.
    pub order: Order,
    /// Steps through time with inertia, undamped, instead of to equilibrium.
    pub motion: bool,
}

impl Default for Config {
    fn default() -> Self {
        Self { iterations: 200, tolerance: 1e-9, order: Order::Linear, motion: false }
    }
}

/// Implicit hyperelastic solver.
pub struct Reference {
    config: Config,
    laws: Vec<Law>,
    stiffness_mpa: f64,
    cells: Cells,
    factor: Factor,
    u: Vec<DVec3>,
    velocity: Vec<DVec3>,
    acceleration: Vec<DVec3>,
    pressure: SurfacePressure,
    pushed: Vec<DVec3>,
    state: NodeState,
}

/// Energy, forces and state of one trial displacement.
struct Trial {
    energy: f64,
    residual: Vec<DVec3>,
    scale: f64,
    inverted: u32,
    /// Springs that press, by their place in the loads.
    pressing: Vec<usize>,
    contact_n: f64,
}

/// What inertia adds to a step: `m/(β h²)` and where a node would go by itself.
struct Inertia {
    stiffness_per_g: f64,
    ahead: Vec<DVec3>,
}

impl Reference {
    /// Factors the pattern of a body; one that is not in motion must be held by its fixed nodes.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        body.check()?;
        let cells = Cells::of(body, config.order);
        let factor = Factor::of(&cells.fixed, cells.cells.iter().map(|cell| &cell.nodes[..]));
        let loose = if config.motion { None } else { body.unsupported() };
        let factor = factor.filter(|_| loose.is_none()).ok_or(BodyError::Floating(loose.unwrap_or_default()))?;
        let zero = || vec![DVec3::ZERO; cells.rest.len()];
        Ok(Self {
            config: *config,
            laws: body.materials.iter().map(Material::law).collect(),
            stiffness_mpa: body.materials.iter().map(Material::shear_mpa).fold(0.0, f64::max),
            factor,
            u: zero(),
            velocity: zero(),
            acceleration: zero(),
            pushed: zero(),
            pressure: SurfacePressure::default(),
            cells,
            state: NodeState::at_rest(&body.mesh),
        })
    }

    /// Number of the mesh's nodes; those in the middle of edges follow.
    fn count(&self) -> usize {
        self.state.positions.len()
    }

    /// Moves a fixed node to `displacement` from its rest position, mm; the next step finds the
    /// equilibrium around it.
    pub fn prescribe(&mut self, node: u32, displacement: DVec3) {
        if self.cells.fixed.get(node as usize) == Some(&true) && (node as usize) < self.count() {
            self.u[node as usize] = displacement;
        }
    }

    /// Sets the state of all nodes of the mesh by their rest position: displacement, mm, and
    /// velocity, mm/ms. Fixed nodes stay.
    pub fn set(&mut self, state: impl Fn(DVec3) -> (DVec3, DVec3)) {
        for n in (0..self.u.len()).filter(|&n| !self.cells.fixed[n]) {
            (self.u[n], self.velocity[n]) = state(self.cells.rest[n]);
        }
        self.acceleration = self.at_rest_or_free_fall();
    }

    /// Puts pressure on some triangles; those that name nodes outside the mesh are left out.
    pub fn set_pressure(&mut self, mut pressure: SurfacePressure) {
        let nodes = self.count();
        pressure.triangles.retain(|t| t.iter().all(|&n| (n as usize) < nodes));
        self.pressure = pressure;
    }

    /// Displacements of the mesh's nodes from their rest positions, mm.
    pub fn displacements(&self) -> &[DVec3] {
        &self.u[..self.count()]
    }

    /// Force that the support exerts on each node of the mesh, N; zero at free nodes in
    /// equilibrium.
    pub fn reactions(&self, loads: &Loads) -> Vec<DVec3> {
        let mut reactions = self.trial(&self.u, loads, None, false).residual;
        let middles = reactions.split_off(self.count());
        for ((ends, force), fixed) in self.cells.ends.iter().zip(middles).zip(&self.cells.fixed[self.count()..]) {
            ends.iter().filter(|_| *fixed).for_each(|&n| reactions[n as usize] += force * 0.5);
        }
        reactions
    }

    /// Elastic and kinetic energy, N mm.
    pub fn energy(&self) -> f64 {
        let kinetic: f64 =
            self.velocity.iter().zip(&self.cells.masses).map(|(v, m)| 0.5 * m * v.length_squared()).sum();
        self.trial(&self.u, &Loads::default(), None, false).energy + kinetic
    }

    /// Acceleration without loads in the present state.
    fn at_rest_or_free_fall(&self) -> Vec<DVec3> {
        let forces = self.trial(&self.u, &Loads::default(), None, true).residual;
        forces.iter().zip(&self.cells.masses).map(|(f, m)| -*f / *m).collect()
    }

    fn trial(&self, u: &[DVec3], loads: &Loads, inertia: Option<&Inertia>, only_free: bool) -> Trial {
        let mut trial = Trial {
            energy: 0.0,
            residual: vec![DVec3::ZERO; u.len()],
            scale: 0.0,
            inverted: 0,
            pressing: Vec::new(),
            contact_n: 0.0,
        };
        self.cells.cells.iter().for_each(|cell| add_cell(cell, &self.laws[cell.material], u, &mut trial));
        for (n, (u, r)) in u.iter().zip(&mut trial.residual).enumerate() {
            let force = loads.gravity.as_dvec3() * self.cells.weights[n] + self.pushed[n];
            trial.energy -= force.dot(*u);
            *r -= force;
            trial.scale = trial.scale.max(force.length());
            if let Some(inertia) = inertia {
                let (stiffness, away) = (inertia.stiffness_per_g * self.cells.masses[n], *u - inertia.ahead[n]);
                trial.energy += 0.5 * stiffness * away.length_squared();
                *r += away * stiffness;
                trial.scale = trial.scale.max(stiffness * away.length());
            }
        }
        self.press(u, loads, &mut trial);
        if only_free {
            trial.residual.iter_mut().zip(&self.cells.fixed).filter(|(_, f)| **f).for_each(|(r, _)| *r = DVec3::ZERO);
        }
        trial
    }

    fn press(&self, u: &[DVec3], loads: &Loads, trial: &mut Trial) {
        for (place, contact) in loads.contacts.all().enumerate() {
            let moved = |(n, w): (usize, f64)| (self.cells.rest[n] + u[n]) * w;
            let mean: DVec3 = known(&contact, self.count()).map(moved).sum();
            let depth = f64::from(contact.offset_mm) + mean.dot(contact.normal.as_dvec3());
            let stiffness = f64::from(contact.stiffness);
            if contact.is_empty() || !(depth > 0.0 && stiffness > 0.0) {
                continue;
            }
            trial.pressing.push(place);
            trial.energy += 0.5 * stiffness * depth * depth;
            trial.contact_n += stiffness * depth;
            trial.scale = trial.scale.max(stiffness * depth);
            let normal = contact.normal.as_dvec3();
            known(&contact, self.count()).for_each(|(n, w)| trial.residual[n] += normal * (stiffness * depth * w));
        }
    }

    /// Assembles and factors the tangent, shifted until it is positive definite.
    fn factor_tangent(&mut self, inertia: Option<&Inertia>) -> bool {
        let (mut shift, masses) = (0.0, &self.cells.masses);
        for _ in 0..12 {
            self.factor.clear();
            for cell in &self.cells.cells {
                add_tangent(&mut self.factor, &self.laws[cell.material], cell, &self.u);
            }
            let of_mass = inertia.map_or(0.0, |inertia| inertia.stiffness_per_g);
            self.factor.add_diagonal(|n| shift + of_mass * masses[n]);
            if self.factor.factor() {
                return true;
            }
            let length_mm = self.cells.cells[0].points[0].volume_mm3.cbrt();
            shift = (4.0 * shift).max(1e-3 * self.stiffness_mpa * length_mm);
        }
        false
    }

    /// The Newton step for a residual, with the springs that press in the matrix: one rank-one term
    /// after the other.
    fn newton_step(&mut self, trial: &Trial, loads: &Loads) -> Vec<DVec3> {
        let mut terms: Vec<RankOne> = Vec::with_capacity(trial.pressing.len());
        let pressing = |place: &usize| trial.pressing.contains(place);
        for contact in loads.contacts.all().enumerate().filter(|(place, _)| pressing(place)).map(|(_, c)| c) {
            let mut v = vec![DVec3::ZERO; trial.residual.len()];
            let (normal, free) = (contact.normal.as_dvec3(), |(n, _): &(usize, f64)| !self.cells.fixed[*n]);
            known(&contact, self.count()).filter(free).for_each(|(n, w)| v[n] += normal * w);
            let mut solved = v.clone();
            self.factor.solve(&mut solved);
            terms.iter().for_each(|term| term.correct(&mut solved));
            terms.push(RankOne { below: 1.0 / f64::from(contact.stiffness) + dot(&v, &solved), v, solved });
        }
        let mut step: Vec<DVec3> = trial.residual.iter().map(|r| -*r).collect();
        self.factor.solve(&mut step);
        terms.iter().for_each(|term| term.correct(&mut step));
        step
    }

    /// Goes along `step` as far as the energy falls; `None` when it does not.
    fn descend(&mut self, step: &[DVec3], from: &Trial, loads: &Loads, inertia: Option<&Inertia>) -> Option<Trial> {
        let slope: f64 = step.iter().zip(&from.residual).map(|(s, r)| s.dot(*r)).sum();
        let before = self.u.clone();
        let mut share = 1.0;
        for _ in 0..40 {
            self.u.iter_mut().zip(&before).zip(step).for_each(|((u, b), s)| *u = *b + *s * share);
            let trial = self.trial(&self.u, loads, inertia, true);
            let slack = 1e-13 * from.energy.abs().max(trial.energy.abs());
            if trial.energy <= from.energy + 1e-4 * share * slope + slack {
                return Some(trial);
            }
            share *= 0.5;
        }
        self.u = before;
        None
    }

    /// Minimises the energy from the present displacements on.
    fn minimise(&mut self, loads: &Loads, inertia: Option<&Inertia>, report: &mut StepReport) {
        let mut trial = self.trial(&self.u, loads, inertia, true);
        while report.iterations < self.config.iterations {
            let worst = trial.residual.iter().map(|r| r.length()).fold(0.0, f64::max);
            report.converged = worst <= self.config.tolerance * trial.scale.max(1e-12);
            if report.converged || !self.factor_tangent(inertia) {
                break;
            }
            let step = self.newton_step(&trial, loads);
            let Some(next) = self.descend(&step, &trial, loads, inertia) else { break };
            trial = next;
            report.iterations += 1;
        }
        (report.inverted, report.contact_n) = (trial.inverted, trial.contact_n as f32);
    }

    /// Computes the forces of pressure anew; gives by how much they changed, as a share of the
    /// largest.
    fn push(&mut self) -> f64 {
        let count = self.count();
        let now: Vec<DVec3> = self.cells.rest[..count].iter().zip(&self.u).map(|(x, u)| *x + *u).collect();
        let mut pushed = vec![DVec3::ZERO; self.u.len()];
        self.pressure.add_to(&now, &mut pushed);
        let change = pushed.iter().zip(&self.pushed).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
        let largest = pushed.iter().map(|f| f.length()).fold(0.0, f64::max);
        self.pushed = pushed;
        if change == 0.0 { 0.0 } else { change / largest.max(f64::MIN_POSITIVE) }
    }

    /// Where every node would go by itself in a step of `h`.
    fn inertia(&self, h: f64) -> Inertia {
        let ahead = |n: usize| {
            let free = if self.cells.fixed[n] { 0.0 } else { 1.0 };
            self.u[n] + (self.velocity[n] * h + self.acceleration[n] * ((0.5 - BETA) * h * h)) * free
        };
        Inertia { stiffness_per_g: 1.0 / (BETA * h * h), ahead: (0..self.u.len()).map(ahead).collect() }
    }

    /// Velocity and acceleration at the end of a step.
    fn arrive(&mut self, inertia: &Inertia, h: f64) {
        for n in (0..self.u.len()).filter(|&n| !self.cells.fixed[n]) {
            let acceleration = (self.u[n] - inertia.ahead[n]) * inertia.stiffness_per_g;
            self.velocity[n] += (self.acceleration[n] + acceleration) * (0.5 * h);
            self.acceleration[n] = acceleration;
        }
    }
}

impl SoftSolver for Reference {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        let mut report = StepReport { substeps: 1, ..StepReport::default() };
        let count = self.count();
        for (i, &[a, b]) in self.cells.ends.iter().enumerate().filter(|(i, _)| self.cells.fixed[count + i]) {
            self.u[count + i] = (self.u[a as usize] + self.u[b as usize]) * 0.5;
        }
        let h = f64::from(dt_ms);
        let inertia = (self.config.motion && h > 0.0).then(|| self.inertia(h));
        for _ in 0..FOLLOWS {
            let change = self.push();
            self.minimise(loads, inertia.as_ref(), &mut report);
            if self.pressure.triangles.is_empty() || change < 1e-3 * self.config.tolerance.sqrt() || !report.converged {
                break;
            }
        }
        if let Some(inertia) = inertia {
            self.arrive(&inertia, h);
        }
        (0..count).for_each(|n| self.state.set(n, self.cells.rest[n] + self.u[n], self.velocity[n]));
        report
    }

    fn state(&self) -> &NodeState {
        &self.state
    }

    fn stable_dt_ms(&self) -> f32 {
        f32::INFINITY
    }
}

fn add_cell(cell: &Cell, law: &Law, u: &[DVec3], trial: &mut Trial) {
    let mut turned = false;
    for point in &cell.points {
        let f = cell.deformation(point, u);
        trial.energy += point.volume_mm3 * law.energy(f);
        turned |= f.determinant() <= 0.0;
        let stress = law.stress(f) * point.volume_mm3;
        for (&n, gradient) in cell.nodes.iter().zip(&point.gradients) {
            let force = stress * *gradient;
            trial.residual[n as usize] += force;
            trial.scale = trial.scale.max(force.length());
        }
    }
    trial.inverted += u32::from(turned);
}

/// Adds one cell's tangent: block (a, b) has the columns `V (∂P/∂F : e_c ⊗ ∇N_b) ∇N_a`.
fn add_tangent(factor: &mut Factor, law: &Law, cell: &Cell, u: &[DVec3]) {
    let count = cell.nodes.len();
    let mut blocks = [DMat3::ZERO; 100];
    for point in &cell.points {
        let f = cell.deformation(point, u);
        for (b, g) in point.gradients.iter().enumerate() {
            let changes = [DVec3::X, DVec3::Y, DVec3::Z]
                .map(|e| law.stress_change(f, DMat3::from_cols(e * g.x, e * g.y, e * g.z)) * point.volume_mm3);
            for (a, gradient) in point.gradients.iter().enumerate() {
                blocks[a * count + b] +=
                    DMat3::from_cols(changes[0] * *gradient, changes[1] * *gradient, changes[2] * *gradient);
            }
        }
    }
    for (at, block) in blocks[..count * count].iter().enumerate() {
        factor.add(cell.nodes[at / count], cell.nodes[at % count], *block);
    }
}

/// What the solver says of itself.
pub const METHOD: Descriptor = Descriptor {
    name: "reference",
    source: "Newton iteration on the hyperelastic energy, f64",
    is_static: true,
    build: |body| Ok(Box::new(Reference::new(body, &Config::default())?)),
};
