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
//! # Practice
//! About 60 ns a tetrahedron and substep; sequential, so the same every time. Elements turned
//! inside out come back: J - γ pulls them through.
//!
//! # When not to use it
//! With substeps over about twice the bound of an explicit step ([`crate::power_bound_ms`]), as for
//! a stiff body on a fine mesh: one pass then leaves so much undone that the body is too soft, and
//! further on it folds into itself.

use crate::body::Element;
use crate::energy::{cofactor, squared};
use crate::method::Descriptor;
use crate::rivals::nodes::{Nodes, depth_mm, known};
use crate::{Body, BodyError, Loads, Material, NodeState, SoftSolver, StepReport};
use glam::{DMat3, DVec3};
use trepan_contact::NodalContact;

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

/// XPBD solver.
pub struct Xpbd {
    config: Config,
    elements: Vec<Element>,
    nodes: Nodes,
    before: Vec<DVec3>,
    inverse_mass: Vec<f64>,
    moduli: Vec<Moduli>,
}

/// μ and λ' of a material, MPa.
#[derive(Clone, Copy)]
struct Moduli {
    mu: f64,
    lambda: f64,
}

impl Moduli {
    fn of(material: &Material) -> Self {
        let mu = material.shear_mpa();
        Self { mu, lambda: material.bulk_mpa() + mu / 3.0 }
    }
}

impl Xpbd {
    /// Takes a body at rest.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        let substep_ms = config.substep_ms;
        let nodes = Nodes::of(body, config.damping_per_ms, || {
            let is_right = substep_ms > 0.0 && substep_ms.is_finite();
            BodyError::check_config(is_right, "substep_ms", substep_ms, "over 0 and finite")
        })?;
        let inverse = |(m, fixed): (&f64, &bool)| if *fixed { 0.0 } else { 1.0 / m };
        Ok(Self {
            config: *config,
            elements: body.elements(),
            before: nodes.u.clone(),
            inverse_mass: nodes.masses.iter().zip(&nodes.fixed).map(inverse).collect(),
            moduli: body.materials.iter().map(Moduli::of).collect(),
            nodes,
        })
    }

    fn substep(&mut self, loads: &Loads, h: f64, report: &mut StepReport) {
        let Nodes { u, v, damping_per_ms, .. } = &mut self.nodes;
        let keep = (-*damping_per_ms * h).exp();
        self.before.copy_from_slice(u);
        for n in (0..u.len()).filter(|&n| self.inverse_mass[n] > 0.0) {
            u[n] += (v[n] * keep + loads.gravity.as_dvec3() * h) * h;
        }
        let mut inverted = 0;
        for t in 0..self.elements.len() {
            inverted += u32::from(self.correct(self.elements[t], h) <= 0.0);
        }
        report.inverted = report.inverted.max(inverted);
        // Each spring in turn; what one moves, the next one sees.
        report.contact_n = loads.contacts.all().map(|spring| self.press(&spring, h)).sum();
        let Nodes { u, v, .. } = &mut self.nodes;
        for n in (0..u.len()).filter(|&n| self.inverse_mass[n] > 0.0) {
            let sound = u[n].is_finite() && u[n].length() < 1e4;
            u[n] = if sound { u[n] } else { self.before[n] };
            report.non_finite += u32::from(!sound);
            v[n] = (u[n] - self.before[n]) / h;
        }
    }

    /// Moves an element's nodes by both constraints at once; gives its J before.
    fn correct(&mut self, Element { corners, shape, material }: Element, h: f64) -> f64 {
        let Moduli { mu, lambda } = self.moduli[usize::from(material)];
        let f = DMat3::IDENTITY + shape.gradient_of(self.nodes.corners(&corners));
        let (j, cofactor) = (f.determinant(), cofactor(f));
        let length = squared(f).sqrt().max(1e-9);
        let stretch = shape.gradients.map(|g| f * g / length);
        let volume = shape.gradients.map(|g| cofactor * g);
        let weights = corners.map(|n| self.inverse_mass[n as usize]);
        let sum = |p: &[DVec3; 4], q: &[DVec3; 4]| (0..4).map(|i| weights[i] * p[i].dot(q[i])).sum::<f64>();
        let compliance = |stiffness: f64| 1.0 / (stiffness * shape.volume_mm3 * h * h);
        let (dd, hh) = (sum(&stretch, &stretch) + compliance(mu), sum(&volume, &volume) + compliance(lambda));
        let (dh, excess) = (sum(&stretch, &volume), j - 1.0 - mu / lambda);
        let determinant = dd * hh - dh * dh;
        let (of_d, of_h) = ((dh * excess - hh * length) / determinant, (dh * length - dd * excess) / determinant);
        for i in (0..4).filter(|&i| weights[i] > 0.0) {
            self.nodes.u[corners[i] as usize] += (stretch[i] * of_d + volume[i] * of_h) * weights[i];
        }
        j
    }

    fn press(&mut self, contact: &NodalContact, h: f64) -> f32 {
        let Nodes { rest, u, .. } = &mut self.nodes;
        let count = u.len();
        let (depth, stiffness) = (depth_mm(contact, count, [rest, u]), f64::from(contact.stiffness));
        if contact.is_empty() || depth <= 0.0 || stiffness <= 0.0 {
            return 0.0;
        }
        let sum: f64 = known(contact, count).map(|(n, w)| w * w * self.inverse_mass[n]).sum();
        let multiplier = -depth / (sum + 1.0 / (stiffness * h * h));
        for (n, w) in known(contact, count).filter(|(n, _)| self.inverse_mass[*n] > 0.0) {
            u[n] += contact.normal.as_dvec3() * (w * self.inverse_mass[n] * multiplier);
        }
        (-multiplier / (h * h)) as f32
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
                self.substep(loads, f64::from(h), &mut report);
            }
        }
        let Nodes { rest, u, v, state, .. } = &mut self.nodes;
        (0..u.len()).for_each(|n| state.set(n, rest[n] + u[n], v[n]));
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
