//! The seam of the soft-tissue solvers: loads in, nodal state out.

use crate::Fluid;
use glam::DVec3;
use std::any::Any;
use trepan_contact::NodalContacts;
use trepan_geometry::Vec3;
use trepan_mesh::{Split, TetMesh};

/// Advances a body under loads. One implementation owns all of a body's nodal state.
///
/// # Practice
/// The real-time solvers neither allocate nor panic in [`step`](Self::step); a solver that does
/// (the reference) says so. They wait for nothing outside the solver. One with threads of its own
/// takes locks that nobody else holds, and waits at the end of a pass for the parts that its other
/// threads have begun. Nodes are numbered as in the mesh that the solver was made from.
pub trait SoftSolver: Send {
    /// Advances by `dt_ms`. Whatever goes wrong is healed and counted in the report; positions stay
    /// finite.
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport;

    /// Present state of the nodes.
    fn state(&self) -> &NodeState;

    /// Present node positions, world mm.
    fn positions(&self) -> &[Vec3] {
        &self.state().positions
    }

    /// Present node velocities, mm/ms.
    fn velocities(&self) -> &[Vec3] {
        &self.state().velocities
    }

    /// Longest step that is stable with margin, ms; infinite for implicit and static solvers.
    fn stable_dt_ms(&self) -> f32;

    /// Longest step that is stable as the body is deformed now, ms; at most
    /// [`stable_dt_ms`](Self::stable_dt_ms). A longer one may be cut into substeps.
    fn next_dt_ms(&self) -> f32 {
        self.stable_dt_ms()
    }

    /// Lets the fill of each tetrahedron fall to a share of its rest volume, in 65,535ths; a higher
    /// one than before changes nothing. A solver that takes nothing away does nothing.
    fn lower_fills(&mut self, _fills: &[u16]) {}

    /// Maker of a solver of the same body for a processor that is too slow: it costs less and errs
    /// more in motion. `None` where there is none.
    fn cheaper(&self) -> Option<MakeSolver> {
        None
    }

    /// Maker of a solver of the same body with nodes split where it was cut; `None` for none.
    /// Splits are those since this solver was made, in their order.
    fn split(&self, _splits: &[Split]) -> Option<MakeSolver> {
        None
    }

    /// Stress memory, of a type of its own; `None` without one.
    fn memory(&mut self) -> Option<&mut dyn Any> {
        None
    }

    /// Present fill of each tetrahedron, in 65,535ths; empty where nothing is taken away.
    fn fills(&self) -> &[u16] {
        &[]
    }

    /// Length of the last step, ms, by half of which velocities are behind; 0 where they are not.
    fn last_step_ms(&self) -> f32 {
        0.0
    }

    /// Goes on from the state, the fills and the stress memory of the solver that made this one,
    /// which loses its stress memory.
    ///
    /// With no splits that was [`cheaper`](Self::cheaper), else [`split`](Self::split).
    fn resume(&mut self, _from: &mut dyn SoftSolver, _splits: &[Split]) {}
}

/// Makes a solver on any thread; `None` if the body is refused.
pub type MakeSolver = Box<dyn FnOnce() -> Option<Box<dyn SoftSolver>> + Send>;

/// What a solver publishes of its nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeState {
    /// Positions, world mm.
    pub positions: Vec<Vec3>,
    /// Velocities, mm/ms.
    pub velocities: Vec<Vec3>,
}

impl NodeState {
    /// The nodes of a mesh at rest.
    pub fn at_rest(mesh: &TetMesh) -> Self {
        Self { positions: mesh.positions.clone(), velocities: vec![Vec3::ZERO; mesh.positions.len()] }
    }

    /// Rounds the state of a node.
    pub(crate) fn set(&mut self, node: usize, position: DVec3, velocity: DVec3) {
        (self.positions[node], self.velocities[node]) = (position.as_vec3(), velocity.as_vec3());
    }
}

/// What acts on the body during one step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loads {
    /// Acceleration of gravity, mm/ms² (9.81e-3 downwards on Earth; zero = none).
    pub gravity: Vec3,
    /// Springs on the tissue (tool, walls, folds), evaluated with the solver's own positions.
    pub contacts: NodalContacts,
    /// Fluid around the body, with its level; TLED takes it, others do not.
    pub fluid: Fluid,
    /// Fill of each tetrahedron that resection leaves, in 65,535ths of its rest volume; empty where
    /// nothing is resected. Whoever moves the loads gives them to
    /// [`lower_fills`](SoftSolver::lower_fills).
    pub fills: Vec<u16>,
    /// Splits of nodes by all cuts so far. Whoever moves the loads has a solver with them made, by
    /// [`split`](SoftSolver::split).
    pub splits: Vec<Split>,
    /// How many of those the contacts know: nodes that later ones split stand for their copies too.
    pub contact_splits: u32,
}

impl Loads {
    /// Shares the contacts of nodes with the copies that they got since: half of each for each.
    pub fn share_contacts(&mut self, solver_splits: usize) {
        let known = self.contact_splits as usize;
        let mut last = None;
        for split in self.splits.get(known..solver_splits).unwrap_or_default() {
            if last.replace(split.node) == Some(split.node) {
                continue;
            }
            for contact in self.contacts.iter_mut() {
                let weight: f32 = contact.nodes().filter(|(n, _)| *n == split.from).map(|(_, weight)| weight).sum();
                if weight != 0.0 {
                    contact.reweight(|n, own| if n == split.from { 0.5 * own } else { own });
                    contact.add(split.node, 0.5 * weight);
                }
            }
        }
        self.contact_splits = self.contact_splits.max(solver_splits as u32);
    }
}

/// What happened in one step; every count is of this step alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Elements whose volume was zero or negative; the energy turns them back.
    pub inverted: u32,
    /// Nodes whose new state was not finite; put back to where they were, at rest.
    pub non_finite: u32,
    /// Nodes that hit the speed or displacement limit and were held to it.
    pub limited: u32,
    /// Steps actually made, over 1 when `dt_ms` was over the stable bound.
    pub substeps: u32,
    /// Time that was asked for and not simulated, because it would have taken too many substeps,
    /// ms.
    pub skipped_ms: f32,
    /// Forces of all contact springs on the tissue at the end of the step, summed without their
    /// directions, N.
    pub contact_n: f32,
    /// Iterations of an implicit or static solver.
    pub iterations: u32,
    /// Whether an iterative solver reached its tolerance; explicit solvers always say true.
    pub converged: bool,
}
