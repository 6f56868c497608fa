//! Equilibrium under given loads, e.g. sag or brain shift, by Newton's method on TLED's own forces.
//!
//! # Theory
//! The residual r is the force on the free nodes: elements, weight, contact springs, pressure. A
//! step is `d = B r`. B starts from the factored tangent of the same laws on plain elements
//! ([`Tangent`]) and is corrected by the last changes of displacement and residual (limited-memory
//! BFGS: Nocedal 1980). So what the tangent leaves out is learnt: averaged pressure, relaxed
//! stress, pressure that follows the surface. A line search on `r·d` shortens a step after which
//! the residual points back.
//!
//! Near rest d is the way that is left. If steps shrink by the factor ρ, `|d|/(1 - ρ)` bounds it.
//! Where rounding of the f32 forces keeps d from shrinking, the way left is the largest d of the
//! last iterations.
//!
//! # Practice
//! About 10 to 40 evaluations of the forces, each at the cost of a step of motion, and about as
//! many solutions of the factored tangent. A slender body takes a thousandth of the steps that
//! motion damped to rest takes. Tissue that relaxes ends fully relaxed.

use crate::tled::Tled;
use glam::DVec3;
use std::collections::VecDeque;
use trepan_geometry::Vec3;
use trepan_soft::{FreeNode, Gain, Loads, StepReport, Tangent};

/// Changes of displacement and residual that correct the tangent, at most.
const MEMORY: usize = 20;
/// Largest gradient of a step; a steeper one is cut, because elements turn far.
const STEEPEST: f64 = 0.3;
/// Gradient of a step above which elements turn so far that the residual does not judge it.
const TURNING: f64 = 0.05;
/// Gradient of steps that are near rest or rounding. Elements that strain more may hold back, by
/// tension of their own, what has far to go.
const FLAT: f64 = 1e-3;
/// Gradient of the displacement since the tangent was factored, above which it is factored anew.
/// `OLD` holds if steps shrink slowly, `FAR` always.
const OLD: f64 = 0.01;
const FAR: f64 = 0.1;
/// Share of the step before that a step must be below, not to be slow.
const SLOW: f64 = 0.3;
/// Steps within the tolerance after which rounding is all that keeps them from shrinking.
const SURE: usize = 4;
/// Iterations without a shorter step after which rounding limits the result.
const STALLED: usize = 12;
/// Most evaluations of one line search.
const TRIALS: u32 = 8;
/// Share of the slope along a step, backwards, that is accepted at its end.
const ACCEPTED: f64 = 0.9;
/// Bulk over shear modulus above which plain elements lock: 10 is a Poisson's ratio of 0.452.
const LOCKING: f64 = 10.0;
/// Way left over the step where the tangent is that of plain elements and pressure is averaged:
/// plain elements are stiffer.
const DOUBT: f64 = 3.0;
/// Time in which tissue relaxes fully, ms.
const RELAXED_MS: f32 = 1e12;

/// Stopping criterion of [`Tled::settle`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settling {
    /// Largest remaining distance of a node, mm.
    pub tolerance_mm: f32,
    /// Largest number of evaluations of the forces, each at the cost of a step of motion.
    pub steps: u32,
}

impl Default for Settling {
    fn default() -> Self {
        Self { tolerance_mm: 0.01, steps: 2000 }
    }
}

/// Result of [`Tled::settle`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settled {
    /// Number of evaluations of the forces.
    pub steps: u32,
    /// Number of times that the tangent was factored.
    pub factored: u32,
    /// Estimated largest remaining distance of a node, mm.
    pub left_mm: f32,
    /// Whether `left_mm` is within the tolerance.
    pub converged: bool,
    /// Report of the last evaluation.
    pub last: StepReport,
}

/// A change of displacement, mm, with the change of the residual against it, N.
struct Change {
    moved: Vec<DVec3>,
    resisted: Vec<DVec3>,
    /// Inverse of their product, 1/(N mm).
    inverse: f64,
}

/// Displacements by mesh node, mm, and the residual there, N.
#[derive(Clone)]
struct State {
    u: Vec<DVec3>,
    residual: Vec<DVec3>,
}

impl Tled {
    /// Moves the body to equilibrium under `loads`, with zero velocities. A body without supports
    /// is not moved, and `converged` is false.
    ///
    /// Allocates; not for a loop that must keep a rate.
    pub fn settle(&mut self, loads: &Loads, settling: &Settling) -> Settled {
        let mut settled = Settled { left_mm: f32::INFINITY, ..Settled::default() };
        let is_exact = !self.base.config.averaged_pressure || self.locks();
        let averaged = self.base.config.averaged_pressure && is_exact;
        let is_held =
            self.base.supported || self.body.anchors.iter().any(|anchor| anchor.along.min(anchor.across) > 0.0);
        let tangent = is_held.then(|| Tangent::of(&self.body, averaged)).flatten();
        let Some(mut tangent) = tangent else { return settled };
        let mut changes = VecDeque::with_capacity(MEMORY + 1);
        let mut at = self.evaluate(self.displacements(), loads, &mut settled);
        let (mut lengths, mut factored_at) = (Vec::<f64>::new(), None::<Vec<DVec3>>);
        let (mut flat, mut near) = (0, 0);
        while settled.steps < settling.steps {
            let slow = matches!(lengths[..], [.., before, last] if last > SLOW * before);
            let old = if near > 0 {
                0.0
            } else if slow {
                OLD
            } else {
                FAR
            };
            let aged = factored_at.as_ref().map_or(1.0, |then| tangent.steepest(&difference(&at.u, then)));
            if aged > old {
                if !tangent.factor(&at.u, loads) {
                    break;
                }
                if aged > OLD {
                    changes.clear();
                }
                factored_at = Some(at.u.clone());
                settled.factored += 1;
            }
            let step = direction(&mut tangent, &changes, &at.residual);
            let steep = tangent.steepest(&step);
            let length = longest(&step) * if is_exact { 1.0 } else { DOUBT };
            let shrinks = lengths.last().is_some_and(|before| length < 0.5 * before) || length == 0.0;
            lengths.push(length);
            flat = if steep < FLAT { flat + 1 } else { 0 };
            near = if length <= f64::from(settling.tolerance_mm) && steep < FLAT { near + 1 } else { 0 };
            settled.left_mm = left_mm(&lengths, near) as f32;
            settled.converged = (near > 1 && shrinks) || near > SURE;
            if settled.converged || (flat > STALLED && is_stalled(&lengths)) {
                break;
            }
            let Some(next) = self.search(&at, &step, steep, loads, &mut settled) else {
                self.evaluate(at.u, loads, &mut settled);
                break;
            };
            changes.extend(Change::between(&at, &next));
            if changes.len() > MEMORY {
                changes.pop_front();
            }
            at = next;
        }
        self.rest();
        settled
    }

    /// Whether plain elements of some material lock, so that their tangent is of no use for
    /// averaged pressure.
    fn locks(&self) -> bool {
        self.body.materials.iter().any(|material| material.bulk_mpa() > LOCKING * material.shear_mpa())
    }

    /// Goes along `step`, or a share of it. `None` when the residual always points back.
    ///
    /// A steep step is not judged by the residual: on straight paths what turns is stretched, and
    /// the next step takes that back.
    fn search(
        &mut self,
        from: &State,
        step: &[DVec3],
        steep: f64,
        loads: &Loads,
        settled: &mut Settled,
    ) -> Option<State> {
        let (slope, inverted, turns) = (dot(&from.residual, step), settled.last.inverted, steep > TURNING);
        let mut share = (STEEPEST / steep).min(1.0);
        for _ in 0..TRIALS {
            let u = from.u.iter().zip(step).map(|(u, d)| *u + *d * share).collect();
            let next = self.evaluate(u, loads, settled);
            let ahead = dot(&next.residual, step);
            let sound = ahead.is_finite() && settled.last.inverted <= inverted;
            if sound && (turns || ahead >= -ACCEPTED * slope) {
                return Some(next);
            }
            share *= if sound { (slope / (slope - ahead)).clamp(0.1, 0.5) } else { 0.25 };
        }
        None
    }

    fn displacements(&self) -> Vec<DVec3> {
        let nodes = self.elements.nodes();
        self.base.layout.place_of.iter().map(|&place| nodes.displacement(place as usize).as_dvec3()).collect()
    }

    /// Moves the nodes to displacements `u`, mm, rounded to f32, and finds the residual.
    fn evaluate(&mut self, u: Vec<DVec3>, loads: &Loads, settled: &mut Settled) -> State {
        settled.steps += 1;
        let relaxed_ms = if self.base.config.relaxation.is_none() { 0.0 } else { RELAXED_MS };
        let places = || self.base.layout.place_of.iter().map(|&place| place as usize);
        let nodes = self.elements.nodes();
        let rounded: Vec<Vec3> = u.iter().map(|u| u.as_vec3()).collect();
        places().zip(&rounded).for_each(|(place, &u)| nodes.set(place, u, Vec3::ZERO));
        let pass = self.elements.forces_at_rest(relaxed_ms);
        settled.last = StepReport { inverted: pass.inverted, converged: true, ..StepReport::default() };
        let (place_of, elements) = (&self.base.layout.place_of, &self.elements);
        let nodes = elements.nodes();
        let gravity = loads.gravity - self.base.config.balanced_gravity;
        let mut residual: Vec<DVec3> = places()
            .map(|place| (elements.force(place) + nodes.force_at_rest(place, gravity, &loads.fluid)).as_dvec3())
            .collect();
        let free = |n: u32| {
            let place = place_of[n as usize] as usize;
            FreeNode {
                position: nodes.position(place),
                velocity: Vec3::ZERO,
                inverse_mass: nodes.inverse_mass.get(place),
            }
        };
        let still = Gain { dt_ms: 0.0, gain_ms: 0.0 };
        let add = |n: u32, force: Vec3| residual[n as usize] += force.as_dvec3();
        settled.last.contact_n = self.springs.press(&loads.contacts, still, free, add);
        let node_at = &self.base.layout.node_at;
        self.pressure.each(
            |place| nodes.position(place as usize),
            |place, force| residual[node_at[place as usize] as usize] += force.as_dvec3(),
        );
        let fixed = places().map(|place| nodes.inverse_mass.get(place) == 0.0);
        residual.iter_mut().zip(fixed).filter(|(_, fixed)| *fixed).for_each(|(r, _)| *r = DVec3::ZERO);
        State { u: rounded.iter().map(|u| u.as_dvec3()).collect(), residual }
    }
}

impl Change {
    /// The change from one state to the next; `None` where the body did not resist it.
    fn between(from: &State, to: &State) -> Option<Self> {
        let (moved, resisted) = (difference(&to.u, &from.u), difference(&from.residual, &to.residual));
        let work = dot(&moved, &resisted);
        let scale = (dot(&moved, &moved) * dot(&resisted, &resisted)).sqrt();
        (work > 1e-6 * scale).then(|| Self { inverse: 1.0 / work, moved, resisted })
    }
}

/// `B r` by the two loops of limited-memory BFGS.
fn direction(tangent: &mut Tangent, changes: &VecDeque<Change>, residual: &[DVec3]) -> Vec<DVec3> {
    let mut step = residual.to_vec();
    let mut shares = Vec::with_capacity(changes.len());
    for change in changes.iter().rev() {
        let share = change.inverse * dot(&change.moved, &step);
        step.iter_mut().zip(&change.resisted).for_each(|(s, y)| *s -= *y * share);
        shares.push(share);
    }
    tangent.solve(&mut step);
    for (change, share) in changes.iter().zip(shares.into_iter().rev()) {
        let back = share - change.inverse * dot(&change.resisted, &step);
        step.iter_mut().zip(&change.moved).for_each(|(s, m)| *s += *m * back);
    }
    step
}

/// Way that is left after steps of these lengths were found, the last one not gone, mm. The last
/// `near` ones were within the tolerance.
fn left_mm(lengths: &[f64], near: usize) -> f64 {
    let [.., before, last] = *lengths else { return 2.0 * lengths[0] };
    if near > 1 { last.max(0.3 * before) } else { last / (1.0 - (last / before).clamp(0.0, 0.9)) }
}

/// Whether the last [`STALLED`] steps found no shorter one than those before.
fn is_stalled(lengths: &[f64]) -> bool {
    let (before, last) = lengths.split_at(lengths.len() - STALLED);
    let least = |some: &[f64]| some.iter().copied().fold(f64::INFINITY, f64::min);
    least(last) >= least(before)
}

fn difference(a: &[DVec3], b: &[DVec3]) -> Vec<DVec3> {
    a.iter().zip(b).map(|(a, b)| *a - *b).collect()
}

fn longest(step: &[DVec3]) -> f64 {
    step.iter().map(|d| d.length_squared()).fold(0.0, f64::max).sqrt()
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}
