//! Corotational elasticity with implicit steps: large rotations, moderate strain, any step length.
//!
//! # Theory
//! Each element carries its own rotation R, so that strain is measured in a frame that turns with
//! it: `P = R (2 μ ε + λ tr ε I)`, `ε = sym(RᵀF) - I` (Müller and Gross 2004). A step of backward
//! Euler with R held solves
//! ```text
//! (M (1 + α h) + h² K_R + (h² k + h b) w wᵀ) v⁺ = M v + h (f_ext - f_int)        K_R = Σ R K Rᵀ
//! ```
//! by conjugate gradients with the diagonal as preconditioner, the tool's spring (k, b, w = weights
//! ⊗ normal) in the matrix. With the gradients turned once a step, `g = R ∇N`, an element's product
//! is that of small strain: `R K Rᵀ` of `∇N` is `K` of `g`. R comes from a few steps of Müller,
//! Bender, Chentanez and Macklin 2016, which also find a rotation for an inverted element.
//!
//! # Practice
//! No matrix is stored; about 5 ns a tetrahedron and iteration, f32, sixteen elements at once, some
//! tens of iterations a step, no allocation. Backward Euler damps fast motion of itself.
//!
//! # When not to use it
//! For strains over about 20 %: the stress grows linearly with stretch and does not resist
//! collapse. For vibration: it is damped by the step.
//!
//! # Sources
//! Müller and Gross 2004: an element's warped forces, `f = R K (Rᵀ x - x₀)`, and one linear system
//! a step by conjugate gradients. Müller et al. 2016: `ω = Σ rᵢ × aᵢ / (|Σ rᵢ·aᵢ| + ε)`, started
//! from the last step. Liberties: preconditioner, and a start from the last velocities; the
//! rotation's step is `2 atan(|ω|/2)` instead of `|ω|` (no trigonometry, the same fixed point); no
//! plasticity; damping by mass.

use super::linear::{SmallStrain, moduli_of};
use super::nodes::{Nodes, dot, known};
use super::parts::{
    Action, Block, Item, Motion, Parts, Rows, gradients_of, hooke, minus, plus, product, scaled, tetrahedra, times,
};
use glam::Vec4;
use trepan_contact::{MAX_PLANES, MAX_SPRINGS, NodalContact};
use trepan_soft::Descriptor;
use trepan_soft::simd::{Lane, dot as scalar_product};
use trepan_soft::{Body, BodyError, Loads, NodeState, SoftSolver, StepReport, Stiffness};

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

// Rows of an element: gradients at rest, gradients turned, moduli, turn (a quaternion, its scalar
// first).
const AT_REST: usize = 0;
const TURNED: usize = 9;
const MODULI: usize = 18;
const TURN: usize = 20;
const ROWS: usize = 24;

/// Corotational solver.
pub struct Corotational {
    config: Config,
    elements: Parts<ROWS>,
    nodes: Nodes,
    /// A third of K's trace at each node at rest, N/mm.
    diagonal: Vec<f32>,
    system: System,
}

/// Vectors of conjugate gradients, and the springs that press.
struct System {
    right: Vec<Vec4>,
    residual: Vec<Vec4>,
    along: Vec<Vec4>,
    product: Vec<Vec4>,
    /// Inverse diagonal of the matrix; 0 for fixed nodes.
    inverse: Vec<f32>,
    touches: Vec<Touch>,
}

/// A spring that presses in this step: `push + rate Σ w n·v` is its force, N.
struct Touch {
    spring: NodalContact,
    push: f64,
    rate: f64,
}

/// Turns each element's frame and gradients, and adds its forces.
struct Turning;

impl Action<ROWS> for Turning {
    #[inline(always)]
    fn act<L: Lane>(&self, block: &mut Block<ROWS>, lanes: usize, x: &mut Rows, sums: &mut Rows) -> u32 {
        let (edges, gradients) = (block.edges::<L>(lanes, x), block.gradients::<L>(lanes, AT_REST));
        let motion = Motion::of(&edges, &gradients);
        let [x, y, z] = block.vector(lanes, TURN + 1);
        let start = [block.number(lanes, TURN), x, y, z];
        let (turn, d) = turn_of(&motion.h, start);
        for k in 0..4 {
            turn[k].store(&mut block.rows[TURN + k], lanes);
        }
        let more = times(&d, &gradients);
        let turned = [plus(&gradients[0], &more[0]), plus(&gradients[1], &more[1]), plus(&gradients[2], &more[2])];
        for k in 0..9 {
            turned[k / 3][k % 3].store(&mut block.rows[TURNED + k], lanes);
        }
        // R ε Rᵀ = sym(F Rᵀ) - I = sym(H Rᵀ + (R - I)ᵀ).
        let moved = product(&edges, &turned);
        let strain = [
            [moved[0][0] + d[0][0], moved[0][1] + d[1][0], moved[0][2] + d[2][0]],
            [moved[1][0] + d[0][1], moved[1][1] + d[1][1], moved[1][2] + d[2][1]],
            [moved[2][0] + d[0][2], moved[2][1] + d[1][2], moved[2][2] + d[2][2]],
        ];
        let stress = hooke(&strain, block.number(lanes, MODULI), block.number(lanes, MODULI + 1));
        block.add(lanes, times(&stress, &turned), sums);
        motion.inverted()
    }
}

impl Corotational {
    /// Takes a body at rest.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        let longest_ms = config.longest_ms;
        let nodes = Nodes::of(body, config.damping_per_ms, || {
            let is_right = longest_ms > 0.0 && longest_ms.is_finite();
            BodyError::check_config(is_right, "longest_ms", longest_ms, "over 0 and finite")
        })?;
        let constants = |t: usize| {
            let (gradients, moduli) = (gradients_of(&body.shape(t)), moduli_of(body, t));
            std::array::from_fn(|row| match row {
                ..MODULI => gradients[row % 9],
                MODULI..TURN => moduli[row - MODULI],
                TURN => 1.0,
                _ => 0.0,
            })
        };
        let items: Vec<Item<ROWS>> = tetrahedra(body, constants);
        let zero = || nodes.u.clone();
        Ok(Self {
            config: *config,
            elements: Parts::spread(&items),
            diagonal: Stiffness::of(body).diagonal().iter().map(|trace| (trace / 3.0) as f32).collect(),
            system: System {
                right: zero(),
                residual: zero(),
                along: zero(),
                product: zero(),
                inverse: nodes.inverse_masses.clone(),
                touches: Vec::with_capacity(MAX_SPRINGS + MAX_PLANES),
            },
            nodes,
        })
    }

    /// Turns every element's frame and makes right side and inverse diagonal; gives the number of
    /// inverted elements.
    fn balance(&mut self, gravity: Vec4, h: f32) -> u32 {
        let Nodes { u, v, masses, inverse_masses, damping_per_ms, .. } = &self.nodes;
        let System { right, product, inverse, .. } = &mut self.system;
        let inverted = self.elements.sum(&Turning, u, product);
        for n in 0..u.len() {
            let is_free = inverse_masses[n] > 0.0;
            right[n] = if is_free { (v[n] + gravity * h) * masses[n] - product[n] * h } else { Vec4::ZERO };
            let diagonal = masses[n] * (1.0 + damping_per_ms * h) + h * h * self.diagonal[n];
            inverse[n] = if is_free { 1.0 / diagonal } else { 0.0 };
        }
        inverted
    }

    /// `product = A along`.
    fn apply(&mut self, h: f32) {
        let System { along, product, touches, .. } = &mut self.system;
        let Nodes { masses, inverse_masses, damping_per_ms, .. } = &self.nodes;
        self.elements.sum(&SmallStrain { gradients: TURNED, moduli: MODULI }, along, product);
        for ((y, x), (m, inverse)) in product.iter_mut().zip(along.iter()).zip(masses.iter().zip(inverse_masses)) {
            let is_free = *inverse > 0.0;
            *y = if is_free { *x * (*m * (1.0 + damping_per_ms * h)) + *y * (h * h) } else { Vec4::ZERO };
        }
        for touch in touches {
            touch.spread(product, f64::from(h) * touch.rate * touch.along(along), inverse_masses);
        }
    }

    /// Conjugate gradients for v from its present value; gives iterations and whether it converged.
    fn solve(&mut self, h: f32) -> (u32, bool) {
        self.system.along.copy_from_slice(&self.nodes.v);
        self.apply(h);
        let System { right, residual, along, product, inverse, .. } = &mut self.system;
        for n in 0..right.len() {
            residual[n] = right[n] - product[n];
            along[n] = residual[n] * inverse[n];
        }
        let goal = self.config.tolerance.powi(2) * dot(right, right);
        let (mut rr, mut rz) = (dot(residual, residual), dot(residual, along));
        for iteration in 0..self.config.iterations {
            if rr <= goal {
                return (iteration, true);
            }
            self.apply(h);
            let System { residual, along, product, inverse, .. } = &mut self.system;
            let share = (rz / dot(along, product)) as f32;
            for n in 0..along.len() {
                self.nodes.v[n] += along[n] * share;
                residual[n] -= product[n] * share;
                product[n] = residual[n] * inverse[n];
            }
            let next = dot(residual, product);
            let kept = (next / rz) as f32;
            along.iter_mut().zip(product.iter()).for_each(|(p, z)| *p = *z + *p * kept);
            (rr, rz) = (dot(residual, residual), next);
        }
        (self.config.iterations, rr <= goal)
    }

    /// Takes the springs that press now, and puts what they do at rest into the right side.
    fn touch(&mut self, loads: &Loads, h: f64) {
        self.system.touches.clear();
        for spring in loads.contacts.all().take(MAX_SPRINGS + MAX_PLANES) {
            let depth = self.nodes.depth_mm(&spring);
            let (k, b) = (f64::from(spring.stiffness), f64::from(spring.damping));
            let rate = h * k + b;
            let push = k * depth - rate * f64::from(spring.tool_normal_velocity);
            if depth > 0.0 && !spring.is_empty() {
                let touch = Touch { spring, push, rate };
                touch.spread(&mut self.system.right, -h * push, &self.nodes.inverse_masses);
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
                touch.spread(right, h * touch.push, &self.nodes.inverse_masses);
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
        report.inverted = self.balance(loads.gravity.extend(0.0), dt_ms);
        self.touch(loads, h);
        (report.iterations, report.converged) = self.solve(dt_ms);
        if self.let_go(h) {
            let again = self.solve(dt_ms);
            (report.iterations, report.converged) = (report.iterations + again.0, again.1);
        }
        report.contact_n =
            self.system.touches.iter().map(|touch| touch.force(&self.nodes.v).max(0.0)).sum::<f64>() as f32;
        self.nodes.advance(&mut report, |Nodes { u, v, .. }, n| (u[n] + v[n] * dt_ms, v[n]));
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
    fn along(&self, x: &[Vec4]) -> f64 {
        let normal = self.spring.normal.as_dvec3();
        known(&self.spring, x.len()).map(|(n, w)| w * x[n].truncate().as_dvec3().dot(normal)).sum()
    }

    /// Adds `scale` times `w n` to free nodes.
    fn spread(&self, to: &mut [Vec4], scale: f64, inverse_masses: &[f32]) {
        for (n, w) in known(&self.spring, to.len()).filter(|(n, _)| inverse_masses[*n] > 0.0) {
            to[n] += (self.spring.normal * (w * scale) as f32).extend(0.0);
        }
    }

    /// With nodes at these velocities, N.
    fn force(&self, v: &[Vec4]) -> f64 {
        self.push + self.rate * self.along(v)
    }
}

/// Most steps to a rotation, and the angle at which it is found, rad.
const STEPS: usize = 80;
const FOUND: f32 = 1e-6;

/// The rotation nearest to I + H from a guess on: its quaternion, scalar first, and R - I by rows.
#[inline(always)]
fn turn_of<L: Lane>(h: &[[L; 3]; 3], mut turn: [L; 4]) -> ([L; 4], [[L; 3]; 3]) {
    let mut d = rotation_less_one(&turn);
    for _ in 0..STEPS {
        // Σ rᵢ × aᵢ over the columns of R and F, without what cancels.
        let x = [minus(&h[0], &d[0]), minus(&h[1], &d[1]), minus(&h[2], &d[2])];
        let twist = [
            x[2][1] - x[1][2] + scalar_product(&d[1], &h[2]) - scalar_product(&d[2], &h[1]),
            x[0][2] - x[2][0] + scalar_product(&d[2], &h[0]) - scalar_product(&d[0], &h[2]),
            x[1][0] - x[0][1] + scalar_product(&d[0], &h[1]) - scalar_product(&d[1], &h[0]),
        ];
        let same = scalar_product(&d[0], &h[0]) + scalar_product(&d[1], &h[1]) + scalar_product(&d[2], &h[2]);
        let along = L::splat(3.0) + d[0][0] + d[1][1] + d[2][2] + h[0][0] + h[1][1] + h[2][2] + same;
        let size = along.with_sign_of(L::splat(1.0)) + L::splat(1e-9);
        let [a, b, c] = scaled(&twist, L::splat(0.5) / size);
        let quarter = a * a + b * b + c * c;
        if quarter.largest() <= 0.25 * FOUND * FOUND {
            break;
        }
        let [w, x, y, z] = turn;
        let next = [
            w - (a * x + b * y + c * z),
            x + (a * w + b * z - c * y),
            y + (b * w + c * x - a * z),
            z + (c * w + a * y - b * x),
        ];
        let length = next[0] * next[0] + next[1] * next[1] + next[2] * next[2] + next[3] * next[3];
        let inverse = L::splat(1.0) / length.sqrt();
        turn = [next[0] * inverse, next[1] * inverse, next[2] * inverse, next[3] * inverse];
        d = rotation_less_one(&turn);
    }
    (turn, d)
}

/// R - I by rows, of a unit quaternion.
#[inline(always)]
fn rotation_less_one<L: Lane>(&[w, x, y, z]: &[L; 4]) -> [[L; 3]; 3] {
    let (zero, two) = (L::splat(0.0), L::splat(2.0));
    [
        [zero - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)],
        [two * (x * y + w * z), zero - two * (x * x + z * z), two * (y * z - w * x)],
        [two * (x * z - w * y), two * (y * z + w * x), zero - two * (x * x + y * y)],
    ]
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
    use glam::{DMat3, DQuat, DVec3};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_rotation_of_a_stretched_turn_is_the_turn(axis in proptest::array::uniform3(-1.0f64..1.0), angle in 0.0f64..2.5, s in proptest::array::uniform3(0.5f64..2.0)) {
            let axis = DVec3::from_array(axis);
            prop_assume!(axis.length() > 0.1);
            let turn = DQuat::from_axis_angle(axis.normalize(), angle);
            let f = DMat3::from_quat(turn) * DMat3::from_diagonal(DVec3::from_array(s));
            let h = (f - DMat3::IDENTITY).transpose().to_cols_array_2d().map(|row| row.map(|x| x as f32));
            let ([w, x, y, z], _) = turn_of::<f32>(&h, [1.0, 0.0, 0.0, 0.0]);
            let found = DQuat::from_xyzw(x.into(), y.into(), z.into(), w.into());
            prop_assert!(found.dot(turn).abs() > 1.0 - 1e-6, "{found} {turn}");
        }
    }
}
