//! The nodes' state and its update by central differences, with what keeps it sane.
//!
//! # Practice
//! State is kept as displacement from rest, by place in the solver's order: f32 displacements of a few mm are a thousand times finer than
//! positions of 200 mm. Positions and velocities are written out in the mesh's order.

use crate::block::Quad;
use crate::damping::RigidMotion;
use crate::elements::Elements;
use crate::layout::Layout;
use trepan_geometry::Vec3;
use trepan_soft::{Body, StepReport};

/// State of all nodes.
pub(crate) struct Nodes {
    /// Displacements by place, mm.
    pub u: Vec<Quad>,
    /// Forces from outside by place, N; cleared by the update.
    pub external: Vec<Vec3>,
    /// Positions by mesh node, mm.
    pub positions: Vec<Vec3>,
    /// Velocities by mesh node, mm/ms.
    pub velocities: Vec<Vec3>,
    /// 1/m by place, 1/g; 0 for fixed nodes.
    pub inverse_mass: Vec<f32>,
    /// Share of the mass by place that has weight.
    weight: Vec<f32>,
    v: Vec<Vec3>,
    rest: Vec<Vec3>,
    node_at: Vec<u32>,
}

/// What the update of one substep needs to know.
pub(crate) struct Update {
    pub dt_ms: f32,
    pub damping_per_ms: f32,
    pub gravity: Vec3,
    pub max_speed: f32,
    pub max_displacement_mm: f32,
    pub rigid: Option<RigidMotion>,
}

impl Nodes {
    /// Nodes at rest, of masses by mesh node, g, which may be more than what their weight comes from.
    pub fn of(body: &Body, layout: &Layout, masses: &[f64]) -> Self {
        let (weights, fixed) = (body.lumped_masses_g(), body.fixed_mask());
        let inverse = |&n: &u32| if fixed[n as usize] { 0.0 } else { (1.0 / masses[n as usize]) as f32 };
        let count = layout.node_at.len();
        Self {
            u: vec![[0.0; 4]; count],
            external: vec![Vec3::ZERO; count],
            positions: body.mesh.positions.clone(),
            velocities: vec![Vec3::ZERO; count],
            inverse_mass: layout.node_at.iter().map(inverse).collect(),
            weight: layout.node_at.iter().map(|&n| (weights[n as usize] / masses[n as usize]) as f32).collect(),
            v: vec![Vec3::ZERO; count],
            rest: layout.node_at.iter().map(|&n| body.mesh.positions[n as usize]).collect(),
            node_at: layout.node_at.clone(),
        }
    }

    /// Moves every free node by one substep.
    pub fn update(&mut self, elements: &Elements, update: &Update, report: &mut StepReport) {
        let half = 0.5 * update.damping_per_ms * update.dt_ms;
        let (keep, gain) = ((1.0 - half) / (1.0 + half), update.dt_ms / (1.0 + half));
        for place in 0..self.u.len() {
            if self.inverse_mass[place] == 0.0 {
                self.lead(place, update.dt_ms);
                continue;
            }
            let force = elements.force(place) + self.external[place];
            let pull = update.gravity * self.weight[place] + force * self.inverse_mass[place];
            let carried = match update.rigid {
                Some(rigid) => {
                    let whole = rigid.at(self.rest[place] + self.displacement(place));
                    whole + (self.v[place] - whole) * keep
                }
                None => self.v[place] * keep,
            };
            self.place(place, carried + pull * gain, update, report);
        }
        self.external.fill(Vec3::ZERO);
    }

    /// Moves a fixed node with the velocity it was given.
    #[inline(always)]
    fn lead(&mut self, place: usize, dt_ms: f32) {
        if self.v[place] != Vec3::ZERO {
            self.set(place, self.displacement(place) + self.v[place] * dt_ms, self.v[place]);
        }
    }

    /// The body's rigid motion, at present.
    pub fn rigid_motion(&self) -> RigidMotion {
        RigidMotion::of((0..self.u.len()).map(|place| {
            (
                1.0 / self.inverse_mass[place].max(f32::MIN_POSITIVE),
                self.rest[place] + self.displacement(place),
                self.v[place],
            )
        }))
    }

    /// Puts a node somewhere from outside.
    pub fn set(&mut self, place: usize, displacement: Vec3, velocity: Vec3) {
        self.u[place] = [displacement.x, displacement.y, displacement.z, 0.0];
        self.v[place] = velocity;
        self.publish(place);
    }

    fn place(&mut self, place: usize, velocity: Vec3, update: &Update, report: &mut StepReport) {
        let before = self.displacement(place);
        let speed = velocity.length();
        let (mut velocity, mut held) = (velocity, false);
        if speed > update.max_speed {
            (velocity, held) = (velocity * (update.max_speed / speed), true);
        }
        let mut after = before + velocity * update.dt_ms;
        if !(velocity.is_finite() && after.is_finite()) {
            (velocity, after, held) = (Vec3::ZERO, before, false);
            report.non_finite += 1;
        } else if after.length() > update.max_displacement_mm {
            (velocity, after, held) = (Vec3::ZERO, after.clamp_length_max(update.max_displacement_mm), true);
        }
        report.limited += u32::from(held);
        self.set(place, after, velocity);
    }

    /// Velocity of the node at a place, mm/ms.
    pub fn velocity(&self, place: usize) -> Vec3 {
        self.v[place]
    }

    /// Present position of the node at a place, mm.
    #[inline(always)]
    pub fn position(&self, place: usize) -> Vec3 {
        self.rest[place] + self.displacement(place)
    }

    /// Displacement of the node at a place, mm.
    #[inline(always)]
    pub fn displacement(&self, place: usize) -> Vec3 {
        let [x, y, z, _] = self.u[place];
        Vec3::new(x, y, z)
    }

    #[inline(always)]
    fn publish(&mut self, place: usize) {
        let node = self.node_at[place] as usize;
        self.positions[node] = self.rest[place] + self.displacement(place);
        self.velocities[node] = self.v[place];
    }
}
