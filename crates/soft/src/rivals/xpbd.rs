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
use crate::method::Descriptor;
use crate::{Body, BodyError, Loads, Material, SoftSolver, StepReport, lowest_frequency};
use glam::{DMat3, DVec3};
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;

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
    rest: Vec<DVec3>,
    u: Vec<DVec3>,
    before: Vec<DVec3>,
    v: Vec<DVec3>,
    inverse_mass: Vec<f64>,
    moduli: Vec<Moduli>,
    damping_per_ms: f64,
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
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
        body.check()?;
        if config.damping_per_ms.is_some_and(|d| d.is_nan() || d < 0.0) {
            let value = config.damping_per_ms.unwrap_or_default();
            return Err(BodyError::Config { field: "damping_per_ms", value, right: "at least 0" });
        }
        if !(config.substep_ms > 0.0 && config.substep_ms.is_finite()) {
            return Err(BodyError::Config {
                field: "substep_ms",
                value: config.substep_ms,
                right: "over 0 and finite",
            });
        }
        let (nodes, fixed) = (body.mesh.positions.len(), body.fixed_mask());
        let inverse = |(m, fixed): (&f64, &bool)| if *fixed { 0.0 } else { 1.0 / m };
        let critical = || 2.0 * lowest_frequency(body).unwrap_or(0.0);
        Ok(Self {
            config: *config,
            elements: body.elements(),
            rest: body.mesh.positions.iter().map(|p| p.as_dvec3()).collect(),
            u: vec![DVec3::ZERO; nodes],
            before: vec![DVec3::ZERO; nodes],
            v: vec![DVec3::ZERO; nodes],
            inverse_mass: body.lumped_masses_g().iter().zip(&fixed).map(inverse).collect(),
            moduli: body.materials.iter().map(Moduli::of).collect(),
            damping_per_ms: config.damping_per_ms.map_or_else(critical, f64::from),
            positions: body.mesh.positions.clone(),
            velocities: vec![Vec3::ZERO; nodes],
        })
    }

    fn substep(&mut self, loads: &Loads, h: f64, report: &mut StepReport) {
        let keep = (-self.damping_per_ms * h).exp();
        self.before.copy_from_slice(&self.u);
        for n in (0..self.u.len()).filter(|&n| self.inverse_mass[n] > 0.0) {
            self.u[n] += (self.v[n] * keep + loads.gravity.as_dvec3() * h) * h;
        }
        let mut inverted = 0;
        for t in 0..self.elements.len() {
            inverted += u32::from(self.correct(self.elements[t], h) <= 0.0);
        }
        report.inverted = report.inverted.max(inverted);
        self.press(loads, h, report);
        for n in (0..self.u.len()).filter(|&n| self.inverse_mass[n] > 0.0) {
            let sound = self.u[n].is_finite() && self.u[n].length() < 1e4;
            self.u[n] = if sound { self.u[n] } else { self.before[n] };
            report.non_finite += u32::from(!sound);
            self.v[n] = (self.u[n] - self.before[n]) / h;
        }
    }

    /// Moves an element's nodes by both constraints at once; gives its J before.
    fn correct(&mut self, Element { corners, shape, material }: Element, h: f64) -> f64 {
        let Moduli { mu, lambda } = self.moduli[usize::from(material)];
        let [a, b, c, d] = corners.map(|n| self.u[n as usize]);
        let f = DMat3::IDENTITY + shape.gradient_of([a, b, c, d]);
        let (j, cofactor) = (f.determinant(), crate::energy::cofactor(f));
        let length = crate::energy::squared(f).sqrt().max(1e-9);
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
            self.u[corners[i] as usize] += (stretch[i] * of_d + volume[i] * of_h) * weights[i];
        }
        j
    }

    /// Each spring in turn; what one moves, the next one sees.
    fn press(&mut self, loads: &Loads, h: f64, report: &mut StepReport) {
        report.contact_n = loads.contacts.all().map(|spring| self.press_one(&spring, h)).sum();
    }

    fn press_one(&mut self, contact: &NodalContact, h: f64) -> f32 {
        let normal = contact.normal.as_dvec3();
        let nodes = || {
            contact.nodes().filter(|(n, _)| (*n as usize) < self.rest.len()).map(|(n, w)| (n as usize, f64::from(w)))
        };
        let mean: DVec3 = nodes().map(|(n, w)| (self.rest[n] + self.u[n]) * w).sum();
        let depth = f64::from(contact.offset_mm) + mean.dot(normal);
        let stiffness = f64::from(contact.stiffness);
        if contact.is_empty() || depth <= 0.0 || stiffness <= 0.0 {
            return 0.0;
        }
        let sum: f64 = nodes().map(|(n, w)| w * w * self.inverse_mass[n]).sum();
        let multiplier = -depth / (sum + 1.0 / (stiffness * h * h));
        for (n, w) in contact.nodes().filter(|(n, _)| self.inverse_mass.get(*n as usize).is_some_and(|m| *m > 0.0)) {
            let n = n as usize;
            self.u[n] += normal * (f64::from(w) * self.inverse_mass[n] * multiplier);
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
        for n in 0..self.u.len() {
            (self.positions[n], self.velocities[n]) = ((self.rest[n] + self.u[n]).as_vec3(), self.v[n].as_vec3());
        }
        report
    }

    fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    fn velocities(&self) -> &[Vec3] {
        &self.velocities
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
