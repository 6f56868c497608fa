//! One collision step: from the newest tool and brain it computes a surface patch for the hand and
//! loads for the solver.
//!
//! # Practice
//! With a tool for bone the result only causes warnings: the patch goes to the haptic thread, the
//! solver gets no contact of it (thesis 6.4). A tool for the brain collides with tip and shaft.
//! From its first use on, the skull supports the brain against the probe and its own weight. The
//! stage has no clock; the same tools and positions give the same results.

use crate::program::{Phase, Program};
use crate::stages::haptic_tick::ToolSample;
use crate::stages::settling::Settling;
use crate::stages::skull_wall::SkullWall;
use trepan_contact::{NodalContacts, SurfacePatch};
use trepan_deformable::{Config, ConfigError, TissueCollision, TissueStep};
use trepan_geometry::{Tool, Vec3};
use trepan_link::wire::CollisionRecord;
use trepan_mesh::TetMesh;
use trepan_soft::Loads;

impl CollisionStage {
    /// Runs a step; its results are in [`patch`](Self::patch) and [`loads`](Self::loads).
    pub fn step(&mut self, sample: &ToolSample, soft: &SoftFrame) -> CollisionRecord {
        self.tools[sample.slot].step(&soft.positions, &soft.velocities, &sample.state, &mut self.step);
        self.patch = self.step.patch.with(self.step.shaft.normal, self.step.shaft.depth_mm);
        self.loads.gravity = self.settling.at(sample.phase(), sample.state.time_ms);
        self.press(sample.phase(), soft);
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

    fn press(&mut self, phase: Phase, soft: &SoftFrame) {
        self.loads.contacts.clear();
        if phase == Phase::Brain {
            self.step.springs(&mut self.loads.contacts);
            self.loads.contacts.overflow += self.step.overflow;
        }
        if let Some(wall) = self.wall.as_mut().filter(|_| self.settling.is_open()) {
            wall.press(&soft.positions, phase == Phase::Brain, &mut self.loads.contacts);
        }
    }
}

/// State of the brain as last published by the solver.
#[derive(Clone, Debug, Default)]
pub struct SoftFrame {
    /// Solver steps done.
    pub step: u64,
    /// Node positions, mm.
    pub positions: Vec<Vec3>,
    /// Node velocities, mm/ms.
    pub velocities: Vec<Vec3>,
}

/// State of the collision loop.
pub struct CollisionStage {
    tools: Vec<TissueCollision>,
    wall: Option<SkullWall>,
    settling: Settling,
    patch: SurfacePatch,
    loads: Loads,
    step: TissueStep,
    seq: u64,
}

impl CollisionStage {
    /// Makes a collision pipeline for each tool of the program, and takes the skull around the
    /// brain if there is one.
    pub fn new(
        program: Program,
        mesh: &TetMesh,
        config: &Config,
        wall: Option<SkullWall>,
    ) -> Result<Self, ConfigError> {
        let of_tool = |tool: &Tool| {
            let config = Config { shaft: Phase::of(tool) == Phase::Brain, ..config.clone() };
            TissueCollision::new(mesh, tool, &config)
        };
        Ok(Self {
            tools: program.tray().iter().map(of_tool).collect::<Result<_, _>>()?,
            wall,
            patch: SurfacePatch::default(),
            settling: Settling::default(),
            loads: Loads { gravity: Vec3::ZERO, contacts: NodalContacts::with_room() },
            step: TissueStep::default(),
            seq: 0,
        })
    }

    /// Adds the body force on the brain once the dura is open.
    pub fn settling(self, settling: Settling) -> Self {
        Self { settling, ..self }
    }

    /// Returns the surface patch for the haptic thread.
    pub fn patch(&self) -> &SurfacePatch {
        &self.patch
    }

    /// Returns the loads for the solver, without contacts of a tool for bone.
    pub fn loads(&self) -> &Loads {
        &self.loads
    }
}
