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

use crate::method::Descriptor;
use crate::rivals::nodes::Nodes;
use crate::{Body, BodyError, Loads, NodeState, SoftSolver, StepReport, Stiffness, power_bound_of_ms};
use glam::DVec3;

pub use crate::rivals::nodes::Config;

/// Explicit small-strain solver.
pub struct Linear {
    stiffness: Stiffness,
    nodes: Nodes,
    force: Vec<DVec3>,
    stable_dt_ms: f64,
}

impl Linear {
    /// Takes a body at rest.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        let (nodes, stiffness) = (config.nodes(body)?, Stiffness::of(body));
        let stable_dt_ms = f64::from(config.safety) * power_bound_of_ms(body, &stiffness);
        Ok(Self { stiffness, force: nodes.u.clone(), nodes, stable_dt_ms })
    }

    /// Sets the state of all free nodes by their rest position: displacement, mm, and velocity,
    /// mm/ms.
    pub fn set(&mut self, state: impl Fn(DVec3) -> (DVec3, DVec3)) {
        let Nodes { rest, u, v, fixed, .. } = &mut self.nodes;
        for n in (0..u.len()).filter(|&n| !fixed[n]) {
            (u[n], v[n]) = state(rest[n]);
        }
    }
}

impl SoftSolver for Linear {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        let mut report = StepReport { substeps: 1, converged: true, ..StepReport::default() };
        self.stiffness.apply(&self.nodes.u, &mut self.force);
        self.force.iter_mut().for_each(|f| *f = -*f);
        report.contact_n = self.nodes.press(loads, &mut self.force);
        self.nodes.leapfrog(&self.force, loads.gravity, dt_ms, &mut report);
        // Displacements are small: they are rounded before they are added.
        let Nodes { rest, u, state, .. } = &mut self.nodes;
        for (x, (rest, u)) in state.positions.iter_mut().zip(rest.iter().zip(u)) {
            *x = rest.as_vec3() + u.as_vec3();
        }
        report
    }

    fn state(&self) -> &NodeState {
        &self.nodes.state
    }

    fn stable_dt_ms(&self) -> f32 {
        self.stable_dt_ms as f32
    }
}

/// What the solver says of itself.
pub const METHOD: Descriptor = Descriptor {
    name: "linear",
    source: "Zienkiewicz, small strain, central differences",
    is_static: false,
    build: |body| Ok(Box::new(Linear::new(body, &Config::default())?)),
};
