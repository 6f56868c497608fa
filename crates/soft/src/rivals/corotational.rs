//! Corotational elasticity with implicit steps: large rotations, moderate strain, any step length.
//!
//! # Theory
//! Each element carries its own rotation R, so that strain is measured in a frame that turns with
//! it: `P = R (2 μ ε + λ tr ε I)`, `ε = sym(RᵀF) - I` (Müller and Gross 2004). A step of backward
//! Euler with R held solves
//! ```text
//! (M (1 + α h) + h² K_R + (h² k + h b) w wᵀ) v⁺ = M v + h (f_ext - f_int)        K_R = Σ R K Rᵀ
//! ```
//! by conjugate gradients, the tool's spring (k, b, w = weights ⊗ normal) in the matrix. R comes
//! from a few steps of Müller, Bender, Chentanez and Macklin 2016, which also find a rotation for
//! an inverted element.
//!
//! # Practice
//! No matrix is stored; about 20 ns a tetrahedron and iteration, some tens of iterations a step, no
//! allocation. Backward Euler damps fast motion of itself.
//!
//! # When not to use it
//! For strains over about 20 %: the stress grows linearly with stretch and does not resist
//! collapse. For vibration: it is damped by the step.

use crate::body::Element;
use crate::bound::dot;
use crate::method::Descriptor;
use crate::operator::Hooke;
use crate::rivals::nodes::{Nodes, known};
use crate::{Body, BodyError, Loads, NodeState, SoftSolver, StepReport};
use glam::{DMat3, DQuat, DVec3};
use trepan_contact::{MAX_PLANES, MAX_SPRINGS, NodalContact};

/// Settings of the corotational solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Mass-proportional damping α, 1/ms; `None` = critical for the lowest mode.
    pub damping_per_ms: Option<f32>,
    /// Most iterations of conjugate gradients in one step.
    pub iterations: u32,
    /// Done when the residual is below this share of the right side, without unit.
    pub tolerance: f64,
    /// Step length that [`SoftSolver::stable_dt_ms`] gives, ms. Stability sets no limit; rotations
    /// lag by one step.
    pub longest_ms: f32,
}

impl Default for Config {
    fn default() -> Self {
        Self { damping_per_ms: None, iterations: 100, tolerance: 1e-4, longest_ms: 4.0 }
    }
}

/// Corotational solver.
pub struct Corotational {
    config: Config,
    elements: Vec<Element>,
    turns: Vec<DQuat>,
    nodes: Nodes,
    hooke: Vec<Hooke>,
    system: System,
}

/// Vectors of conjugate gradients, and the springs that press.
struct System {
    right: Vec<DVec3>,
    residual: Vec<DVec3>,
    along: Vec<DVec3>,
    product: Vec<DVec3>,
    touches: Vec<Touch>,
}

/// A spring that presses in this step: `push + rate Σ w n·v` is its force, N.
struct Touch {
    spring: NodalContact,
    push: f64,
    rate: f64,
}

impl Corotational {
    /// Takes a body at rest.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        let longest_ms = config.longest_ms;
        let nodes = Nodes::of(body, config.damping_per_ms, || {
            let is_right = longest_ms > 0.0 && longest_ms.is_finite();
            BodyError::check_config(is_right, "longest_ms", longest_ms, "over 0 and finite")
        })?;
        let zero = || nodes.u.clone();
        Ok(Self {
            config: *config,
            elements: body.elements(),
            turns: vec![DQuat::IDENTITY; body.mesh.tets.len()],
            hooke: body.materials.iter().map(Hooke::of).collect(),
            system: System {
                right: zero(),
                residual: zero(),
                along: zero(),
                product: zero(),
                touches: Vec::with_capacity(MAX_SPRINGS + MAX_PLANES),
            },
            nodes,
        })
    }

    /// Turns every element's frame and puts `M v + h (f_ext - f_int)` into the right side; gives
    /// the number of inverted elements.
    fn balance(&mut self, gravity: DVec3, h: f64) -> u32 {
        let Nodes { v, masses, fixed, .. } = &self.nodes;
        for ((right, v), (m, fixed)) in self.system.right.iter_mut().zip(v).zip(masses.iter().zip(fixed)) {
            *right = if *fixed { DVec3::ZERO } else { (*v + gravity * h) * *m };
        }
        let mut inverted = 0;
        for (Element { corners, shape, material }, turn) in self.elements.iter().zip(&mut self.turns) {
            let f = DMat3::IDENTITY + shape.gradient_of(self.nodes.corners(corners));
            *turn = rotation_of(f, *turn);
            inverted += u32::from(f.determinant() <= 0.0);
            let r = DMat3::from_quat(*turn);
            let strain = r.transpose() * f - DMat3::IDENTITY;
            let stress = self.hooke[usize::from(*material)].stress(strain);
            scatter(&mut self.system.right, corners, &shape.forces_of(r * stress), -h, fixed);
        }
        inverted
    }

    /// `product = A along`.
    fn apply(&mut self, h: f64) {
        let System { along, product, touches, .. } = &mut self.system;
        let Nodes { masses, fixed, damping_per_ms, .. } = &self.nodes;
        for ((y, x), (m, fixed)) in product.iter_mut().zip(along.iter()).zip(masses.iter().zip(fixed)) {
            *y = if *fixed { DVec3::ZERO } else { *x * (*m * (1.0 + damping_per_ms * h)) };
        }
        for (Element { corners, shape, material }, turn) in self.elements.iter().zip(&self.turns) {
            let r = DMat3::from_quat(*turn);
            let g = r.transpose() * shape.gradient_of(corners.map(|n| along[n as usize]));
            let stress = self.hooke[usize::from(*material)].stress(g);
            scatter(product, corners, &shape.forces_of(r * stress), h * h, fixed);
        }
        for touch in touches {
            touch.spread(product, h * touch.rate * touch.along(along), fixed);
        }
    }

    /// Conjugate gradients for v from its present value; gives iterations and whether it converged.
    fn solve(&mut self, h: f64) -> (u32, bool) {
        self.system.along.copy_from_slice(&self.nodes.v);
        self.apply(h);
        let System { right, residual, along, product, .. } = &mut self.system;
        for ((r, b), y) in residual.iter_mut().zip(right.iter()).zip(product.iter()) {
            *r = *b - *y;
        }
        along.copy_from_slice(residual);
        let goal = self.config.tolerance.powi(2) * dot(right, right);
        let mut rr = dot(residual, residual);
        for iteration in 0..self.config.iterations {
            if rr <= goal {
                return (iteration, true);
            }
            self.apply(h);
            let System { residual, along, product, .. } = &mut self.system;
            let share = rr / dot(along, product);
            self.nodes.v.iter_mut().zip(along.iter()).for_each(|(v, p)| *v += *p * share);
            residual.iter_mut().zip(product.iter()).for_each(|(r, y)| *r -= *y * share);
            let next = dot(residual, residual);
            along.iter_mut().zip(residual.iter()).for_each(|(p, r)| *p = *r + *p * (next / rr));
            rr = next;
        }
        (self.config.iterations, rr <= goal)
    }

    /// Takes the springs that press now, and puts what they do at rest into the right side.
    fn touch(&mut self, loads: &Loads, h: f64) {
        self.system.touches.clear();
        for spring in loads.contacts.all().take(MAX_SPRINGS + MAX_PLANES) {
            let (Nodes { rest, u, fixed, .. }, normal) = (&self.nodes, spring.normal.as_dvec3());
            let place: f64 = known(&spring, u.len()).map(|(n, w)| w * (rest[n] + u[n]).dot(normal)).sum();
            let depth = f64::from(spring.offset_mm) + place;
            let (k, b) = (f64::from(spring.stiffness), f64::from(spring.damping));
            let push = k * depth - b * f64::from(spring.tool_normal_velocity);
            if depth > 0.0 && !spring.is_empty() {
                let touch = Touch { spring, push, rate: h * k + b };
                touch.spread(&mut self.system.right, -h * push, fixed);
                self.system.touches.push(touch);
            }
        }
    }

    /// Lets go of springs that would pull within this step; says whether there were any.
    fn let_go(&mut self, h: f64) -> bool {
        let before = self.system.touches.len();
        let System { touches, right, .. } = &mut self.system;
        touches.retain(|touch| {
            let pulls = touch.force(&self.nodes.v) < 0.0;
            if pulls {
                touch.spread(right, h * touch.push, &self.nodes.fixed);
            }
            !pulls
        });
        touches.len() < before
    }
}

impl SoftSolver for Corotational {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        let h = f64::from(dt_ms);
        let mut report = StepReport { substeps: 1, ..StepReport::default() };
        report.inverted = self.balance(loads.gravity.as_dvec3(), h);
        self.touch(loads, h);
        (report.iterations, report.converged) = self.solve(h);
        if self.let_go(h) {
            (report.iterations, report.converged) = self.solve(h);
        }
        report.contact_n =
            self.system.touches.iter().map(|touch| touch.force(&self.nodes.v).max(0.0)).sum::<f64>() as f32;
        self.nodes.advance(&mut report, |Nodes { u, v, .. }, n| (u[n] + v[n] * h, v[n]));
        report
    }

    fn state(&self) -> &NodeState {
        &self.nodes.state
    }

    fn stable_dt_ms(&self) -> f32 {
        self.config.longest_ms
    }
}

impl Touch {
    /// `Σ w n·x`, mm.
    fn along(&self, x: &[DVec3]) -> f64 {
        let sum: DVec3 = known(&self.spring, x.len()).map(|(n, w)| x[n] * w).sum();
        sum.dot(self.spring.normal.as_dvec3())
    }

    /// Adds `scale` times `w n` to free nodes.
    fn spread(&self, to: &mut [DVec3], scale: f64, fixed: &[bool]) {
        for (n, w) in known(&self.spring, fixed.len()).filter(|(n, _)| !fixed[*n]) {
            to[n] += self.spring.normal.as_dvec3() * (w * scale);
        }
    }

    /// With nodes at these velocities, N.
    fn force(&self, v: &[DVec3]) -> f64 {
        self.push + self.rate * self.along(v)
    }
}

/// Adds `scale` times an element's forces to its free nodes.
fn scatter(to: &mut [DVec3], corners: &[u32; 4], forces: &[DVec3; 4], scale: f64, fixed: &[bool]) {
    for (&n, force) in corners.iter().zip(forces) {
        if !fixed[n as usize] {
            to[n as usize] += *force * scale;
        }
    }
}

/// The rotation nearest to F, from a guess on.
fn rotation_of(f: DMat3, mut turn: DQuat) -> DQuat {
    for _ in 0..80 {
        let r = DMat3::from_quat(turn);
        let twist = r.x_axis.cross(f.x_axis) + r.y_axis.cross(f.y_axis) + r.z_axis.cross(f.z_axis);
        let along = r.x_axis.dot(f.x_axis) + r.y_axis.dot(f.y_axis) + r.z_axis.dot(f.z_axis);
        let omega = twist / (along.abs() + 1e-9);
        let angle = omega.length();
        if angle < 1e-9 || !angle.is_finite() {
            break;
        }
        turn = (DQuat::from_axis_angle(omega / angle, angle) * turn).normalize();
    }
    turn
}

/// What the solver says of itself.
pub const METHOD: Descriptor = Descriptor {
    name: "corotational",
    source: "Müller and Gross 2004",
    is_static: false,
    build: |body| Ok(Box::new(Corotational::new(body, &Config::default())?)),
};

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_rotation_of_a_stretched_turn_is_the_turn(axis in proptest::array::uniform3(-1.0f64..1.0), angle in 0.0f64..2.5, s in proptest::array::uniform3(0.5f64..2.0)) {
            let axis = DVec3::from_array(axis);
            prop_assume!(axis.length() > 0.1);
            let turn = DQuat::from_axis_angle(axis.normalize(), angle);
            let f = DMat3::from_quat(turn) * DMat3::from_diagonal(DVec3::from_array(s));
            let found = rotation_of(f, DQuat::IDENTITY);
            prop_assert!(found.dot(turn).abs() > 1.0 - 1e-6, "{found} {turn}");
        }
    }
}
