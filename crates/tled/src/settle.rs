//! Dynamic relaxation: reaches equilibrium under given loads in few steps, e.g. sag or brain shift.
//!
//! # Theory
//! Steps have the longest stable length and are damped critically for the slowest remaining motion,
//! `α = 2 ω`: the remaining distance falls by `e^(-ω dt)` a step, so about `10/(ω dt)` steps
//! suffice. ω is the Rayleigh quotient of the changes of displacement and force over some steps,
//! `ω² = -Σ Δu·Δf / Σ m Δu²` (Joldes, Wittek and Miller 2009), clamped to a range around that of
//! the rest state. The remaining distance is estimated from velocity and acceleration by
//! `|v|/ω + |a|/ω²`.
//!
//! # Practice
//! With infinite `Config::mass_scaling` all elements have the same stable step. This takes the
//! fewest steps if only the equilibrium matters, not the motion towards it.

use crate::tled::Tled;
use trepan_geometry::Vec3;
use trepan_soft::{Loads, SoftSolver, StepReport};

/// Steps between two estimates of the frequency.
const CHECK_STEPS: u32 = 20;
/// Range of ω, as a multiple of that of the rest state.
const NEAR: std::ops::RangeInclusive<f32> = 0.25..=4.0;

/// Stopping criterion of [`Tled::settle`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settling {
    /// Largest remaining distance of a node, mm.
    pub tolerance_mm: f32,
    /// Largest number of steps.
    pub steps: u32,
}

impl Default for Settling {
    fn default() -> Self {
        Self { tolerance_mm: 0.01, steps: 20_000 }
    }
}

/// Result of [`Tled::settle`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settled {
    /// Number of steps done.
    pub steps: u32,
    /// Estimated largest remaining distance of a node, mm.
    pub left_mm: f32,
    /// Whether `left_mm` is within the tolerance.
    pub converged: bool,
    /// Report of the last step.
    pub last: StepReport,
}

impl Tled {
    /// Moves the body to equilibrium under `loads`, then sets velocities to zero and restores the
    /// damping. A body without supports is not moved, and `converged` is false.
    pub fn settle(&mut self, loads: &Loads, settling: &Settling) -> Settled {
        let (rate, lowest) = (self.base.damping_per_ms, self.base.lowest_per_ms);
        let (mut slow, mut settled) = (lowest, Settled { left_mm: f32::INFINITY, ..Settled::default() });
        if !self.base.supported {
            return settled;
        }
        let mut before = self.elements_and_nodes();
        while settled.steps < settling.steps && !settled.converged {
            self.base.damping_per_ms = 2.0 * slow;
            let dt_ms = self.longest_dt_ms();
            for _ in 0..CHECK_STEPS {
                settled.last = self.step(loads, dt_ms);
            }
            settled.steps += CHECK_STEPS;
            let now = self.elements_and_nodes();
            slow = self
                .frequency_between(&before, &now)
                .map_or(lowest, |w| w.clamp(NEAR.start() * lowest, NEAR.end() * lowest));
            settled.left_mm = self.left_mm(slow.min(lowest), CHECK_STEPS as f32 * dt_ms, &before, &now);
            settled.converged = settled.left_mm <= settling.tolerance_mm;
            before = now;
        }
        self.base.damping_per_ms = rate;
        self.stop();
        settled
    }

    /// Longest step that is stable near rest, ms; cut into substeps where the body is not.
    fn longest_dt_ms(&self) -> f32 {
        self.base.config.safety * self.base.bound.at_rest_ms
    }

    /// Displacement, velocity and force of every node, by place.
    fn elements_and_nodes(&self) -> Vec<[Vec3; 3]> {
        let nodes = self.elements.nodes();
        let of = |place| [nodes.displacement(place), nodes.velocity(place), self.elements.force(place)];
        (0..nodes.u.len()).map(of).collect()
    }

    /// Rayleigh quotient (frequency, rad/ms) of a change of state; `None` when nothing moved.
    fn frequency_between(&self, before: &[[Vec3; 3]], now: &[[Vec3; 3]]) -> Option<f32> {
        let (mut work, mut swung) = (0.0f64, 0.0f64);
        for ((a, b), inverse) in
            before.iter().zip(now).zip(&self.elements.nodes().inverse_mass).filter(|(_, m)| **m > 0.0)
        {
            let moved = (b[0] - a[0]).as_dvec3();
            work -= moved.dot((b[2] - a[2]).as_dvec3());
            swung += moved.length_squared() / f64::from(*inverse);
        }
        (work > 0.0 && swung > 0.0).then(|| (work / swung).sqrt() as f32)
    }

    fn left_mm(&self, slow: f32, apart_ms: f32, before: &[[Vec3; 3]], now: &[[Vec3; 3]]) -> f32 {
        let of = |(a, b): (&[Vec3; 3], &[Vec3; 3])| {
            let pull = (b[1] - a[1]) / apart_ms + b[1] * (2.0 * slow);
            b[1].length() / slow + pull.length() / (slow * slow)
        };
        before.iter().zip(now).map(of).fold(0.0, f32::max)
    }
}
