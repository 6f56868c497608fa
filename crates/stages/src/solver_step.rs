//! One solver step: takes the newest loads and moves the nodes.
//!
//! # Practice
//! Contacts are springs on the nodes. The solver evaluates them at its own positions, so steps
//! between two collision results remain stable. They move on with the tool, at its velocity: a
//! contact that waits for the next result is found up to a step too deep, and gives the hand 0.04 N
//! too much at 40 mm/s. A record is made when a new contact takes effect,
//! and every [`EACH`] steps: as much as a replay needs. Where the processor is too slow, a cheaper
//! solver of the same body goes on from the same state; the record of its first step says so, and
//! a replay changes at the same step. So it is where the brain was cut: a solver of the split body
//! is made beside, and goes on when it is there.

use crate::collision_step::SoftFrame;
use serde::Serialize;
use std::sync::mpsc::{Receiver, Sender, channel};
use trepan_contact::NodalContacts;
use trepan_geometry::Vec3;
use trepan_link::wire::SolverRecord;
use trepan_mesh::Split;
use trepan_soft::{Loads, MakeSolver, SoftSolver, StepReport};

/// Steps between two records while the contact is unchanged.
pub const EACH: u64 = 32;
/// Limit for the motion of a node in a step while no tool touches the brain, mm.
pub const REST_MOTION_MM: f32 = 0.02;
/// Longest time in which contacts follow a tool of which nothing new is heard, ms.
const FOLLOWED_MS: f32 = 2.0;
/// Time after the last touch in which the brain may still move back, ms.
const MOVES_BACK_MS: f64 = 500.0;

impl SolverStage {
    /// Runs a step; returns a record if one is due.
    pub fn step(&mut self, loads: &Loads, contact_seq: u64) -> Option<SolverRecord> {
        let switched = contact_seq != self.contact_seq;
        if switched {
            (self.loads.gravity, self.loads.fluid) = (loads.gravity, loads.fluid);
            self.loads.contacts.copy_from(&loads.contacts);
            if self.loads.fills != loads.fills {
                self.loads.fills.clone_from(&loads.fills);
                self.solver.lower_fills(&loads.fills);
            }
            if self.loads.splits.len() != loads.splits.len() {
                self.loads.splits.clone_from(&loads.splits);
            }
            self.loads.contact_splits = loads.contact_splits;
            self.loads.share_contacts(self.splits);
            (self.contact_seq, self.followed_ms) = (contact_seq, 0.0);
            self.solver_faults.contacts_left_out += u64::from(loads.contacts.overflow);
        }
        let changed = self.takes_next();
        let dt_ms = self.dt_ms();
        let report = self.solver.step(&self.loads, dt_ms);
        self.steps += 1;
        self.time_ms += f64::from(dt_ms);
        if self.followed_ms < FOLLOWED_MS {
            self.loads.contacts.follow_tool(dt_ms);
            self.followed_ms += dt_ms;
            if self.followed_ms >= FOLLOWED_MS {
                self.loads.contacts.stop_tool();
            }
        }
        self.solver_faults.add(&report);
        if !self.loads.contacts.is_empty() {
            self.touched_ms = self.time_ms();
        } else if self.time_ms() - self.touched_ms > MOVES_BACK_MS {
            self.solver_faults.rest(self.fastest() * dt_ms);
        }
        (switched || changed || self.steps.is_multiple_of(EACH)).then(|| self.record(report.inverted))
    }

    /// Returns the speed of the fastest node, mm/ms.
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
            cheaper: self.solver_faults.cheaper_from_ms.is_some().into(),
            splits: self.splits as u32,
        }
    }

    /// Has a cheaper solver made, once; it steps from when it is there.
    pub fn ask_for_cheaper(&mut self) {
        let is_wanted = self.may_be_cheaper && self.coming.is_none();
        let Some(make) = is_wanted.then(|| self.solver.cheaper()).flatten() else { return };
        self.may_be_cheaper = false;
        self.ask(make, Coming::Cheaper);
    }

    /// Has a solver of the body as it was cut by now made; it steps from when it is there.
    /// Allocates where there are new splits.
    pub fn ask_for_splits(&mut self) {
        self.ask_for(self.loads.splits.len());
    }

    fn ask_for(&mut self, splits: usize) {
        let Some(new) = self.loads.splits.get(self.splits..splits).filter(|new| !new.is_empty()) else { return };
        let is_wanted = self.coming.is_none() && self.refused < splits;
        if let Some(make) = is_wanted.then(|| self.solver.split(new)).flatten() {
            self.ask(make, Coming::Split(splits));
        }
    }

    fn ask(&mut self, make: MakeSolver, coming: Coming) {
        let asked = self.maker.as_ref().is_some_and(|maker| maker.jobs.send(Job::Make(make)).is_ok());
        self.coming = asked.then_some(coming);
    }

    /// The same as [`ask_for_cheaper`](Self::ask_for_cheaper), and the step waits for it: for a
    /// replay.
    pub fn wait_for_cheaper(&mut self) {
        self.ask_for_cheaper();
        self.waits = true;
    }

    /// The same as [`ask_for_splits`](Self::ask_for_splits) for so many of those in the loads.
    pub fn wait_for_splits(&mut self, loads: &Loads, splits: usize) {
        self.loads.splits.clone_from(&loads.splits);
        self.ask_for(splits);
        self.waits = true;
    }

    /// Lets the solver that was asked for go on once it is made; returns whether it does from this
    /// step on. This step alone allocates.
    fn takes_next(&mut self) -> bool {
        let waits = std::mem::take(&mut self.waits);
        let Some((coming, maker)) = self.coming.zip(self.maker.as_ref()) else { return false };
        let made = if waits { maker.made.recv().ok() } else { maker.made.try_recv().ok() };
        let Some(made) = made else { return false };
        self.coming = None;
        let Some(mut solver) = made else {
            tracing::warn!("the brain's solver goes on as it was: that of its changed body was refused");
            if let Coming::Split(to) = coming {
                self.refused = to;
            }
            return false;
        };
        let to = if let Coming::Split(to) = coming { to } else { self.splits };
        let new = &self.loads.splits[self.splits..to];
        solver.resume(&mut *self.solver, new);
        solver.lower_fills(&self.loads.fills);
        for Split { from, node, .. } in new {
            if *node as usize == self.rest.len() {
                self.rest.push(self.rest[*from as usize]);
            }
        }
        self.splits = to;
        self.loads.share_contacts(to);
        if let Coming::Cheaper = coming {
            self.solver_faults.cheaper_from_ms = Some(self.time_ms);
        }
        let former = std::mem::replace(&mut self.solver, solver);
        // Where the maker is gone, it ends here.
        maker.jobs.send(Job::End(former)).ok();
        true
    }
}

/// State of the solver loop.
pub struct SolverStage {
    solver: Box<dyn SoftSolver>,
    rest: Vec<Vec3>,
    loads: Loads,
    /// Simulated time, ms.
    time_ms: f64,
    steps: u64,
    contact_seq: u64,
    /// Simulated time in which these contacts have followed their tool, ms.
    followed_ms: f32,
    solver_faults: SolverFaults,
    max_displacement_mm: f32,
    /// Simulated time of the last touch of the brain, ms.
    touched_ms: f64,
    /// Splits that the solver has, and those up to which they were refused.
    splits: usize,
    refused: usize,
    maker: Option<Maker>,
    coming: Option<Coming>,
    /// Whether the next step waits for what is coming.
    waits: bool,
    /// Whether no cheaper solver was asked for yet.
    may_be_cheaper: bool,
}

/// A solver that is being made.
#[derive(Clone, Copy)]
enum Coming {
    Cheaper,
    /// With so many splits.
    Split(usize),
}

/// What the maker's thread is to do.
enum Job {
    Make(MakeSolver),
    End(Box<dyn SoftSolver>),
}

/// A thread that makes solvers and ends former ones. It begins with the stage, not when it is
/// asked: then it would inherit the real-time priority of the solver's loop, and its solver's
/// threads with it.
struct Maker {
    jobs: Sender<Job>,
    made: Receiver<Option<Box<dyn SoftSolver>>>,
}

impl Maker {
    /// Starts the thread; it ends when this is dropped.
    fn start() -> Option<Self> {
        let (jobs, todo) = channel();
        let (ready, made) = channel();
        let work = move || {
            for job in todo {
                match job {
                    // Nobody waits for it any more.
                    Job::Make(make) => _ = ready.send(make()),
                    Job::End(solver) => drop(solver),
                }
            }
        };
        std::thread::Builder::new().name("solver maker".into()).spawn(work).ok()?;
        Some(Self { jobs, made })
    }
}

/// Says that a cheaper solver steps from some simulated time on, ms.
pub fn cheaper_text(from_ms: f64) -> String {
    format!(
        "the processor was too slow for the brain: from {:.1} s on its solver took longer steps, and a fast press \
         feels heavier; close programs, or take a lower quality",
        1e-3 * from_ms
    )
}

/// Faults of a solver, summed over steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SolverFaults {
    /// Inverted elements, which their strain energy restores.
    pub inverted: u64,
    /// Nodes clamped to the limit of speed or displacement.
    pub limited: u64,
    /// Nodes with a non-finite new state, reset to their previous state.
    pub non_finite: u64,
    /// Time not simulated because it would have taken too many substeps, ms.
    pub skipped_ms: f64,
    /// Contacts and springs dropped for lack of room, summed over the collision steps used.
    pub contacts_left_out: u64,
    /// Largest motion of a node in a step, mm, while no tool has touched the brain for 0.5 s.
    pub rest_motion_mm: f32,
    /// Steps in which that motion exceeded 0.02 mm.
    pub restless_steps: u64,
    /// Simulated time from which a cheaper solver stepped, as the processor was too slow, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cheaper_from_ms: Option<f64>,
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

    /// Returns the remarks for a report where faults make the brain's motion unreliable.
    pub fn remarks(&self) -> impl Iterator<Item = String> + use<> {
        let Self {
            inverted,
            limited,
            non_finite,
            skipped_ms,
            contacts_left_out,
            rest_motion_mm,
            restless_steps,
            cheaper_from_ms,
        } = *self;
        let valid = limited + non_finite + contacts_left_out == 0 && skipped_ms == 0.0;
        let invalid = (!valid).then(|| {
            format!(
                "the brain's solver clamped {limited} nodes to a limit, reset {non_finite} non-finite nodes, skipped \
                 {skipped_ms:.1} ms and dropped {contacts_left_out} contacts for lack of room: do not rely on the \
                 brain's motion"
            )
        });
        let inverted = (inverted > 0).then(|| {
            format!("elements of the brain were inverted {inverted} times: forces there were wrong; use --quality fine")
        });
        let restless = (restless_steps > 0).then(|| {
            format!(
                "the brain moved by itself: up to {rest_motion_mm:.2} mm in a step while nothing touched it, over \
                 {REST_MOTION_MM} mm in {restless_steps} steps: do not rely on its motion; report the case"
            )
        });
        let cheaper = cheaper_from_ms.map(cheaper_text);
        [invalid, inverted, restless, cheaper].into_iter().flatten()
    }
}

impl SolverStage {
    /// Makes a stage with a solver at rest, whose rest shape is in equilibrium.
    pub fn new(solver: Box<dyn SoftSolver>) -> Self {
        Self {
            rest: solver.positions().to_vec(),
            solver,
            time_ms: 0.0,
            loads: Loads { contacts: NodalContacts::with_room(), ..Loads::default() },
            steps: 0,
            contact_seq: 0,
            followed_ms: 0.0,
            solver_faults: SolverFaults::default(),
            max_displacement_mm: 0.0,
            touched_ms: f64::NEG_INFINITY,
            splits: 0,
            refused: 0,
            maker: Maker::start(),
            coming: None,
            waits: false,
            may_be_cheaper: true,
        }
    }

    /// Returns the node positions, mm.
    pub fn positions(&self) -> &[Vec3] {
        self.solver.positions()
    }

    /// Copies step, positions and velocities into a frame; does not allocate if the frame is large
    /// enough.
    pub fn publish(&self, frame: &mut SoftFrame) {
        (frame.step, frame.time_ms) = (self.steps, self.time_ms());
        frame.positions.clear();
        frame.positions.extend_from_slice(self.solver.positions());
        frame.velocities.clear();
        frame.velocities.extend_from_slice(self.solver.velocities());
        frame.fills.clone_from(&self.loads.fills);
        if frame.splits.len() != self.splits {
            frame.splits.clear();
            frame.splits.extend_from_slice(&self.loads.splits[..self.splits]);
        }
    }

    /// Makes room for what an aspirator leaves of a number of tetrahedra.
    pub fn resectable(mut self, tets: usize) -> Self {
        self.loads.fills = vec![u16::MAX; tets];
        self
    }

    /// What is left of each tetrahedron, of 65535; empty where nothing can be resected.
    pub fn fills(&self) -> &[u16] {
        &self.loads.fills
    }

    /// Splits of nodes that the solver has.
    pub fn splits(&self) -> &[Split] {
        &self.loads.splits[..self.splits]
    }

    /// Returns the largest displacement of a node from its rest position, mm.
    pub fn displacement_mm(&self) -> f32 {
        let squared = self.solver.positions().iter().zip(&self.rest).map(|(x, x0)| x.distance_squared(*x0));
        squared.fold(0.0, f32::max).sqrt()
    }

    /// Largest displacement in any record so far, mm.
    pub fn max_displacement_mm(&self) -> f32 {
        self.max_displacement_mm
    }

    /// Length of the next step, ms: shorter than at rest while the brain is deformed much.
    pub fn dt_ms(&self) -> f32 {
        self.solver.next_dt_ms()
    }

    /// Mean length of the steps done, ms; that of the next one before the first.
    pub fn mean_dt_ms(&self) -> f32 {
        if self.steps > 0 { (self.time_ms / self.steps as f64) as f32 } else { self.dt_ms() }
    }

    /// Steps done.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Simulated time, ms.
    pub fn time_ms(&self) -> f64 {
        self.time_ms
    }

    /// Returns the faults so far.
    pub fn solver_faults(&self) -> &SolverFaults {
        &self.solver_faults
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_contact::NodalContact;
    use trepan_soft::{Body, Material, boxes};
    use trepan_tled::{Config, Tled};

    #[test]
    fn a_tool_of_which_nothing_is_heard_stands_after_two_milliseconds() {
        let mesh = boxes::split_box([3; 3], Vec3::splat(30.0));
        let body = Body::uniform(mesh, vec![0, 3, 12, 15], Material::BRAIN);
        let mut stage = SolverStage::new(Box::new(Tled::new(&body, &Config::default()).expect("the block is sound")));
        let mut contact = NodalContact::none();
        (contact.normal, contact.stiffness, contact.offset_mm) = (Vec3::Z, 0.1, -30.0);
        contact.tool_normal_velocity = -0.04;
        contact.lateral_velocity = Vec3::X;
        contact.add(63, 1.0);
        let loads = Loads { contacts: contact.into(), ..Loads::default() };
        while stage.time_ms() < 20.0 {
            _ = stage.step(&loads, 1);
        }
        let stood = stage.loads.contacts[0];
        let moved_mm = stood.offset_mm - contact.offset_mm;
        let expected = 0.04 * FOLLOWED_MS..0.04 * (FOLLOWED_MS + 1.5);
        assert!(expected.contains(&moved_mm), "{moved_mm}");
        assert_eq!((stood.tool_normal_velocity, stood.lateral_velocity), (0.0, Vec3::ZERO));
    }
}
