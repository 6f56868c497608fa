//! One solver step: the newest loads in, moved nodes out.
//!
//! # Practice
//! Contacts are springs on the nodes that the solver evaluates with its own positions, so steps
//! between two collision results stay stable. A record is made whenever another contact took
//! effect, and every [`EACH`] steps: what a replay needs, no more.

use crate::stages::collision_step::SoftFrame;
use serde::Serialize;
use trepan_contact::NodalContacts;
use trepan_geometry::Vec3;
use trepan_link::wire::SolverRecord;
use trepan_soft::{Loads, SoftSolver, StepReport};

/// Steps between two records when the contact stays.
pub const EACH: u64 = 32;
/// Longest way that a node may go in a step while no tool touches the brain, mm.
pub const REST_MOTION_MM: f32 = 0.02;
/// Time after the last touch in which the brain may still move back, ms.
const MOVES_BACK_MS: f64 = 500.0;

/// The state that lives from step to step.
pub struct SolverStage {
    solver: Box<dyn SoftSolver>,
    rest: Vec<Vec3>,
    loads: Loads,
    dt_ms: f32,
    steps: u64,
    contact_seq: u64,
    solver_faults: SolverFaults,
    max_displacement_mm: f32,
    /// Simulated time at which a tool touched the brain last, ms.
    touched_ms: f64,
}

/// What a solver had to put right, summed over steps; all 0 where nothing was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SolverFaults {
    /// Inverted elements, which their energy turns back.
    pub inverted: u64,
    /// Nodes that hit the limit of speed or displacement and were held to it.
    pub limited: u64,
    /// Nodes whose new state was not finite, put back to where they were.
    pub non_finite: u64,
    /// Time that was not simulated because it would have taken too many substeps, ms.
    pub skipped_ms: f64,
    /// Contacts and springs for which there was no room, summed over the collision steps that took
    /// effect.
    pub contacts_left_out: u64,
    /// Longest way of a node in one step while no tool touched the brain, nor in the half second
    /// before, mm.
    pub rest_motion_mm: f32,
    /// Steps in which that was more than 0.02 mm.
    pub restless_steps: u64,
}

impl SolverFaults {
    fn add(&mut self, report: &StepReport) {
        self.inverted += u64::from(report.inverted);
        self.limited += u64::from(report.limited);
        self.non_finite += u64::from(report.non_finite);
        self.skipped_ms += f64::from(report.skipped_ms);
    }

    fn rest(&mut self, motion_mm: f32) {
        self.rest_motion_mm = self.rest_motion_mm.max(motion_mm);
        self.restless_steps += u64::from(motion_mm > REST_MOTION_MM);
    }

    /// What a report should say of them, where the brain did not move as its solver says.
    pub fn remarks(&self) -> impl Iterator<Item = String> + use<> {
        let Self { inverted, limited, non_finite, skipped_ms, contacts_left_out, rest_motion_mm, restless_steps } =
            *self;
        let sound = limited + non_finite + contacts_left_out == 0 && skipped_ms == 0.0;
        let held = (!sound).then(|| {
            format!(
                "the brain's solver held {limited} nodes to a limit, put {non_finite} back that were not finite, \
                 left {skipped_ms:.1} ms out and {contacts_left_out} contacts for which there was no room: do not \
                 trust how it moved"
            )
        });
        let inverted = (inverted > 0).then(|| {
            format!(
                "elements of the brain were inverted {inverted} times: its forces were wrong there; take --quality fine"
            )
        });
        let restless = (restless_steps > 0).then(|| {
            format!(
                "the brain moved by itself: up to {rest_motion_mm:.2} mm in a step while nothing touched it, over \
                 {REST_MOTION_MM} mm in {restless_steps} steps: do not trust its motion; report the case"
            )
        });
        [held, inverted, restless].into_iter().flatten()
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
            solver_faults: SolverFaults::default(),
            max_displacement_mm: 0.0,
            touched_ms: f64::NEG_INFINITY,
        }
    }

    /// The step; a record when it is worth one.
    pub fn step(&mut self, loads: &Loads, contact_seq: u64) -> Option<SolverRecord> {
        let switched = contact_seq != self.contact_seq;
        if switched {
            self.loads.gravity = loads.gravity;
            self.loads.contacts.copy_from(&loads.contacts);
            self.contact_seq = contact_seq;
            self.solver_faults.contacts_left_out += u64::from(loads.contacts.overflow);
        }
        let report = self.solver.step(&self.loads, self.dt_ms);
        self.steps += 1;
        self.solver_faults.add(&report);
        if !self.loads.contacts.is_empty() {
            self.touched_ms = self.time_ms();
        } else if self.time_ms() - self.touched_ms > MOVES_BACK_MS {
            self.solver_faults.rest(self.fastest() * self.dt_ms);
        }
        (switched || self.steps.is_multiple_of(EACH)).then(|| self.record(report.inverted))
    }

    /// Speed of the fastest node, mm/ms.
    fn fastest(&self) -> f32 {
        self.solver.velocities().iter().map(|v| v.length_squared()).fold(0.0, f32::max).sqrt()
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
    pub fn solver_faults(&self) -> &SolverFaults {
        &self.solver_faults
    }
}
