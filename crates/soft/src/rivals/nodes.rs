//! What the moving rivals share: settings, nodes in f64, and a step by central differences.

use crate::{Body, BodyError, Loads, NodeState, StepReport, lowest_frequency};
use glam::DVec3;
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;

/// Settings of the explicit rivals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Mass-proportional damping α, 1/ms; `None` = critical for the lowest mode of the elastic
    /// body.
    pub damping_per_ms: Option<f32>,
    /// Share of a bound of the stable step that [`crate::SoftSolver::stable_dt_ms`] gives, over 0
    /// and below 1.
    pub safety: f32,
}

impl Default for Config {
    fn default() -> Self {
        Self { damping_per_ms: None, safety: 0.8 }
    }
}

impl Config {
    /// The nodes of a body that passes its check, with settings that pass theirs.
    pub(super) fn nodes(&self, body: &Body) -> Result<Nodes, BodyError> {
        let is_right = self.safety > 0.0 && self.safety < 1.0;
        Nodes::of(body, self.damping_per_ms, || {
            BodyError::check_config(is_right, "safety", self.safety, "over 0 and below 1")
        })
    }
}

/// State and masses of a body's nodes, and their damping.
pub(super) struct Nodes {
    /// Rest positions and displacements, mm, and velocities, mm/ms.
    pub rest: Vec<DVec3>,
    pub u: Vec<DVec3>,
    pub v: Vec<DVec3>,
    pub masses: Vec<f64>,
    pub fixed: Vec<bool>,
    /// Mass-proportional damping α, 1/ms.
    pub damping_per_ms: f64,
    pub state: NodeState,
}

impl Nodes {
    /// Checks a body, then a rival's own settings, then its damping; the nodes are at rest.
    pub fn of(
        body: &Body,
        damping_per_ms: Option<f32>,
        check: impl FnOnce() -> Result<(), BodyError>,
    ) -> Result<Self, BodyError> {
        body.check()?;
        check()?;
        let damping = damping_per_ms.unwrap_or_default();
        BodyError::check_config(damping >= 0.0, "damping_per_ms", damping, "at least 0")?;
        let critical = || 2.0 * lowest_frequency(body).unwrap_or(0.0);
        let zero = vec![DVec3::ZERO; body.mesh.positions.len()];
        Ok(Self {
            rest: body.mesh.positions.iter().map(|p| p.as_dvec3()).collect(),
            u: zero.clone(),
            v: zero,
            masses: body.lumped_masses_g(),
            fixed: body.fixed_mask(),
            damping_per_ms: damping_per_ms.map_or_else(critical, f64::from),
            state: NodeState::at_rest(&body.mesh),
        })
    }

    /// Displacements of an element's corners, mm.
    #[inline]
    pub fn corners(&self, corners: &[u32; 4]) -> [DVec3; 4] {
        corners.map(|n| self.u[n as usize])
    }

    /// Adds the forces of all contacts, whole and explicit, N; gives their sum without their
    /// directions.
    pub fn press(&self, loads: &Loads, force: &mut [DVec3]) -> f32 {
        let NodeState { positions, velocities } = &self.state;
        let of = |values: &[Vec3], n: u32| values.get(n as usize).copied().unwrap_or_default();
        let press = |spring: NodalContact| {
            let pressure = spring.pressure_n(spring.mean(|n| of(positions, n)), spring.mean(|n| of(velocities, n)));
            if !(pressure.is_finite() && pressure > 0.0) {
                return 0.0;
            }
            let nodes = spring.nodes().filter(|(n, _)| (*n as usize) < positions.len());
            nodes.for_each(|(n, w)| force[n as usize] += (spring.normal * -(pressure * w)).as_dvec3());
            pressure
        };
        loads.contacts.all().map(press).sum()
    }

    /// Moves the free nodes by these forces, N, by central differences.
    pub fn leapfrog(&mut self, force: &[DVec3], gravity: Vec3, dt_ms: f32, report: &mut StepReport) {
        let (gravity, dt) = (gravity.as_dvec3(), f64::from(dt_ms));
        let half = 0.5 * self.damping_per_ms * dt;
        self.advance(report, |Self { u, v, masses, .. }, n| {
            let pull = gravity + force[n] / masses[n];
            let v = (v[n] * (1.0 - half) + pull * dt) / (1.0 + half);
            (u[n] + v * dt, v)
        });
    }

    /// Gives every free node the displacement and velocity of `next`. One that is not finite or far
    /// off goes back to rest and is counted.
    pub fn advance(&mut self, report: &mut StepReport, next: impl Fn(&Self, usize) -> (DVec3, DVec3)) {
        for n in 0..self.u.len() {
            if self.fixed[n] {
                continue;
            }
            let (u, v) = next(self, n);
            let sound = v.is_finite() && u.is_finite() && u.length() < 1e4;
            (self.u[n], self.v[n]) = if sound { (u, v) } else { (DVec3::ZERO, DVec3::ZERO) };
            report.non_finite += u32::from(!sound);
            self.state.set(n, self.rest[n] + self.u[n], self.v[n]);
        }
    }
}

/// Nodes below `count` of a spring, with their weights.
pub(super) fn known(spring: &NodalContact, count: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
    spring.nodes().map(|(n, w)| (n as usize, f64::from(w))).filter(move |(n, _)| *n < count)
}

/// How deep the first `count` nodes are in a spring, mm.
pub(super) fn depth_mm(spring: &NodalContact, count: usize, [rest, u]: [&[DVec3]; 2]) -> f64 {
    let mean: DVec3 = known(spring, count).map(|(n, w)| (rest[n] + u[n]) * w).sum();
    f64::from(spring.offset_mm) + mean.dot(spring.normal.as_dvec3())
}
