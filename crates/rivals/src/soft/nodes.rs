//! What the moving rivals share: settings, nodes in f32, and a step by central differences.
//!
//! # Practice
//! State is displacement from rest, so that f32 resolves a nanometre at a millimetre.

use glam::Vec4;
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;
use trepan_soft::{Body, BodyError, Loads, NodeState, StepReport, lowest_frequency};

/// Settings of the explicit rivals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Mass-proportional damping α, 1/ms; `None` = critical for the lowest mode of the elastic
    /// body.
    pub damping_per_ms: Option<f32>,
    /// Share of a bound of the stable step that
    /// [`stable_dt_ms`](trepan_soft::SoftSolver::stable_dt_ms) gives, over 0 and below 1.
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
    /// Rest positions, mm.
    pub rest: Vec<Vec3>,
    /// Displacements, mm, and velocities, mm/ms; the fourth number is 0.
    pub u: Vec<Vec4>,
    pub v: Vec<Vec4>,
    /// g.
    pub masses: Vec<f32>,
    /// 1/g; 0 for fixed nodes.
    pub inverse_masses: Vec<f32>,
    /// Mass-proportional damping α, 1/ms.
    pub damping_per_ms: f32,
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
        let critical = || 2.0 * lowest_frequency(body).unwrap_or(0.0) as f32;
        let zero = vec![Vec4::ZERO; body.mesh.positions.len()];
        let masses = body.lumped_masses_g();
        let inverse = |(m, fixed): (&f64, bool)| if fixed { 0.0 } else { (1.0 / m) as f32 };
        Ok(Self {
            rest: body.mesh.positions.clone(),
            u: zero.clone(),
            v: zero,
            inverse_masses: masses.iter().zip(body.fixed_mask()).map(inverse).collect(),
            masses: masses.iter().map(|&m| m as f32).collect(),
            damping_per_ms: damping_per_ms.unwrap_or_else(critical),
            state: NodeState::at_rest(&body.mesh),
        })
    }

    /// Adds the forces of all contacts, whole and explicit, N; gives their sum without their
    /// directions.
    pub fn press(&self, loads: &Loads, force: &mut [Vec4]) -> f32 {
        let NodeState { positions, velocities } = &self.state;
        let of = |values: &[Vec3], n: u32| values.get(n as usize).copied().unwrap_or_default();
        let press = |spring: NodalContact| {
            let pressure = spring.pressure_n(spring.mean(|n| of(positions, n)), spring.mean(|n| of(velocities, n)));
            if !(pressure.is_finite() && pressure > 0.0) {
                return 0.0;
            }
            let nodes = spring.nodes().filter(|(n, _)| (*n as usize) < positions.len());
            nodes.for_each(|(n, w)| force[n as usize] += (spring.normal * -(pressure * w)).extend(0.0));
            pressure
        };
        loads.contacts.all().map(press).sum()
    }

    /// How deep the nodes are in a spring, mm.
    pub fn depth_mm(&self, spring: &NodalContact) -> f64 {
        let place =
            |n: usize| (self.rest[n].as_dvec3() + self.u[n].truncate().as_dvec3()).dot(spring.normal.as_dvec3());
        f64::from(spring.offset_mm) + known(spring, self.u.len()).map(|(n, w)| w * place(n)).sum::<f64>()
    }

    /// Moves the free nodes by these forces, N, by central differences.
    pub fn leapfrog(&mut self, force: &[Vec4], gravity: Vec3, dt_ms: f32, report: &mut StepReport) {
        let gravity = gravity.extend(0.0);
        let half = 0.5 * self.damping_per_ms * dt_ms;
        let (keep, gain) = ((1.0 - half) / (1.0 + half), dt_ms / (1.0 + half));
        self.advance(report, |Self { u, v, inverse_masses, .. }, n| {
            let v = v[n] * keep + (gravity + force[n] * inverse_masses[n]) * gain;
            (u[n] + v * dt_ms, v)
        });
    }

    /// Gives every free node the displacement and velocity of `next`. One that is not finite or far
    /// off goes back to rest and is counted.
    pub fn advance(&mut self, report: &mut StepReport, next: impl Fn(&Self, usize) -> (Vec4, Vec4)) {
        for n in 0..self.u.len() {
            if self.inverse_masses[n] == 0.0 {
                continue;
            }
            let (u, v) = next(self, n);
            let sound = v.is_finite() && u.length_squared() < FURTHEST_MM * FURTHEST_MM;
            (self.u[n], self.v[n]) = if sound { (u, v) } else { (Vec4::ZERO, Vec4::ZERO) };
            report.non_finite += u32::from(!sound);
            self.publish(n);
        }
    }

    /// Writes the state of a node.
    pub fn publish(&mut self, n: usize) {
        self.state.positions[n] = self.rest[n] + self.u[n].truncate();
        self.state.velocities[n] = self.v[n].truncate();
    }
}

/// A node that is displaced this far has burst, mm.
pub(super) const FURTHEST_MM: f32 = 1e4;

/// Sum of the products of two fields: f32 within 64 nodes, f64 over them.
pub(super) fn dot(a: &[Vec4], b: &[Vec4]) -> f64 {
    let some =
        |(a, b): (&[Vec4], &[Vec4])| f64::from(a.iter().zip(b).map(|(a, b)| *a * *b).sum::<Vec4>().element_sum());
    a.chunks(64).zip(b.chunks(64)).map(some).sum()
}

/// Nodes below `count` of a spring, with their weights.
pub(super) fn known(spring: &NodalContact, count: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
    spring.nodes().map(|(n, w)| (n as usize, f64::from(w))).filter(move |(n, _)| *n < count)
}
