//! State of the nodes and its update by central differences, with limits on speed and displacement.
//!
//! # Practice
//! State is stored as displacement from rest, by place in the solver's order: f32 displacements of
//! a few mm have a thousand times finer resolution than positions of 200 mm. A node beside a
//! sleeping part does not move until a force pushes it. Any thread may update any run of nodes,
//! because a node's update depends only on its state and its slots.

use crate::damping::RigidMotion;
use crate::field::{Field, Scalars};
use crate::force_slots::ForceSlots;
use glam::Vec4;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use trepan_geometry::Vec3;
use trepan_soft::simd::Layout;
use trepan_soft::{Anchor, Body, Fluid};

/// State of all nodes, by place.
pub(crate) struct Nodes {
    /// Displacements, mm.
    pub u: Field,
    /// Velocities, mm/ms.
    v: Field,
    /// External forces, N; cleared by the update, and 0 everywhere while `is_pushed` is false.
    external: Field,
    is_pushed: AtomicBool,
    /// 1 where a load, or an awake part beside a sleeping one, pushed in the last step, so that the
    /// parts around stay awake.
    pub pushed: Scalars,
    /// 1/m, 1/g; 0 for fixed nodes.
    pub inverse_mass: Vec<f32>,
    /// Mass that stiffened elements add in this step, g; 0 everywhere while `is_heavier` is false.
    added: Scalars,
    is_heavier: AtomicBool,
    /// Share of the mass that has weight (scaled mass has none).
    weight: Vec<f32>,
    rest: Vec<Vec4>,
    /// Anchors; empty where the body has none.
    anchors: Vec<Anchor>,
    /// Nodes clamped to a limit, and nodes reset because they were not finite, since `finish`.
    limited: AtomicU32,
    non_finite: AtomicU32,
}

/// Parameters of one substep's node update.
#[derive(Clone, Copy)]
pub(crate) struct Update {
    pub dt_ms: f32,
    /// Time from the middle of the last substep to that of this one, over which forces change
    /// velocities.
    pub kick_ms: f32,
    pub damping_per_ms: f32,
    pub gravity: Vec3,
    pub fluid: Fluid,
    pub max_speed: f32,
    pub max_displacement_mm: f32,
    pub rigid: Option<RigidMotion>,
    /// Nodes beside a sleeping part do not move while a step from rest would move them by less than
    /// this, mm.
    pub calm_mm: f32,
}

impl Update {
    /// Factors on velocity, without unit, and on acceleration, ms.
    pub fn keep_and_gain(&self) -> [f32; 2] {
        keep_and_gain(self.damping_per_ms, self.kick_ms)
    }

    /// Acceleration of a node at a place in world space, mm/ms².
    #[inline(always)]
    fn weight_at(&self, place: Vec4) -> Vec4 {
        match self.fluid.weight == Vec3::ZERO {
            true => self.gravity.extend(0.0),
            false => (self.gravity + self.fluid.weight * self.fluid.dryness(place.truncate())).extend(0.0),
        }
    }

    /// What damping leaves of a node's velocity; a rigid motion of the whole body is not damped.
    #[inline(always)]
    fn carried(&self, position: Vec4, velocity: Vec4, keep: f32) -> Vec4 {
        let Some(rigid) = self.rigid else { return velocity * keep };
        let whole = rigid.at(position.truncate()).extend(0.0);
        whole + (velocity - whole) * keep
    }
}

/// Time from the middle of the last substep to that of this one, ms; `last_ms` is 0 before the
/// first one.
///
/// Central differences with a changing step need it (Belytschko, Liu and Moran 2000, chapter 6):
/// if a step that is shortened while elements stiffen gave velocities its own length, every swing
/// would gain energy.
pub(crate) fn kick_ms(last_ms: f32, dt_ms: f32) -> f32 {
    if last_ms > 0.0 { 0.5 * (last_ms + dt_ms) } else { dt_ms }
}

/// Factors on velocity, without unit, and on acceleration, ms, from the damping rate, 1/ms.
pub(crate) fn keep_and_gain(damping_per_ms: f32, kick_ms: f32) -> [f32; 2] {
    let half = 0.5 * damping_per_ms * kick_ms;
    [(1.0 - half) / (1.0 + half), kick_ms / (1.0 + half)]
}

/// By place: 1/m, 1/g, 0 for fixed nodes; and the share of the mass that has weight.
pub(crate) fn inverse_masses_and_weights(body: &Body, layout: &Layout, masses: &[f64]) -> (Vec<f32>, Vec<f32>) {
    let (weights, fixed) = (body.lumped_masses_g(), body.fixed_mask());
    let of = |&n: &u32| {
        let (n, mass) = (n as usize, masses[n as usize]);
        (if fixed[n] { 0.0 } else { (1.0 / mass) as f32 }, (weights[n] / mass) as f32)
    };
    layout.node_at.iter().map(of).unzip()
}

/// The body's anchors by place, one for every node; none where it has none.
pub(crate) fn anchors_by_place(body: &Body, layout: &Layout) -> Vec<Anchor> {
    let mut anchors = vec![Anchor::default(); if body.anchors.is_empty() { 0 } else { layout.node_at.len() }];
    for anchor in &body.anchors {
        anchors[layout.place_of[anchor.node as usize] as usize] = *anchor;
    }
    anchors
}

impl Nodes {
    /// Creates nodes at rest with the given masses by mesh node, g. Added mass (mass scaling) has
    /// no weight.
    pub fn of(body: &Body, layout: &Layout, masses: &[f64]) -> Self {
        let (inverse_mass, weight) = inverse_masses_and_weights(body, layout, masses);
        let field = || Field::zeroed(layout.node_at.len());
        Self {
            u: field(),
            v: field(),
            external: field(),
            is_pushed: AtomicBool::new(false),
            pushed: Scalars::zeroed(layout.node_at.len()),
            inverse_mass,
            added: Scalars::zeroed(layout.node_at.len()),
            is_heavier: AtomicBool::new(false),
            weight,
            rest: layout.node_at.iter().map(|&n| body.mesh.positions[n as usize].extend(0.0)).collect(),
            anchors: anchors_by_place(body, layout),
            limited: AtomicU32::new(0),
            non_finite: AtomicU32::new(0),
        }
    }

    /// Moves the nodes at some places by one substep.
    pub fn update(&self, places: Range<usize>, force_slots: &ForceSlots, update: &Update) {
        let [keep, gain] = update.keep_and_gain();
        let (dt_ms, is_anchored) = (update.dt_ms, !self.anchors.is_empty());
        let square = |limit: f32| (limit * limit).min(f32::MAX);
        let (fastest, furthest) = (square(update.max_speed), square(update.max_displacement_mm));
        // Unneeded fields are neither read nor written: the update is limited by memory bandwidth,
        // about 100 bytes a node.
        let (anything_pushes, may_sleep) = (self.is_pushed.load(Relaxed), update.calm_mm > 0.0);
        let is_heavier = self.is_heavier.load(Relaxed);
        for place in places {
            let (u, v, inverse_mass) = (self.u.vector(place), self.v.vector(place), self.inverse_mass[place]);
            if inverse_mass == 0.0 {
                // A fixed node moves with its prescribed velocity.
                self.u.set(place, (u + v * dt_ms).to_array());
                self.take_external(place, anything_pushes);
                continue;
            }
            let (mut force, external) = (force_slots.force(place), self.take_external(place, anything_pushes));
            let is_beside_sleepers = force.w > 0.0;
            force.w = 0.0;
            let lightness = if is_heavier { self.lightness(place) } else { 1.0 };
            let gravity = update.weight_at(self.rest[place] + u);
            let pull = (gravity * self.weight[place] + (force + external) * inverse_mass) * lightness;
            let mut is_pushed = external != Vec4::ZERO;
            if is_beside_sleepers {
                is_pushed |= pull.length() * dt_ms * dt_ms > update.calm_mm;
                if !is_pushed {
                    self.pushed.set(place, 0.0);
                    self.v.set(place, [0.0; 4]);
                    continue;
                }
            }
            if may_sleep {
                self.pushed.set(place, if is_pushed { 1.0 } else { 0.0 });
            }
            let velocity = update.carried(self.rest[place] + u, v, keep) + pull * gain;
            let velocity = match is_anchored {
                true => self.anchored(place, u, velocity, inverse_mass * lightness * gain, update),
                false => velocity,
            };
            let after = u + velocity * dt_ms;
            // False for NaN.
            let within = velocity.length_squared() <= fastest && after.length_squared() <= furthest;
            let (after, velocity) = if within { (after, velocity) } else { self.limit(u, velocity, update) };
            self.u.set(place, after.to_array());
            self.v.set(place, velocity.to_array());
        }
    }

    /// Velocity of a node after a substep under its element force alone, mm/ms. A fixed node keeps
    /// its velocity.
    pub fn free_velocity(&self, place: usize, force: Vec3, update: &Update) -> Vec3 {
        let (u, v, inverse_mass) = (self.u.vector(place), self.v.vector(place), self.inverse_mass[place]);
        if inverse_mass == 0.0 {
            return v.truncate();
        }
        let [keep, gain] = update.keep_and_gain();
        let (at, lightness) = (self.rest[place] + u, self.lightness(place));
        let pull = update.weight_at(at).truncate() * self.weight[place] + force * inverse_mass;
        let velocity = update.carried(at, v, keep).truncate() + pull * (lightness * gain);
        match self.anchors.is_empty() {
            true => velocity,
            false => self.anchored(place, u, velocity.extend(0.0), inverse_mass * lightness * gain, update).truncate(),
        }
    }

    /// What the anchor of the node at a place makes of its velocity, by backward Euler: stable at
    /// any stiffness. `gain` is the velocity that a force gives the node, mm/ms for N.
    #[inline(always)]
    fn anchored(&self, place: usize, u: Vec4, velocity: Vec4, gain: f32, update: &Update) -> Vec4 {
        let Anchor { normal, along, across, in_fluid, open_mm2, .. } = self.anchors[place];
        if along + across + open_mm2 == 0.0 {
            return velocity;
        }
        let (normal, fluid) = (normal.extend(0.0), &update.fluid);
        let held = 1.0 - in_fluid * fluid.dryness((self.rest[place] + u).truncate());
        let velocity = velocity + normal * (open_mm2 * fluid.opening_mpa * gain);
        let reached = u + velocity * update.dt_ms;
        let out = normal * reached.dot(normal);
        let taken = |stiffness: f32| held * stiffness * gain / (1.0 + held * stiffness * gain * update.dt_ms);
        velocity - out * taken(along) - (reached - out) * taken(across)
    }

    /// 1/m with the mass that stiffened elements add, 1/g, and less where an anchor holds the node:
    /// what a contact's force changes of [`free_velocity`](Self::free_velocity).
    pub fn present_inverse_mass(&self, place: usize, update: &Update) -> f32 {
        let inverse_mass = self.inverse_mass[place] * self.lightness(place);
        let Some(anchor) = self.anchors.get(place).filter(|anchor| anchor.along > 0.0) else { return inverse_mass };
        let held = 1.0 - anchor.in_fluid * update.fluid.dryness(self.position(place));
        let [_, gain] = update.keep_and_gain();
        inverse_mass / (1.0 + held * anchor.along * inverse_mass * gain * update.dt_ms)
    }

    /// A node's mass without over that with what stiffened elements add; 1 for a fixed node.
    #[inline(always)]
    fn lightness(&self, place: usize) -> f32 {
        1.0 / (1.0 + self.added.get(place) * self.inverse_mass[place])
    }

    /// Adds mass to the node at a place, g.
    pub fn add_mass(&self, place: usize, grams: f32) {
        self.is_heavier.store(true, Relaxed);
        self.added.set(place, self.added.get(place) + grams);
    }

    /// Takes the added mass of the node at a place away.
    pub fn take_mass(&self, place: usize) {
        self.is_heavier.store(false, Relaxed);
        self.added.set(place, 0.0);
    }

    /// Takes and clears the external force on the node at a place, N.
    #[inline(always)]
    fn take_external(&self, place: usize, anything_pushes: bool) -> Vec4 {
        if !anything_pushes {
            return Vec4::ZERO;
        }
        let external = self.external.vector(place);
        self.external.set(place, [0.0; 4]);
        external
    }

    /// Clamps speed and displacement of a node over a limit; resets one that is not finite.
    #[cold]
    fn limit(&self, before: Vec4, velocity: Vec4, update: &Update) -> (Vec4, Vec4) {
        let velocity = velocity.clamp_length_max(update.max_speed);
        let after = before + velocity * update.dt_ms;
        if !(velocity.is_finite() && after.is_finite()) {
            self.non_finite.fetch_add(1, Relaxed);
            return (before, Vec4::ZERO);
        }
        self.limited.fetch_add(1, Relaxed);
        if after.length() > update.max_displacement_mm {
            return (after.clamp_length_max(update.max_displacement_mm), Vec4::ZERO);
        }
        (after, velocity)
    }

    /// Ends an update: clears the external loads and returns the numbers of clamped and of
    /// non-finite nodes.
    pub fn finish(&self) -> [u32; 2] {
        self.is_pushed.store(false, Relaxed);
        [&self.limited, &self.non_finite].map(|count| count.swap(0, Relaxed))
    }

    /// Adds an external force, N.
    pub fn push(&self, place: usize, force: Vec3) {
        self.is_pushed.store(true, Relaxed);
        self.external.set(place, (self.external.vector(place) + force.extend(0.0)).to_array());
    }

    /// Present rigid motion of the body.
    pub fn rigid_motion(&self) -> RigidMotion {
        let of = |place: usize| {
            (1.0 / self.inverse_mass[place].max(f32::MIN_POSITIVE), self.position(place), self.velocity(place))
        };
        RigidMotion::of((0..self.u.len()).map(of))
    }

    /// Sets a node's displacement, mm, and velocity, mm/ms.
    pub fn set(&self, place: usize, displacement: Vec3, velocity: Vec3) {
        self.u.set(place, displacement.extend(0.0).to_array());
        self.v.set(place, velocity.extend(0.0).to_array());
    }

    /// Weight of the node at a place in `gravity`, mm/ms², without scaled mass, and the force of
    /// its anchor, N; zero for a fixed node.
    pub fn force_at_rest(&self, place: usize, gravity: Vec3, fluid: &Fluid) -> Vec3 {
        if self.inverse_mass[place] == 0.0 {
            return Vec3::ZERO;
        }
        let (u, dryness) = (self.displacement(place), fluid.dryness(self.position(place)));
        let weight = (gravity + fluid.weight * dryness) * (self.weight[place] / self.inverse_mass[place]);
        let Some(anchor) = self.anchors.get(place) else { return weight };
        let (held, out) = (1.0 - anchor.in_fluid * dryness, anchor.normal * u.dot(anchor.normal));
        let taken = (out * anchor.along + (u - out) * anchor.across) * held;
        weight + anchor.normal * (anchor.open_mm2 * fluid.opening_mpa) - taken
    }

    /// Velocity of the node at a place, mm/ms.
    #[inline(always)]
    pub fn velocity(&self, place: usize) -> Vec3 {
        self.v.vector(place).truncate()
    }

    /// Present position of the node at a place, mm.
    #[inline(always)]
    pub fn position(&self, place: usize) -> Vec3 {
        (self.rest[place] + self.u.vector(place)).truncate()
    }

    /// Displacement of the node at a place, mm.
    #[inline(always)]
    pub fn displacement(&self, place: usize) -> Vec3 {
        self.u.vector(place).truncate()
    }
}
