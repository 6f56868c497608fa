//! All validation suites, one file each; one list feeds the command line and the page.

mod failures;
pub mod families;
mod thesis;

use trepan_evidence::part::nothing_more;
pub use trepan_evidence::part::{Part, Scope, Suite};
use trepan_trials_bone::{force, haptics, rigid, sensitivity, voxel_size};
use trepan_trials_sessions::{ablation, budget, measurement, operation, population, scripted, simulators};
use trepan_trials_tissue::{card, deformable, mesh, render, rivals, tled, volume};

/// Suites that run only when named: they need a graphics card,
/// download other programs, or take an hour.
pub const ON_REQUEST: &[Suite] = &[
    Suite {
        name: "card",
        question: "what do tissue and pictures cost on this machine's graphics card, and do they agree with the processor",
        chart: ("wall_us", "tetrahedron_steps_per_s"),
        parts: card::parts,
        judge: card::judge,
    },
    Suite {
        name: "population",
        question: "do heads that no one has seen open, keep still and warn rightly, by every quality",
        chart: ("displacement_mm", "jump_mm"),
        parts: population::parts,
        judge: population::judge,
    },
    Suite {
        name: "rivals",
        question: "how right and how fast are soft bodies of MuJoCo, Newton, PyBullet and scikit-fem beside TLED (fetched from Python's package index for this run)",
        chart: ("cpu_to_rest_ms", "displacement_error_percent"),
        parts: rivals::parts,
        judge: rivals::judge,
    },
    Suite {
        name: "render-rivals",
        question: "how fast is VTK's ray caster at an equal image error (fetched from Python's package index for this run)",
        chart: ("frame_p50_ms", "image_error_percent"),
        parts: render::rivals::parts,
        judge: nothing_more,
    },
    Suite {
        name: "recording-readers",
        question: "do the mcap package and Rerun read a recording (fetched from Python's package index for this run)",
        chart: ("ticks_written", "ticks_decoded"),
        parts: simulators::readers::parts,
        judge: nothing_more,
    },
    Suite {
        name: "mesh-rivals",
        question: "how do TetGen and fTetWild fill the same surface (fetched from Python's package index for this run)",
        chart: ("mesh_s", "min_dihedral_deg"),
        parts: mesh::rivals::parts,
        judge: nothing_more,
    },
];

/// Suites that run by default.
pub const ALL: &[Suite] = &[
    Suite {
        name: "ablation",
        question: "what does each ingredient of --set change in the operation, and what does it cost",
        chart: ("cpu_s_per_s", "change_over_tolerance"),
        parts: ablation::parts,
        judge: ablation::judge,
    },
    Suite {
        name: "mesh",
        question: "how well do tetrahedra fill a mask, and what does meshing cost",
        chart: ("mesh_s", "surface_p95_voxel"),
        parts: mesh::parts,
        judge: nothing_more,
    },
    Suite {
        name: "budget",
        question: "does a plan meet its tolerances, and how near to the cheapest choice that would",
        chart: ("cost_cores", "error_over_tolerance"),
        parts: budget::parts,
        judge: budget::judge,
    },
    Suite {
        name: "deformable",
        question: "how right is each way of touching moving tissue, and what does a step cost",
        chart: ("step_p50_us", "depth_error_p95_mm"),
        parts: deformable::parts,
        judge: deformable::judge,
    },
    Suite {
        name: "failures",
        question: "which smallest change of one condition breaks each method, and how",
        chart: ("failure_factor", "failure_factor"),
        parts: failures::parts,
        judge: failures::judge,
    },
    Suite {
        name: "force",
        question: "what does a force model cost, and does a pressed hand come to rest under the right force",
        chart: ("call_p50_ns", "force_error_rms_n"),
        parts: force::parts,
        judge: nothing_more,
    },
    Suite {
        name: "haptics",
        question: "which walls are quiet on which device in which hand, and what force does that cost",
        chart: ("stiffness_over_gil", "limit_cycle_mm"),
        parts: haptics::parts,
        judge: haptics::judge,
    },
    Suite {
        name: "measurement",
        question: "which published forces, times and shapes does the simulator reproduce",
        chart: ("measured", "ours"),
        parts: measurement::parts,
        judge: measurement::judge,
    },
    Suite {
        name: "operation",
        question: "what does the whole operation cost by each setup, and how wrong are force, bone and brain then",
        chart: ("cpu_s_per_s", "error_over_tolerance"),
        parts: operation::parts,
        judge: operation::judge,
    },
    Suite {
        name: "render",
        question: "is the picture where the bone is, and what does a look cost",
        chart: ("frame_p50_ms", "image_error_percent"),
        parts: render::parts,
        judge: nothing_more,
    },
    Suite {
        name: "rigid",
        question: "how right is each way of touching voxel bone, and what does a tick cost",
        chart: ("tick_p50_us", "depth_error_p95_voxel"),
        parts: rigid::parts,
        judge: rigid::judge,
    },
    Suite {
        name: "sensitivity",
        question: "which constants change the forces, times and shapes that a trainee meets, and by how much",
        chart: ("effect_percent", "effect_deviation_percent"),
        parts: sensitivity::parts,
        judge: sensitivity::judge,
    },
    Suite {
        name: "simulators",
        question: "are breaches told before they come, do the scores tell hands apart, is a replay the same",
        chart: ("path_mm", "plunge_mm"),
        parts: simulators::parts,
        judge: simulators::judge,
    },
    Suite {
        name: "thesis",
        question: "which numbered figures and tables of the thesis come out again, the same, better or worse",
        chart: ("printed", "ours"),
        parts: thesis::parts,
        judge: thesis::judge,
    },
    Suite {
        name: "tled",
        question: "how right is the brain's motion, and what does a step cost",
        chart: ("step_p50_us", "displacement_error_percent"),
        parts: tled::parts,
        judge: tled::judge,
    },
    Suite {
        name: "volume",
        question: "are images found again, kept exactly and measured rightly, and what does it cost",
        chart: ("cost_s", "error_p95_mm"),
        parts: volume::parts,
        judge: nothing_more,
    },
    Suite {
        name: "voxel-size",
        question: "which voxel edge makes collision cheapest, and what does a wrong guess cost",
        chart: ("cost_us", "regret_percent"),
        parts: voxel_size::parts,
        judge: voxel_size::judge,
    },
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_part_has_a_unique_file_name() {
        for suite in ALL.iter().chain(ON_REQUEST) {
            for quick in [true, false] {
                let names = trepan_evidence::report::slugs(suite, Scope { quick, seed: 1 });
                assert!(!names.is_empty() && names.iter().all(|name| !name.is_empty()));
                assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len(), "{}: {names:?}", suite.name);
            }
        }
    }
}
