//! Published figures: the thesis's own, the claims of the rivals' papers, and the rivals before.
//!
//! # Sources
//! The thesis's text, on its machine of 2012; abstracts of the papers named. Times of before: quick
//! runs of the same scenes, the trees refitted whole in every step and asked point by point.

use trepan_evidence::picture::Table;
use trepan_evidence::suite::Row;
use trepan_trials_scenes::claims::{Claim, Former, Scale, Test, as_published, before_and_now};

/// Models of Tables 4.1 and 4.2: name, tetrahedra, cell, mm, and whether every step kept within 1
/// ms (Figures 4.8 and 4.12).
pub const MODELS: [(&str, usize, f64, bool); 12] = [
    ("Cube1", 1_715, 37.5, true),
    ("Cube2", 10_985, 20.0, true),
    ("Cube3", 53_240, 12.0, true),
    ("Cube4", 135_000, 8.7, false),
    ("Cube5", 320_000, 6.5, false),
    ("Cube6", 625_000, 5.2, false),
    ("Cube7", 1_080_000, 4.2, false),
    ("Brain1", 3_497, 15.5, true),
    ("Brain2", 12_511, 10.5, true),
    ("Brain3", 22_076, 8.6, false),
    ("Brain4", 40_584, 7.0, false),
    ("Brain5", 50_041, 6.4, false),
];

/// Largest change of force in a tick along its paths (Figure 4.19), N.
const FORCE_CHANGE_N: f64 = 0.8;

/// One row for each model, and one for the force.
pub fn rows() -> Vec<Row> {
    let model = |(name, tets, cell_mm, in_time): (&str, usize, f64, bool)| {
        Row::new(format!("{name}, {tets} tetrahedra"), "thesis, as published")
            .with("tets", tets)
            .with("cell_mm", cell_mm)
            .metric("within_1_ms_flag", f64::from(u8::from(in_time)))
    };
    let force = Row::new("Brain3, three paths", "thesis, as published").metric("force_change_max_n", FORCE_CHANGE_N);
    MODELS.into_iter().map(model).chain([force]).collect()
}

const TIME: &str = "step_p50_us";

const CLAIMS: [Claim; 9] = [
    Claim {
        source: "Larsson and Akenine-Möller 2001",
        claim: "hybrid update four to five times faster than refitting all of an AABB tree",
        test: Test::Ratio { metric: TIME, of: "hybrid-tree", over: "scan", most: AABB_REFITTED / 4.0 },
    },
    Claim {
        source: "van den Bergen 1997",
        claim: "AABB trees suit deformable models better than OBB trees",
        test: Test::Ratio { metric: TIME, of: "aabb-tree", over: "obb-tree", most: 1.0 },
    },
    Claim {
        source: "Gottschalk et al. 1996",
        claim: "OBB trees are faster than AABB trees (rigid models, close together)",
        test: Test::Ratio { metric: TIME, of: "obb-tree", over: "aabb-tree", most: 1.0 },
    },
    Claim {
        source: "Klosowski et al. 1998",
        claim: "18-DOPs are at least as fast as OBBs (rigid models)",
        test: Test::Ratio { metric: TIME, of: "k-dop-tree", over: "obb-tree", most: 1.0 },
    },
    Claim {
        source: "Teschner et al. 2003",
        claim: "hashed grid: up to 20 thousand tetrahedra in real time",
        test: Test::Bound { metric: TIME, of: "hashed-grid", most: 1000.0 },
    },
    Claim {
        source: "James and Pai 2004",
        claim: "balls updated from reduced coordinates, at a cost that does not depend on the mesh",
        test: Test::NotHere("a mesh of free nodes has no reduced coordinates; balls take margins by motion"),
    },
    Claim {
        source: "Heidelberger et al. 2003",
        claim: "layered depth images at interactive rates on a graphics card",
        test: Test::Bound { metric: "missed_percent", of: "image-space", most: 0.0 },
    },
    Claim {
        source: "Teschner et al. 2005",
        claim: "stochastic methods trade accuracy for time",
        test: Test::NotHere("time is a setting here; missed points stand in the rows"),
    },
    Claim {
        source: "Bielser and Gross 2000",
        claim: "surface boxes with tolerance at interactive rates",
        test: Test::Bound { metric: TIME, of: "surface-boxes", most: 1000.0 },
    },
];

/// Time of the AABB tree over the scan's when it was refitted whole, on the brain.
const AABB_REFITTED: f64 = 4.71;
const ON_BRAIN: Scale = Scale {
    scene: "brain, 21925 tetrahedra, at rest, recorded path brain-random",
    base: "scan",
    time: TIME,
    error: "missed_percent",
};
const ON_CUBE: Scale = Scale { scene: "cube, 53240 tetrahedra, random movements", ..ON_BRAIN };

const fn former(method: &'static str, time: f64) -> Former {
    Former { method, error: 0.0, time, remark: "fitted where the tool is, asked once with its box" }
}

const fn same(method: &'static str, time: f64, remark: &'static str) -> Former {
    Former { method, error: 0.0, time, remark }
}

const HALF_WAY: &str = "not changed: it was fitted only where needed before";

/// Claims of papers, and rivals before and now.
pub fn tables(rows: &[Row]) -> Vec<Table> {
    let brain = [
        former("aabb-tree", AABB_REFITTED),
        former("sphere-tree", 14.6),
        former("k-dop-tree", 9.6),
        former("obb-tree", 27.6),
        former("parry-tree", 5.0),
        same("hybrid-tree", 0.49, HALF_WAY),
    ];
    let cube = [
        former("aabb-tree", 5.4),
        former("sphere-tree", 16.5),
        former("k-dop-tree", 11.8),
        former("parry-tree", 4.9),
        same("hybrid-tree", 0.38, HALF_WAY),
    ];
    vec![
        as_published("Rivals as published", ON_BRAIN.scene, &CLAIMS, rows),
        before_and_now("Rivals before and now", &ON_BRAIN, &brain, rows),
        before_and_now("Rivals before and now", &ON_CUBE, &cube, rows),
    ]
}
