//! One solver step: the newest loads in, moved nodes out.
//!
//! # Practice
//! Contacts are springs on the nodes that the solver evaluates with its own positions, so steps between two
//! collision results stay stable. A record is made whenever another contact took effect, and every [`EACH`] steps: what a replay needs, no
//! more.

use crate::stages::collision_step::SoftFrame;
use trepan_contact::NodalContacts;
use trepan_geometry::Vec3;
use trepan_link::wire::SolverRecord;
use trepan_soft::{Loads, SoftSolver};

/// Steps between two records when the contact stays.
pub const EACH: u64 = 32;

/// The state that lives from step to step.
pub struct SolverStage {
    solver: Box<dyn SoftSolver>,
    rest: Vec<Vec3>,
    loads: Loads,
    dt_ms: f32,
    steps: u64,
    contact_seq: u64,
    inverted: u64,
    max_displacement_mm: f32,
}

impl SolverStage {
    /// A stage over a solver at rest, whose shape at rest is in balance.
    pub fn new(solver: Box<dyn SoftSolver>) -> Self {
        Self {
            rest: solver.positions().to_vec(),
            dt_ms: solver.stable_dt_ms(),
            solver,
            loads: Loads { gravity: Vec3::ZERO, contacts: NodalContacts::with_room() },
            steps: 0,
            contact_seq: 0,
            inverted: 0,
            max_displacement_mm: 0.0,
        }
    }

    /// The step; a record when it is worth one.
    pub fn step(&mut self, loads: &Loads, contact_seq: u64) -> Option<SolverRecord> {
        let switched = contact_seq != self.contact_seq;
        if switched {
            self.loads.gravity = loads.gravity;
            self.loads.contacts.copy_from(&loads.contacts);
            self.contact_seq = contact_seq;
        }
        let report = self.solver.step(&self.loads, self.dt_ms);
        self.steps += 1;
        self.inverted += u64::from(report.inverted);
        (switched || self.steps.is_multiple_of(EACH)).then(|| self.record(report.inverted))
    }

    fn record(&mut self, inverted: u32) -> SolverRecord {
        let now_mm = self.displacement_mm();
        self.max_displacement_mm = self.max_displacement_mm.max(now_mm);
        SolverRecord {
            step: self.steps,
            contact_seq: self.contact_seq,
            time_ms: self.time_ms(),
            max_displacement_mm: now_mm,
            inverted,
            compute_us: 0.0,
        }
    }

    /// Where the nodes are, mm.
    pub fn positions(&self) -> &[Vec3] {
        self.solver.positions()
    }

    /// Copies the brain as it is now into a frame, without allocating when the frame has the size.
    pub fn publish(&self, frame: &mut SoftFrame) {
        frame.step = self.steps;
        frame.positions.clear();
        frame.positions.extend_from_slice(self.solver.positions());
        frame.velocities.clear();
        frame.velocities.extend_from_slice(self.solver.velocities());
    }

    /// Largest distance of a node from where it began, mm.
    pub fn displacement_mm(&self) -> f32 {
        let squared = self.solver.positions().iter().zip(&self.rest).map(|(x, x0)| x.distance_squared(*x0));
        squared.fold(0.0, f32::max).sqrt()
    }

    /// Largest displacement in any record so far, mm.
    pub fn max_displacement_mm(&self) -> f32 {
        self.max_displacement_mm
    }

    /// Length of a step, ms.
    pub fn dt_ms(&self) -> f32 {
        self.dt_ms
    }

    /// Steps done.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Simulated time, ms.
    pub fn time_ms(&self) -> f64 {
        self.steps as f64 * f64::from(self.dt_ms)
    }

    /// Elements found inverted, summed over steps.
    pub fn inverted(&self) -> u64 {
        self.inverted
    }
}
