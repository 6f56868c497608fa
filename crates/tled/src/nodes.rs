//! State of the nodes and its update by central differences, with limits on speed and displacement.
//!
//! # Practice
//! State is stored as displacement from rest, by place in the solver's order: f32 displacements of
//! a few mm have a thousand times finer resolution than positions of 200 mm. A node beside a
//! sleeping part does not move until a force pushes it. Any thread may update any run of nodes,
//! because a node's update depends only on its state and its slots.

use crate::averaging::Averaging;
use crate::damping::RigidMotion;
use crate::dynamic_scaling::Added;
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
    pub inverse_mass: Scalars,
    /// Mass that stiffened elements add in this step, g; 0 everywhere while `is_heavier` is false.
    added: Scalars,
    is_heavier: AtomicBool,
    /// Share of the mass that has weight (scaled mass has none).
    weight: Scalars,
    rest: Vec<Vec4>,
    /// Anchors; empty where the body has none.
    anchors: Vec<Anchor>,
    /// Where accelerations are averaged: by whom, velocity changes of a step before it, mm/ms, and
    /// forces against them, N, which are valid while `is_opposed`.
    averaging: Option<Averaging>,
    changes: Field,
    opposed: Field,
    is_opposed: AtomicBool,
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

/// What the nodes need in a substep.
#[derive(Clone, Copy)]
struct Flags {
    anything_pushes: bool,
    may_sleep: bool,
    is_heavier: bool,
    is_anchored: bool,
    is_opposed: bool,
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
    pub fn of(body: &Body, layout: &Layout, masses: &[f64], averaging: Option<Averaging>) -> Self {
        let (inverse_mass, weight) = inverse_masses_and_weights(body, layout, masses);
        let field = || Field::zeroed(layout.node_at.len());
        let averaged = || Field::zeroed(if averaging.is_some() { layout.node_at.len() } else { 0 });
        Self {
            changes: averaged(),
            opposed: averaged(),
            is_opposed: AtomicBool::new(false),
            averaging,
            u: field(),
            v: field(),
            external: field(),
            is_pushed: AtomicBool::new(false),
            pushed: Scalars::zeroed(layout.node_at.len()),
            inverse_mass: Scalars::of(&inverse_mass),
            added: Scalars::zeroed(layout.node_at.len()),
            is_heavier: AtomicBool::new(false),
            weight: Scalars::of(&weight),
            rest: layout.node_at.iter().map(|&n| body.mesh.positions[n as usize].extend(0.0)).collect(),
            anchors: anchors_by_place(body, layout),
            limited: AtomicU32::new(0),
            non_finite: AtomicU32::new(0),
        }
    }

    /// Moves the nodes at some places by one substep.
    pub fn update(&self, places: Range<usize>, force_slots: &ForceSlots, update: &Update) {
        let [keep, gain] = update.keep_and_gain();
        let dt_ms = update.dt_ms;
        let square = |limit: f32| (limit * limit).min(f32::MAX);
        let (fastest, furthest) = (square(update.max_speed), square(update.max_displacement_mm));
        let flags = self.flags(update);
        for place in places {
            let (u, v) = (self.u.vector(place), self.v.vector(place));
            if self.inverse_mass.get(place) == 0.0 {
                // A fixed node moves with its prescribed velocity.
                self.u.set(place, (u + v * dt_ms).to_array());
                self.take_external(place, flags.anything_pushes);
                continue;
            }
            let Some([_, velocity]) = self.kicked(place, [u, v], force_slots, update, [keep, gain], flags) else {
                self.v.set(place, [0.0; 4]);
                continue;
            };
            let velocity = velocity.with_w(0.0);
            let after = u + velocity * dt_ms;
            // False for NaN.
            let within = velocity.length_squared() <= fastest && after.length_squared() <= furthest;
            let (after, velocity) = if within { (after, velocity) } else { self.limit(u, velocity, update) };
            self.u.set(place, after.to_array());
            self.v.set(place, velocity.to_array());
        }
    }

    /// What the nodes need in this substep. Unneeded fields are neither read nor written, since
    /// memory bandwidth limits the update, about 100 bytes a node.
    fn flags(&self, update: &Update) -> Flags {
        Flags {
            anything_pushes: self.is_pushed.load(Relaxed),
            may_sleep: update.calm_mm > 0.0,
            is_heavier: self.is_heavier.load(Relaxed),
            is_anchored: !self.anchors.is_empty(),
            is_opposed: self.is_opposed.load(Relaxed),
        }
    }

    /// Velocity of a free node that damping leaves, and the one after a substep, mm/ms; none for a
    /// node that rests beside a sleeping part.
    #[inline(always)]
    fn kicked(
        &self,
        place: usize,
        [u, v]: [Vec4; 2],
        force_slots: &ForceSlots,
        update: &Update,
        [keep, gain]: [f32; 2],
        flags: Flags,
    ) -> Option<[Vec4; 2]> {
        let (inverse_mass, external) = (self.inverse_mass.get(place), self.take_external(place, flags.anything_pushes));
        let lightness = if flags.is_heavier { self.lightness(place) } else { 1.0 };
        let carried = update.carried(self.rest[place] + u, v, keep);
        let opposed = if flags.is_opposed { self.opposed.vector(place) } else { Vec4::ZERO };
        if flags.is_opposed && external == Vec4::ZERO {
            let change = self.changes.vector(place);
            if change.w == 0.0 {
                return Some([carried, carried + change - opposed * (inverse_mass * lightness * gain)]);
            }
        }
        let mut force = force_slots.force(place) - opposed;
        let is_beside_sleepers = force.w > 0.0;
        force.w = 0.0;
        let gravity = update.weight_at(self.rest[place] + u);
        let pull = (gravity * self.weight.get(place) + (force + external) * inverse_mass) * lightness;
        let mut is_pushed = external != Vec4::ZERO;
        if is_beside_sleepers {
            is_pushed |= pull.length() * update.dt_ms * update.dt_ms > update.calm_mm;
            if !is_pushed {
                self.pushed.set(place, 0.0);
                return None;
            }
        }
        if flags.may_sleep {
            self.pushed.set(place, if is_pushed { 1.0 } else { 0.0 });
        }
        let velocity = carried + pull * gain;
        let velocity = match flags.is_anchored {
            true => self.anchored(place, u, velocity, inverse_mass * lightness * gain, update),
            false => velocity,
        };
        // Where the fourth number is 0, another force changes the velocity by itself alone.
        let alone = external == Vec4::ZERO && !flags.may_sleep && !self.is_anchored(place);
        Some([carried, velocity.with_w(if alone { 0.0 } else { 1.0 })])
    }

    /// Whether an anchor acts on the node at a place.
    #[inline(always)]
    fn is_anchored(&self, place: usize) -> bool {
        self.anchors.get(place).is_some_and(|anchor| anchor.along + anchor.across + anchor.open_mm2 != 0.0)
    }

    /// Finds the velocity changes of some nodes in a substep without moving them.
    pub fn predict(&self, places: Range<usize>, force_slots: &ForceSlots, update: &Update) {
        let (keep_and_gain, flags) = (update.keep_and_gain(), self.flags(update));
        for place in places {
            let state = [self.u.vector(place), self.v.vector(place)];
            let kicked = match self.inverse_mass.get(place) == 0.0 {
                true => None,
                false => self.kicked(place, state, force_slots, update, keep_and_gain, flags),
            };
            // What is not finite must not spread to neighbours before the update resets it.
            let change = kicked.map_or(Vec4::W, |[carried, velocity]| velocity - carried);
            let change = if change.is_finite() { change } else { Vec4::W };
            self.changes.set(place, change.to_array());
        }
    }

    /// Finds the forces that average the predicted changes of some nodes over elements.
    pub fn oppose(&self, places: Range<usize>, update: &Update) {
        let (Some(averaging), [_, gain]) = (&self.averaging, update.keep_and_gain()) else { return };
        for place in places {
            let force = averaging.opposed(place, |at| self.changes.vector(at)) / gain;
            self.opposed.set(place, force.with_w(0.0).to_array());
        }
    }

    /// Adds the same of an element that has stiffened.
    pub fn oppose_added(&self, added: [Added; 4], update: &Update) {
        let [_, gain] = update.keep_and_gain();
        let changes = added.map(|a| self.changes.vector(a.node as usize));
        let mean = (changes[0] + changes[1] + changes[2] + changes[3]) * 0.25;
        for (Added { node, averaged, .. }, change) in added.into_iter().zip(changes) {
            let force = self.opposed.vector(node as usize) + (change - mean) * (averaged / gain);
            self.opposed.set(node as usize, force.with_w(0.0).to_array());
        }
    }

    /// From now on, and until the update, the forces against changes count.
    pub fn count_opposed(&self) {
        self.is_opposed.store(true, Relaxed);
    }

    /// Velocity of a node after a substep under its element force alone, mm/ms. A fixed node keeps
    /// its velocity.
    pub fn free_velocity(&self, place: usize, force: Vec3, update: &Update) -> Vec3 {
        let (u, v, inverse_mass) = (self.u.vector(place), self.v.vector(place), self.inverse_mass.get(place));
        if inverse_mass == 0.0 {
            return v.truncate();
        }
        let [keep, gain] = update.keep_and_gain();
        let (at, lightness) = (self.rest[place] + u, self.lightness(place));
        let opposed = if self.is_opposed.load(Relaxed) { self.opposed.vector(place) } else { Vec4::ZERO };
        let force = force - opposed.truncate();
        let pull = update.weight_at(at).truncate() * self.weight.get(place) + force * inverse_mass;
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
        if !self.is_anchored(place) {
            return velocity;
        }
        let Anchor { normal, along, across, in_fluid, open_mm2, .. } = self.anchors[place];
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
        let inverse_mass = self.inverse_mass.get(place) * self.lightness(place);
        let Some(anchor) = self.anchors.get(place).filter(|anchor| anchor.along > 0.0) else { return inverse_mass };
        let held = 1.0 - anchor.in_fluid * update.fluid.dryness(self.position(place));
        let [_, gain] = update.keep_and_gain();
        inverse_mass / (1.0 + held * anchor.along * inverse_mass * gain * update.dt_ms)
    }

    /// A node's mass without over that with what stiffened elements add; 1 for a fixed node.
    #[inline(always)]
    fn lightness(&self, place: usize) -> f32 {
        1.0 / (1.0 + self.added.get(place) * self.inverse_mass.get(place))
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
        self.is_opposed.store(false, Relaxed);
        [&self.limited, &self.non_finite].map(|count| count.swap(0, Relaxed))
    }

    /// Adds an external force, N.
    pub fn push(&self, place: usize, force: Vec3) {
        self.is_pushed.store(true, Relaxed);
        self.external.set(place, (self.external.vector(place) + force.extend(0.0)).to_array());
    }

    /// Leaves a node this mass with weight, g, and its inertia; without any mass it stops for good.
    pub fn set_weight(&self, place: usize, grams: Option<f64>) {
        let inverse_mass = self.inverse_mass.get(place);
        self.weight.set(place, (grams.unwrap_or(0.0) * f64::from(inverse_mass)) as f32);
        if grams.is_none() && inverse_mass > 0.0 {
            self.inverse_mass.set(place, 0.0);
            self.v.set(place, [0.0; 4]);
        }
    }

    /// Present rigid motion of the body.
    pub fn rigid_motion(&self) -> RigidMotion {
        let of = |place: usize| (1.0 / self.inverse_mass.get(place), self.position(place), self.velocity(place));
        RigidMotion::of((0..self.u.len()).filter(|&place| self.inverse_mass.get(place) > 0.0).map(of))
    }

    /// Sets a node's displacement, mm, and velocity, mm/ms.
    pub fn set(&self, place: usize, displacement: Vec3, velocity: Vec3) {
        self.u.set(place, displacement.extend(0.0).to_array());
        self.v.set(place, velocity.extend(0.0).to_array());
    }

    /// Weight of the node at a place in `gravity`, mm/ms², without scaled mass, and the force of
    /// its anchor, N; zero for a fixed node.
    pub fn force_at_rest(&self, place: usize, gravity: Vec3, fluid: &Fluid) -> Vec3 {
        if self.inverse_mass.get(place) == 0.0 {
            return Vec3::ZERO;
        }
        let (u, dryness) = (self.displacement(place), fluid.dryness(self.position(place)));
        let weight = (gravity + fluid.weight * dryness) * (self.weight.get(place) / self.inverse_mass.get(place));
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
