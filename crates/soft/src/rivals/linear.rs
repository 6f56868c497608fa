//! Small-strain elasticity with central differences: the cheapest right answer while nothing turns
//! or stretches much.
//!
//! # Theory
//! `M ü + α M u̇ + K u = f` with the constant stiffness of the rest state. Leapfrog:
//! `v⁺ = ((1 - α dt/2) v + dt M⁻¹ (f - K u)) / (1 + α dt/2)`, `u⁺ = u + dt v⁺`.
//!
//! # Practice
//! About 20 ns a tetrahedron and step, f64, no allocation. Damping is critical for the lowest mode
//! unless set.
//!
//! # When not to use it
//! When anything rotates by more than a few degrees or stretches by more than a few percent: a
//! turned part swells, because small strain takes rotation for strain.

use crate::contact::press;
use crate::method::Descriptor;
use crate::{Body, BodyError, Loads, SoftSolver, StepReport, Stiffness, lowest_frequency, power_bound_ms};
use glam::DVec3;
use trepan_geometry::Vec3;

/// Settings of the linear solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Mass-proportional damping α, 1/ms; `None` = critical for the lowest mode.
    pub damping_per_ms: Option<f32>,
    /// Share of the stable bound that [`SoftSolver::stable_dt_ms`] gives, over 0 and below 1.
    pub safety: f32,
}

impl Default for Config {
    fn default() -> Self {
        Self { damping_per_ms: None, safety: 0.8 }
    }
}

/// Explicit small-strain solver.
pub struct Linear {
    stiffness: Stiffness,
    rest: Vec<Vec3>,
    u: Vec<DVec3>,
    v: Vec<DVec3>,
    force: Vec<DVec3>,
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
    damping_per_ms: f64,
    bound_ms: f64,
    safety: f64,
}

impl Linear {
    /// Takes a body at rest.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        body.check()?;
        if !(config.safety > 0.0 && config.safety < 1.0) {
            return Err(BodyError::Config { field: "safety", value: config.safety, right: "over 0 and below 1" });
        }
        if config.damping_per_ms.is_some_and(|d| d.is_nan() || d < 0.0) {
            let value = config.damping_per_ms.unwrap_or_default();
            return Err(BodyError::Config { field: "damping_per_ms", value, right: "at least 0" });
        }
        let nodes = body.mesh.positions.len();
        let critical = || 2.0 * lowest_frequency(body).unwrap_or(0.0);
        Ok(Self {
            stiffness: Stiffness::of(body),
            rest: body.mesh.positions.clone(),
            u: vec![DVec3::ZERO; nodes],
            v: vec![DVec3::ZERO; nodes],
            force: vec![DVec3::ZERO; nodes],
            positions: body.mesh.positions.clone(),
            velocities: vec![Vec3::ZERO; nodes],
            damping_per_ms: config.damping_per_ms.map_or_else(critical, f64::from),
            bound_ms: power_bound_ms(body),
            safety: f64::from(config.safety),
        })
    }

    /// Sets the state of all free nodes by their rest position: displacement, mm, and velocity,
    /// mm/ms.
    pub fn set(&mut self, state: impl Fn(DVec3) -> (DVec3, DVec3)) {
        for n in (0..self.u.len()).filter(|&n| !self.stiffness.fixed()[n]) {
            (self.u[n], self.v[n]) = state(self.rest[n].as_dvec3());
        }
    }

    fn press(&mut self, loads: &Loads) -> f32 {
        let state = [&self.positions[..], &self.velocities[..]];
        let mut add = |n: u32, push: Vec3| self.force[n as usize] -= push.as_dvec3();
        loads.contacts.all().map(|spring| press(&spring, state, &mut add)).sum()
    }

    fn advance(&mut self, gravity: DVec3, dt: f64, report: &mut StepReport) {
        let half = 0.5 * self.damping_per_ms * dt;
        for n in 0..self.u.len() {
            if self.stiffness.fixed()[n] {
                continue;
            }
            let pull = gravity - self.force[n] / self.stiffness.masses_g()[n];
            let v = (self.v[n] * (1.0 - half) + pull * dt) / (1.0 + half);
            let u = self.u[n] + v * dt;
            let sound = v.is_finite() && u.is_finite() && u.length() < 1e4;
            (self.v[n], self.u[n]) = if sound { (v, u) } else { (DVec3::ZERO, DVec3::ZERO) };
            report.non_finite += u32::from(!sound);
            (self.positions[n], self.velocities[n]) = (self.rest[n] + self.u[n].as_vec3(), self.v[n].as_vec3());
        }
    }
}

impl SoftSolver for Linear {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        self.stiffness.apply(&self.u, &mut self.force);
        let mut report = StepReport { substeps: 1, converged: true, ..StepReport::default() };
        report.contact_n = self.press(loads);
        self.advance(loads.gravity.as_dvec3(), f64::from(dt_ms), &mut report);
        report
    }

    fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    fn velocities(&self) -> &[Vec3] {
        &self.velocities
    }

    fn stable_dt_ms(&self) -> f32 {
        (self.safety * self.bound_ms) as f32
    }
}

/// What the solver says of itself.
pub const METHOD: Descriptor = Descriptor {
    name: "linear",
    source: "Zienkiewicz, small strain, central differences",
    is_static: false,
    build: |body| Ok(Box::new(Linear::new(body, &Config::default())?)),
};
