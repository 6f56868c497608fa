//! The oracle: static equilibrium of a hyperelastic body, f64, Newton's method with an exact tangent and a sparse Cholesky factor.
//!
//! # Theory
//! Minimises the potential energy `Π(u) = Σ V W(F) - Σ m g·u + Π_contact(u)`. Each iteration solves `(K + k v vᵀ + τ I) Δu = -∂Π/∂u`,
//! `v = w ⊗ n` being the tool's spring (a rank-one term, taken in by the Sherman-Morrison formula), τ a shift that grows until the matrix
//! is positive definite; a line search makes sure that Π falls. The loads are not stepped: with an energy that is finite for every state,
//! descent alone finds the equilibrium.
//!
//! # Practice
//! A "step" goes all the way to equilibrium under the loads, whatever `dt_ms` is; velocities are zero. About 0.1 s an iteration at
//! 5,000 tetrahedra. Prescribed displacements: [`Reference::prescribe`].
//!
//! # When not to use it
//! In any loop that must keep a rate. Where several equilibria exist it finds one of them, not the one that dynamics would reach.

use crate::body::Element;
use crate::factor::Factor;
use crate::{Body, BodyError, Law, Loads, Material, Shape, SoftSolver, StepReport};
use glam::{DMat3, DVec3};
use trepan_geometry::Vec3;

/// Settings of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Most Newton iterations in one step.
    pub iterations: u32,
    /// Done when no residual force is over this share of the largest nodal force, without unit.
    pub tolerance: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { iterations: 200, tolerance: 1e-9 }
    }
}

/// Static hyperelastic solver.
pub struct Reference {
    config: Config,
    laws: Vec<Law>,
    stiffness_mpa: f64,
    elements: Vec<Element>,
    rest: Vec<DVec3>,
    masses: Vec<f64>,
    fixed: Vec<bool>,
    factor: Factor,
    u: Vec<DVec3>,
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
}

/// Energy, forces and state of one trial displacement.
struct Trial {
    energy: f64,
    residual: Vec<DVec3>,
    scale: f64,
    inverted: u32,
    pressing: bool,
    contact_n: f64,
}

impl Reference {
    /// Factors the pattern of a body that is held by its fixed nodes.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        body.check()?;
        let factor = Factor::of(body).filter(|_| body.is_held()).ok_or(BodyError::Floating(body.fixed.len()))?;
        let nodes = body.mesh.positions.len();
        Ok(Self {
            config: *config,
            laws: body.materials.iter().map(Material::law).collect(),
            stiffness_mpa: body.materials.iter().map(Material::shear_mpa).fold(0.0, f64::max),
            elements: body.elements(),
            rest: body.mesh.positions.iter().map(|p| p.as_dvec3()).collect(),
            masses: body.lumped_masses_g(),
            fixed: body.fixed_mask(),
            factor,
            u: vec![DVec3::ZERO; nodes],
            positions: body.mesh.positions.clone(),
            velocities: vec![Vec3::ZERO; nodes],
        })
    }

    /// Moves a fixed node to `displacement` from its rest position, mm; the next step finds the equilibrium around it.
    pub fn prescribe(&mut self, node: u32, displacement: DVec3) {
        if self.fixed.get(node as usize) == Some(&true) {
            self.u[node as usize] = displacement;
        }
    }

    /// Displacements from the rest positions, mm.
    pub fn displacements(&self) -> &[DVec3] {
        &self.u
    }

    /// Force that the support exerts on each node, N; zero at free nodes in equilibrium.
    pub fn reactions(&self, loads: &Loads) -> Vec<DVec3> {
        self.trial(&self.u, loads, false).residual
    }

    fn trial(&self, u: &[DVec3], loads: &Loads, only_free: bool) -> Trial {
        let mut trial = Trial {
            energy: 0.0,
            residual: vec![DVec3::ZERO; u.len()],
            scale: 0.0,
            inverted: 0,
            pressing: false,
            contact_n: 0.0,
        };
        for Element { corners, shape, material } in &self.elements {
            let law = &self.laws[usize::from(*material)];
            let f = DMat3::IDENTITY + shape.gradient_of(corners.map(|n| u[n as usize]));
            trial.energy += shape.volume_mm3 * law.energy(f);
            trial.inverted += u32::from(f.determinant() <= 0.0);
            for (&n, force) in corners.iter().zip(shape.forces_of(law.stress(f))) {
                trial.residual[n as usize] += force;
                trial.scale = trial.scale.max(force.length());
            }
        }
        for ((u, r), m) in u.iter().zip(&mut trial.residual).zip(&self.masses) {
            let weight = loads.gravity.as_dvec3() * *m;
            trial.energy -= weight.dot(*u);
            *r -= weight;
            trial.scale = trial.scale.max(weight.length());
        }
        self.press(u, loads, &mut trial);
        if only_free {
            trial.residual.iter_mut().zip(&self.fixed).filter(|(_, f)| **f).for_each(|(r, _)| *r = DVec3::ZERO);
        }
        trial
    }

    fn press(&self, u: &[DVec3], loads: &Loads, trial: &mut Trial) {
        let (contact, normal) = (&loads.contact, loads.contact.normal.as_dvec3());
        let mean: DVec3 = contact.nodes().map(|(n, w)| (self.rest[n as usize] + u[n as usize]) * f64::from(w)).sum();
        let depth = f64::from(contact.offset_mm) + mean.dot(normal);
        trial.pressing = !contact.is_empty() && depth > 0.0 && contact.stiffness > 0.0;
        if trial.pressing {
            let stiffness = f64::from(contact.stiffness);
            trial.energy += 0.5 * stiffness * depth * depth;
            trial.contact_n = stiffness * depth;
            trial.scale = trial.scale.max(trial.contact_n);
            contact
                .nodes()
                .for_each(|(n, w)| trial.residual[n as usize] += normal * (stiffness * depth * f64::from(w)));
        }
    }

    /// Assembles and factors the tangent, shifted until it is positive definite.
    fn factor_tangent(&mut self) -> bool {
        let mut shift = 0.0;
        for _ in 0..12 {
            self.factor.clear();
            for Element { corners, shape, material } in &self.elements {
                let f = DMat3::IDENTITY + shape.gradient_of(corners.map(|n| self.u[n as usize]));
                add_element(&mut self.factor, &self.laws[usize::from(*material)], corners, shape, f);
            }
            self.factor.add_diagonal(shift);
            if self.factor.factor() {
                return true;
            }
            shift = (4.0 * shift).max(1e-3 * self.stiffness_mpa * self.elements[0].shape.volume_mm3.cbrt());
        }
        false
    }

    /// The Newton step for a residual, with the tool's spring in the matrix when it presses.
    fn newton_step(&mut self, trial: &Trial, loads: &Loads) -> Vec<DVec3> {
        let mut step: Vec<DVec3> = trial.residual.iter().map(|r| -*r).collect();
        self.factor.solve(&mut step);
        if trial.pressing {
            let mut v = vec![DVec3::ZERO; step.len()];
            loads.contact.nodes().for_each(|(n, w)| v[n as usize] += loads.contact.normal.as_dvec3() * f64::from(w));
            v.iter_mut().zip(&self.fixed).filter(|(_, f)| **f).for_each(|(v, _)| *v = DVec3::ZERO);
            let mut solved = v.clone();
            self.factor.solve(&mut solved);
            let dot = |a: &[DVec3]| a.iter().zip(&v).map(|(a, v)| a.dot(*v)).sum::<f64>();
            let share = dot(&step) / (1.0 / f64::from(loads.contact.stiffness) + dot(&solved));
            step.iter_mut().zip(&solved).for_each(|(s, c)| *s -= *c * share);
        }
        step
    }

    /// Goes along `step` as far as the energy falls; `None` when it does not.
    fn descend(&mut self, step: &[DVec3], from: &Trial, loads: &Loads) -> Option<Trial> {
        let slope: f64 = step.iter().zip(&from.residual).map(|(s, r)| s.dot(*r)).sum();
        let before = self.u.clone();
        let mut share = 1.0;
        for _ in 0..40 {
            self.u.iter_mut().zip(&before).zip(step).for_each(|((u, b), s)| *u = *b + *s * share);
            let trial = self.trial(&self.u, loads, true);
            let slack = 1e-13 * from.energy.abs().max(trial.energy.abs());
            if trial.energy <= from.energy + 1e-4 * share * slope + slack {
                return Some(trial);
            }
            share *= 0.5;
        }
        self.u = before;
        None
    }
}

impl SoftSolver for Reference {
    fn step(&mut self, loads: &Loads, _dt_ms: f32) -> StepReport {
        let mut trial = self.trial(&self.u, loads, true);
        let mut report = StepReport { substeps: 1, contact_scale: 1.0, ..StepReport::default() };
        while report.iterations < self.config.iterations {
            let worst = trial.residual.iter().map(|r| r.length()).fold(0.0, f64::max);
            report.converged = worst <= self.config.tolerance * trial.scale.max(1e-12);
            if report.converged || !self.factor_tangent() {
                break;
            }
            let step = self.newton_step(&trial, loads);
            let Some(next) = self.descend(&step, &trial, loads) else { break };
            trial = next;
            report.iterations += 1;
        }
        self.positions.iter_mut().zip(&self.rest).zip(&self.u).for_each(|((p, x), u)| *p = (*x + *u).as_vec3());
        StepReport { inverted: trial.inverted, contact_n: trial.contact_n as f32, ..report }
    }

    fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    fn velocities(&self) -> &[Vec3] {
        &self.velocities
    }

    fn stable_dt_ms(&self) -> f32 {
        f32::INFINITY
    }
}

/// Adds one element's tangent: block (a, b) has the columns `V (∂P/∂F : e_c ⊗ ∇N_b) ∇N_a`.
fn add_element(factor: &mut Factor, law: &Law, corners: &[u32; 4], shape: &Shape, f: DMat3) {
    for b in 0..4 {
        let g = shape.gradients[b];
        let forces = [DVec3::X, DVec3::Y, DVec3::Z]
            .map(|e| shape.forces_of(law.stress_change(f, DMat3::from_cols(e * g.x, e * g.y, e * g.z))));
        for a in 0..4 {
            let block = DMat3::from_cols(forces[0][a], forces[1][a], forces[2][a]);
            factor.add(corners[a], corners[b], block);
        }
    }
}
