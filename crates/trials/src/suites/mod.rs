//! The suites, one file each; one list feeds the command line and the page.

pub mod deformable;
mod haptics;
mod mesh;
mod render;
pub mod rigid;
mod simulators;
mod tled;
mod volume;
mod voxel_size;

use crate::suite::Findings;

/// How much of a suite to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scope {
    /// Fewer and smaller scenes, for every day.
    pub quick: bool,
    /// This run's part of the rows, and of how many.
    pub shard: (usize, usize),
}

impl Scope {
    /// Whether the row of this number is this run's to make.
    pub fn takes(&self, number: usize) -> bool {
        number % self.shard.1 == self.shard.0
    }

    /// The first of two numbers in a quick run, else the second.
    pub fn pick<T>(&self, quick: T, full: T) -> T {
        if self.quick { quick } else { full }
    }
}

/// A suite.
pub struct Suite {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it asks.
    pub question: &'static str,
    /// The metrics of its chart: cost, then error.
    pub chart: (&'static str, &'static str),
    /// Runs it.
    pub run: fn(Scope) -> Findings,
}

/// Suites that fetch programs of others: run when they are named only.
pub const ON_REQUEST: &[Suite] = &[
    Suite {
        name: "render-rivals",
        question: "how fast is VTK's ray caster at an equal image error (fetched from Python's package index for this run)",
        chart: ("frame_p50_ms", "image_error_percent"),
        run: render::rivals::run,
    },
    Suite {
        name: "recording-readers",
        question: "do the mcap package and Rerun read a recording (fetched from Python's package index for this run)",
        chart: ("ticks_written", "ticks_decoded"),
        run: simulators::readers::run,
    },
    Suite {
        name: "mesh-rivals",
        question: "how do TetGen and fTetWild fill the same surface (fetched from Python's package index for this run)",
        chart: ("mesh_s", "min_dihedral_deg"),
        run: mesh::rivals::run,
    },
];

/// Every suite.
pub const ALL: &[Suite] = &[
    Suite {
        name: "mesh",
        question: "how well do tetrahedra fill a mask, and what does meshing cost",
        chart: ("mesh_s", "surface_p95_voxel"),
        run: mesh::run,
    },
    Suite {
        name: "deformable",
        question: "how right is each way of touching moving tissue, and what does a step cost",
        chart: ("step_p50_us", "depth_error_p95_mm"),
        run: deformable::run,
    },
    Suite {
        name: "haptics",
        question: "which walls are quiet on which device in which hand, and what force does that cost",
        chart: ("stiffness_over_gil", "limit_cycle_mm"),
        run: haptics::run,
    },
    Suite {
        name: "render",
        question: "is the picture where the bone is, and what does a look cost",
        chart: ("frame_p50_ms", "image_error_percent"),
        run: render::run,
    },
    Suite {
        name: "rigid",
        question: "how right is each way of touching voxel bone, and what does a tick cost",
        chart: ("tick_p50_us", "depth_error_p95_voxel"),
        run: rigid::run,
    },
    Suite {
        name: "simulators",
        question: "are breaches told before they come, do the scores tell hands apart, is a replay the same",
        chart: ("path_mm", "plunge_mm"),
        run: simulators::run,
    },
    Suite {
        name: "tled",
        question: "how right is the brain's motion, and what does a step cost",
        chart: ("step_p50_us", "displacement_error_percent"),
        run: tled::run,
    },
    Suite {
        name: "volume",
        question: "are images found again, kept exactly and measured rightly, and what does it cost",
        chart: ("cost_s", "error_p95_mm"),
        run: volume::run,
    },
    Suite {
        name: "voxel-size",
        question: "which voxel edge makes collision cheapest, and what does a wrong guess cost",
        chart: ("cost_us", "regret_percent"),
        run: voxel_size::run,
    },
];
