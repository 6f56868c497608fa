//! What the papers of the rivals claim, and what the rivals were before.
//!
//! # Sources
//! The papers named. Times of before: least of five quick runs, rivals in f64, one element at a
//! time.

use trepan_evidence::picture::Table;
use trepan_evidence::suite::Row;
use trepan_trials_scenes::claims::{Claim, Former, Scale, Test, as_published, before_and_now};

const ERROR: &str = "displacement_error_percent";
const BLOCK: Scale =
    Scale { scene: "hanging block, 1152 tetrahedra", base: "tled", time: "time_to_rest_ms", error: ERROR };

const CLAIMS: [Claim; 6] = [
    Claim {
        source: "Müller and Gross 2004",
        claim: "warped stiffness takes away the growth of the linear model under rotation",
        test: Test::Ratio { metric: ERROR, of: "corotational", over: "linear", most: 1.0 },
    },
    Claim {
        source: "Müller and Gross 2004",
        claim: "implicit steps make it fast: real time on meshes of the day",
        test: Test::Ratio { metric: BLOCK.time, of: "corotational", over: "tled", most: 1.0 },
    },
    Claim {
        source: "Macklin and Müller 2021",
        claim: "neo-Hookean constraints come to the elastic solution (here: the reference on the same mesh)",
        test: Test::Ratio { metric: ERROR, of: "xpbd", over: "reference", most: 1.05 },
    },
    Claim {
        source: "Macklin, Müller and Chentanez 2016",
        claim: "stiffness does not depend on time step and iterations",
        test: Test::NotHere("one iteration a substep; the map Solvers has 1.5 and 5 times the step"),
    },
    Claim {
        source: "Provot 1995",
        claim: "masses and springs move like cloth",
        test: Test::NotHere("no claim on forces or strains of a solid"),
    },
    Claim {
        source: "Sase et al. 2015",
        claim: "corotational on a graphics card: 19,600 tetrahedra in under 20 ms a step",
        test: Test::NotHere("another machine; ns a tetrahedron and iteration stand in crates/soft/README.md"),
    },
];

/// Claims of papers, and rivals before and now.
pub fn tables(rows: &[Row]) -> Vec<Table> {
    let former = |method, error, time, remark| Former { method, error, time, remark };
    let lanes = "f32, sixteen elements at once";
    let formers = [
        former("linear", 37.537, 1.1, lanes),
        former("mass-spring", 29.318, 2.5, lanes),
        former("corotational", 36.356, 22.0, "the same; turned gradients, preconditioner"),
        former("xpbd", 34.232, 6.2, "the same; elements without a common node at once"),
    ];
    vec![
        as_published("Rivals as published", BLOCK.scene, &CLAIMS, rows),
        before_and_now("Rivals before and now", &BLOCK, &formers, rows),
    ]
}
