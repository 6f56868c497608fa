//! One solver step: the newest loads in, moved nodes out.
//!
//! # Practice
//! Contacts are springs on the nodes that the solver evaluates with its own positions, so steps between two
//! collision results stay stable. A record is made whenever another contact took effect, and every [`EACH`] steps: what a replay needs, no
//! more.

use crate::stages::collision_step::SoftFrame;
use serde::Serialize;
use trepan_contact::NodalContacts;
use trepan_geometry::Vec3;
use trepan_link::wire::SolverRecord;
use trepan_soft::{Loads, SoftSolver, StepReport};

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
    mishaps: Mishaps,
    max_displacement_mm: f32,
}

/// What a solver had to put right, summed over steps; all 0 where nothing was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Mishaps {
    /// Inverted elements, which their energy turns back.
    pub inverted: u64,
    /// Nodes that hit the limit of speed or displacement and were held to it.
    pub limited: u64,
    /// Nodes whose new state was not finite, put back to where they were.
    pub non_finite: u64,
    /// Time that was not simulated because it would have taken too many substeps, ms.
    pub skipped_ms: f64,
    /// Contacts and springs for which there was no room, summed over the collision steps that took effect.
    pub contacts_left_out: u64,
}

impl Mishaps {
    fn add(&mut self, report: &StepReport) {
        self.inverted += u64::from(report.inverted);
        self.limited += u64::from(report.limited);
        self.non_finite += u64::from(report.non_finite);
        self.skipped_ms += f64::from(report.skipped_ms);
    }

    /// What a report should say of them, where the brain did not move as its solver says.
    pub fn remark(&self) -> Option<String> {
        let Self { limited, non_finite, skipped_ms, contacts_left_out, .. } = *self;
        let sound = limited + non_finite + contacts_left_out == 0 && skipped_ms == 0.0;
        (!sound).then(|| {
            format!(
                "the brain's solver held {limited} nodes to a limit, put {non_finite} back that were not finite, left {skipped_ms:.1} ms out \
                 and {contacts_left_out} contacts for which there was no room: do not trust how it moved"
            )
        })
    }
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
            mishaps: Mishaps::default(),
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
            self.mishaps.contacts_left_out += u64::from(loads.contacts.overflow);
        }
        let report = self.solver.step(&self.loads, self.dt_ms);
        self.steps += 1;
        self.mishaps.add(&report);
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

    /// What had to be put right so far.
    pub fn mishaps(&self) -> &Mishaps {
        &self.mishaps
    }
}
