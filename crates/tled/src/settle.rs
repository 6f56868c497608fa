//! Dynamic relaxation: from here to rest under given loads in the fewest steps, as for the sag
//! under gravity or the shift of a brain.
//!
//! # Theory
//! Steps of the longest stable length, damped critically for the slowest motion that is still going
//! on, `α = 2 ω`: what is left falls by `e^(-ω dt)` a step, so about `10/(ω dt)` steps end it. ω
//! comes from the motion itself, Rayleigh's quotient of what nodes and forces changed by over some
//! steps, `ω² = -Σ Δu·Δf / Σ m Δu²` (Joldes, Wittek and Miller 2009), held near that of the rest
//! state. What is left is estimated from velocity and acceleration by `|v|/ω + |a|/ω²`.
//!
//! # Practice
//! With `Config::mass_scaling` infinite all elements have the same bound: fewest steps where rest,
//! and not the way there, is wanted.

use crate::tled::Tled;
use trepan_geometry::Vec3;
use trepan_soft::{Loads, SoftSolver, StepReport};

/// Steps between two looks at the motion.
const LOOK: u32 = 20;
/// How far ω may go from that of the rest state.
const NEAR: std::ops::RangeInclusive<f32> = 0.25..=4.0;

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settling {
    /// Done when no node has further than this to go, mm.
    pub tolerance_mm: f32,
    /// Most steps.
    pub steps: u32,
}

impl Default for Settling {
    fn default() -> Self {
        Self { tolerance_mm: 0.01, steps: 20_000 }
    }
}

/// How it went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settled {
    /// Steps made.
    pub steps: u32,
    /// Estimate of how far the furthest node has still to go, mm.
    pub left_mm: f32,
    /// Whether that is within the tolerance.
    pub converged: bool,
    /// The last step's report.
    pub last: StepReport,
}

impl Tled {
    /// Goes to rest under `loads`, then stops all motion; damping is afterwards as before. A body
    /// that nothing holds does not come to rest, and this says so.
    pub fn settle(&mut self, loads: &Loads, settling: &Settling) -> Settled {
        let (rate, lowest) = (self.damping_per_ms, self.lowest_per_ms);
        let (mut slow, mut settled) = (lowest, Settled { left_mm: f32::INFINITY, ..Settled::default() });
        if !self.held {
            return settled;
        }
        let mut before = self.elements_and_nodes();
        while settled.steps < settling.steps && !settled.converged {
            self.damping_per_ms = 2.0 * slow;
            let dt_ms = self.stable_dt_ms();
            for _ in 0..LOOK {
                settled.last = self.step(loads, dt_ms);
            }
            settled.steps += LOOK;
            let now = self.elements_and_nodes();
            slow = self
                .frequency_between(&before, &now)
                .map_or(lowest, |w| w.clamp(NEAR.start() * lowest, NEAR.end() * lowest));
            settled.left_mm = self.left_mm(slow.min(lowest), LOOK as f32 * dt_ms, &before, &now);
            settled.converged = settled.left_mm <= settling.tolerance_mm;
            before = now;
        }
        self.damping_per_ms = rate;
        self.stop();
        settled
    }

    /// Displacement, velocity and force of every node, by place.
    fn elements_and_nodes(&self) -> Vec<[Vec3; 3]> {
        let nodes = self.elements.nodes();
        let of = |place| [nodes.displacement(place), nodes.velocity(place), self.elements.force(place)];
        (0..nodes.u.len()).map(of).collect()
    }

    /// Rayleigh's frequency of a change of state; `None` when nothing moved.
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
