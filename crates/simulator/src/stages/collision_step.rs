//! One collision step: the newest tool and the newest brain in; a surface patch for the hand, a contact for the solver out.
//!
//! # Practice
//! While the burr is in the hand the result only warns: the patch goes to the haptic thread, the solver gets no contact
//! (thesis 6.4). The stage has no clock; the same tools and positions give the same results.

use crate::program::{Phase, Program};
use crate::stages::haptic_tick::ToolSample;
use trepan_contact::{NodalContact, SurfacePatch};
use trepan_deformable::{Config, ConfigError, TissueCollision, TissueStep};
use trepan_geometry::Vec3;
use trepan_link::wire::CollisionRecord;
use trepan_mesh::TetMesh;

/// The brain as the solver last published it.
#[derive(Clone, Debug, Default)]
pub struct SoftFrame {
    /// Solver steps done.
    pub step: u64,
    /// Node positions, mm.
    pub positions: Vec<Vec3>,
    /// Node velocities, mm/ms.
    pub velocities: Vec<Vec3>,
}

/// The state that lives from step to step.
pub struct CollisionStage {
    program: Program,
    tools: Vec<TissueCollision>,
    phase: Phase,
    step: TissueStep,
    seq: u64,
}

impl CollisionStage {
    /// One collision pipeline for each tool of the program.
    pub fn new(program: Program, mesh: &TetMesh, config: &Config) -> Result<Self, ConfigError> {
        let of_phase = |phase: &Phase| TissueCollision::new(mesh, &phase.tool(), config);
        Ok(Self {
            program,
            tools: program.phases().iter().map(of_phase).collect::<Result<_, _>>()?,
            phase: program.phases()[0],
            step: TissueStep::default(),
            seq: 0,
        })
    }

    /// The step. Its results stand in [`patch`](Self::patch) and [`contact`](Self::contact) until the next.
    pub fn step(&mut self, sample: &ToolSample, soft: &SoftFrame) -> CollisionRecord {
        let at = self.program.phases().iter().position(|&p| p == sample.phase).unwrap_or(0);
        self.phase = sample.phase;
        self.tools[at].step(&soft.positions, &soft.velocities, &sample.state, &mut self.step);
        self.seq += 1;
        CollisionRecord {
            seq: self.seq,
            tick: sample.tick,
            solver_step: soft.step,
            depth_mm: self.step.manifold.depth_mm,
            points: self.step.points_in_contact,
            compute_us: 0.0,
        }
    }

    /// For the haptic thread.
    pub fn patch(&self) -> &SurfacePatch {
        &self.step.patch
    }

    /// For the solver: nothing while the burr is in the hand.
    pub fn contact(&self) -> NodalContact {
        if self.phase == Phase::Brain { self.step.nodal } else { NodalContact::none() }
    }
}
