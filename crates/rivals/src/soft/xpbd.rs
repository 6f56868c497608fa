//! Extended position-based dynamics with neo-Hookean constraints: small, forgiving, right in the
//! limit of small substeps.
//!
//! # Theory
//! Energy `μ/2 tr(FᵀF) + λ'/2 (J - γ)²` with `γ = 1 + μ/λ'` and `λ' = κ + μ/3`, so that both moduli
//! at small strain are right. Each substep moves all nodes freely, then goes once through the
//! elements and moves their nodes along the gradients of two constraints, `C_D = √tr(FᵀF)` and
//! `C_H = J - γ`: `(∇C W ∇Cᵀ + 1/(k V h²)) Δλ = -C`, `Δx = W ∇Cᵀ Δλ`, W = 1/m (Macklin and Müller
//! 2021). Both at once, a 2×2 system: one after the other they would stir a body at rest, where
//! neither is zero and only their forces cancel. The tool's spring is one more such constraint.
//!
//! In f32 the two multipliers would leave their rounding at rest. By Woodbury's identity the same
//! Δx comes from the element's elastic force f, which is zero at rest digit by digit: with
//! `b = h² W f`, `G = ∇C W ∇Cᵀ` and `D = diag(k V h²)`
//! ```text
//! Δx = b - W ∇Cᵀ D (I + G D)⁻¹ ∇C b        f = -V (μ (F - cof F) + λ' (J - 1) cof F) ∇N
//! ```
//!
//! # Practice
//! About 7 ns a tetrahedron and substep, f32, sixteen elements at once. Those share no node, so
//! that the pass is Gauss and Seidel's, one after the other in a fixed order: the same every time.
//! Elements turned inside out come back: J - γ pulls them through.
//!
//! # When not to use it
//! With substeps over about twice the bound of an explicit step
//! ([`power_bound_ms`](trepan_soft::power_bound_ms)), as for a stiff body on a fine mesh: one pass
//! then leaves so much undone that the body is too soft, and further on it folds into itself.
//!
//! # Sources
//! Macklin, Müller and Chentanez 2016, equations 17 and 18 (`Δx = M⁻¹ ∇Cᵀ Δλ`, `Δλ`) with one
//! iteration a substep, so that λ starts at 0; Macklin and Müller 2021 for `C_D`, `C_H` and their
//! coupled solve. Liberties: γ and λ' by the moduli at small strain; no logarithm in the
//! deviatoric energy (Smith et al. 2018 add one); the order of the elements; damping by mass; the
//! tool's spring.

use super::nodes::{FURTHEST_MM, Nodes, known};
use super::parts::{Action, Block, Item, Motion, Parts, Rows, applied, gradients_of, minus, plus, scaled, tetrahedra};
use glam::Vec4;
use trepan_contact::NodalContact;
use trepan_soft::Descriptor;
use trepan_soft::simd::{Lane, dot, squared};
use trepan_soft::{Body, BodyError, Loads, NodeState, SoftSolver, StepReport};

/// Settings of XPBD.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Mass-proportional damping α, 1/ms; `None` = critical for the lowest mode.
    pub damping_per_ms: Option<f32>,
    /// Longest substep, ms. Shorter is more accurate and costs as many more passes.
    pub substep_ms: f32,
    /// Most substeps in one call; the rest of the time is counted as skipped.
    pub substeps: u32,
}

impl Default for Config {
    fn default() -> Self {
        Self { damping_per_ms: None, substep_ms: 0.5, substeps: 8 }
    }
}

// Rows of an element: gradients, μV and λ'V, inverse masses.
const MODULI: usize = 9;
const MASSES: usize = 11;
const ROWS: usize = 15;

/// XPBD solver.
pub struct Xpbd {
    config: Config,
    elements: Parts<ROWS>,
    nodes: Nodes,
    before: Vec<Vec4>,
}

/// Moves an element's nodes by both constraints at once.
struct Correct {
    /// Square of the substep, ms².
    h2: f32,
}

impl Action<ROWS> for Correct {
    #[inline(always)]
    fn act<L: Lane>(&self, block: &mut Block<ROWS>, lanes: usize, x: &mut Rows, _: &mut Rows) -> u32 {
        let [g, h, i] = block.gradients::<L>(lanes, 0);
        let motion = Motion::of(&block.edges::<L>(lanes, x), &[g, h, i]);
        let h2 = L::splat(self.h2);
        let (mu, lambda) = (block.number::<L>(lanes, MODULI) * h2, block.number::<L>(lanes, MODULI + 1) * h2);
        let (one, zero) = (L::splat(1.0), L::splat(0.0));
        let (m, c) = (&motion.h, &motion.cofactor_less_one());
        let f =
            [[m[0][0] + one, m[0][1], m[0][2]], [m[1][0], m[1][1] + one, m[1][2]], [m[2][0], m[2][1], m[2][2] + one]];
        let inverse = one / squared(&f).sqrt().at_least(1e-9);
        // Gradients of both constraints and the elastic force times h², at nodes 1 to 3.
        let push = zero - lambda * motion.excess;
        let of = [inverse, mu, push];
        let (a, b, d) = (AtNode::of(m, c, &g, of), AtNode::of(m, c, &h, of), AtNode::of(m, c, &i, of));
        let o = AtNode {
            stretch: less(&a.stretch, &b.stretch, &d.stretch),
            volume: less(&a.volume, &b.volume, &d.volume),
            force: less(&a.force, &b.force, &d.force),
        };
        let [wa, wb, wd] = block.vector::<L>(lanes, MASSES + 1);
        let wo = block.number::<L>(lanes, MASSES);
        let (nodes, weights) = ([o, a, b, d], [wo, wa, wb, wd]);
        let [mut ss, mut sv, mut vv, mut of_s, mut of_v] = [zero; 5];
        for k in 0..4 {
            let node = &nodes[k];
            let (stretch, volume) = (scaled(&node.stretch, weights[k]), scaled(&node.volume, weights[k]));
            ss = ss + dot(&stretch, &node.stretch);
            sv = sv + dot(&stretch, &node.volume);
            vv = vv + dot(&volume, &node.volume);
            of_s = of_s + dot(&stretch, &node.force);
            of_v = of_v + dot(&volume, &node.force);
        }
        // (I + G D) z = ∇C b, and D z.
        let (p, q, r, s) = (one + ss * mu, sv * lambda, sv * mu, one + vv * lambda);
        let inverse = one / (p * s - q * r);
        let of_stretch = mu * ((s * of_s - q * of_v) * inverse);
        let of_volume = lambda * ((p * of_v - r * of_s) * inverse);
        let mut moves = [[zero; 3]; 4];
        for k in 0..4 {
            let back = plus(&scaled(&nodes[k].stretch, of_stretch), &scaled(&nodes[k].volume, of_volume));
            moves[k] = scaled(&minus(&nodes[k].force, &back), weights[k]);
        }
        L::add_rows(moves, x, block.corners::<L>(lanes));
        motion.inverted()
    }
}

/// Gradients of the two constraints at a node, and the elastic force on it times h².
#[derive(Clone, Copy)]
struct AtNode<L> {
    stretch: [L; 3],
    volume: [L; 3],
    force: [L; 3],
}

impl<L: Lane> AtNode<L> {
    /// At a node of gradient g, from H, cof F - I, and `1/|F|`, μVh², -λ'Vh² (J - 1).
    #[inline(always)]
    fn of(h: &[[L; 3]; 3], c: &[[L; 3]; 3], g: &[L; 3], [inverse, mu, push]: [L; 3]) -> Self {
        let (hg, cg) = (applied(h, g), applied(c, g));
        let volume = plus(g, &cg);
        let force = plus(&scaled(&minus(&cg, &hg), mu), &scaled(&volume, push));
        Self { stretch: scaled(&plus(g, &hg), inverse), volume, force }
    }
}

/// -(a + b + c).
#[inline(always)]
fn less<L: Lane>(a: &[L; 3], b: &[L; 3], c: &[L; 3]) -> [L; 3] {
    minus(&[L::splat(0.0); 3], &plus(&plus(a, b), c))
}

impl Xpbd {
    /// Takes a body at rest.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        let substep_ms = config.substep_ms;
        let nodes = Nodes::of(body, config.damping_per_ms, || {
            let is_right = substep_ms > 0.0 && substep_ms.is_finite();
            BodyError::check_config(is_right, "substep_ms", substep_ms, "over 0 and finite")
        })?;
        let constants = |t: usize| {
            let (shape, material) = (body.shape(t), body.material(t));
            let (gradients, mu) = (gradients_of(&shape), material.shear_mpa());
            let moduli = [mu, material.bulk_mpa() + mu / 3.0].map(|modulus| (modulus * shape.volume_mm3) as f32);
            let masses = body.mesh.tets[t].map(|n| nodes.inverse_masses[n as usize]);
            std::array::from_fn(|row| match row {
                ..MODULI => gradients[row],
                MODULI..MASSES => moduli[row - MODULI],
                _ => masses[row - MASSES],
            })
        };
        let items: Vec<Item<ROWS>> = tetrahedra(body, constants);
        Ok(Self { config: *config, elements: Parts::disjoint(&items), before: nodes.u.clone(), nodes })
    }

    fn substep(&mut self, loads: &Loads, h: f32, report: &mut StepReport) {
        let Nodes { u, v, inverse_masses, damping_per_ms, .. } = &mut self.nodes;
        let (keep, gravity) = ((-*damping_per_ms * h).exp(), loads.gravity.extend(0.0));
        self.before.copy_from_slice(u);
        for n in (0..u.len()).filter(|&n| inverse_masses[n] > 0.0) {
            u[n] += (v[n] * keep + gravity * h) * h;
        }
        report.inverted = report.inverted.max(self.elements.correct(&Correct { h2: h * h }, u));
        // Each spring in turn; what one moves, the next one sees.
        report.contact_n = loads.contacts.all().map(|spring| self.press(&spring, h)).sum();
        let Nodes { u, v, inverse_masses, .. } = &mut self.nodes;
        for n in 0..u.len() {
            // Of what is no number, none stays at a fixed node either.
            let (sound, is_free) = (u[n].length_squared() < FURTHEST_MM * FURTHEST_MM, inverse_masses[n] > 0.0);
            u[n] = if sound && is_free { u[n] } else { self.before[n] };
            report.non_finite += u32::from(!sound && is_free);
            v[n] = (u[n] - self.before[n]) / h;
        }
    }

    fn press(&mut self, contact: &NodalContact, h: f32) -> f32 {
        // The tool goes on during the substep, as the nodes did.
        let depth = self.nodes.depth_mm(contact) - f64::from(h * contact.tool_normal_velocity);
        let stiffness = f64::from(contact.stiffness);
        if contact.is_empty() || depth <= 0.0 || stiffness <= 0.0 {
            return 0.0;
        }
        let (Nodes { u, inverse_masses, .. }, h2) = (&mut self.nodes, f64::from(h) * f64::from(h));
        let sum: f64 = known(contact, u.len()).map(|(n, w)| w * w * f64::from(inverse_masses[n])).sum();
        let multiplier = -depth / (sum + 1.0 / (stiffness * h2));
        for (n, w) in known(contact, u.len()) {
            u[n] += (contact.normal * (w * multiplier) as f32 * inverse_masses[n]).extend(0.0);
        }
        (-multiplier / h2) as f32
    }
}

impl SoftSolver for Xpbd {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        let wanted = (dt_ms / self.config.substep_ms - 1e-4).ceil().max(1.0);
        let substeps = wanted.min(self.config.substeps.max(1) as f32);
        let h = (dt_ms / wanted).max(0.0);
        let mut report = StepReport { substeps: substeps as u32, converged: true, ..StepReport::default() };
        report.skipped_ms = (wanted - substeps) * h;
        for _ in 0..report.substeps {
            if h > 0.0 {
                self.substep(loads, h, &mut report);
            }
        }
        (0..self.before.len()).for_each(|n| self.nodes.publish(n));
        report
    }

    fn state(&self) -> &NodeState {
        &self.nodes.state
    }

    fn stable_dt_ms(&self) -> f32 {
        self.config.substep_ms * self.config.substeps.max(1) as f32
    }
}

/// What the solver says of itself.
pub const METHOD: Descriptor = Descriptor {
    name: "xpbd",
    source: "Macklin, Müller and Chentanez 2016; Macklin and Müller 2021",
    is_static: false,
    build: |body| Ok(Box::new(Xpbd::new(body, &Config::default())?)),
};
